"""Cost-to-go over place, course and direction of travel: a vehicle that turns no tighter than its gaits.

The map of `costmap` knows places only, so it leads into corners that are too tight to turn in and past a
goal that asks for a heading. Here every node also has one of 16 courses and a direction (forward or back),
and edges are straight moves, arcs of the radii that the gait table offers, and changes of direction, which
cost a start from rest. Only the centre line of the way has to keep off the walls: an estimate, not a bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.maze.field import DistanceField
from planners.maze.places import Goal
from planners.search.costmap import BLOCKED_S
from planners.search.settings import HEADING_MAP
from srs_opt.gait_opt.table import GaitTable

Array = NDArray[np.float64]
COURSES = 16  # the directions of a knight's moves: straight edges in them have no rounding
STEP_RAD = 2 * math.pi / COURSES
_MOVES = [(1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)]
MOVES = np.array(_MOVES + [(-x, -y) for x, y in _MOVES])


class Turn(NamedTuple):
    """An arc that gaits of the table can follow: radius and speeds forward and backward (0: not at all)."""

    radius_m: float
    forward_m_s: float
    back_m_s: float


@dataclass(frozen=True, eq=False)
class HeadingMap:
    """Cost-to-go; BLOCKED_S where there is no way.

    Attributes
    ----------
    seconds : array (rows, columns, COURSES, 2)
        Last axis: forward, back.
    origin : (float, float)
        Position of node (0, 0), m.
    spacing_m : float
    """

    seconds: NDArray[np.float32]
    origin: tuple[float, float]
    spacing_m: float

    def at(self, points: Array, course: Array, back: NDArray[np.bool_]) -> Array:
        """Return the cost-to-go from `points` (n, 2) on a course (n,), moving forward or back."""
        rows, columns = self.seconds.shape[:2]
        u = np.clip((points[..., 0] - self.origin[0]) / self.spacing_m, 0, columns - 1.001)
        v = np.clip((points[..., 1] - self.origin[1]) / self.spacing_m, 0, rows - 1.001)
        w = np.asarray(course) % (2 * math.pi) / STEP_RAD
        i, j, k = v.astype(np.int64), u.astype(np.int64), w.astype(np.int64)
        dv, du, dw = v - i, u - j, w - k
        d = np.asarray(back).astype(np.int64)
        total, weight = np.zeros(i.shape), np.full(i.shape, 1e-9)
        for c, share in ((k % COURSES, 1 - dw), ((k + 1) % COURSES, dw)):
            for a, b, part in (
                (0, 0, (1 - dv) * (1 - du)),
                (0, 1, (1 - dv) * du),
                (1, 0, dv * (1 - du)),
                (1, 1, dv * du),
            ):
                value = self.seconds[i + a, j + b, c, d]
                counts = np.where(value < BLOCKED_S, share * part + 1e-6, 0.0)
                total += counts * np.minimum(value, BLOCKED_S)
                weight += counts
        return np.where(weight > 1e-7, total / weight, BLOCKED_S)


def turns_of(table: GaitTable) -> tuple[list[Turn], tuple[float, float]]:
    """Return the tightest turn of a table and one twice as wide, and the best straight speeds both ways."""
    forward = [e for e in table.gaits if e.speed_m_s > 0]
    back = [e for e in table.gaits if e.speed_m_s < 0]
    top = max(abs(e.speed_m_s) for e in table.gaits)

    def best(entries: list, most_m: float) -> float:  # type: ignore[type-arg]
        speeds = [abs(e.speed_m_s) for e in entries if e.radius_m is not None and abs(e.radius_m) <= most_m]
        return max(speeds, default=0.0)

    radii = [
        abs(e.radius_m)
        for e in table.gaits
        if e.radius_m is not None and abs(e.speed_m_s) > HEADING_MAP.slow * top
    ]
    same = HEADING_MAP.same_radius
    turns = [
        Turn(radius, best(forward, same * radius), best(back, same * radius))
        for radius in ((min(radii), 2 * min(radii)) if radii else ())
    ]
    straight = tuple(max((abs(e.speed_m_s) for e in entries), default=0.0) for entries in (forward, back))
    return turns, straight  # type: ignore[return-value]


def heading_map(
    field: DistanceField,
    goal: Goal,
    table: GaitTable,
    reach_m: float,
    slowness: Callable[[Array], Array],
    reversal_s: float,
    wanted: Callable[[Array], NDArray[np.bool_]] = lambda nodes: np.ones(nodes.shape[:-1], dtype=bool),
) -> HeadingMap:
    """Return the cost-to-go.

    Parameters
    ----------
    field : DistanceField
    goal : Goal
    table : GaitTable
    reach_m : float
        That the way keeps from walls.
    slowness : callable
        Cost per metre of a straight way by the distance to the nearest wall (m).
    reversal_s : float
        Cost of a change of direction.
    wanted : callable
        Which of the nodes (rows, columns, 2) shall be looked at.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    turns, straight = turns_of(table)
    xmin, ymin, xmax, ymax = field.bounds
    width, height = xmax - xmin, ymax - ymin
    tightest = turns[0].radius_m if turns else 0.02 * (width + height)
    chord_m = 2 * tightest * math.sin(STEP_RAD / 2)
    # a look at more than four times as many nodes as may be free is not worth it
    spacing = max(
        chord_m / HEADING_MAP.fine, math.sqrt(width * height * 2 * COURSES / (4 * HEADING_MAP.most_states))
    )
    while True:
        columns, rows = max(2, math.ceil(width / spacing)), max(2, math.ceil(height / spacing))
        x, y = xmin + spacing * (np.arange(columns) + 0.5), ymin + spacing * (np.arange(rows) + 0.5)
        nodes = np.stack(np.meshgrid(x, y), axis=-1)
        room = field.clearance(nodes)
        free = (room > reach_m) & wanted(nodes)
        most = HEADING_MAP.few_states if spacing < chord_m / HEADING_MAP.coarse else HEADING_MAP.most_states
        if free.sum() * 2 * COURSES <= most:
            break
        spacing *= HEADING_MAP.coarsening
    number = np.full((rows, columns), -1, dtype=np.int32)
    number[free] = np.arange(free.sum(), dtype=np.int32)
    place = np.argwhere(free)
    per_metre = slowness(room[free])
    edges: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]] = []

    def add(offset: NDArray[np.int64], cost: Array, k: int, to: int, d: int) -> None:
        """Put edges from course k to another, by an offset in nodes, on the list."""
        r, c = place[:, 0] + offset[1], place[:, 1] + offset[0]
        inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
        begin = np.flatnonzero(inside)
        end = number[r[begin], c[begin]]
        # the middle of a move must be free as well: walls are thinner than it is long
        middle = nodes[place[begin, 0], place[begin, 1]] + 0.5 * spacing * offset
        clear = end >= 0
        clear[clear] = field.clearance(middle[clear]) > reach_m
        begin, end = begin[clear], end[clear]
        mean = 0.5 * (cost[begin] + cost[end])
        # there are fewer states than 2^31, and half the memory of millions of edges counts
        first, last = (begin * COURSES + k) * 2 + d, (end.astype(np.int64) * COURSES + to) * 2 + d
        edges.append((first.astype(np.int32), last.astype(np.int32), mean))

    for d, sign in ((0, 1), (1, -1)):
        if not straight[d]:
            continue
        for k in range(COURSES):
            way = float(np.hypot(*MOVES[k])) * spacing
            add(sign * MOVES[k], per_metre * way, k, k, d)
            for turn in turns:
                speed = turn.back_m_s if d else turn.forward_m_s
                if not speed:
                    continue
                chord = 2 * turn.radius_m * math.sin(STEP_RAD / 2) / spacing
                slower = max(straight) / speed
                for side in (1, -1):
                    middle = (k + side / 2) * STEP_RAD
                    offset = np.round(sign * chord * np.array([math.cos(middle), math.sin(middle)]))
                    cost = per_metre * slower * turn.radius_m * STEP_RAD
                    add(offset.astype(np.int64), cost, k, (k + side) % COURSES, d)
    count = len(place) * COURSES * 2
    if min(straight) > 0:
        forward = 2 * np.arange(count // 2, dtype=np.int32)
        cost = np.full(forward.size, reversal_s)
        edges += [(forward, forward + 1, cost), (forward + 1, forward, cost)]
    begins, ends, costs = (np.concatenate(part) for part in zip(*edges))
    edges.clear()
    graph = coo_matrix((costs, (ends, begins)), shape=(count, count)).tocsr()  # backwards, from the goal
    del begins, ends, costs
    sources = _sources(goal, nodes[free])
    seconds = np.full((rows, columns, COURSES, 2), BLOCKED_S, dtype=np.float32)
    if sources.size:
        found = dijkstra(graph, indices=sources, min_only=True)
        seconds[free] = np.where(np.isfinite(found), found, BLOCKED_S).reshape(-1, COURSES, 2)
    return HeadingMap(seconds, (float(x[0]), float(y[0])), spacing)


def _sources(goal: Goal, nodes: Array) -> NDArray[np.int64]:
    """Return the states that have arrived: nodes in the goal (or nearest to it) on courses that it allows."""
    if not len(nodes):
        return np.zeros(0, dtype=np.int64)
    away = goal.distance(nodes)
    inside = np.flatnonzero(away <= max(float(away.min()), 0.0))
    allowed = [k for k in range(COURSES) if goal.heading_error(k * STEP_RAD) <= STEP_RAD / 2]
    courses = np.array(allowed or range(COURSES))
    states: NDArray[np.int64] = (
        (inside[:, None, None] * COURSES + courses[:, None]) * 2 + np.array([0, 1])
    ).ravel()
    return states
