"""The whole chain on this machine, on its clock: plan, pilot, valve line, firmware, snake, data set."""

import contextlib
import json
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
# four processes share two cores here; a decision that comes late on a busy machine is no fault of the pilot
SLOW = ("--slow-motion", "4")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler"),
]


@pytest.fixture
def snakes(header, tmp_path):
    """Return a context: a virtual snake in real time, its port's name and the address of its poses."""
    return lambda: _snake(header, tmp_path)


@contextlib.contextmanager
def _snake(header, tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    link = tmp_path / "valves"
    words = ["--program", header, "--start", "0.2,1.024,0", "--link", link, "--pose", f"127.0.0.1:{port}"]
    process = subprocess.Popen(
        [sys.executable, "-m", "virtual_lab.robot", *map(str, words), "--duration", "120", *SLOW],
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
    # a goal after the first of two U-turns: a drive lasts as long as the motion
    words = ["planners.pilot", "mazes/first.yaml", "--goal", "0.8,0.612"]
    words += ["--valves", str(link), "--pose", poses, "--out", str(out)]
    return [sys.executable, "-m", *words, "--json", *SLOW]


def test_a_maze_is_piloted_on_the_machines_clock(snakes, tmp_path):
    with snakes() as snake:
        out = tmp_path / "out"
        done = subprocess.run(command(snake, out), capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)["execution"]
    assert record["reached"] and record["smallest_clearance_m"] > 0
    written = {path.name for path in out.iterdir()}
    assert written >= {"pilot.json", "motion.json", "dataset", "plan.png"}


def test_a_pilot_that_is_killed_leaves_a_vented_robot(snakes, tmp_path):
    with snakes() as snake:
        pilot = subprocess.Popen(
            command(snake, tmp_path / "out"),
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        told = ""
        while "driving" not in told:
            line = pilot.stderr.readline()
            assert line, told  # it ended before it drove
            told += line
        time.sleep(6.0)
        pilot.kill()
        pilot.wait()
        pilot.stderr.close()
        time.sleep(4.0)  # a second of the robot's
        port = open_port(str(snake[0]), 115_200)
        line = ValveLine(port, MachineClock(float(SLOW[1])))
        line.ping()
        status = line.query()
        port.close()
    assert status.cycles > 0
    assert status.state in (State.VENTING, State.VENTED) and status.pressure_pa == 0
