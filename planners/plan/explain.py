"""Why no plan exists: the tightest place on the widest route, its width, and what every gait needs there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.maze.places import RobotSize
from planners.plan.settings import NARROWNESS
from planners.search.problem import ROUNDING_M, Problem
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.orbit.steady import steady_gait

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tightest:
    """The tightest place on the widest route from start to goal.

    Attributes
    ----------
    x_m, y_m : float
    width_m : float
        Between the walls on either side.
    route : array (n, 2)
        The route, m.
    """

    x_m: float
    y_m: float
    width_m: float
    route: Array


@dataclass(frozen=True)
class Explanation:
    """Why there is no way.

    Attributes
    ----------
    tightest : Tightest or None
        None when start and goal are not connected at all.
    needs : tuple of (gait, width_m)
        Envelope and margins of every gait of the table, slimmest first.
    body_needs_m : float
        Body width and margins: no gait can do with less.
    outside_needs_m : float or None
        The least that a weaker gait outside the table needs.
    start_clearance_m, margin_m : float
        Of the straight robot at the start; what is to be kept.
    unknown_walls : bool
        Whether cells that nobody has seen are taken for walls.
    assumed_ramp_s : float or None
        In which every change of pressure is taken to happen, where no rate of the regulator was given.
    """

    tightest: Tightest | None
    needs: tuple[tuple[str, float], ...]
    body_needs_m: float
    outside_needs_m: float | None
    start_clearance_m: float
    margin_m: float
    unknown_walls: bool = False
    assumed_ramp_s: float | None = None

    @property
    def too_narrow(self) -> bool:
        """Whether the tightest place is narrower than what the slimmest gait of the table needs."""
        return self.tightest is None or self.tightest.width_m < self.needs[0][1]

    @property
    def start_too_near(self) -> bool:
        """Whether the straight robot breaks the margin at the start."""
        return self.start_clearance_m < self.margin_m - ROUNDING_M

    def in_words(self, what: str | None) -> str:
        """Return the explanation in a few sentences, `what` first."""
        said = self._sentences(what)
        if self.unknown_walls and not self.start_too_near:
            said.append("Cells that nobody has seen count as walls (--unknown free: as free).")
        return " ".join(said).strip()

    def _sentences(self, what: str | None) -> list[str]:
        said = [f"{what}." if what else ""]
        t = self.tightest
        if self.start_too_near:
            said.append(
                f"The start breaks the margin: the straight robot is {1e3 * self.start_clearance_m:.1f} mm "
                f"from a wall there, and {1e3 * self.margin_m:.1f} mm are to be kept; move the start or "
                "choose a smaller --margin."
            )
            if t is not None:  # the tightest place would be the start's doing
                return said
        if t is None:
            return [*said, "Walls separate the start from the goal completely."]
        said.append(
            f"The tightest place on the widest route is at ({t.x_m:.3f}, {t.y_m:.3f}), "
            f"{t.width_m:.3f} m wide."
        )
        said.append(
            "Needed there, margins included: "
            + ", ".join(f"{name} {width:.3f} m" for name, width in self.needs[:4])
            + f"{' ...' if len(self.needs) > 4 else ''}."
        )
        if not self.too_narrow:
            said.append(
                "So the widths alone do not rule a way out; what was tried found none, which is no proof "
                "that there is none."
            )
            if self.assumed_ramp_s is not None:  # in a narrow corridor a ramp costs millimetres
                said.append(
                    f"Every change of pressure is taken to last {self.assumed_ramp_s:g} s; a faster "
                    "regulator (--pressure-rate, measured) may leave room for one."
                )
            return said
        if t.width_m < self.body_needs_m:
            said.append(
                f"No gait at all would fit: the body and its margins are {self.body_needs_m:.3f} m wide. "
                "That is a proof."
            )
            return said
        if self.outside_needs_m is not None:
            verb = "would fit" if self.outside_needs_m <= t.width_m else "would not fit either"
            said.append(f"A weaker gait outside the table needs {self.outside_needs_m:.3f} m and {verb}.")
        else:
            said.append("None of the weaker gaits that were tried outside the table moves the robot.")
        said.append("Gaits are judged by what they sweep in their steady state.")
        return said

    def to_record(self) -> dict[str, Any]:
        """Return the facts for the command's JSON."""
        t = self.tightest
        return {
            "x_m": t and round(t.x_m, 4),
            "y_m": t and round(t.y_m, 4),
            "width_m": t and round(t.width_m, 4),
            "needs": [{"gait": name, "width_m": round(width, 4)} for name, width in self.needs],
            "body_needs_m": round(self.body_needs_m, 4),
            "outside_table_needs_m": self.outside_needs_m and round(self.outside_needs_m, 4),
        }


