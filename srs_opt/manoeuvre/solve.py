"""All switch times at once: sequential linear programming with exact derivatives in a trust region.

The motion depends on its switch times smoothly but, near sticking friction, with strong curvature; its
memory is short (velocities and bends decay within a cycle) and only the pose adds up. So single shooting
from the start is well conditioned, the linear model is right within some milliseconds, and optima lie in
corners: where dwell, end and room bind. Violations are penalized exactly, by their sum, or by the worst where
many rows tell of one overlap; the linear program minimizes the merit by which steps are judged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from srs_opt.manoeuvre.order import OrderRows, standing_s
from srs_opt.manoeuvre.rows import RowMaker, Rows
from srs_opt.manoeuvre.settings import MANOEUVRE_SOLVER
from srs_opt.manoeuvre.shooting import Shot, shoot, shoot_with_sensitivity
from srs_opt.manoeuvre.task import Task
from srs_opt.manoeuvre.valves import ValvePlan
from srs_opt.simulate.integrate import Integrator


@dataclass(frozen=True)
class Candidate:
    """A manoeuvre with what it costs: `merit` = price + penalty; `worst_m` the largest violation."""

    plan: ValvePlan
    price: float
    merit: float
    worst_m: float
    steps: int = 0


class Solver:
    """Optimizes manoeuvres of one task on one model (which holds the friction's smoothing)."""

    def __init__(self, run: Integrator, task: Task, step_s: float | None = None) -> None:
        self.run, self.task, self.step_s = run, task, step_s
        self.rows = RowMaker(run, task)
        length = run.robot.length_m
        self.penalty_s_m = MANOEUVRE_SOLVER.penalty_s / length
        self.space_s_m = MANOEUVRE_SOLVER.space_s / length
        self.ages = task.start.ages_s(run.structure.segments)

    def judge(self, plans: list[ValvePlan]) -> list[Candidate]:
        """Simulate and judge manoeuvres."""
        return [self.judged(shot) for shot in shoot(self.run, self.task.start.state, plans, self.step_s)]

    def judged(self, shot: Shot) -> Candidate:
        """Judge a simulated manoeuvre."""
        radius = self._radius(shot)
        values = self.rows(shot, radius).values
        if not np.isfinite(values).all():
            return Candidate(shot.plan, np.inf, np.inf, np.inf)
        missed = np.minimum(values, 0.0)
        price = self._price(shot.plan, radius)
        violation = missed.min() if _is_shared(values) else missed.sum()
        merit = price - self._penalty_s_m(values) * violation
        return Candidate(shot.plan, price, float(merit), float(-missed.min(initial=0.0)))

    def _penalty_s_m(self, values: np.ndarray) -> float:
        return self.penalty_s_m * (MANOEUVRE_SOLVER.worst_times if _is_shared(values) else 1.0)

    def _radius(self, shot: Shot) -> float:
        if self.task.objective != "space":
            return 0.0
        points, _ = self.rows.points(Shot(shot.plan, shot.time_s, shot.states), self.rows.looks(shot))
        away = points.reshape(-1, 2) - self.rows.centre(points)
        return float(np.hypot(*away.T).max()) + self.run.robot.body_width_m / 2

    def _price(self, plan: ValvePlan, radius_m: float) -> float:
        if self.task.objective == "space":
            return self.space_s_m * radius_m + MANOEUVRE_SOLVER.time_beside * plan.duration_s
        if self.task.objective == "air":
            air = MANOEUVRE_SOLVER.fill_s_kpa * plan.fills * plan.pressure_kpa
            return air + MANOEUVRE_SOLVER.time_beside * plan.duration_s
        return plan.duration_s

    def plays(self, plan: ValvePlan) -> bool:
        """Whether valves can play a plan from the start: every switch inside it and dwelt for."""
        _, room = self._dwell_rows(plan, plan.switches + 2)
        return bool((room > -1e-9).all())

    def solve(self, plan: ValvePlan, most: int = 60) -> Candidate:
        """Return the local optimum near a manoeuvre."""
        (best,) = self.judge([plan])
        reach, idle = MANOEUVRE_SOLVER.first_reach_s, 0
        steps = 0
        while steps < most and reach >= MANOEUVRE_SOLVER.least_reach_s and idle < MANOEUVRE_SOLVER.most_idle:
            steps += 1
            shot = shoot_with_sensitivity(self.run, self.task.start.state, best.plan, self.step_s)
            step = self._step(shot, reach)
            if step is None:
                break
            # fractions of the step guard against what the linear model does not see
            old = np.concatenate([best.plan.times(), [best.plan.duration_s, best.plan.pressure_kpa]])
            trials = [best.plan.with_times(*_split(old + f * step)) for f in MANOEUVRE_SOLVER.step_fractions]
            found = self.judge([t.trimmed() for t in trials])
            k = int(np.argmin([c.merit for c in found]))
            gain = best.merit - found[k].merit
            if gain > 0:
                best = found[k]
                idle = idle + 1 if gain < MANOEUVRE_SOLVER.gain_s else 0
                reach = (
                    min(2 * reach, MANOEUVRE_SOLVER.most_reach_s)
                    if k == 0
                    else max(MANOEUVRE_SOLVER.step_fractions[k] * 1.5 * reach, MANOEUVRE_SOLVER.least_reach_s)
                )
            else:
                reach *= MANOEUVRE_SOLVER.step_fractions[-1] * 4
            # a pulse that has shrunk to the dwell holds up all later steps
            merged = self._without_short_pulses(best)
            if merged is not None:
                best = merged
        return Candidate(best.plan, best.price, best.merit, best.worst_m, steps)

    def _without_short_pulses(self, best: Candidate) -> Candidate | None:
        """Return the manoeuvre without a pulse that has shrunk to the dwell, if it is the better for it."""
        trials = []
        for s, row in enumerate(best.plan.rows):
            for k in range(len(row.times_s) - 1):
                short = row.times_s[k + 1] - row.times_s[k] < self.task.bounds.dwell_s + 1e-4
                if short and row.states[k] == row.states[k + 2]:
                    rows = [*best.plan.rows]
                    rows[s] = row.without_pulse(k)
                    trials.append(replace(best.plan, rows=tuple(rows)))
        if not trials:
            return None
        found = min(self.judge(trials), key=lambda c: c.merit)
        return found if found.merit < best.merit + MANOEUVRE_SOLVER.gain_s else None

    def _step(self, shot: Shot, reach: float) -> np.ndarray | None:
        """Return the linear model's best change of times, duration and pressure; None if there is none."""
        plan, task, bounds = shot.plan, self.task, self.task.bounds
        radius = self._radius(shot)
        rows = self.rows(shot, radius)
        # rows with more to spare than a step can use up only make the linear program larger
        used = MANOEUVRE_SOLVER.kept_per_s * max(reach, MANOEUVRE_SOLVER.kept_reach_s)
        penalty, shared = self._penalty_s_m(rows.values), _is_shared(rows.values)
        keep = rows.values < (used + MANOEUVRE_SOLVER.kept) * self.run.robot.length_m
        rows = Rows(rows.values[keep], None if rows.jacobian is None else rows.jacobian[keep])
        assert rows.jacobian is not None
        n, m = plan.switches, rows.values.size
        slack = np.ones((m, 1)) if shared else sparse.identity(m)
        size = n + 2 + 1 + slack.shape[1]  # times, duration, pressure; radius; violations
        cost = np.zeros(size)
        cost[n] = 1.0 if task.objective == "time" else MANOEUVRE_SOLVER.time_beside
        cost[n + 1] = MANOEUVRE_SOLVER.fill_s_kpa * plan.fills if task.objective == "air" else 0.0
        cost[n + 2] = self.space_s_m if task.objective == "space" else 0.0
        cost[n + 3 :] = penalty
        # values + J x + violation >= 0, written as A x <= b
        near = sparse.hstack([sparse.csr_matrix(-rows.jacobian), -slack])
        dwell, room = self._dwell_rows(plan, size)
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        # the trust region: linear models of sticking friction hold for milliseconds
        low[:n], high[:n] = -reach, reach
        high[n] = MANOEUVRE_SOLVER.duration_reaches * reach
        low[n] = -high[n]
        if task.longest_s is not None:
            high[n] = min(high[n], max(task.longest_s - plan.duration_s, low[n]))
        # a linear step must not take the whole manoeuvre away
        low[n] = max(low[n], MANOEUVRE_SOLVER.least_duration_s - plan.duration_s)
        span = MANOEUVRE_SOLVER.pressure_kpa_per_s * reach
        low[n + 1] = np.clip(bounds.pressure_kpa[0] - plan.pressure_kpa, -span, span)
        high[n + 1] = np.clip(bounds.pressure_kpa[1] - plan.pressure_kpa, -span, span)
        if not task.pressure_is_free:
            low[n + 1] = high[n + 1] = 0.0
        high[n + 2] = MANOEUVRE_SOLVER.radius_per_s * self.run.robot.length_m * reach
        low[n + 2] = -high[n + 2]
        low[n + 3 :] = 0.0
        found = linprog(
            cost,
            A_ub=sparse.vstack([near, dwell]).tocsr(),
            b_ub=np.concatenate([rows.values, room]),
            bounds=np.column_stack([low, high]),
            method="highs",
        )
        return None if found.x is None else np.asarray(found.x[: n + 2])

    def _dwell_rows(self, plan: ValvePlan, size: int) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Return ``A x <= b``: switches of a segment keep the dwell, at start and end too."""
        least = self.task.bounds.dwell_s
        n = plan.switches
        rows = OrderRows()
        first = 0
        tail = self._tail_s()
        for segment, (valves, age) in enumerate(zip(plan.rows, self.ages)):
            times = valves.times_s
            for k, time in enumerate(times):
                if k == 0:
                    # at rest a valve may be vented until its first switch: no dwell before that
                    wait = 0.0 if valves.states[0] == 0 else least
                    since = 0.0 if age == np.inf else -age
                    rows.add(first, None, time - since - wait)
                else:
                    rows.add(first + k, first + k - 1, time - times[k - 1] - least)
            if times:
                rows.add(n, first + len(times) - 1, plan.duration_s - times[-1] - tail[segment])
            first += len(times)
        return rows.matrix(size)

    def _tail_s(self) -> tuple[float, ...]:
        """Return how long each segment's last state must have stood at the end."""
        orbit = self.task.end.orbit
        if orbit is None:
            return (0.0,) * self.run.structure.segments
        return standing_s(orbit.gait, self.task.bounds.dwell_s)


def _is_shared(values: np.ndarray) -> bool:
    """Whether one violation, the worst, stands for all: many rows tell of one overlap."""
    return values.size >= MANOEUVRE_SOLVER.many_rows


def _split(x: np.ndarray) -> tuple[np.ndarray, float, float]:
    return x[:-2], float(x[-2]), float(x[-1])


def smoothed(robot_run: Integrator, friction_speed_m_s: float) -> Integrator:
    """Return the model with its friction smoothed at least so much."""
    robot = robot_run.robot
    if friction_speed_m_s <= robot.friction_speed_m_s:
        return robot_run
    return Integrator(
        robot.with_values(friction_speed_m_s=friction_speed_m_s), robot_run.structure.model, room=False
    )
