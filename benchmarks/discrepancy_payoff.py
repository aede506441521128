"""What naming the effect buys, driven on the laboratory's truth.

    python -m benchmarks.discrepancy_payoff [--effects NAME ...] [--maze FILE]

For every effect: a generated data set in which it is hidden, the calibrated robot (before) and the corrected
robot (after). Each optimizes its fastest gait; the laboratory, which shares no code with the models, plays
both. Then each plans through a maze with its own gaits, and the laboratory plays the valves of the plan,
without feedback: how far from where the plan ends does the true robot end, and does it touch a wall?
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from planners.maze.load import load_maze
from planners.motion.store import load_motion
from planners.plan.answer import Plan
from planners.plan.solve import solve_with_lattice
from planners.search.clearance import BodyClearance
from planners.search.problem import Problem
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.companions import duty_biased_family
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import search
from srs_opt.robot import Robot
from virtual_lab import simulate
from virtual_lab.assemble import assemble
from virtual_lab.simulate import look, sample
from virtual_lab.trials import Schedule, Trial
from virtual_lab.truth import Truth

EFFECTS = ("curvature_bias", "gap_bending", "tether_drag", "hysteresis")
MARGIN_M = 0.01
FRAMES = 40  # per cycle
SETTLED, MEASURED = 10, 10  # cycles
ALONG = 12  # points of the body's centre line between two links


@dataclass(frozen=True)
class Played:
    """What the true robot did.

    Attributes
    ----------
    centre : array (T, 2)
        Centre of mass, m.
    lines : array (T, P, 2)
        Links' places joined by straight lines.
    """

    centre: np.ndarray
    lines: np.ndarray


def play(truth: Truth, gaits: list[Gait], start: tuple[float, float, float]) -> Played:
    """Play gaits, a cycle each, on the true robot: at rest, straight, centre of mass at `start`.

    What segments remember (hysteresis) goes on from cycle to cycle; of effects that delay valves the first
    moments of every cycle would be wrong.
    """
    x, y, heading = start
    links = truth.parameters.links
    pitch = truth.parameters.segment_length_m + truth.parameters.gap_length_m
    back = 0.5 * pitch * (links - 1)
    state = np.array([x - back * np.cos(heading), y - back * np.sin(heading), heading, 0.0, 0.0, 0.0])
    shape = np.zeros((links - 1, 4))
    centres, lines = [], []
    for gait in gaits:
        times = np.linspace(0.0, gait.period_s, FRAMES + 1)
        tables = assemble(truth, trial_of(gait), gait.period_s + 1e-9)
        samples = sample(tables, state, shape, times)
        seen = look(tables, samples, times)
        centres.append(seen.centre_of_mass()[1:])
        lines.append(np.stack([_filled(seen.x), _filled(seen.y)], axis=2)[1:])
        state = samples[-1, :6].copy()
    return Played(np.concatenate(centres), np.concatenate(lines))


def trial_of(gait: Gait) -> Trial:
    """Return a gait as the laboratory plays it."""
    entries = tuple((i + 1, on, off) for i, pairs in enumerate(gait.intervals) for on, off in pairs)
    schedule = Schedule(entries, gait.period_s)
    return Trial("gait", 1 / gait.period_s, gait.pressure_kpa, schedule=schedule)


def _filled(nodes: np.ndarray) -> np.ndarray:
    """Put ALONG points between neighbouring links, (T, N) to (T, (N-1) ALONG + 1)."""
    share = np.arange(ALONG) / ALONG
    inner = nodes[:, :-1, None] * (1 - share) + nodes[:, 1:, None] * share
    return np.concatenate([inner.reshape(len(nodes), -1), nodes[:, -1:]], axis=1)


def true_speed_m_s(truth: Truth, gait: Gait) -> float:
    """Return the steady speed of a straight gait on the true robot."""
    times = gait.period_s * np.arange(SETTLED, SETTLED + MEASURED + 1)
    steps = np.diff(simulate.run(truth, trial_of(gait), times).centre_of_mass(), axis=0)
    return float(np.linalg.norm(steps, axis=1).mean() / gait.period_s)


def robots_of(effect: str, folder: Path) -> tuple[Truth, dict[str, Robot], str]:
    """Return the truth, the calibrated and the corrected robot, and what was said."""
    from srs_opt.calibrate.result import calibrated_robot
    from srs_opt.discrepancy.answer import corrected_robot
    from srs_opt.discrepancy.pipeline import diagnose
    from srs_opt.measurement.dataset import load_dataset
    from virtual_lab.dataset import Recording, write_dataset
    from virtual_lab.draw import draw_truth
    from virtual_lab.trials import small_design

    truth = draw_truth((effect,), np.random.default_rng([11, 4]), (1.0, 1.0))
    write_dataset(folder, truth, small_design(np.random.default_rng([11, 5])), 11, Recording())
    found = diagnose(load_dataset(folder))
    assert found.null is not None
    before = calibrated_robot(found.dataset.robot, found.null.hypothesis.fit)
    after = corrected_robot(found) or before  # what is not believed corrects nothing
    return truth, {"calibrated": before, "corrected": after}, f"{found.verdict.word}: {found.verdict.why}"


def planned(robot: Robot, gait: Gait, maze_file: Path) -> tuple[Problem, Plan | None]:
    """Plan through a maze with the fastest gait and its companions."""
    table = duty_biased_family(robot, gait)
    problem = Problem(robot, table, load_motion(robot, table), load_maze(str(maze_file)), MARGIN_M)
    return problem, solve_with_lattice(problem, max_nodes=20_000, time_limit_s=120.0).plan


def driven(truth: Truth, problem: Problem, plan: Plan) -> tuple[float, float]:
    """Return how far from the plan's end the true robot ends, and its smallest clearance on the way, m."""
    start = problem.start
    gaits = [problem.gaits.gaits[index].gait for index in plan.gaits]
    seen = play(truth, gaits, (start.x, start.y, start.heading))
    body = BodyClearance(problem.maze, problem.field, problem.robot.body_width_m / 2, 0.0)
    end = plan.path()[-1]
    away = float(np.hypot(*(seen.centre[-1] - (end["x_m"], end["y_m"]))))
    return away, float(body.exact(seen.lines).min())