def explain(problem: Problem) -> Explanation:
    """Return why there is no way through the maze of `problem`."""
    needs = gait_needs(problem)
    tightest = tightest_place(problem)
    body = problem.robot.body_width_m + 2 * problem.margin_m
    outside = None
    if tightest is not None and body <= tightest.width_m < needs[0][1]:
        outside = _slimmest_outside(problem, needs[0][0])
    size = RobotSize(problem.robot.length_m, problem.robot.body_width_m / 2, problem.margin_m)
    room = problem.maze.clearance(size.straight_body(problem.start))
    raster = problem.maze.raster
    unseen = (
        raster is not None and raster.unknown is not None and bool((raster.occupied & raster.unknown).any())
    )
    ramp_s = problem.joints.limits.assumed_ramp_s
    return Explanation(tightest, needs, body, outside, room, problem.margin_m, unseen, ramp_s)


def no_body_fits(problem: Problem) -> bool:
    """Whether it is proven that no body with its margin gets from the start to the goal.

    A point of the body's centre line keeps half the width and the margin from walls all the way, and passes
    from node to node of the distance field where these are no nearer than that less the field's error. At
    the goal some point of the centre line is within its length over pi of the centre of mass: that lies on a
    chord of the line, and an arc that keeps farther from it than that is longer than the line.
    """
    from scipy.ndimage import label

    half = problem.robot.body_width_m / 2
    keeps_m = half + min(problem.margin_m, problem.margin_m + problem.start_slack_m)
    start, reach = problem.start, problem.robot.length_m / 2 - half
    along = np.linspace(-reach, reach, NARROWNESS.body_points)
    body = np.stack(
        [start.x + along * math.cos(start.heading), start.y + along * math.sin(start.heading)], axis=1
    )
    # the coarser field, which is there, often decides
    for field in (problem.field, problem.finer.field):
        labels, _ = label(field.values >= keeps_m - field.error_m, structure=np.ones((3, 3)))
        origin, spacing = np.array(field.origin), field.resolution
        column, row = np.round((body - origin) / spacing).astype(int).T
        inside = (row.clip(0, labels.shape[0] - 1), column.clip(0, labels.shape[1] - 1))
        mine = np.unique(labels[inside])
        rows, columns = np.nonzero(np.isin(labels, mine[mine > 0]))
        nodes = origin + spacing * np.stack([columns, rows], axis=-1)
        near_m = problem.robot.length_m / math.pi + spacing
        if not nodes.size or problem.goal.distance(nodes).min() > near_m:
            return True
    return False


def narrower_than_any_gait(problem: Problem) -> bool:
    """Whether the widest route has a place clearly narrower than what the slimmest gait needs.

    A thin gate can be passed with a little less than a gait's envelope; `spare_widths` allows for that.
    """
    tightest = tightest_place(problem)
    if tightest is None:
        return True
    spare_m = NARROWNESS.spare_widths * problem.robot.body_width_m
    return tightest.width_m < gait_needs(problem)[0][1] - spare_m


def gait_needs(problem: Problem) -> tuple[tuple[str, float], ...]:
    """Return the width that each gait that gets anywhere needs, margins included, slimmest first."""
    needs = [
        (entry.name, sum(entry.envelope_m) + 2 * problem.margin_m)
        for entry in problem.gaits.gaits
        if abs(entry.speed_m_s) > NARROWNESS.slowest * problem.robot.length_m
    ]
    return tuple(sorted(needs, key=lambda need: need[1]))


