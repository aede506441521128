"""Time to the goal from every place: Dijkstra on a grid, with lower speeds where only slim gaits fit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.maze.field import DistanceField
from planners.maze.places import Goal
from planners.search.settings import COST_MAP
from srs_opt.gait_opt.table import GaitTable

Array = NDArray[np.float64]
BLOCKED_S = 1e6  # stands for: no way
# neighbours up to a knight's move: paths at most 2.7 % too long
_STEPS = [(0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)]


@dataclass(frozen=True, eq=False)
class CostMap:
    """Time to the goal on a grid of nodes, in seconds; BLOCKED_S where there is no way.

    Attributes
    ----------
    seconds : array (rows, columns)
    origin : (float, float)
        Position of node (0, 0), m.
    spacing_m : float
    """

    seconds: Array
    origin: tuple[float, float]
    spacing_m: float

    def at(self, points: Array) -> Array:
        """Return the time (s) from `points`, shape (..., 2), by bilinear interpolation; free nodes lead."""
        rows, columns = self.seconds.shape
        u = np.clip((points[..., 0] - self.origin[0]) / self.spacing_m, 0, columns - 1.001)
        v = np.clip((points[..., 1] - self.origin[1]) / self.spacing_m, 0, rows - 1.001)
        i, j = v.astype(np.int64), u.astype(np.int64)
        dv, du = v - i, u - j
        total, weight = np.zeros(i.shape), np.full(i.shape, 1e-9)
        for a, b, w in (
            (0, 0, (1 - dv) * (1 - du)),
            (0, 1, (1 - dv) * du),
            (1, 0, dv * (1 - du)),
            (1, 1, dv * du),
        ):
            value = self.seconds[i + a, j + b]
            w = np.where(value < BLOCKED_S, w + 1e-6, 0.0)
            total += w * np.minimum(value, BLOCKED_S)
            weight += w
        return np.where(weight > 1e-7, total / weight, BLOCKED_S)


def speed_by_room(table: GaitTable) -> tuple[Array, Array]:
    """Return half-widths (m, ascending) and the best speed (m/s) of a gait that fits into each."""
    reach = np.array([max(entry.envelope_m) for entry in table.gaits])
    speed = np.array([abs(entry.speed_m_s) for entry in table.gaits])
    order = np.argsort(reach)
    return reach[order], np.maximum.accumulate(speed[order])


def cost_map(
    field: DistanceField,
    goal: Goal,
    table: GaitTable,
    half_width_m: float,
    per_metre: Callable[[Array, Array], Array] = lambda in_time, room: in_time,
) -> CostMap:
    """Return the time to `goal` for the centre of mass, or the cost that `per_metre` makes of it.

    `per_metre` takes seconds per metre and distances to walls at places, and returns costs per metre.

    Nodes nearer to a wall than half the body's width less the little by which the centre of mass of a bent
    body leaves its centre line are blocked.
    """
    from scipy.sparse.csgraph import dijkstra

    xmin, ymin, xmax, ymax = field.bounds
    area = (xmax - xmin) * (ymax - ymin)
    blocked = COST_MAP.blocked * half_width_m
    # finer than the blocked strip about the thinnest wall, so that no cell has nodes on both sides of it
    spacing = min(max(math.sqrt(area / COST_MAP.nodes), COST_MAP.finest * half_width_m), 2 * blocked)
    spacing = max(spacing, math.sqrt(area / COST_MAP.most_nodes))
    columns, rows = (max(2, math.ceil(side / spacing)) for side in (xmax - xmin, ymax - ymin))
    x, y = xmin + spacing * (np.arange(columns) + 0.5), ymin + spacing * (np.arange(rows) + 0.5)
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    room = field.clearance(nodes)
    reach, speed = speed_by_room(table)
    per_node = per_metre(slowness(room, reach, speed), room)
    free = room > blocked
    clear = np.zeros((rows, columns, len(_STEPS)), dtype=bool)
    for step, (di, dj) in enumerate(_STEPS):
        a = (slice(max(0, -di), rows - max(0, di)), slice(max(0, -dj), columns - max(0, dj)))
        b = (slice(max(0, di), rows + min(0, di)), slice(max(0, dj), columns + min(0, dj)))
        ok = free[a] & free[b]
        # an interpolated distance changes by the square root of 2 per metre at most: elsewhere it is clear
        near = np.minimum(room[a], room[b]) < blocked + math.hypot(di, dj) * spacing
        for part in (1 / 3, 2 / 3) if abs(di) + abs(dj) > 2 else (1 / 2,):
            doubt = ok & near
            between = (1 - part) * nodes[a][doubt] + part * nodes[b][doubt]
            ok[doubt] = field.clearance(between) > blocked
        clear[..., step][a] = ok
    away = goal.distance(nodes).ravel()
    sources = np.flatnonzero((away <= 0) & free.ravel())
    if not sources.size:  # a goal smaller than the grid
        sources = np.array([np.where(free.ravel(), away, np.inf).argmin()])
    graph = _graph(clear, per_node, spacing)
    del nodes, room, per_node, clear, away  # large maps: the search needs the room
    seconds = dijkstra(graph, directed=False, indices=sources, min_only=True)
    seconds = np.where(np.isfinite(seconds), seconds, BLOCKED_S).reshape(rows, columns)
    return CostMap(seconds, (float(x[0]), float(y[0])), spacing)


def _graph(clear: NDArray[np.bool_], per_node: Array, spacing: float) -> Any:
    """Return the clear steps (rows, columns, steps) as a sparse matrix of their costs.

    Its arrays are filled in place, row by row of the matrix: with lists of edges the memory of large maps
    would be three times as much.
    """
    from scipy.sparse import csr_matrix

    rows, columns, _ = clear.shape
    count = rows * columns
    begins = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(clear.reshape(count, -1).sum(axis=1), out=begins[1:])
    ends, costs = np.empty(begins[-1], dtype=np.int32), np.empty(begins[-1])
    following, per_metre = begins[:-1].copy(), per_node.ravel()
    for step, (di, dj) in enumerate(_STEPS):
        here = np.flatnonzero(clear[..., step])
        there, slot = here + di * columns + dj, following[here]
        ends[slot] = there
        costs[slot] = math.hypot(di, dj) * spacing * (per_metre[here] + per_metre[there]) / 2
        following[here] += 1
    return csr_matrix((costs, ends, begins), shape=(count, count))


def slowness(room: Array, reach: Array, speed: Array) -> Array:
    """Return seconds per metre: the fastest gait that fits, and a little less where it just fits."""
    fitting = np.searchsorted(reach, room, side="right") - 1
    best = np.where(fitting >= 0, speed[np.maximum(fitting, 0)], COST_MAP.unfitting * speed[0])
    best = np.maximum(best, COST_MAP.least_speed * speed[-1])
    enough_m = COST_MAP.comfort * reach[int(speed.argmax())]
    comfortable = np.clip(room / enough_m, COST_MAP.least_comfort, 1.0)
    cost: Array = 1 / (best * comfortable)
    return cost
