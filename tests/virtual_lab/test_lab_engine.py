"""Trials in the physics engine: as the laboratory's equations have them, where both have the effect."""

import dataclasses
import json

import numpy as np
import pytest

pytest.importorskip("dartpy", reason="the package 'dartpy' is not installed (extra judge)")

from virtual_lab.__main__ import main
from virtual_lab.assemble import NOMINAL
from virtual_lab.catalogue import LISTED
from virtual_lab.errors import LabError
from virtual_lab.in_engine import run_in_engine
from virtual_lab.simulate import run
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

GAIT = Trial("t", 2.0, 55.0, 0.3, heading_rad=1.0, duration_s=2.5)
SEEN_S = np.array([-0.1, 0.0, 1.0, 2.5])


def lab(*effects: dict, engine: str = "dart") -> Truth:
    listed = tuple(e for e in effects if e["name"] in LISTED)
    return Truth(effects=listed, unlisted=tuple(e for e in effects if e not in listed), engine=engine)


@pytest.mark.parametrize(
    "effects",
    [
        [],
        [
            {"name": "tether_drag", "force_n": 0.035},
            {"name": "head_mass", "extra_kg": 0.02},
            {"name": "worn_wheels", "gradient": 0.8},
        ],
        [
            {"name": "hose_spring", "stiffness": 0.1, "ax_m": 0.2, "ay_m": -1.0, "slack_m": 0.3},
            {"name": "single_wheel_toe", "angle": 0.1, "link": 3},
            {"name": "viscous_rolling", "damping": 0.06},
        ],
        [
            {"name": "floor_slope", "angle": 0.01, "direction": 2.0},
            {"name": "hysteresis", "ratio": 0.35, "width": 4.0},
            {"name": "slow_valve", "delay_s": 0.08, "segment": 2},
        ],
        [
            {"name": "tether_weight", "load_n": 0.2},
            {"name": "bending_compliance", "flexibility": 50.0, "relaxation_s": 0.005},
            {"name": "hose_torsion", "torque_n_m": 1.5e-3},
            {"name": "long_segment", "extra": 0.35, "segment": 1},
        ],
    ],
    ids=lambda effects: "+".join(e["name"] for e in effects) or "none",
)
def test_the_engine_and_the_equations_move_the_robot_alike(effects):
    here = run(lab(*effects, engine="equations"), GAIT, SEEN_S)
    there = run_in_engine(lab(*effects), GAIT, SEEN_S, NOMINAL, 2e-3)
    went = np.hypot(here.x[-1] - here.x[0], here.y[-1] - here.y[0]).mean()
    # a soft body's hinges are no arcs of constant curvature, which is what the equations bend
    soft = any(e["name"] == "bending_compliance" for e in effects)
    near = (0.05 if soft else 0.025) * went
    np.testing.assert_allclose(there.kappa, here.kappa, atol=1.0 if soft else 0.02)
    np.testing.assert_allclose(there.x[:2], here.x[:2], atol=1e-9)
    np.testing.assert_allclose(there.x, here.x, atol=near)
    np.testing.assert_allclose(there.y, here.y, atol=near)
    np.testing.assert_allclose(there.theta, here.theta, atol=0.05)


@pytest.mark.parametrize(
    ("effect", "least_m"),
    [
        ({"name": "seized_wheel", "seized": 1.0, "link": 2}, 0.05),
        ({"name": "loose_wheel", "play_m": 0.002, "link": 3}, 0.002),
    ],
    ids=lambda value: value["name"] if isinstance(value, dict) else "",
)
def test_what_only_the_engine_has_shows(effect, least_m):
    trial = dataclasses.replace(GAIT, duration_s=1.5)
    seen = np.array([1.5])
    plain, odd = (run_in_engine(lab(*e), trial, seen, NOMINAL, 2e-3) for e in ((), (effect,)))
    assert np.hypot(odd.x - plain.x, odd.y - plain.y).max() > least_m
    with pytest.raises(LabError, match="needs --engine dart"):
        run(lab(effect, engine="equations"), trial, seen)


def test_a_data_set_of_the_engine(tmp_path, capsys):
    out = tmp_path / "set"
    given = [
        "--engine",
        "dart",
        "--effect",
        "seized_wheel",
        "--design",
        "steps",
        "--duration",
        "0.1",
        "--seed",
        "3",
    ]
    assert main([*given, "--json", "--out", str(out)]) == 0
    assert json.loads(capsys.readouterr().out)["hidden"] == ["seized_wheel"]
    assert json.loads((tmp_path / "set.truth.json").read_text())["truth"]["engine"] == "dart"
    assert (out / "trials" / "s01.csv").exists()


def test_what_the_engine_cannot_is_refused_in_a_line(tmp_path, capsys):
    given = ["--engine", "dart", "--effect", "stribeck", "--duration", "0.2", "--out", str(tmp_path / "set")]
    assert main(given) == 2
    assert "cannot represent stribeck" in capsys.readouterr().err