def examine(effect: str, maze_file: Path) -> list[dict[str, object]]:
    """Return a row for the calibrated and one for the corrected robot."""
    with tempfile.TemporaryDirectory() as scratch:
        truth, robots, said = robots_of(effect, Path(scratch) / "set")
    rows: list[dict[str, object]] = []
    for name, robot in robots.items():
        limits = Limits(frequency_hz=(1.0, 2.0), pressure_kpa=(41.0, 55.0)).for_robot(robot)
        best = search(CycleProblem((robot,), "complex", Goal("speed"), limits), starts=2)
        row: dict[str, object] = {
            "effect": effect,
            "robot": name,
            "said": said,
            "promised_m_s": best.orbits[0].speed_m_s,
            "true_m_s": true_speed_m_s(truth, best.gait),
        }
        problem, plan = planned(robot, best.gait, maze_file)
        if plan is not None:
            away, clearance = driven(truth, problem, plan)
            row |= {"cycles": len(plan.gaits), "ends_away_m": away, "clearance_m": clearance}
        rows.append(row)
    return rows


def run(quick: bool) -> Section:
    """Return what was measured last; it takes minutes, and is not made anew for the report."""
    stored = stored_rows("discrepancy_payoff")
    measured, rows = stored if stored else ("never", [])
    columns = [
        "hidden", "robot", "speed promised, m/s", "true speed, m/s", "plan: cycles",
        "true end from planned, m", "least clearance, m",
    ]  # fmt: skip
    keys = ("effect", "robot", "promised_m_s", "true_m_s", "cycles", "ends_away_m", "clearance_m")
    table = [[_cell(row.get(key)) for key in keys] for found in rows for row in found]
    notes = [
        f"Measured {measured}.",
        "The robot's fastest gait, and a plan through a maze with it and its turning companions, played "
        "without feedback by the laboratory that made the data. Clearance below zero: in the wall.",
    ]
    return Section("Discrepancy: what naming the effect buys", columns, table, notes)


def _cell(value: object) -> str:
    return "no plan" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)


def main() -> int:
    """Examine every effect and keep the rows."""
    parser = study_parser("discrepancy_payoff", __doc__, len(EFFECTS))
    parser.add_argument("--effects", nargs="+", default=list(EFFECTS))
    parser.add_argument("--maze", type=Path, default=Path("mazes/first.yaml"))
    options = parser.parse_args()
    items = [(effect, options.maze) for effect in options.effects[: options.sets]]
    for row in chain.from_iterable(gather("discrepancy_payoff", examine, items, options)):
        print(", ".join(f"{k} {_cell(v)}" for k, v in row.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
