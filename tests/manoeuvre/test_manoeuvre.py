"""Manoeuvres: exact derivatives, certified answers that replay, room kept, ticks and dwell."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from srs_opt.errors import InputError
from srs_opt.gait import published_wave
from srs_opt.manoeuvre.__main__ import main
from srs_opt.manoeuvre.certificate import certify
from srs_opt.manoeuvre.search import find
from srs_opt.manoeuvre.settings import MANOEUVRE_CERTIFICATE
from srs_opt.manoeuvre.shooting import shoot, shoot_with_sensitivity
from srs_opt.manoeuvre.space import load_space
from srs_opt.manoeuvre.starts import playable
from srs_opt.manoeuvre.task import End, Start, Task
from srs_opt.manoeuvre.valves import ValvePlan, ValveRow
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.orbit.body import integrator
from srs_opt.robot import wpi_srs
from srs_opt.simulate.__main__ import main as simulate
from srs_opt.simulate.run import simulate_valves

ROBOT = wpi_srs()
QUICK = ["--starts", "2", "--populations", "0", "--shakes", "0", "--quiet", "--json"]


def answer(arguments, out, capsys):
    status = main([*arguments, "--out", str(out)])
    record = json.loads(capsys.readouterr().out)
    assert (status, record["certificate"]["passed"]) == (0, True), record["certificate"]
    return record


def test_slopes_are_those_of_differences():
    run = integrator(ROBOT)
    plan = ValvePlan.of_gaits((published_wave(ROBOT, 2.0, 50.0, 0.3).gait().later(0.013),), 0.83)
    shot = shoot_with_sensitivity(run, run.rest(), plan, 2e-4)
    times = np.append(plan.times(), [plan.duration_s, plan.pressure_kpa])
    for k in (0, times.size // 2, times.size - 2, times.size - 1):
        hair = np.zeros(times.size)
        hair[k] = 1e-5
        moved = [plan.with_times((times + s * hair)[:-2], *(times + s * hair)[-2:]) for s in (1, -1)]
        # small steps: the differences then are those of the motion, not of a mesh that moves along
        one, other = shoot(run, run.rest(), moved, 2e-4)
        wanted = (one.states[-1] - other.states[-1]) / 2e-5
        found = shot.sensitivity[-1, :, k]
        assert np.abs(found - wanted)[:6].max() < 0.05 * np.abs(wanted[:6]).max() + 1e-3


class WithErrors:
    """An integrator whose motions end a given way from the true end, one after the other."""

    def __init__(self, run, errors_m):
        self._run, self._errors_m = run, list(errors_m)

    def __getattr__(self, name):
        return getattr(self._run, name)

    def integrate(self, timeline, state, tolerance):
        path = self._run.integrate(timeline, state, tolerance)
        return replace(path, final=path.final + self._errors_m.pop(0) * np.eye(path.final.size)[0])


def test_the_certificate_s_bound_covers_the_finer_motion_s_error():
    """Errors with the least ratio, of one sign: their difference is all that the two motions tell."""
    run, finer_m = integrator(ROBOT), 1e-3
    plan = ValvePlan.of_gaits((published_wave(ROBOT, 2.0, 50.0, 0.3).gait(),), 0.3)
    task = Task(Start.at_rest(run), End(past_m=0.1))
    off = WithErrors(run, (MANOEUVRE_CERTIFICATE.ratio * finer_m, finer_m))
    certificate, _ = certify(off, task, plan)
    assert certificate.error_m == pytest.approx(finer_m, rel=1e-2)
    assert certificate.error_m > 0.999 * finer_m


def test_a_supply_that_droops_with_the_frequency_is_refused():
    """Its loss at a gait's frequency is known; a manoeuvre has no frequency."""
    droops = ROBOT.with_values(effects=[{"name": "supply_droop", "per_hz": 0.1}])
    plan = ValvePlan.of_gaits((published_wave(ROBOT, 2.0, 50.0, 0.3).gait(),), 0.3)
    with pytest.raises(InputError, match=r"supply_droop.*frequency"):
        simulate_valves(droops, plan.timeline())
    run = integrator(droops)
    with pytest.raises(InputError, match=r"supply_droop.*frequency"):
        find(run, Task(Start.at_rest(run), End(past_m=0.1)), [])
    stiffens = ROBOT.with_values(effects=[{"name": "curvature_stiffening", "per_curv2": 6e-4}])
    assert build(Structure.of(stiffens))[2].by_frequency == ()


def test_a_quarter_turn_at_rest_replays(tmp_path, capsys):
    record = answer(["--turn", "1.5708", "--rest", *QUICK], tmp_path, capsys)
    assert record["duration_s"] < 0.98 * record["first_s"]
    assert record["end"]["heading_rad"] >= 1.5708
    assert record["end"]["speed_m_s"] < 0.01
    assert record["certificate"]["shortest_dwell_s"] >= 0.02 - 1e-9
    assert all(abs(s["at_s"] / 1e-3 - round(s["at_s"] / 1e-3)) < 1e-6 for s in record["switches"])
    replayed = ["--valves", str(tmp_path / "valves.csv"), "--out", str(tmp_path / "again"), "--quiet"]
    assert simulate(replayed) == 0
    with (tmp_path / "again" / "trajectory.csv").open() as file:
        *_, last = csv.DictReader(file)
    assert float(last["heading_rad"]) == pytest.approx(record["end"]["heading_rad"], abs=0.01)
    assert "manoeuvre" in (tmp_path / "manoeuvre_program.h").read_text()


def test_a_stop_out_of_a_gait(tmp_path, capsys):
    record = answer(["--from", "fast", "--rest", "--within", "0.15", *QUICK], tmp_path, capsys)
    # rolling out vented and straight takes 0.36 m; v^2/(2 mu_t g)
    assert math.hypot(record["end"]["x_m"], record["end"]["y_m"]) <= 0.15
    assert record["duration_s"] < 0.8


def test_the_body_keeps_to_its_corridor(tmp_path, capsys):
    (tmp_path / "space.yaml").write_text("corridor: {line: [[-0.3, 0], [1, 0]], width_m: 0.11}\n")
    arguments = ["--past", "0.2", "--space", str(tmp_path / "space.yaml"), *QUICK]
    record = answer(arguments, tmp_path / "out", capsys)
    assert record["end"]["x_m"] >= 0.2


def test_depth_in_a_space(tmp_path):
    (tmp_path / "l.yaml").write_text("polygon: [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]\n")
    depth, jacobian = load_space(str(tmp_path / "l.yaml")).depth(
        np.array([[1.5, 0.8], [1.5, 1.3], [0.1, 1.5]])
    )
    assert depth == pytest.approx([0.2, -0.3, 0.1])
    assert jacobian == pytest.approx(np.array([[0, -1], [0, -1], [1, 0]]))
    (tmp_path / "bow.yaml").write_text("polygon: [[0, 0], [1, 1], [1, 0], [0, 1]]\n")
    with pytest.raises(Exception, match="crosses itself"):
        load_space(str(tmp_path / "bow.yaml"))


def test_a_plan_waits_for_the_dwell():
    run = integrator(ROBOT)
    task = Task(Start.at_rest(run), End(past_m=1.0))
    row = ValveRow((1, -1, 1, -1), (0.005, 0.2, 0.21))
    plan = playable(task, ValvePlan((row,) * 4, 0.5, 50.0))
    assert plan.shortest_dwell_s((math.inf,) * 4) >= 0.02 - 1e-12
    assert [r.at(0.4) for r in plan.rows] == [-1] * 4
