"""One window's local optimum: sequential linear programming with exact derivatives in a trust region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

from planners.motion.valves import ValveLimits
from planners.refine.limits import Limits, Values
from planners.refine.settings import WINDOW_STEP
from planners.refine.shots import WindowShot, shoot_windows, with_sensitivity
from planners.refine.window import Window
from srs_opt.errors import NoAnswerError
from srs_opt.manoeuvre.order import OrderRows
from srs_opt.simulate.integrate import Integrator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Before:
    """What the valves did before a window: states and ages (infinite at rest, states 0)."""

    states: tuple[int, ...]
    ages_s: tuple[float, ...]


@dataclass(frozen=True)
class Found:
    """A window, simulated, and what it costs; `worst_m` is the largest violation."""

    shot: WindowShot
    values: Values
    merit: float
    worst_m: float


class WindowSolver:
    """Optimizes the windows of one start and end.

    Parameters
    ----------
    run : Integrator
    start : array (nx,)
    limits : Limits
    before : Before
    valves : ValveLimits
    pressure_kpa : (low, high)
    """

    def __init__(
        self,
        run: Integrator,
        start: Array,
        limits: Limits,
        before: Before,
        valves: ValveLimits,
        pressure_kpa: tuple[float, float],
    ) -> None:
        self.run, self.start, self.limits = run, start, limits
        self.before, self.valves, self.pressure_kpa = before, valves, pressure_kpa
        self.tail_s = (0.0,) * len(before.states)
        self.steps = 0  # taken so far

    def judge(self, windows: list[Window]) -> list[Found | None]:
        """Simulate and judge windows; None where the model cannot go on."""
        shots = shoot_windows(self.run, self.start, windows)
        values = iter(self.limits([shot for shot in shots if shot is not None]))
        return [None if shot is None else self._judged(shot, next(values)) for shot in shots]

    @staticmethod
    def _judged(shot: WindowShot, values: Values) -> Found:
        missed = np.minimum(values.values, 0.0)
        # many rows tell of one overlap: the worst counts, and a little of the others
        penalty = WINDOW_STEP.penalty_per_m * (3 * missed.min(initial=0.0) + missed.sum() / 30)
        return Found(shot, values, shot.window.ends_s[-1] - float(penalty), float(-missed.min(initial=0.0)))

    def solve(self, window: Window, most: int) -> Found:
        """Return the local optimum near a window.

        Raises
        ------
        NoAnswerError
            If the model cannot go through the window.
        """
        (best,) = self.judge([window])
        if best is None:
            raise NoAnswerError("the plan cannot be simulated")
        reach, idle = WINDOW_STEP.first_reach_s, 0
        for _ in range(most):
            if reach < WINDOW_STEP.least_reach_s or idle > WINDOW_STEP.most_idle:
                break
            self.steps += 1
            found = self._around(best, reach)
            if found is None:
                break
            f, trial = found
            gain = best.merit - trial.merit
            if gain <= 0:
                reach *= WINDOW_STEP.shrink
                continue
            best = trial
            idle = idle + 1 if gain < WINDOW_STEP.gain_s else 0
            s = WINDOW_STEP
            if f == 1.0:
                reach = min(s.grow * reach, s.most_reach_s)
            else:
                reach = max(1.5 * f * reach, s.least_reach_s)
        return best

    def _around(self, best: Found, reach: float) -> tuple[float, Found] | None:
        """Return the best window that the linear model leads to and for which part of the reach; or None.

        The end is missed by the square of a step, so each part is corrected once by what it misses.
        """
        shot = with_sensitivity(self.run, self.start, best.shot)
        (rows,) = self.limits([shot])
        step = self._step(shot.window, rows, reach, np.zeros(0))
        if step is None:
            return None
        x = shot.window.unknowns()
        tried: list[tuple[float, Window]] = [
            (f, shot.window.moved(x + f * step)) for f in WINDOW_STEP.fractions
        ]
        found = list(zip(WINDOW_STEP.fractions, self.judge([window for _, window in tried])))
        again = []
        for f, trial in found[:-1]:
            if trial is not None:
                ends = self.limits.ends
                missed = trial.values.values[:ends] - rows.values[:ends] - f * rows.jacobian[:ends] @ step
                better = self._step(shot.window, rows, f * reach, missed)
                if better is not None:
                    again.append((f, shot.window.moved(x + better)))
        found += zip([f for f, _ in again], self.judge([window for _, window in again]))
        judged = [(f, trial) for f, trial in found if trial is not None]
        return min(judged, key=lambda pair: pair[1].merit, default=None)

    def _step(self, window: Window, rows: Values, reach: float, missed: Array) -> Array | None:
        """Return the linear model's best change of the unknowns; None if there is none.

        `missed` is what the model errs by in the first rows.
        """
        values = rows.values.copy()
        values[: missed.size] += missed
        keep = values < 1.5 * reach + 0.005
        values, jacobian = values[keep], rows.jacobian[keep]
        n, m, ends = window.size, values.size, window.switches + window.cycles
        by_cycles = window.by_cycles()
        cost = np.concatenate([by_cycles[ends - 1], np.full(m, WINDOW_STEP.penalty_per_m)])
        near = sparse.hstack([sparse.csr_matrix(-jacobian @ by_cycles), -sparse.identity(m)])
        order, room = self.order_rows(window)
        order = sparse.hstack([order @ by_cycles, sparse.csr_matrix((room.size, m))])
        low, high = np.full(n + m, -reach), np.full(n + m, reach)
        low[window.switches : ends] *= WINDOW_STEP.stretch
        high[window.switches : ends] *= WINDOW_STEP.stretch
        kpa = window.unknowns()[ends:]
        span = WINDOW_STEP.pressure_per_s * reach * (self.valves.pressure_rate_kpa_s is None)
        low[ends:n] = np.clip(self.pressure_kpa[0] - kpa, -span, 0.0)
        high[ends:n] = np.clip(self.pressure_kpa[1] - kpa, 0.0, span)
        low[n:], high[n:] = 0.0, np.inf
        columns = np.column_stack([low, high])
        rows_of_all = sparse.vstack([near, order]).tocsr()
        # what a start breaks is put right, all at once where the reach allows for it
        for mended in (-reach / 2, 0.0):
            bounds = np.concatenate([values, np.maximum(room, mended)])
            found = linprog(cost, A_ub=rows_of_all, b_ub=bounds, bounds=columns, method="highs")
            if found.x is not None:
                return np.asarray(by_cycles @ found.x[:n])
        return None

    def order_rows(self, window: Window, ticks: int = 1) -> tuple[sparse.csr_matrix, Array]:
        """Return ``A x <= b`` for changes x: dwell, and every switch in its own cycle.

        Every segment switches inside every cycle. `ticks` are kept for rounding; with 0 of them the end is
        open.
        """
        tick = self.valves.tick_s
        least = self.valves.dwell_s + ticks * tick
        rows = OrderRows()
        ends, first = window.switches, 0
        for k, end in enumerate(window.ends_s):
            begin = window.ends_s[k - 1] if k else 0.0
            shortest = max(window.ramp_s[k], 2 * least)
            rows.add(ends + k, ends + k - 1 if k else None, end - begin - shortest)
        before = zip(self.before.states, self.before.ages_s, self.tail_s)
        for valves, owners, (state, age, tail) in zip(window.rows, window.cycle_of, before):
            times = valves.times_s
            since = -age if valves.states[0] == state else 0.0
            for j, (time, k) in enumerate(zip(times, owners)):
                rows.add(
                    first + j, first + j - 1 if j else None, time - (times[j - 1] if j else since) - least
                )
                begin, end = window.ends_s[k - 1] if k else 0.0, window.ends_s[k]
                last = j + 1 == len(times) or owners[j + 1] != k
                rows.add(
                    first + j,
                    ends + k - 1 if k else None,
                    time - begin - ((1 + ticks) * tick if last else 0.0),
                )
                rows.add(ends + k, first + j, end - time - (1 + ticks) * tick)
            if times and tail and ticks:
                rows.add(
                    ends + window.cycles - 1,
                    first + len(times) - 1,
                    window.ends_s[-1] - times[-1] - tail - 2 * ticks * tick,
                )
            first += len(times)
        return rows.matrix(window.size)
