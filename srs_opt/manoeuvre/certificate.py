"""The certificate of a manoeuvre: simulated afresh, adaptively, with two tolerances; all of it checked."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from srs_opt.manoeuvre.rows import RowMaker
from srs_opt.manoeuvre.settings import CONSTRAINT, MANOEUVRE_CERTIFICATE
from srs_opt.manoeuvre.shooting import Shot
from srs_opt.manoeuvre.task import Task
from srs_opt.manoeuvre.valves import ValvePlan
from srs_opt.model.state import POSE, VELOCITY
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.settings import INTEGRATION


@dataclass(frozen=True)
class Certificate:
    """What the fresh simulation found.

    Attributes
    ----------
    end_ok, space_ok, curvature_ok : bool
        The end is reached (the numerical error taken off); the body keeps to its room; bends to their limits.
    dwell_ok, tick_ok, pressure_ok : bool
    shortest_dwell_s, largest_curvature_1_m : float
    error_m : float
        Bound on the end's numerical error.
    """

    end_ok: bool
    space_ok: bool
    curvature_ok: bool
    dwell_ok: bool
    tick_ok: bool
    pressure_ok: bool
    shortest_dwell_s: float | None
    largest_curvature_1_m: float
    error_m: float

    @property
    def passed(self) -> bool:
        """Whether everything holds."""
        checks = (
            self.end_ok,
            self.space_ok,
            self.curvature_ok,
            self.dwell_ok,
            self.tick_ok,
            self.pressure_ok,
        )
        return all(checks)

    def record(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {**asdict(self), "passed": self.passed}

    def failures(self) -> str:
        """Return what fails, in words."""
        words = {
            "end_ok": "the end is not reached",
            "space_ok": "the body leaves its space",
            "curvature_ok": f"a bend reaches {self.largest_curvature_1_m:.2f} 1/m",
            "dwell_ok": f"a valve is held for only {self.shortest_dwell_s} s",
            "tick_ok": "a switch stands off the ticks",
            "pressure_ok": "the pressure is out of its limits",
        }
        return ", ".join(text for name, text in words.items() if not getattr(self, name))


def certify(run: Integrator, task: Task, plan: ValvePlan) -> tuple[Certificate, Trajectory]:
    """Simulate a manoeuvre afresh and check it against its task."""
    coarse_m_s = INTEGRATION.tolerance_m_s / MANOEUVRE_CERTIFICATE.finer
    coarse = run.integrate(plan.timeline(), task.start.state, coarse_m_s)
    fine = run.integrate(plan.timeline(), task.start.state, coarse_m_s / MANOEUVRE_CERTIFICATE.finer)
    apart = (coarse.final[POSE] - fine.final[POSE]) * (1.0, 1.0, CONSTRAINT.lever * run.robot.length_m)
    # errors a ratio apart differ by ratio - 1 of the smaller, the finer motion's
    error = float(np.hypot(*apart[:2]) + abs(apart[2])) / (MANOEUVRE_CERTIFICATE.ratio - 1)
    shot = Shot(plan, fine.time_s, seen_states(run, fine))
    # the whole tolerances: the optimization kept inside of them for ticks and errors
    rows = RowMaker(run, task, inside=1.0)
    end = float(rows.end_values(shot).min())
    space = float(rows.space_values(shot, np.arange(fine.time_s.size)).min(initial=np.inf))
    curvature = float(np.abs(fine.kappa).max())
    bounds = task.bounds
    dwell = plan.shortest_dwell_s(task.start.ages_s(run.structure.segments))
    low, high = bounds.pressure_kpa
    if task.pressure_kpa is not None:  # a gait's own pressure is given
        low, high = min(low, task.pressure_kpa), max(high, task.pressure_kpa)
    certificate = Certificate(
        end_ok=end >= error and error <= MANOEUVRE_CERTIFICATE.error * run.robot.length_m,
        space_ok=space >= error,
        curvature_ok=bounds.max_curvature_1_m is None or curvature <= bounds.max_curvature_1_m * (1 + 1e-6),
        # times are sums: a nanosecond, or a millionth of a tick, is rounding
        dwell_ok=dwell >= bounds.dwell_s - 1e-9,
        tick_ok=plan.off_tick_s(bounds.tick_s) <= 1e-6 * bounds.tick_s + 1e-9,
        pressure_ok=low - 1e-9 <= plan.pressure_kpa <= high + 1e-9,
        shortest_dwell_s=round(dwell, 9) if np.isfinite(dwell) else None,
        largest_curvature_1_m=curvature,
        error_m=error,
    )
    return certificate, fine


def seen_states(run: Integrator, path: Trajectory) -> np.ndarray:
    """Return the states (n, nx) that constraints look at: pose, velocity and curvatures."""
    states = np.zeros((path.time_s.size, run.states))
    states[:, POSE], states[:, VELOCITY] = path.pose, path.velocity
    states[:, run.layout.kappa] = path.kappa
    return states
