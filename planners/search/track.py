"""Receding-horizon choice of the next gait: a few cycles are rolled out over the gait table.

The predictor learns as it drives: how much farther or shorter than predicted a cycle goes, and how much
the robot turns by itself. That is what a robot with other friction, a tether or a bent segment shows.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.motion.table import SAMPLES
from planners.search.problem import Problem
from planners.search.tree import arrival_index
from srs_opt.geometry import compose, points_in_room, rotate, wrapped

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TrackSettings:
    """What a gait is chosen by. Lengths in body lengths, speeds in body lengths per second.

    What half and double of a value do is said as it is to be expected; only the values were driven.

    Attributes
    ----------
    place, course_rad, speed : float
        Deviations from the plan that cost one unit each. Their ratios weigh place against course; half of all
        three follows the plan more closely and pays in time, double cuts its corners.
    unit_s : float
        Time that costs one unit: a robot slower than its plan must not creep along it.
    air, air_units : float
        Below this clearance it costs, up to so many units at contact. Half: bodies pass nearer to walls;
        double: the robot leaves a plan that is itself nearer to walls.
    contact, contact_units : float
        A clearance below this counts as contact, which costs more than any deviation.
    change_units : float
        Cost of another gait than the one before: without, two gaits that are as good alternate.
    horizon, beam : int
        Cycles rolled out, and branches kept at each: the time for a choice grows with both. Fewer cycles miss
        turns that only pay two cycles later.
    nodes_per_cycle : int
        Nodes of the reference per cycle of the plan: the nearest one is found to within a sixth of a cycle.
    learning : float
        Weight of the last cycle in what is learned. Half follows a change of ground in twice the cycles,
        double follows the noise of single ones.
    least_way : float
        A cycle that should go less far teaches nothing about the stretch.
    thinned : int
        Every so many samples of a cycle are looked at. Larger may miss a touch, smaller takes time.
    """

    place: float = 0.0847
    course_rad: float = 0.15
    speed: float = 2.54
    unit_s: float = 0.1
    air: float = 0.0636
    air_units: float = 4.0
    contact: float = 0.00212
    contact_units: float = 100.0
    change_units: float = 0.05
    horizon: int = 3
    beam: int = 5
    nodes_per_cycle: int = 6
    learning: float = 0.3
    least_way: float = 0.0212
    thinned: int = 3


DEFAULT_TRACK = TrackSettings()


class Reference(NamedTuple):
    """The plan as nodes: place and course (n, 3), speed (n,), time to go (n,), gait played (n,)."""

    pose: Array
    speed_m_s: Array
    left_s: Array
    gait: NDArray[np.int64]

    def part(self, nodes: slice) -> Reference:
        """Return some of the nodes."""
        return Reference(self.pose[nodes], self.speed_m_s[nodes], self.left_s[nodes], self.gait[nodes])


@dataclass(frozen=True)
class Learned:
    """How the driven robot differs from the table: stretch of a cycle's way, turn of its own (rad/s).

    `own` holds what single gaits were seen to do beyond the common stretch: what slows one gait a little may
    stop another.
    """

    stretch: float = 1.0
    drift_rad_s: float = 0.0
    own: Mapping[int, float] = field(default_factory=dict)

    def stretches(self, gaits: int) -> Array:
        """Return every gait's stretch, (gaits,)."""
        found = np.full(gaits, self.stretch)
        for gait, share in self.own.items():
            found[gait] *= share
        return found

    def apply(self, local: Array, period_s: Array | float) -> Array:
        """Correct all gaits' poses (gaits, SAMPLES + 1, 3) in the frame of a cycle's start."""
        turned = self.drift_rad_s * np.asarray(period_s)[..., None] * np.linspace(0, 1, local.shape[-2])
        stretch = self.stretches(len(local))[:, None]
        x, y = rotate(turned / 2, stretch * local[..., 0], stretch * local[..., 1])
        return np.stack([x, y, local[..., 2] + turned], axis=-1)

    def update(
        self,
        predicted: Array,
        observed: Array,
        period_s: float,
        gait: int,
        length_m: float,
        settings: TrackSettings = DEFAULT_TRACK,
    ) -> Learned:
        """Learn from one cycle's predicted (corrected) and observed displacement, (3,) each."""
        far = math.hypot(predicted[0], predicted[1])
        stretch, own = self.stretch, dict(self.own)
        if far > settings.least_way * length_m:
            along = min(max(float(observed[:2] @ predicted[:2]) / far**2, 0.2), 1.5)
            stretch = min(max(stretch * (1 + settings.learning * (along - 1)), 0.5), 1.5)
            alone = own.get(gait, 1.0) * along * self.stretch / stretch
            own[gait] = min(max(alone, 0.1), 1.5)
        drift = self.drift_rad_s + settings.learning * float(observed[2] - predicted[2]) / period_s
        return Learned(stretch, min(max(drift, -1.0), 1.0), own)


@dataclass(frozen=True)
class Where:
    """The measured state at a cycle's end: place, gait before, forward speed."""

    pose: Array
    gait: int
    speed_m_s: float


@dataclass(frozen=True)
class Choice:
    """The gait to play, what it should do, and how well it keeps to the plan.

    Attributes
    ----------
    gait : int
    displacement : array (3,)
        Predicted, in the frame of the cycle's start.
    clearance_m : float
        Predicted for this cycle.
    astray_m : float
        Distance from the plan after the horizon.
    """

    gait: int
    displacement: Array
    clearance_m: float
    astray_m: float


@dataclass(frozen=True)
class _Branch:
    where: Where
    cost: float  # of the cycles so far
    ahead: float  # of what remains: deviation from the plan and time to go
    first: Choice | None
    arrived: bool = False


