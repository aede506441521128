"""The map agrees with known values and with itself however it is computed."""

import json
import math

import numpy as np
import pytest

from srs_opt.errors import InputError
from srs_opt.gait_map.__main__ import main
from srs_opt.gait_map.grid import COLUMNS, grid_points, load_map, map_at, save_map
from srs_opt.robot import wpi_srs

LAG = math.pi / 2


def test_known_values_to_one_percent():
    gaits = map_at(
        wpi_srs(), "complex", [(1.0, 41.0, 0.0, LAG), (2.0, 55.0, 0.4, LAG), (2.0, 41.0, 0.4, 0.9)]
    )
    assert gaits.column("speed_m_s") == pytest.approx([0.0787, 0.2019, 0.5046], rel=0.01)
    assert gaits.column("turn_rate_rad_s")[1:] == pytest.approx([0.817, 1.510], rel=0.01)
    assert np.isnan(gaits.column("radius_m")[0])
    assert gaits.column("radius_m")[1:] == pytest.approx([0.2473, 0.3341], rel=0.01)


def test_speed_is_turn_rate_times_radius():
    gaits = map_at(wpi_srs(), "simplified", grid_points([1.2, 1.8], [45.0], [-0.5, 0.3], [1.1]))
    product = gaits.column("turn_rate_rad_s") * gaits.column("radius_m")
    assert product == pytest.approx(gaits.column("speed_m_s"), rel=1e-9)


def test_processes_change_nothing():
    points = grid_points(list(np.linspace(1, 2, 6)), [41.0, 55.0], [0.0, 0.2, 0.4, 0.6, 0.8], [LAG])
    alone = map_at(wpi_srs(), "complex", points, jobs=1)
    shared = map_at(wpi_srs(), "complex", points, jobs=2)
    assert np.array_equal(alone.rows, shared.rows, equal_nan=True)


def test_file_round_trip(tmp_path):
    gaits = map_at(wpi_srs(), "complex", [(2.0, 48.0, 0.0, LAG), (2.0, 48.0, 0.3, LAG)])
    again = load_map(save_map(gaits, tmp_path / "map.csv"))
    np.testing.assert_allclose(again.rows, gaits.rows, rtol=1e-6)


@pytest.mark.parametrize(
    "text", ["", "a,b\n1,2\n", ",".join(COLUMNS) + "\n1,2,x,4,5,6,7,8,9\n", ",".join(COLUMNS) + "\n"]
)
def test_bad_files_are_refused_in_one_line(tmp_path, text):
    file = tmp_path / "map.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=r"map\.csv"):
        load_map(file)


def test_command(tmp_path, capsys):
    arguments = ["--frequency", "1.8", "2", "2", "--pressure", "50", "55", "2", "--offset", "0.4"]
    assert main([*arguments, "--json", "--jobs", "1", "--out", str(tmp_path / "a b")]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["points"] == 4
    assert record["speed_max_m_s"] == pytest.approx(0.2019, rel=0.01)
    assert (tmp_path / "a b" / "map.csv").exists()
    assert (tmp_path / "a b" / "map.png").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["--offset", "1.0"],
        ["--frequency", "2", "1", "3"],
        ["--frequency", "1", "2", "0"],
        ["--robot", "nowhere.yaml"],
    ],
)
def test_command_refuses_with_status_2(tmp_path, capsys, arguments):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
