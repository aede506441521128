"""The whole chain on this machine in real time: plan, pilot, valve line, firmware, snake, data set."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from planners.pilot.hardware import MachineClock, open_port
from planners.pilot.protocol import State
from planners.pilot.valve_line import ValveLine

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("cc") is None or not hasattr(os, "openpty"), reason="no compiler, no pty"
    ),
]


@pytest.fixture
def snake(header, tmp_path):
    """A virtual snake in real time; returns its port's name and the address of its poses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    link = tmp_path / "valves"
    words = ["--program", header, "--start", "0.2,1.024,0", "--link", link, "--pose", f"127.0.0.1:{port}"]
    process = subprocess.Popen(
        [sys.executable, "-m", "virtual_lab.robot", *map(str, words), "--duration", "120"],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    try:
        assert "valves:" in process.stdout.readline()
        yield link, f"udp://127.0.0.1:{port}"
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
        process.stdout.close()
        assert not link.is_symlink()


def command(snake, out):
    link, poses = snake
    words = ["planners.pilot", "mazes/first.yaml", "--valves", str(link), "--pose", poses, "--out", str(out)]
    return [sys.executable, "-m", *words, "--json"]


def test_a_maze_is_piloted_in_real_time(snake, tmp_path):
    done = subprocess.run(command(snake, tmp_path / "out"), capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    assert record["execution"]["reached"] and record["execution"]["smallest_clearance_m"] > 0
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {
        "pilot.json",
        "motion.json",
        "dataset",
        "plan.png",
    }


def test_a_pilot_that_is_killed_leaves_a_vented_robot(snake, tmp_path):
    link, _ = snake
    pilot = subprocess.Popen(command(snake, tmp_path / "out"), cwd=ROOT, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and pilot.poll() is None and not _is_driving(pilot.pid):
        time.sleep(0.1)
    time.sleep(3.0)
    assert pilot.poll() is None
    pilot.kill()
    pilot.wait()
    time.sleep(1.0)
    port = open_port(str(link), 115_200)
    line = ValveLine(port, MachineClock())
    line.ping()
    status = line.query()
    port.close()
    assert status.cycles > 0
    assert status.state in (State.VENTING, State.VENTED) and status.pressure_pa == 0


def _is_driving(pid):
    """Whether the process holds the valve line."""
    try:
        held = [os.readlink(f"/proc/{pid}/fd/{fd}") for fd in os.listdir(f"/proc/{pid}/fd")]
    except OSError:
        return False
    return any("/dev/pts/" in name for name in held)
