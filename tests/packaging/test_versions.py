"""One version number, and every JSON file that programs exchange carries the version of its format."""

import re
from pathlib import Path

import pytest

import srs_opt
from srs_opt.drive.calibration import NO_CALIBRATION, load_calibration, save_calibration
from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.gait import published_wave
from srs_opt.gait_opt.table import GaitTable, TableGait, load_table, save_table
from srs_opt.robot import wpi_srs

ROOT = Path(__file__).resolve().parents[2]


def test_one_version():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.search(r'^version = "(.*)"$', text, re.MULTILINE)[1] == srs_opt.__version__
    assert f"## {srs_opt.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def table_file(folder: Path) -> Path:
    robot = wpi_srs()
    entry = TableGait("g", published_wave(robot).gait(), 0.2, 0.0, None, (0.04, 0.04), (0.1, 0.0, 0.0), 0.01)
    return save_table(GaitTable(robot.name, robot.fingerprint(), "complex", (entry,)), folder / "table.json")


@pytest.mark.parametrize(
    ("write", "load"),
    [
        (table_file, load_table),
        (lambda folder: save_calibration(NO_CALIBRATION, folder / "drive.json"), load_calibration),
    ],
    ids=["gait table", "drive"],
)
def test_a_future_version_is_refused_in_one_line(write, load, tmp_path):
    path = write(tmp_path)
    load(path)
    text = read_text(path, "")
    assert '"version": 1' in text
    path.write_text(text.replace('"version": 1', '"version": 99'), encoding="utf-8")
    with pytest.raises(InputError, match="version") as caught:
        load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
