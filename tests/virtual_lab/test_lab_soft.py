"""The laboratory's bodies that bend under load, and robots of one's own in it."""

import json

import numpy as np
import pytest
import yaml

from virtual_lab import kernel, soft
from virtual_lab.__main__ import main
from virtual_lab.assemble import assemble
from virtual_lab.bench import Instruments, step_rows
from virtual_lab.live import LiveRobot
from virtual_lab.simulate import look, rest_state, run, sample
from virtual_lab.trials import Trial
from virtual_lab.truth import Parameters, Truth

GAIT = Trial("t", 2.0, 55.0, 0.4, duration_s=1.0)
SOFT = Truth(Parameters(bending_stiffness_n_m2=0.005), friction_speed_m_s=0.002)


def test_stiffness_without_end_is_the_rigid_body():
    times = np.linspace(0, 1, 11)
    rigid = run(Truth(friction_speed_m_s=0.002), GAIT, times).centre_of_mass()
    gaps = [
        np.abs(
            run(
                Truth(Parameters(bending_stiffness_n_m2=ei), friction_speed_m_s=0.002), GAIT, times
            ).centre_of_mass()
            - rigid
        ).max()
        for ei in (0.05, 0.2)
    ]
    assert 3 < gaps[0] / gaps[1] < 5  # first order in 1/EI


def test_energy_only_falls_without_pressure_and_friction():
    """Links' motion and elastic energy, from places alone; the loss is the material's."""
    truth = Truth(Parameters(bending_stiffness_n_m2=0.005, friction_tangential=0.0, friction_normal=0.0))
    tables = assemble(truth, Trial("still", 1.0, 0.0, kind="still"), 0.2)
    state = rest_state(tables, 0.3)
    rng = np.random.default_rng(3)
    state[6:10] = rng.normal(0, 10, 4)
    state[3:6] = rng.normal(0, 0.3, 3)
    times = np.arange(0, 0.2, 1e-4)
    rows = sample(tables, state, np.zeros((4, 4)), times)
    seen = look(tables, rows, times)
    vx, vy, w = (np.gradient(a, times, axis=0) for a in (seen.x, seen.y, seen.theta))
    kinetic = 0.5 * (0.03 * (vx**2 + vy**2) + 1e-6 * w**2).sum(axis=1)
    elastic = 0.5 * 0.037 * 0.005 * (seen.kappa**2).sum(axis=1)
    loss = 0.037 * 0.005 * 0.005 * (seen.kappa_rate**2).sum(axis=1)
    lost = np.concatenate([[0], np.cumsum(0.5 * (loss[1:] + loss[:-1]) * np.diff(times))])
    total = kinetic + elastic + lost
    inner = slice(5, -5)
    assert np.ptp(total[inner]) < 2e-3 * total[0]
    assert lost[-1] > 0.3 * total[0]


@pytest.mark.parametrize("bends", [False, True])
def test_chambers_that_lengthen_move_the_links_as_their_places_say(bends):
    """Velocities and accelerations of the chain are differences of the places that the camera sees."""
    rng = np.random.default_rng(5)
    p = Parameters(bending_stiffness_n_m2=0.005 if bends else None)
    hidden = ({"name": "chamber_stretch", "per_curv2": 3e-4},)
    tables = assemble(Truth(p, effects=hidden), Trial("still", 1.0, 0.0, kind="still"), 1.0)
    free = np.column_stack([rng.normal(0, s, 4) for s in (10.0, 50.0, 0.0, 500.0)])
    bent = np.column_stack([rng.normal(0, s, 4) for s in (10.0, 50.0, 0.0, 500.0)]) if bends else free
    lengths, chain = np.empty((4, 3)), np.zeros((5, kernel.CHAIN_COLUMNS))
    kernel.set_lengths(free, tables.lengths, 3e-4, lengths)
    kernel.set_chain(bent, lengths, tables.ground, chain)

    def places(t):
        kappa, no_load = (v[:, 0] + v[:, 1] * t + v[:, 3] * t * t / 2 for v in (bent, free))
        row = np.concatenate([np.zeros(6), kappa, 0 * kappa, *([no_load, 0 * no_load] if bends else [])])
        seen = look(tables, row[None], np.zeros(1))
        return np.stack([seen.x[0], seen.y[0], seen.theta[0]], axis=1)

    h = 1e-4
    before, now, after = places(-h), places(0.0), places(h)
    np.testing.assert_allclose(chain[:, [kernel.RX, kernel.RY]], now[:, :2], atol=1e-12)
    columns = [kernel.VX, kernel.VY, kernel.TURN]
    np.testing.assert_allclose(chain[:, columns], (after - before) / (2 * h), rtol=1e-4, atol=1e-4)
    columns = [kernel.AX, kernel.AY, kernel.TURN_RATE]
    np.testing.assert_allclose(chain[:, columns], (after - 2 * now + before) / h**2, rtol=1e-3, atol=2e-2)


