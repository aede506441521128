"""OMPL's geometric planners on curves of bounded radius (Dubins, Reeds-Shepp), smoothed, then driven.

The body stands in for itself by a straight strip as long as the robot and as wide as a gait sweeps; what
the path is worth is seen when the dynamic model follows it, and in the certificate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.search.follow import follow, reference_along
from planners.search.ompl_setup import counted, seeded, until_a_signal
from planners.search.problem import Problem
from planners.search.settings import ROUTE
from planners.search.tree import Step

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """What the geometric planners assume of the robot: turning radius and the strip it sweeps.

    Attributes
    ----------
    radius_m, half_width_m : float
    """

    radius_m: float
    half_width_m: float


def curves_of(problem: Problem) -> tuple[Curves, Curves]:
    """Return a comfortable and a tight assumption, from the table's gaits."""
    turning = [
        e
        for e in problem.gaits.gaits
        if e.radius_m is not None and e.speed_m_s > ROUTE.slowest * problem.robot.length_m
    ]
    # of the calibrated drive
    radii = problem.drive.radius.value * np.array([abs(e.radius_m or 0.0) for e in turning])
    bands = np.array([sum(e.envelope_m) / 2 for e in turning])
    if not radii.size:
        return (Curves(ROUTE.straight * problem.robot.length_m, problem.robot.body_width_m),) * 2
    slimmest = min(
        sum(e.envelope_m) / 2
        for e in problem.gaits.gaits
        if abs(e.speed_m_s) > ROUTE.slowest * problem.robot.length_m
    )
    easy = Curves(ROUTE.easy * float(radii.min()), float(np.median(bands)))
    return easy, Curves(float(radii.min()), max(slimmest, problem.robot.body_width_m / 2))


def search_geometric(
    problem: Problem, kind: str, method: str, iterations: int, seed: int
) -> list[Step] | None:
    """Return a way to the goal, or None.

    Parameters
    ----------
    problem : Problem
    kind : {"dubins", "rs"}
        Curves that only go forward, or Reeds and Shepp's.
    method : str
        Class of `ompl.geometric`.
    iterations : int
        After how many the planner gives up.
    seed : int
    """
    for curves in curves_of(problem):
        path = geometric_path(problem, kind, method, curves, iterations, seed)
        if path is not None:
            way = follow(problem, reference_along(problem, path))
            if way is not None:
                return way
    return None


def geometric_path(
    problem: Problem, kind: str, method: str, curves: Curves, iterations: int, seed: int
) -> Array | None:
    """Return the poses (n, 3) of a path that the strip can follow, or None."""
    from ompl import geometric

    def found(stop: Callable[[], bool]) -> Array | None:
        seeded(seed)
        setup = strip_setup(problem, kind, curves)
        info = setup.getSpaceInformation()
        setup.setPlanner(getattr(geometric, method)(info))
        setup.setup()
        setup.solve(counted(iterations, lambda: stop() or setup.haveExactSolutionPath()))
        if not setup.haveExactSolutionPath():
            return None
        path = setup.getSolutionPath()
        # the simplifier's rounds are counted, not timed
        geometric.PathSimplifier(info).reduceVertices(path, 50, 50, 0.5)
        return poses_along(path, ROUTE.step * problem.robot.length_m)

    return until_a_signal(found)


def strip_setup(problem: Problem, kind: str, curves: Curves) -> Any:
    """Return OMPL's set-up of the strip in the maze, without a planner.

    Parameters
    ----------
    problem : Problem
    kind : {"dubins", "rs"}
    curves : Curves
    """
    from ompl import base, geometric

    space = (base.DubinsStateSpace if kind == "dubins" else base.ReedsSheppStateSpace)(curves.radius_m)
    xmin, ymin, xmax, ymax = problem.maze.bounds
    bounds = base.RealVectorBounds(2)
    for axis, (low, high) in enumerate(((xmin, xmax), (ymin, ymax))):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(_strip_checker(problem, curves))
    info = setup.getSpaceInformation()
    info.setStateValidityCheckingResolution(ROUTE.step * problem.robot.length_m / space.getMaximumExtent())
    start, goal = space.allocState(), space.allocState()
    _set(start, problem.start.x, problem.start.y, problem.start.heading)
    _set(goal, *_goal_pose(problem))
    setup.setStartAndGoalStates(start, goal, ROUTE.goal * problem.robot.length_m)
    return setup


def poses_along(path: Any, step_m: float) -> Array | None:
    """Return the poses (n, 3), a step apart, of OMPL's path; None where it is not what it says."""
    if not path.check():  # some planners call paths exact that are not
        return None
    path.interpolate(max(2, int(path.length() / step_m)))
    return np.array([[s.getX(), s.getY(), s.getYaw()] for s in path.getStates()])


def _strip_checker(problem: Problem, curves: Curves) -> Any:
    """Return the check that a straight strip at a pose keeps off the walls."""
    half = problem.robot.length_m / 2 - problem.robot.body_width_m / 2
    offsets = np.linspace(-half, half, ROUTE.strip_points)
    field = problem.field
    keep = curves.half_width_m + problem.margin_m
    # the start may be nearer to a wall than a gait sweeps
    sx, sy = problem.start.x, problem.start.y

    def valid(state: Any) -> bool:
        x, y, yaw = state.getX(), state.getY(), state.getYaw()
        wanted = problem.body.half_width_m if math.hypot(x - sx, y - sy) < half else keep
        points = np.stack([x + offsets * math.cos(yaw), y + offsets * math.sin(yaw)], axis=1)
        return bool(field.clearance(points).min() >= wanted)

    return valid


def _goal_pose(problem: Problem) -> tuple[float, float, float]:
    """Return a pose in the goal: where the quickest way for a point arrives, and its heading there."""
    trail = [np.array([problem.start.x, problem.start.y])]
    turns = np.arange(0.0, 2 * math.pi, math.pi / 8)
    step_m = ROUTE.step * problem.robot.length_m
    circle = step_m * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    # downhill on the time to go; it falls by a step's worth at least, so this ends
    for _ in range(int(1e5)):
        around = trail[-1] + circle
        following = around[int(problem.to_goal.at(around).argmin())]
        if problem.to_goal.at(following) >= problem.to_goal.at(trail[-1]):
            break
        trail.append(following)
    last = trail[-1]
    before = trail[max(0, len(trail) - 1 - round(ROUTE.before / ROUTE.step))]
    heading = problem.goal.heading
    if heading is None:
        heading = math.atan2(last[1] - before[1], last[0] - before[0])
    if problem.goal.boxes or problem.goal.distance(last) <= 0:
        return float(last[0]), float(last[1]), heading
    return problem.goal.x, problem.goal.y, heading


def _set(state: Any, x: float, y: float, heading: float) -> None:
    state.setX(float(x))
    state.setY(float(y))
    state.setYaw(math.remainder(heading, 2 * math.pi))
