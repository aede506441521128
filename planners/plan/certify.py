"""The certificate: the whole plan played on the dynamic model, afresh and finer, against exact geometry.

Nothing of the search is used but the order of its gaits: the model is integrated adaptively from rest, and
at every node of that integration the body's capsules are measured against the walls themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planners.motion.table import body_in_room
from planners.search.problem import ROUNDING_M, Problem
from planners.search.tree import Root, arrival_index, at_rest
from srs_opt.model.outline import POINTS_PER_ARC
from srs_opt.simulate.integrate import Trajectory
from srs_opt.simulate.shapes import centre_lines
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]
TOLERANCE_M_S = 1e-5
EXACT_BELOW_M = 0.03  # of clearance; above, the table's lower bound will do


@dataclass(frozen=True)
class Certificate:
    """What the fresh simulation found.

    Attributes
    ----------
    passed : bool
    reason : str
        Why not; empty when passed.
    clearance_m : float
        Smallest distance of the body to a wall on the way.
    between_m : float
        No part of the body comes nearer than this between the instants looked at either (at least 0 is
        asked for): the clearance less half of what any point moves meanwhile and the arcs' sagitta.
    failed_cycle : int or None
        Index of the first cycle that fails.
    time_s : array (n,)
        Instants, up to arrival.
    pose : array (n, 3)
    lines : array (n, points, 2)
        Centre line of the body in the room.
    room_m : array (n,)
        Clearance at those instants (a lower bound where it is above EXACT_BELOW_M).
    cycle : int array (n,)
        Index of the cycle that each instant belongs to.
    states : tuple of arrays
        State of the model at the end of every cycle.
    """

    passed: bool
    reason: str
    clearance_m: float
    between_m: float
    failed_cycle: int | None
    time_s: Array
    pose: Array
    lines: Array
    room_m: Array
    cycle: NDArray[np.int64]
    states: tuple[Array, ...]


def certify(problem: Problem, gaits: Sequence[int], root: Root | None = None) -> Certificate:
    """Play a sequence of gaits, a cycle each, from the start (or another root) and judge it."""
    root = root or at_rest(problem)
    entries = [problem.gaits.gaits[g].gait for g in gaits]
    played, state = [], root.state
    for gait in entries:
        played.append(problem.run.run(Timeline.of_gait(gait, gait.period_s), state, TOLERANCE_M_S))
        state = played[-1].final
    time, pose, kappa, cycle = _joined(played)
    lines = body_in_room(centre_lines(problem.run, kappa), pose)
    arrived = arrival_index(problem.goal, pose)
    last = len(time) if arrived is None else arrived + 1
    time, pose, lines, kappa, cycle = time[:last], pose[:last], lines[:last], kappa[:last], cycle[:last]
    room = clearances(problem, lines)
    unseen = np.zeros(last)
    moved = np.hypot(*(lines[1:] - lines[:-1]).transpose(2, 0, 1)).max(axis=1, initial=0.0)
    unseen[1:] = moved / 2
    unseen += _sagitta(problem, kappa)
    between = float((room - unseen).min())
    wanted = problem.margin_m + np.where(cycle == 0, root.slack_m, -ROUNDING_M)
    close = room < wanted
    failed = int(cycle[close.argmax()]) if close.any() else None
    reason = ""
    if failed is not None:
        reason = f"the body comes within {1e3 * room.min():.2f} mm of a wall in cycle {failed + 1}"
    elif between < 0:
        failed = int(cycle[int((room - unseen).argmin())])
        reason = f"contact between two instants of cycle {failed + 1} cannot be ruled out"
    elif arrived is None:
        away = float(problem.goal.distance(pose[-1, :2]))
        reason = f"the centre of mass ends {1e3 * away:.1f} mm short of the goal"
        failed = len(gaits) - 1
    states = tuple(t.final for t in played)
    return Certificate(
        failed is None, reason, float(room.min()), between, failed, time, pose, lines, room, cycle, states
    )


def _joined(played: Sequence[Trajectory]) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Return times, poses, curvatures and cycle indices of consecutive trajectories."""
    begins = np.cumsum([0.0, *(t.time_s[-1] for t in played)])
    time = [played[0].time_s[:1], *(t.time_s[1:] + begin for t, begin in zip(played, begins))]
    pose = [played[0].pose[:1], *(t.pose[1:] for t in played)]
    kappa = [played[0].kappa[:1], *(t.kappa[1:] for t in played)]
    counts = [1, *(t.time_s.size - 1 for t in played)]
    cycle = np.repeat([0, *range(len(played))], counts)
    return np.concatenate(time), np.concatenate(pose), np.concatenate(kappa), cycle


def clearances(problem: Problem, lines: Array, limit_m: float = EXACT_BELOW_M) -> Array:
    """Return the clearance of bodies (n, points, 2): exact below `limit_m`, a lower bound above."""
    room = problem.body.estimate(lines) - problem.field.error_m
    close = room < limit_m
    if close.any():
        room[close] = problem.body.exact(lines[close])
    return room


def _sagitta(problem: Problem, kappa: Array) -> Array:
    """Return by how much the arcs leave the chords that stand for them, per instant."""
    chord = problem.robot.segment_length_m / POINTS_PER_ARC
    return np.abs(kappa).max(axis=1) * chord**2 / 8