def tightest_place(problem: Problem) -> Tightest | None:
    """Return the bottleneck of the widest route, or None when there is no route for a point."""
    from scipy.ndimage import label

    field = problem.field
    stride = max(1, math.ceil(math.sqrt(field.values.size / NARROWNESS.nodes)))
    room = np.asarray(field.values[::stride, ::stride], dtype=float)
    spacing = field.resolution * stride
    origin = np.array(field.origin)

    def node(x: float, y: float) -> tuple[int, int]:
        column, row = np.round((np.array([x, y]) - origin) / spacing).astype(int)
        return int(np.clip(row, 0, room.shape[0] - 1)), int(np.clip(column, 0, room.shape[1] - 1))

    start, goal = node(problem.start.x, problem.start.y), node(*_goal_point(problem))
    low, high = 1e-6, float(min(room[start], room[goal]))

    def connected(clearance: float) -> NDArray[np.bool_] | None:
        labels, _ = label(room >= clearance, structure=np.ones((3, 3)))
        same = labels[start] == labels[goal] and labels[start] > 0
        return labels == labels[start] if same else None

    region = connected(low)
    if region is None:
        return None
    for _ in range(NARROWNESS.halvings):
        middle = (low + high) / 2
        wider = connected(middle)
        if wider is None:
            high = middle
        else:
            low, region = middle, wider
    cells = _route(region, start, goal)
    route = origin + spacing * cells[:, ::-1]
    along = room[cells[:, 0], cells[:, 1]]
    # near start and goal it is they that are near walls, not the route
    inner = slice(1, -1) if len(cells) > 2 else slice(None)
    index = int(along[inner].argmin()) + (inner.start or 0)
    place, width = _measure(problem, route, index)
    return Tightest(float(place[0]), float(place[1]), width, route)


def _goal_point(problem: Problem) -> tuple[float, float]:
    """Return the goal's centre, or that of its most spacious cell (a post may stand between cells)."""
    goal = problem.goal
    if not goal.boxes:
        return goal.x, goal.y
    centres = np.array([((a + c) / 2, (b + d) / 2) for a, b, c, d in goal.boxes])
    x, y = centres[int(problem.field.clearance(centres).argmax())]
    return float(x), float(y)


def _route(region: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]) -> NDArray[np.int64]:
    """Return the shortest route of cells within a region, (n, 2) rows and columns."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    number = np.full(region.shape, -1, dtype=np.int64)
    cells = np.argwhere(region)
    number[region] = np.arange(len(cells))
    starts, ends, costs = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        rows, columns = cells[:, 0] + di, cells[:, 1] + dj
        inside = (rows < region.shape[0]) & (columns < region.shape[1]) & (columns >= 0)
        other = np.full(len(cells), -1)
        other[inside] = number[rows[inside], columns[inside]]
        ok = np.flatnonzero(other >= 0)
        starts.append(ok)
        ends.append(other[ok])
        costs.append(np.full(ok.size, math.hypot(di, dj)))
    graph = coo_matrix(
        (np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends))), shape=(len(cells),) * 2
    )
    source = int(number[goal])
    _, before = dijkstra(graph.tocsr(), directed=False, indices=source, return_predecessors=True)
    way = [int(number[start])]
    while way[-1] != source:
        way.append(int(before[way[-1]]))
    return cells[way]


def _measure(problem: Problem, route: Array, index: int) -> tuple[Array, float]:
    """Return the middle of the passage at a node of the route, and its exact width there."""
    a, b = route[max(index - 3, 0)], route[min(index + 3, len(route) - 1)]
    direction = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
    across = np.array([-direction[1], direction[0]])
    step = problem.field.resolution
    s = np.linspace(-3, 3, 61) * step
    # the narrowest of the cuts across the route near the node, at its widest point
    best = (route[index], math.inf)
    for shift in np.linspace(-3, 3, 13) * step:
        points = route[index] + shift * direction + s[:, None] * across
        room = problem.maze.point_clearances(points)
        widest = int(room.argmax())
        if room[widest] < best[1]:
            best = (points[widest], float(room[widest]))
    return best[0], 2 * best[1]


def _slimmest_outside(problem: Problem, name: str) -> float | None:
    """Return what the slimmest of some weaker gaits needs; None if none of them moves."""
    model = problem.gaits[name]
    slimmest = None
    for factor in NARROWNESS.weaker:
        gait = Gait(model.gait.period_s, factor * model.gait.pressure_kpa, model.gait.intervals)
        try:
            orbit = steady_gait(problem.robot, gait, problem.gaits.model)
        except NoAnswerError:
            continue
        if abs(orbit.speed_m_s) > NARROWNESS.slowest * problem.robot.length_m:
            need = sum(orbit.envelope_m) + 2 * problem.margin_m
            slimmest = min(need, slimmest or math.inf)
    return slimmest
