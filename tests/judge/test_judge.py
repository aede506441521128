"""What the judge says of gaits, against values found in this engine by an independent program."""

import json
import math

import numpy as np
import pytest

pytest.importorskip("dartpy", reason="the package 'dartpy' is not installed (extra judge)")

from srs_opt.errors import InputError
from srs_opt.gait import Wave, published_wave
from srs_opt.judge.__main__ import main
from srs_opt.judge.bodies import check_engine
from srs_opt.judge.gaits import judge_gait
from srs_opt.judge.opinion import opinion_on
from srs_opt.judge.settings import AGREEMENT, EngineSettings
from srs_opt.robot import Robot, wpi_srs
from srs_opt.simulate.timeline import Timeline
from srs_opt.simulate.valve_file import write_valves
from virtual_lab.simulate import run
from virtual_lab.trials import Trial
from virtual_lab.truth import Parameters, Truth

ROBOT = wpi_srs()


def test_the_published_gait_with_its_error():
    """0.2296 to 0.2301 m/s there; steps and hinges say how far off these numbers are."""
    them = opinion_on(ROBOT, "published", published_wave(ROBOT).gait(), None, EngineSettings(1.5e-3))
    assert them.judge.speed_m_s == pytest.approx(0.2300, abs=5e-4)
    assert 0 < them.judge.speed_error_m_s < 0.002
    assert them.judge.settled
    assert them.agrees


def test_a_turning_gait_backwards():
    gait = Wave.uniform(4, 2.0, 41.0, 0.9, 0.4).gait().reversed_wave()
    them = opinion_on(ROBOT, "back", gait, None, EngineSettings(2e-3), refine=False)
    assert them.agrees
    assert them.judge.speed_m_s < -0.3
    assert them.judge.radius_m * them.judge.turn_rate_rad_s == pytest.approx(them.judge.speed_m_s, rel=1e-6)


@pytest.mark.parametrize("begun", [None, "gait"])
def test_a_manoeuvre_from_rest_and_out_of_a_gait(begun, tmp_path, capsys):
    gait = published_wave(ROBOT, 2.0, 55.0, 0.3).gait()
    write_valves(Timeline.of_gait(gait.mirrored(), 1.2), tmp_path / "valves.csv")
    start = {"gait": None if begun is None else gait.record()}
    (tmp_path / "manoeuvre.json").write_text(json.dumps({"start": start}))
    asked = ["--step", "2e-3", "--json", "--quiet", "--out", str(tmp_path / "out")]
    status = main([str(tmp_path / "manoeuvre.json"), *asked])
    played = json.loads(capsys.readouterr().out)["manoeuvre"]
    assert (status, played["agrees"]) == (0, True)
    assert played["duration_s"] == pytest.approx(1.2, abs=0.021)
    assert played["way_m"] > (0.1 if begun is None else 0.2)
    assert played["turn_rad"] == pytest.approx(played["our_turn_rad"], abs=0.05)
    assert played["our_turn_rad"] < -0.3


def test_soft_silicone():
    """0.246 m/s there (0.231 when stiff), three hinges per segment in this engine within 2.5 % of it."""
    soft = ROBOT.with_values(bending_stiffness_n_m2=0.005, bending_relaxation_s=0.005)
    them = judge_gait(soft, published_wave(ROBOT).gait(), EngineSettings(2e-3))
    assert them.speed_m_s == pytest.approx(0.246, rel=0.025)


def laboratory(robot: Robot, effects: list[dict], offset: float) -> tuple[float, float]:
    """Return displacement per second and turn rate of the virtual laboratory's robot, from the last cycle."""
    lag = 2 * math.pi / robot.segments
    truth = Truth(Parameters(links=robot.links), tuple(effects))
    trial = Trial("x", 2.0, 55.0, offset, lag, duration_s=5.0)
    seen = run(truth, trial, np.array([4.5, 5.0]))
    turn = np.diff(seen.theta.mean(axis=1))[0]
    return math.hypot(*np.diff(seen.centre_of_mass(), axis=0)[0]) / 0.5, turn / 0.5


@pytest.mark.parametrize(
    ("links", "effects"),
    [
        (8, []),
        (5, [{"name": "tether_drag", "force_n": 0.035}, {"name": "head_mass", "extra_kg": 0.02}]),
        (5, [{"name": "tether_weight", "load_n": 0.2}, {"name": "gap_length", "extra_m": 0.008}]),
        (5, [{"name": "viscous_rolling", "damping": 0.06}, {"name": "wheel_toe", "angle": 0.03}]),
        (5, [{"name": "segment_bias", "bias": 3.0, "segment": 2}, {"name": "supply_droop", "per_hz": 0.1}]),
        (
            5,
            [
                {"name": "single_wheel_toe", "angle": 0.1, "link": 2},
                {"name": "tether_viscous", "damping": 0.25},
            ],
        ),
    ],
)  # fmt: skip
def test_links_and_effects_move_it_as_they_do_in_the_laboratory(links, effects):
    robot = ROBOT.with_values(links=links, effects=effects)
    gait = published_wave(robot, offset=0.3).gait()
    them = judge_gait(robot, gait, EngineSettings(2e-3))
    speed, turn = laboratory(robot, effects, 0.3)
    bow = them.turn_rate_rad_s * gait.period_s / 2  # displacement over arc
    assert them.speed_m_s * math.sin(bow) / bow == pytest.approx(speed, rel=0.02)
    assert them.turn_rate_rad_s == pytest.approx(turn, rel=0.03)


def test_a_table_through_the_command(tmp_path, capsys):
    gait = published_wave(ROBOT, 2.0, 55.0, 0.4).gait()
    entry = {
        "name": "left", **gait.record(), "speed_m_s": 0.2, "turn_rate_rad_s": 0.8, "radius_m": 0.25,
        "envelope_m": [0.1, 0.1], "displacement": [0.1, 0.0, 0.4], "friction_work_j": 0.1,
    }  # fmt: skip
    mirrored = {**entry, "name": "right", **gait.mirrored().record()}
    table = tmp_path / "gait_table.json"
    record = {
        "version": 1,
        "robot": "x",
        "fingerprint": "0" * 16,
        "model": "complex",
        "gaits": [entry, mirrored],
    }
    table.write_text(json.dumps(record))
    arguments = [
        str(table),
        "--json",
        "--jobs",
        "1",
        "--refine",
        "1",
        "--step",
        "0.004",
        "--tolerance",
        "0.03",
        "--out",
        str(tmp_path),
    ]
    assert main([*arguments, "--quiet"]) == 0
    answer = json.loads(capsys.readouterr().out)
    left, right = answer["gaits"]
    assert answer["agree"] == 2
    assert left["judge"]["turn_rate_rad_s"] > 0 > right["judge"]["turn_rate_rad_s"]
    assert sum(g["judge"]["error"] is not None for g in answer["gaits"]) == 1
    assert json.loads((tmp_path / "judge.json").read_text()) == answer


def test_a_longer_robot_is_judged_by_its_own_lengths():
    longer = AGREEMENT.of_body(2 * ROBOT.length_m)
    assert AGREEMENT.speed_m_s == pytest.approx(0.002)
    assert longer.speed_m_s == pytest.approx(2 * AGREEMENT.speed_m_s)
    assert longer.turn_rate_rad_s == AGREEMENT.turn_rate_rad_s


def test_without_the_engine_it_is_one_line(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'srs-opt\[judge\]'"):
        check_engine()
