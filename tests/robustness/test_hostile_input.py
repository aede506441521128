"""Numbers, names and surroundings that no writer of a file meant: every reader refuses or shows them."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from planners.motion.store import load_motion, write_transitions
from planners.motion.transitions import simulate_transitions
from srs_opt.command import visible
from srs_opt.document import parse_yaml, read_json
from srs_opt.drive.calibration import load_calibration
from srs_opt.errors import InputError
from srs_opt.figures import new_figure, plain_names
from srs_opt.gait import check_gait, published_wave
from srs_opt.gait_file import load_gait
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.gait_opt.table import GaitTable
from srs_opt.robot import load_robot, wpi_srs
from srs_opt.simulate import compiled

ROOT = Path(__file__).resolve().parents[2]
HUGE = "1" + "0" * 400
DRIVE = (
    '{{"version": 1, "speed": {{"value": {0}, "sd": 0.1, "scatter_sd": 0.1, "gaits": {1}}}, '
    '"radius": {{"value": 1, "sd": 0, "scatter_sd": 0, "gaits": 3}}}}'
)
GAIT = (
    '{{"frequency_hz": {0}, "pressure_kpa": 41, "switches": [{{"segment": {1}, "on_s": 0, "off_s": 0.5}}]}}'
)


@pytest.mark.parametrize("number", [".inf", "-.inf", ".nan", HUGE])
@pytest.mark.parametrize(
    ("reader", "text"),
    [
        (load_robot, "friction_speed_m_s: {0}"),
        (load_calibration, DRIVE.replace("{1}", "3")),
        (load_calibration, DRIVE.replace("{0}", "1").replace("{1}", "{0}")),
        (lambda path: load_gait(str(path), 41.0), GAIT.replace("{1}", "1")),
        (lambda path: load_gait(str(path), 41.0), GAIT.replace("{0}", "1").replace("{1}", "{0}")),
    ],
)
def test_numbers_that_are_none(reader, text, number, tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text(text.format(number))
    with pytest.raises(InputError, match=r"file\.yaml:1: .*must be a finite number"):
        reader(file)


def test_json_of_other_programs_may_hold_what_json_has_not(tmp_path):
    for text, complaint in (
        ("[1, NaN]", r"\[1\]: must be a finite number"),
        ("[Infinity]", r"\[0\]: must be"),
        (r'["x \ud800"]', r"\[0\]: must be text in Unicode"),
        (r'{"\udc00": 1}', "no text in Unicode"),
    ):
        (tmp_path / "x.json").write_text(text)
        with pytest.raises(InputError, match=complaint):
            read_json(tmp_path / "x.json", "something")


def test_millions_of_values_are_refused_at_once():
    with pytest.raises(InputError, match="more than 1000000 values"):
        parse_yaml("x: [" + "1," * 2_100_000 + "1]", "big.yaml", "something")


def test_control_characters_do_not_reach_the_terminal():
    assert visible("link\x1b[31mRED\x1b]0;title\x07 Ü 蛇\n") == "link\\x1b[31mRED\\x1b]0;title\\x07 Ü 蛇\n"


def test_a_dollar_in_a_name_is_a_dollar():
    figure, axes = new_figure()
    axes.set(title=r"a $\frac{$ b", yscale="log")
    axes.plot([1, 2], [1, 1e4], label=r"$\bad{$")
    axes.legend()
    plain_names(figure)
    figure.canvas.draw()  # a formula that does not parse would raise here
    assert axes.title.get_text() == r"a $\frac{$ b"


def test_pressure_in_the_wrong_unit():
    robot = wpi_srs()
    with pytest.raises(
        InputError, match=r"5500 kPa bends .* more than a full turn; expected at most 485 kPa"
    ):
        check_gait(robot, published_wave(robot, frequency_hz=1.0, pressure_kpa=5500.0).gait())


@pytest.fixture(scope="module")
def few():
    """Two gaits of the shipped table, their motion simulated."""
    table = shipped_table()
    table = GaitTable(table.robot_name, table.fingerprint, table.model, table.gaits[:2])
    return table, simulate_transitions(wpi_srs(), table)


@pytest.mark.parametrize("damage", ["bits", "nan", "shape", "field"])
def test_a_damaged_motion_cache_is_made_again(few, damage, tmp_path, monkeypatch):
    table, transitions = few
    monkeypatch.setenv("SRS_OPT_CACHE", str(tmp_path))
    robot = wpi_srs()
    whole = load_motion(robot, table)
    (file,) = tmp_path.glob("motion_*.npz")
    if damage == "bits":
        content = bytearray(file.read_bytes())
        content[len(content) // 3 : len(content) // 3 + 40] = bytes(40)
        file.write_bytes(bytes(content))
    elif damage == "nan":
        write_transitions(file, transitions._replace(pose=transitions.pose * np.float32(np.nan)))
    elif damage == "shape":
        write_transitions(file, transitions._replace(kappa=transitions.kappa[:, :1]))
    else:
        np.savez(file, pose=transitions.pose)
    again = load_motion(robot, table)
    assert np.array_equal(again.pose, whole.pose)
    assert np.array_equal(load_motion(robot, table).pose, whole.pose)


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_cache_that_others_can_write_is_not_run(tmp_path, monkeypatch):
    monkeypatch.setenv("SRS_OPT_CACHE", str(tmp_path))
    tmp_path.chmod(0o777)
    with pytest.raises(InputError, match="others can write into this folder"):
        compiled.compiled("x", lambda: None)


def test_a_relative_cache_home_is_ignored(monkeypatch):
    monkeypatch.delenv("SRS_OPT_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert compiled.cache_folder().is_absolute()


@pytest.mark.skipif(compiled.compiler() is None, reason="needs a C compiler")
def test_a_compiler_behind_a_wrapper(monkeypatch):
    monkeypatch.setenv("CC", "env LANG=C cc")
    command, version = compiled.compiler.__wrapped__()
    assert Path(command[0]).name == "env"
    assert command[1:] == ("LANG=C", "cc")
    assert version


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_sigterm_clears_up(tmp_path):
    slow = tmp_path / "cc"
    slow.write_text('#!/bin/sh\ncase "$*" in *--version*) echo slow 1.0;; *) sleep 60;; esac\n')
    slow.chmod(0o755)
    process = subprocess.Popen(
        [sys.executable, "-m", "srs_opt.simulate", "--duration", "1", "--out", tmp_path / "out"],
        cwd=ROOT, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "SRS_OPT_CC": str(slow), "SRS_OPT_CACHE": str(tmp_path / "cache")},
    )  # fmt: skip
    for _ in range(600):
        if list(tmp_path.glob("cache/.building-*")):
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    _, complaint = process.communicate(timeout=30)
    assert process.returncode == 143, complaint
    assert "terminated" in complaint
    assert not list(tmp_path.glob("cache/.building-*"))
    assert not list(tmp_path.glob("out/*"))
    sleeping = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout
    assert str(slow) not in sleeping


def test_a_backend_that_is_not_there(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "srs_opt.simulate", "--duration", "1", "--json", "--out", tmp_path],
        cwd=ROOT, capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "nonsense"}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["speed_m_s"] > 0.1
