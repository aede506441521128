"""A window simulated, with its exact derivatives by everything that is free in it.

Steps are adaptive: where links stick and slip, even steps of a millisecond leave derivatives that are off by
a fifth and more, adapted ones of 2 ms in the mean by less than a hundredth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planners.refine.settings import WINDOW
from planners.refine.window import Window
from srs_opt.errors import NoAnswerError
from srs_opt.manoeuvre.certificate import seen_states
from srs_opt.manoeuvre.shooting import Born, carried_on, jump_of
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.kernel import Course

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WindowShot:
    """A simulated window.

    Attributes
    ----------
    window : Window
    time_s : array (n,)
    states : array (n, nx)
        Pose, velocity and curvatures; all of it where there are derivatives.
    final : array (nx,)
        All of the last state.
    sensitivity : array (n, nx, unknowns) or None
    """

    window: Window
    time_s: Array
    states: Array
    final: Array
    sensitivity: Array | None = None


def shoot_windows(run: Integrator, start: Array, windows: list[Window]) -> list[WindowShot | None]:
    """Simulate several windows from one state, side by side; None where the model cannot go on."""
    tolerance = WINDOW.tolerance * run.robot.length_m
    found = run_batched([run.travel(window.timeline(), start, tolerance) for window in windows])
    return [
        None
        if isinstance(path, NoAnswerError)
        else WindowShot(window, path.time_s, seen_states(run, path), path.final)
        for window, path in zip(windows, found)
    ]


def with_sensitivity(run: Integrator, start: Array, shot: WindowShot) -> WindowShot:
    """Differentiate a simulated window on its own steps."""
    window, timeline = shot.window, shot.window.timeline().at_one_pressure()
    full_kpa = float(timeline.pressure_kpa[0])
    h_s = np.diff(shot.time_s)
    middles = shot.time_s[:-1] + h_s / 2
    phase = np.searchsorted(np.cumsum(timeline.duration_s), middles).clip(max=timeline.duration_s.size - 1)
    course = Course(start, h_s, timeline.valve.T[phase], run.pack(full_kpa, 1.0))
    found, _ = run.kernel.run([course])
    states = np.vstack([start, found[:, :, 0]])
    kpa = window.pressures(middles)
    born: Born = {}
    for column, at, segment in window.edges():
        if column < 0:
            continue
        node = int(np.argmin(np.abs(shot.time_s[:-1] - at)))
        after = course.valve[node]
        if segment < 0:
            before = after / kpa[node] * (kpa[node - 1] if node else window.from_kpa)
        else:
            before = after.copy()
            before[segment] *= -1.0
        born.setdefault(node, []).append((column, jump_of(run, states[node], course.p, before, after)))
    by_pressure = np.zeros((h_s.size, window.size))
    shares = window.pressure_shares(middles)[:, 1:]
    by_pressure[:, window.size - window.cycles :] = shares * (full_kpa / kpa)[:, None]
    sensitivity = carried_on(run, course, states, born, by_pressure)
    # the end of the last cycle: f there, from the last step itself
    sensitivity[-1, :, window.switches + window.cycles - 1] = (states[-1] - states[-2]) / h_s[-1]
    return replace(shot, states=states, sensitivity=sensitivity)
