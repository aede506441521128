"""The program's rows for the gait as a whole: targets, dwell times, merit, own constraints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy import sparse

from srs_opt.errors import InputError
from srs_opt.gait_opt.collocation.layout import (
    ENVELOPE_UNIT_M,
    PRESSURE_UNIT_KPA,
    ROBOT_UNKNOWNS,
    Layout,
)
from srs_opt.gait_opt.collocation.point import PointKind, linear_shape
from srs_opt.gait_opt.goal import air_work_j
from srs_opt.gait_opt.objectives.cycle import SAMPLES
from srs_opt.gait_opt.objectives.objective import Formulas, Objective, formulas
from srs_opt.gait_opt.settings import COLLOCATION, GOAL
from srs_opt.model.registry import build

GOAL_NUMBERS = ("min_dwell_s", "radius_m", "envelope_m", "chamber_volume_m3")


@dataclass(frozen=True)
class Times:
    """Place and width of the points by the switch times: ``matrix @ switches + constant`` (2 points each).

    `turns` (points, switches) fixes the switch order; ``lengths @ switches + offsets`` are the phases'
    lengths, which must not be negative.
    """

    matrix: sparse.csr_matrix
    constant: np.ndarray
    turns: np.ndarray
    lengths: np.ndarray
    offsets: np.ndarray


@dataclass(frozen=True)
class GoalKind:
    """What fixes the rows, numbers apart: the objective, and whether a radius and a band are wanted."""

    objective: Objective
    radius: bool
    envelope: bool


@dataclass(frozen=True)
class GoalRows:
    """``function(head, numbers, the robots' parameters) -> rows``, their bounds and what they stand for."""

    function: ca.Function
    low: np.ndarray
    high: np.ndarray
    names: tuple[str, ...]


def goal_rows(layout: Layout, kind: GoalKind, times: Times | None = None) -> GoalRows:
    """Return the rows of all robots.

    The head is what all robots share, then five unknowns per robot; the numbers are `GOAL_NUMBERS`, then the
    weight of every robot and the unit of its merit.
    """
    robots = len(layout.kinds)
    shared = ca.SX.sym("shared", layout.shared)
    own = [ca.SX.sym(f"own{r}", len(ROBOT_UNKNOWNS)) for r in range(robots)]
    number = {name: ca.SX.sym(name) for name in GOAL_NUMBERS}
    weights, units = ca.SX.sym("weight_n", robots), ca.SX.sym("merit_unit", robots)
    parameters = [
        ca.SX.sym(f"p{r}", build(k.structure)[0].vector.numel()) for r, k in enumerate(layout.kinds)
    ]
    found: list[tuple[str, ca.SX, float, float]] = []

    def not_negative(name: str, value: ca.SX) -> None:
        found.append((name, value, 0.0, np.inf))

    first = layout.kinds[0]
    frequency, k = shared[0], first.intervals
    for i in range(0 if first.relaxed else first.segments):
        switches = ca.vertsplit(shared[2 + 2 * k * i : 2 + 2 * k * (i + 1)])
        on, off = switches[:k], switches[k:]
        # switch times are fractions of the period, so the dwell is one, too
        least = number["min_dwell_s"] * frequency
        for start, end, following in zip(on, off, [*on[1:], on[0] + 1]):
            not_negative("dwell", end - start - least)
            not_negative("dwell", following - end - least)
    if times is not None:
        not_negative("order", ca.DM(times.lengths) @ shared[2 : 2 + layout.switches] + times.offsets)
    aim = formulas(kind.objective, first.segments, k)
    for r, u in enumerate(own):
        speed, turn_rate, _, left, right = ca.vertsplit(u)
        if kind.radius:
            # speed = turn rate x radius, regular where the turn rate passes zero
            arc = number["radius_m"] * turn_rate
            if r == 0:
                # the nominal robot keeps it exactly
                found.append(("radius", speed - arc, 0.0, 0.0))
            else:  # one gait cannot give every robot the very same radius
                not_negative("radius", speed - (1 - COLLOCATION.other_robots_share * GOAL.turn_error) * arc)
                not_negative("radius", (1 + COLLOCATION.other_robots_share * GOAL.turn_error) * arc - speed)
        merit, rows = _formulas_of(aim, layout.kinds[r], shared, u, number, weights[r], parameters[r])
        # epigraph form: the least of the robots' merits is maximized without a kink
        not_negative("merit", merit / units[r] - shared[layout.merit])
        found += [
            (name, rows[j], low, high)
            for j, (name, low, high) in enumerate(zip(aim.names, aim.low, aim.high))
        ]
        if kind.envelope:
            not_negative("envelope", number["envelope_m"] / ENVELOPE_UNIT_M - left - right)
    head = ca.vertcat(shared, *own)
    values = [value for _, value, _, _ in found]
    function = ca.Function(
        "goal",
        [head, ca.vertcat(*number.values(), weights, units), ca.vertcat(*parameters)],
        [ca.vertcat(*values)],
    )
    sizes = [value.numel() for value in values]
    low, high = (np.repeat([row[j] for row in found], sizes).astype(float) for j in (2, 3))
    names = tuple(np.repeat([row[0] for row in found], sizes).tolist())
    return GoalRows(function, low, high, names)


def _formulas_of(
    aim: Formulas,
    kind: PointKind,
    shared: ca.SX,
    own: ca.SX,
    number: dict[str, ca.SX],
    weight: ca.SX,
    parameters: ca.SX,
) -> tuple[ca.SX, ca.SX]:
    """Return merit and constraints of one robot."""
    speed, turn_rate, work, left, right = ca.vertsplit(own)
    frequency, pressure = shared[0], PRESSURE_UNIT_KPA * shared[1]
    air = air_work_j(kind.intervals * kind.segments, pressure, number["chamber_volume_m3"])
    band = (ENVELOPE_UNIT_M * left, ENVELOPE_UNIT_M * right)
    scalars = ca.vertcat(speed, turn_rate, work, air, *band, frequency, pressure, weight)
    count = 2 * kind.intervals * kind.segments
    if kind.relaxed:
        if aim.uses_switches or aim.uses_curvature:
            raise InputError("an objective of switch times or curvatures has no relaxed form")
        switches, curvature = ca.SX.zeros(count), ca.SX.zeros(kind.segments, SAMPLES)
    else:
        switches = shared[2 : 2 + count]
        curvature = ca.SX.zeros(kind.segments, SAMPLES)
        if aim.uses_curvature:
            curvature = _curvature(kind, switches, frequency, pressure, parameters)
    merit, rows = aim.function(scalars, switches, curvature)
    return merit, rows


def _curvature(kind: PointKind, switches: ca.SX, frequency: ca.SX, pressure: ca.SX, p: ca.SX) -> ca.SX:
    """Return the closed-form curvatures over the cycle, (segments, SAMPLES)."""
    if kind.structure.compliant or not build(kind.structure)[2].linear:
        raise InputError(
            "an objective of the curvature needs actuators whose curvature is known in closed form: the "
            "model complex or simplified, without effects on the actuators; --max-curvature goes with any"
        )
    plain = replace(kind, ordered=False, envelope=False, curvature=False)
    at = ca.DM(np.arange(SAMPLES)[None] / SAMPLES)
    kappa, _ = linear_shape(plain, SAMPLES)(
        switches, frequency, pressure, at, p, COLLOCATION.curvature_switch_half_width
    )
    return kappa