def choose(
    problem: Problem,
    reference: Reference,
    where: Where,
    learned: Learned,
    step: int | None = None,
    barred: Collection[int] = (),
    settings: TrackSettings = DEFAULT_TRACK,
) -> Choice:
    """Return the best gait for the next cycle, none of those `barred`.

    `step` is the reference's node that the robot has come to; only nodes near it are looked at, so that
    a plan that crosses itself is followed in order.
    """
    window = slice(None) if step is None else slice(max(step - 12, 0), step + 5 * settings.nodes_per_cycle)
    near = reference.part(window)
    beam = [_Branch(where, 0.0, 0.0, None)]
    for _ in range(settings.horizon):
        grown = [
            new
            for old in beam
            for new in ([old] if old.arrived else _grow(problem, near, old, learned, barred, settings))
        ]
        grown.sort(key=lambda branch: branch.cost + branch.ahead)
        beam = grown[: settings.beam]
    best = beam[0]
    assert best.first is not None  # every branch has grown
    offset = near.pose[:, :2] - best.where.pose[:2]
    return replace(best.first, astray_m=float(np.hypot(*offset.T).min()))


def by_plan(problem: Problem, where: Where, learned: Learned, gait: int) -> Choice:
    """Return a gait that is played because the plan says so; the caller checks its clearance."""
    local = learned.apply(
        problem.motion.move(0.0, 0.0, 0.0, where.gait, where.speed_m_s).pose, problem.motion.period_s
    )
    return Choice(gait, local[gait, -1], math.inf, 0.0)


def nearest_node(
    reference: Reference, pose: Array, after: int, settings: TrackSettings = DEFAULT_TRACK
) -> int:
    """Return the node nearest to a place, not before `after` and not far beyond it."""
    window = reference.pose[after : after + 4 * settings.nodes_per_cycle, :2]
    return after + int(np.hypot(*(window - pose[:2]).T).argmin())


def _grow(
    problem: Problem,
    reference: Reference,
    branch: _Branch,
    learned: Learned,
    barred: Collection[int],
    settings: TrackSettings,
) -> list[_Branch]:
    """Return the branch with every gait played after it, the best few; those `barred` do not come first."""
    motion, where = problem.motion, branch.where
    move = motion.move(0.0, 0.0, 0.0, where.gait, where.speed_m_s)
    local = learned.apply(move.pose, motion.period_s)
    pose = compose(where.pose, local)
    speed = move.speed_m_s * learned.stretches(len(move.speed_m_s))
    place = np.concatenate([pose[:, -1, :2], (pose[:, -1, 2] + motion.course[:-1])[:, None]], axis=1)
    offset = _offset(reference, place, speed, problem.robot.length_m, settings)
    order = np.argsort(offset, kind="stable")[: 3 * settings.beam]
    order = np.union1d(order, _planned(reference, where.pose, settings))  # which nothing may resemble
    order = order[motion.may_follow(where.gait)[order]]
    if branch.first is None:
        order = np.setdiff1d(order, list(barred))
    thinned = settings.thinned
    lines = points_in_room(motion.body[motion.row(where.gait), order, 1::thinned], pose[order, 1::thinned])
    room, length = _room(problem, lines, settings), problem.robot.length_m
    grown = []
    for gait, clearance in zip(map(int, order), map(float, room)):
        arrival = arrival_index(problem.goal, pose[gait])
        part = 1.0 if arrival is None else arrival / SAMPLES
        lack = min(max(1 - clearance / (settings.air * length), 0.0), 1.0)
        changes = gait != motion.row(where.gait)
        cost = branch.cost + settings.air_units * lack**2 + settings.change_units * changes
        cost += part * float(motion.period_s[gait]) / settings.unit_s
        cost += settings.contact_units * (1 + lack) if clearance <= settings.contact * length else 0.0
        first = branch.first or Choice(gait, local[gait, -1], clearance, 0.0)
        after = Where(pose[gait, -1], gait, float(speed[gait]))
        ahead = float(offset[gait]) if arrival is None else 0.0
        grown.append(_Branch(after, cost, ahead, first, arrival is not None))
    return grown


def _planned(reference: Reference, pose: Array, settings: TrackSettings) -> NDArray[np.int64]:
    """Return the gaits that the plan plays near a place, one or two."""
    node = int(np.hypot(*(reference.pose[:, :2] - pose[:2]).T).argmin())
    return reference.gait[node : node + settings.nodes_per_cycle // 2 + 1]


def _room(problem: Problem, lines: Array, settings: TrackSettings) -> Array:
    """Return the clearance (gaits,) of bodies (gaits, samples, points, 2), exact where it is small."""
    flat = lines.reshape(-1, *lines.shape[2:])
    room = problem.body.estimate(flat)
    close = room < settings.air * problem.robot.length_m + problem.field.error_m
    if close.any():
        room[close] = problem.body.exact(flat[close], room[close])
    return np.asarray(room.reshape(lines.shape[:2]).min(axis=1))


def _offset(
    reference: Reference, place: Array, speed: Array, length_m: float, settings: TrackSettings
) -> Array:
    """Return what places (n, 3) with speeds (n,) cost: deviation from the plan and time to go."""
    dx, dy, turn = (place[:, None, :] - reference.pose[None]).transpose(2, 0, 1)
    off = (dx**2 + dy**2) / (settings.place * length_m) ** 2 + (wrapped(turn) / settings.course_rad) ** 2
    off = off + ((speed[:, None] - reference.speed_m_s) / (settings.speed * length_m)) ** 2
    return np.asarray((off + reference.left_s / settings.unit_s).min(axis=1))
