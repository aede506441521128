"""Compiled models: built once, rebuilt when damaged, shared by processes, optional."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow  # every case is a process of its own that compiles

SCRIPT = """
import json, math
from srs_opt.gait import Wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from srs_opt.simulate import compiled
robot = wpi_srs().with_values(links=3)
orbit = steady_gait(robot, Wave.uniform(2, 2.0, 50.0, 1.2, 0.3).gait())
print(json.dumps([orbit.speed_m_s, orbit.turn_rate_rad_s, orbit.work_j, compiled.compile_seconds]))
"""


def start(cache, **environment):
    variables = {**os.environ, "SRS_OPT_CACHE": str(cache), **environment}
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT],
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process):
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    *numbers, seconds = json.loads(out)
    return numbers, seconds, err


def run(cache, **environment):
    return finish(start(cache, **environment))


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache that one process has filled, and what that process found."""
    cache = tmp_path_factory.mktemp("cache") / "made" / "on demand"
    numbers, seconds, err = run(cache)
    assert seconds > 0
    assert err == ""
    return cache, numbers


def test_the_second_process_compiles_nothing(filled):
    cache, numbers = filled
    before = sorted(cache.iterdir())
    again, seconds, err = run(cache)
    assert again == numbers
    assert seconds == 0
    assert err == ""
    assert sorted(cache.iterdir()) == before
    assert all(path.suffix == ".so" for path in before)


@pytest.mark.parametrize("damage", ["truncated", "empty", "garbage", "flipped"])
def test_damaged_libraries_are_rebuilt(filled, damage):
    cache, numbers = filled
    for library in cache.glob("*.so"):
        content = library.read_bytes()
        library.unlink()
        middle = len(content) // 2
        flipped = content[:middle] + bytes([content[middle] ^ 0xFF]) + content[middle + 1 :]
        library.write_bytes(
            {"truncated": content[:middle], "empty": b"", "garbage": b"no library" * 999, "flipped": flipped}[
                damage
            ]
        )
    again, seconds, _ = run(cache)
    assert again == numbers
    assert seconds > 0


def test_two_processes_at_once(tmp_path, filled):
    processes = [start(tmp_path) for _ in range(2)]
    for process in processes:
        assert finish(process)[0] == filled[1]
    assert not [p for p in tmp_path.iterdir() if p.suffix != ".so"]


def test_without_a_compiler_the_interpreter_gives_the_same_numbers(tmp_path, filled):
    numbers, seconds, err = run(tmp_path, SRS_OPT_CC="none")
    assert numbers == pytest.approx(filled[1], rel=1e-10)
    assert seconds == 0
    assert err.count("note: no C compiler found") == 1
    assert not list(tmp_path.iterdir())


def test_a_compiler_that_fails_is_no_more_than_a_note(tmp_path, filled):
    broken = tmp_path / "cc"
    broken.write_text('#!/bin/sh\n[ "$1" = --version ] && echo broken 1.0 && exit 0\nexit 1\n')
    broken.chmod(0o755)
    numbers, _, err = run(tmp_path / "cache", SRS_OPT_CC=str(broken))
    assert numbers == pytest.approx(filled[1], rel=1e-10)
    assert "runs interpreted" in err
    assert "Traceback" not in err


def test_a_cache_that_cannot_be_written_is_no_more_than_a_note(tmp_path, filled):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    numbers, _, err = run(blocked)
    assert numbers == pytest.approx(filled[1], rel=1e-10)
    assert "interpreted" in err
    assert "Traceback" not in err
