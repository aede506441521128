"""Drives in the other engine: valves of a motion.json, walls that are hit, the closed loop."""

import base64
import io
import json
import math

import numpy as np
import pytest

pytest.importorskip("dartpy", reason="the package 'dartpy' is not installed (extra judge)")

from srs_opt.gait import Wave
from srs_opt.judge.__main__ import main
from srs_opt.judge.replay import phases_of, replay
from srs_opt.judge.settings import EngineSettings
from srs_opt.judge.walls import clearances, solid_region
from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()
GAIT = Wave.uniform(4, 2.0, 41.0, 0.9).gait()
COARSE = EngineSettings(2e-3)


def motion(rings: list, cycles: int = 3, goal_x: float = 9.0) -> dict:
    """Return a straight run of some cycles along +x from the origin, whose own motion claims 0.5 m/s."""
    duration = cycles * GAIT.period_s
    way = np.linspace(0, 0.5 * duration, 31)
    return {
        "version": 2, "robot": "x", "body_width_m": 0.04, "margin_m": 0.0,
        "maze": {
            "name": "x", "bounds": [-1, -1, 3, 1], "rings": rings, "cells": None, "start": [0, 0, 0],
            "goal": {"x": goal_x, "y": 0.0, "radius": 0.05, "boxes": [], "heading": None},
        },
        "valves": {"min_dwell_s": 0.02, "tick_s": 0.001, "pressure_rate_kpa_s": None},
        "gaits": [{"name": "fast", **GAIT.record()}],
        "joining": [
            {"gait": "fast", "after": None, **GAIT.record(), "from_kpa": 20.0, "ramp_s": 0.1}
        ],
        "runs": [{
            "name": "planned", "duration_s": duration,
            "cycles": [[0, k * GAIT.period_s, None if k else 0] for k in range(cycles)],
            "centre": np.round(1e4 * np.stack([way, 0 * way], axis=1)).astype(int).tolist(),
            "body": [], "clearance_mm": [],
        }],
    }  # fmt: skip


def box(x0: float, y0: float, x1: float, y1: float) -> list:
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]


def test_valves_of_a_run_ramp_halts_and_vents_included():
    record = motion([], cycles=2)
    run = record["runs"][0]
    run["halts"] = [{"start_s": 0.7, "duration_s": [0.1], "valve": [[1]] * 4, "pressure_kpa": [30.0]}]
    phases = phases_of(record, run)
    ends = np.cumsum(phases.duration_s)
    assert ends[-1] == pytest.approx(1.0)
    at = {t: int(np.searchsorted(ends, t)) for t in (0.001, 0.05, 0.4, 0.75, 0.9)}
    assert phases.pressure_kpa[at[0.001]] == pytest.approx(20.0, abs=0.6)
    assert phases.pressure_kpa[at[0.05]] == pytest.approx(30.5, abs=0.6)
    assert phases.pressure_kpa[at[0.4]] == 41.0
    np.testing.assert_array_equal(phases.valve[:, at[0.4]], GAIT.valve(0.4))
    np.testing.assert_array_equal(phases.valve[:, at[0.75]], 1.0)
    np.testing.assert_array_equal(phases.valve[:, at[0.9]], 0.0)


def test_a_wall_ahead_is_touched_and_stops_it():
    free = replay(ROBOT, motion([]), COARSE)
    assert not free.contacts
    assert free.smallest_clearance_m > 0.5
    blocked = replay(ROBOT, motion([box(0.25, -0.5, 0.3, 0.5)]), COARSE)
    assert blocked.contacts
    assert blocked.smallest_clearance_m == pytest.approx(0.0, abs=2e-3)
    assert blocked.lines[-1, :, 0].max() < 0.25
    assert free.centre[-1, 0] > blocked.centre[-1, 0] + 0.05
    # until the wall it was where it would have been without
    before = free.time_s < blocked.first_contact_s - 0.05
    np.testing.assert_allclose(blocked.centre[before], free.centre[before], atol=1e-4)


def test_walls_are_rings_with_holes_cells_and_what_is_beyond_the_bounds():
    from PIL import Image

    pixels = np.zeros((2, 4, 2), dtype=np.uint8)
    pixels[0, 3] = 255  # the top row's last cell
    stream = io.BytesIO()
    Image.fromarray(pixels, "LA").save(stream, "PNG")
    cells = {
        "png": base64.b64encode(stream.getvalue()).decode(),
        "origin": [0, 0, math.pi / 2],
        "size": [4, 2],
    }
    maze = {"bounds": [-5, -5, 5, 5], "rings": [box(1, 1, 4, 4), box(2, 2, 3, 3)], "cells": cells}
    region = solid_region(maze)
    points = np.array([[1.5, 2.5], [2.5, 2.5], [-1.5, 3.5], [-0.5, 0.5], [5.01, 0.0]])
    lines = np.stack([points, points + 1e-6], axis=1)
    inside = clearances(region, lines, 0.0) <= 0
    assert inside.tolist() == [True, False, True, False, True]
    assert clearances(region, np.array([[[4.2, 2.0], [4.5, 2.0]]]), 0.04)[0] == pytest.approx(0.18)


def test_the_command_plays_a_motion(tmp_path, capsys):
    file = tmp_path / "motion.json"
    file.write_text(json.dumps(motion([], cycles=2, goal_x=0.1)))
    (tmp_path / "plan.json").write_text('{"status": "solved"}')
    given = ["--json", "--quiet", "--step", "0.004", "--out", str(tmp_path / "out")]
    status = main([str(tmp_path / "plan.json"), *given])
    answer = json.loads(capsys.readouterr().out)["drive"]
    assert status == (0 if answer["agrees"] else 1)
    assert answer["contacts"] == 0
    assert answer["reached"]
    assert answer["way_m"] == pytest.approx(0.5, abs=1e-3)
    assert (tmp_path / "out" / "judge.png").exists()


def test_closed_loop_through_a_maze_with_the_engine_as_the_robot(tmp_path, capsys):
    from planners.plan.__main__ import main as plan

    maze = tmp_path / "short.yaml"
    maze.write_text(
        "bounds: [0, 0, 1.2, 0.4]\nwalls: [{box: [0.5, 0.3, 0.6, 0.4]}]\n"
        "start: {x: 0.2, y: 0.2, heading: 0}\ngoal: {x: 0.7, y: 0.2, radius: 0.05}\n"
    )
    assert plan([str(maze), "--judge", "--json", "--quiet", "--out", str(tmp_path)]) == 0
    judge = json.loads(capsys.readouterr().out)["judge"]
    assert judge["reached"]
    assert judge["contacts"] == 0
    assert judge["smallest_clearance_m"] > 0.003