def test_gap_springs_are_in_series_with_the_chambers():
    p = Parameters(bending_stiffness_n_m2=0.01, gap_stiffness_n_m2=0.002)
    table = assemble(Truth(p), GAIT, 1.0).segments
    expected = 1 / (1 / 0.01 + 0.012 / (0.037 * 0.002))
    np.testing.assert_allclose(table[:, soft.STIFFNESS], expected)


def test_step_on_the_ground_loses_what_an_independent_program_says():
    truth = Truth(Parameters(bending_stiffness_n_m2=0.005), friction_speed_m_s=1e-4)
    readings = {}
    for _, segment, condition, _, time, kappa in step_rows(
        truth, np.random.default_rng(0), Instruments(curvature_sd_1_m=0.0), (62.0,)
    ):
        if segment == 2 and float(time) >= 0.5:
            readings.setdefault(condition, []).append(float(kappa))
    loss = 1 - np.mean(readings["ground"]) / np.mean(readings["lifted"])
    assert loss == pytest.approx(0.091, rel=0.05)


def test_live_robot_goes_the_same_way():
    live = LiveRobot(SOFT)
    trial = Trial("t", 2.0, 55.0, 0.0, duration_s=0.3)
    tables = assemble(SOFT, trial, 0.3)
    for a, b, valves in zip(tables.edges, tables.edges[1:], tables.sign):
        live.advance(valves, 55.0, b - a)
    there = run(SOFT, trial, np.array([0.0, 0.3]))
    start = there.centre_of_mass()[0]
    np.testing.assert_allclose(live.look().centre_of_mass()[0] + start, there.centre_of_mass()[1], atol=1e-5)


def test_own_robot_file(tmp_path, capsys):
    robot = {
        "name": "mine",
        "bending_stiffness_n_m2": 0.008,
        "body_width_m": 0.05,
        "relative_sd": {"bending_stiffness_n_m2": 0.1},
        "effects": [{"name": "tether_drag", "force_n": 0.02}],
    }
    file = tmp_path / "robot.yaml"
    file.write_text(yaml.safe_dump(robot))
    out = tmp_path / "set"
    arguments = ["--robot", str(file), "--design", "steps", "--duration", "0.1", "--out", str(out), "--json"]
    assert main([*arguments, "--effect", "head_mass"]) == 0
    assert json.loads(capsys.readouterr().out)["hidden"] == ["head_mass"]
    written = yaml.safe_load((out / "robot.yaml").read_text())
    assert written["bending_stiffness_n_m2"] == 0.008
    assert written["body_width_m"] == 0.05
    assert written["effects"] == robot["effects"]
    truth = json.loads((tmp_path / "set.truth.json").read_text())["truth"]
    assert truth["parameters"]["bending_stiffness_n_m2"] != 0.008
    assert [e["name"] for e in truth["effects"]] == ["tether_drag", "head_mass"]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("links: 2", "links"),
        ("bending_stiffness_n_m2: 0", "bending_stiffness_n_m2"),
        ("bending_stiffness_n_m2: 1e9", "rigid"),
        ("stiffness: 1", "stiffness"),
        ("- 1", "robot file"),
        ("links: [", "robot file"),
        ("effects: [{name: crosstalk, ratio: 0.1}]", "crosstalk"),
        ("relative_sd: {bending_stiffness_n_m2: 0.1}", "relative_sd"),
    ],
)
def test_bad_robot_files_are_one_line(tmp_path, capsys, text, word):
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    assert main(["--robot", str(file), "--duration", "0.1", "--out", str(tmp_path / "set")]) == 2
    message = capsys.readouterr().err
    assert word in message
    assert message.count("\n") == 1
    assert not (tmp_path / "set").exists()
