"""Ctrl-C and SIGTERM while OMPL's C++ searches."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from planner_rooms import gate

from planners.plan.registry import Effort, planner_named

ROOT = Path(__file__).resolve().parents[2]
SIGNALS = pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
# as `gate(0.0)`: the goal lies behind a wall
NO_WAY = """bounds: [0, 0, 2.0, 0.6]
start: {x: 0.25, y: 0.3, heading: 0}
goal: {x: 1.7, y: 0.3, radius: 0.08}
walls:
  - {box: [0.99, 0, 1.01, 0.6]}
"""


class Ended(BaseException):
    pass


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("rrt", signal.SIGINT),
        ("rrt", signal.SIGTERM),
        ("est", signal.SIGTERM),
        ("rs-rrtconnect", signal.SIGINT),
    ],
)
def test_a_search_without_end(problem_in, number, name):
    def end(number, frame):
        raise Ended

    problem = problem_in(gate(0.0))
    before = signal.signal(number, end)
    alarm = signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), number))
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(Ended):
            planner_named(name).find(problem, Effort(10**9, 0, lambda: False))
    finally:
        signal.signal(number, before)
        signal.signal(signal.SIGALRM, alarm)


def children(parent):
    found = subprocess.run(
        ["ps", "--ppid", str(parent), "-o", "pid=,args="], capture_output=True, text=True, check=False
    )
    return found.stdout.splitlines()


@SIGNALS
def test_the_command(tmp_path, number, status):
    maze = tmp_path / "no_way.yaml"
    maze.write_text(NO_WAY)
    process = subprocess.Popen(
        [sys.executable, "-m", "planners.plan", maze, "--planner", "est", "--out", tmp_path / "out"],
        cwd=ROOT, stderr=subprocess.PIPE, text=True,
        # whoever runs the tests in the background has switched Ctrl-C off
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    workers = []
    while not workers and process.poll() is None:
        time.sleep(0.1)
        workers = [line for line in children(process.pid) if "multiprocessing.spawn" in line]
    time.sleep(0.5)
    process.send_signal(number)
    try:
        _, complaint = process.communicate(timeout=30)
    finally:
        process.kill()  # a failure here must not disturb the tests that follow
    assert process.returncode == status, complaint
    assert workers
    left = {line.split()[0] for line in workers}
    for _ in range(50):
        running = subprocess.run(["ps", "-eo", "pid="], capture_output=True, text=True, check=True).stdout
        if not left & set(running.split()):
            break
        time.sleep(0.1)
    assert not left & set(running.split())
