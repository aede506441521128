"""Exact clearances against distances worked out by hand, and the table against the exact ones."""

import math

import numpy as np
import pytest
import shapely

from planners.maze.field import DistanceField
from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.maze.raster import Raster
from planners.maze.walls import Walls, box_shape

BOUNDS = (0.0, 0.0, 4.0, 3.0)


def vector_maze() -> Maze:
    walls = [
        (shapely.LineString([(1.0, 1.0), (2.0, 1.0)]), 0.05),
        (shapely.Point(3.0, 2.0), 0.3),
        box_shape((0.0, 2.0, 0.5, 2.5)),
        (shapely.Polygon([(3.0, 0.5), (3.5, 0.5), (3.5, 1.0)]), 0.0),
    ]
    return Maze("v", BOUNDS, Walls.of(walls))


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.1, 0.6), 0.1),  # the left bound
        ((1.5, 0.7), 0.25),  # 0.3 below the wall's middle line, less 0.05
        ((2.3, 1.4), 0.45),  # 3-4-5 triangle from the wall's round end, 0.5 - 0.05
        ((3.0 - 0.6, 2.0 + 0.8), 0.2),  # the upper bound is nearer than the disc (1.0 - 0.3)
        ((2.4, 1.2), 0.2**0.5 - 0.05),  # 0.4, 0.2 from the wall's end
        ((0.8, 2.9), 0.1),
        ((0.8, 2.7), 0.3),  # bound; the box's corner is hypot(0.3, 0.2) away
        ((0.7, 2.4), 0.2),  # beside the box
        ((3.15, 0.85), math.hypot(0.1, 0.1)),  # 45 degree side of the triangle
        ((3.4, 0.6), 0.0),  # in the triangle
        ((3.0, 2.29), 0.0),  # in the disc
        ((4.1, 1.0), 0.0),  # outside
    ],
)
def test_point_clearances(point, expected):
    assert vector_maze().point_clearances([point])[0] == pytest.approx(expected, abs=1e-12)


def test_clearance_of_a_body():
    maze = vector_maze()
    body = shapely.box(1.2, 0.3, 1.8, 0.6)
    assert maze.clearance(body) == pytest.approx(0.3)  # to the lower bound
    assert maze.clearance(shapely.box(1.2, 0.5, 1.8, 0.8)) == pytest.approx(0.15)
    assert maze.clearance(shapely.box(1.2, 0.5, 1.8, 0.96)) == 0.0
    assert maze.clearance(shapely.box(-0.1, 0.3, 0.5, 0.6)) == 0.0  # leaves the bounds
    assert maze.clearance(body, limit_m=0.1) == pytest.approx(0.1)


def test_disc_is_exact_not_a_polygon():
    maze = Maze("d", (-9, -9, 9, 9), Walls.of([(shapely.Point(0, 0), 1.0)]))
    angles = np.linspace(0, 2 * np.pi, 97)
    points = 1.25 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    np.testing.assert_allclose(maze.point_clearances(points), 0.25, atol=1e-12)


def test_mixed_radii_nearest_is_exact():
    rng = np.random.default_rng(5)
    centres, radii = rng.uniform(0, 4, (200, 2)), rng.uniform(0.001, 0.3, 200)
    maze = Maze("m", (-5, -5, 9, 9), Walls.of([(shapely.Point(c), r) for c, r in zip(centres, radii)]))
    points = rng.uniform(-1, 5, (300, 2))
    brute = (np.linalg.norm(points[:, None] - centres, axis=2) - radii).min(axis=1).clip(0)
    np.testing.assert_allclose(maze.point_clearances(points), brute, atol=1e-12)


def turned_raster() -> Raster:
    occupied = np.zeros((4, 6), dtype=bool)
    occupied[1, 2] = True  # the square [0.2, 0.3] x [0.1, 0.2] before turning
    return Raster(occupied, 0.1, Pose(1.0, 1.0, math.pi / 2))


def test_turned_raster_clearance():
    maze = Maze("r", (0, 0, 3, 3), raster=turned_raster())
    # turned by 90 degrees about (1, 1): u goes up, v goes left
    assert maze.point_clearances([(1.0 - 0.15, 1.25)])[0] == 0.0
    assert maze.point_clearances([(1.0, 1.25)])[0] == pytest.approx(0.1)
    assert maze.point_clearances([(1.2, 1.7)])[0] == pytest.approx(
        0.5
    )  # 0.3 and 0.4 from the corner (0.9, 1.3)


def test_raster_nearest_by_brute_force():
    rng = np.random.default_rng(2)
    for fill in (0.002, 0.3):
        raster = Raster(rng.random((60, 80)) < fill, 0.05, Pose(0.2, -0.1, 0.3))
        maze = Maze("r", (-9, -9, 9, 9), raster=raster)
        points = rng.uniform(-1, 4, (60, 2))
        rows, columns = np.nonzero(raster.occupied)
        local = raster.to_grid(points)
        low = np.stack([columns, rows], axis=1) * 0.05
        gap = np.maximum(np.maximum(low - local[:, None], local[:, None] - low - 0.05), 0)
        brute = np.linalg.norm(gap, axis=2).min(axis=1)
        np.testing.assert_allclose(maze.point_clearances(points), brute, atol=1e-9)
        body = shapely.Point(1.0, 1.0).buffer(0.2)
        corners = 0.05 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        squares = [shapely.Polygon(raster.to_world(corner + corners)) for corner in low]
        assert maze.clearance(body) == pytest.approx(min(map(body.distance, squares)), abs=1e-9)


def table_cases() -> dict[str, tuple[Maze, float | None]]:
    rng = np.random.default_rng(1)
    cells = rng.random((40, 50)) < 0.05
    flat = Raster(cells, 0.1)
    turned = Raster(cells, 0.1, Pose(1.0, 2.0, 0.7))
    odd = Raster(cells, 0.1, Pose(-0.03, -0.04, 0.0))
    walls = vector_maze().walls
    return {
        "shapes": (vector_maze(), 0.02),
        "cells": (Maze("c", flat.bounds(), raster=flat), None),
        "cells fine": (Maze("c", flat.bounds(), raster=flat), 0.02),
        "cells pooled": (Maze("c", flat.bounds(), raster=flat), 0.25),
        "turned": (Maze("t", turned.bounds(), raster=turned), 0.03),
        "mixed": (Maze("m", BOUNDS, walls, odd), 0.02),
        "empty": (Maze("e", BOUNDS), 0.05),
        "sliver": (Maze("s", (0, 0, 3.0, 0.004)), 0.05),
    }


@pytest.mark.parametrize("case", table_cases())
def test_table_within_its_stated_error(case):
    maze, resolution = table_cases()[case]
    field = DistanceField.of(maze, resolution)
    xmin, ymin, xmax, ymax = maze.bounds
    points = np.random.default_rng(0).uniform((xmin, ymin), (xmax, ymax), (3000, 2))
    exact = maze.point_clearances(points)
    if case != "turned":  # outside a turned grid the corners would be walls, which this maze omits
        assert np.abs(field.clearance(points) - exact).max() <= field.error_m
        assert (field.at_least(points) <= exact + 1e-12).all()
    assert field.error_m <= 3 * field.resolution
    assert field.values.dtype == np.float32
    assert field.clearance((xmin - 1.0, ymin)) == 0.0


def test_table_error_shrinks_with_its_resolution():
    maze = vector_maze()
    points = np.random.default_rng(0).uniform((0, 0), (4, 3), (2000, 2))
    exact = maze.point_clearances(points)
    worst = [np.abs(DistanceField.of(maze, h).clearance(points) - exact).max() for h in (0.08, 0.04, 0.02)]
    assert worst[0] > 1.5 * worst[1] > 1.5**2 * worst[2]


def test_table_is_bounded_in_size():
    field = DistanceField.of(Maze("w", (0, 0, 1000.0, 10.0)), 0.001, max_nodes=10_000)
    assert field.values.size <= 11_000


def test_scaled_maze_scales_everything():
    maze = vector_maze().with_places(Pose(1, 2, 0.3), Goal(2, 2, 0.1))
    double = maze.scaled(2.0)
    points = np.random.default_rng(3).uniform((0, 0), (4, 3), (50, 2))
    np.testing.assert_allclose(
        double.point_clearances(2 * points), 2 * maze.point_clearances(points), atol=1e-12
    )
    assert double.start == Pose(2, 4, 0.3)
    assert double.goal is not None and double.goal.radius == 0.2
    assert maze.scaled(1.0) is maze


def test_fingerprint_sees_walls_and_places_not_names():
    maze = vector_maze()
    assert maze.fingerprint == Maze("other", BOUNDS, vector_maze().walls, source="x").fingerprint
    assert maze.fingerprint != maze.with_places(start=Pose(1, 1, 0)).fingerprint
    assert maze.fingerprint != maze.scaled(2.0).fingerprint


def test_goal_disc_boxes_and_heading():
    disc = Goal(1.0, 1.0, 0.5, heading=math.pi, heading_tolerance=0.2)
    assert disc.reached(1.3, 1.4, -math.pi + 0.1)
    assert not disc.reached(1.3, 1.4, 0.0)
    assert disc.heading_error(0.0) == pytest.approx(math.pi - 0.2)
    assert not disc.reached(1.4, 1.4, math.pi)
    cells = Goal.of_boxes(((0, 0, 1, 1), (1, 0, 2, 1)))
    assert (cells.x, cells.y) == (1.0, 0.5)
    np.testing.assert_allclose(cells.distance([(0.5, 0.5), (2.3, 1.4), (-1, 0.5)]), [0, 0.5, 1])


@pytest.mark.parametrize("heading", [0.0, 0.7])
@pytest.mark.parametrize("share", [0.0, 0.002, 0.3])
def test_points_of_a_grid(heading, share):
    """As far as shapely says they are from the union of the cells and from the bounds."""
    rng = np.random.default_rng(3)
    raster = Raster(rng.random((40, 60)) < share, 0.05, Pose(0.4, -0.3, heading))
    maze = Maze("grid", raster.bounds(), raster=raster)
    points = rng.uniform(raster.bounds()[:2], raster.bounds()[2:], (300, 2))
    cells = np.argwhere(raster.occupied)[:, ::-1] * raster.cell_m
    corners = cells[:, None] + raster.cell_m * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    solid = shapely.union_all(shapely.polygons(raster.to_world(corners)))
    wanted = shapely.distance(shapely.box(*maze.bounds).exterior, shapely.points(points))
    if share:
        wanted = np.minimum(wanted, shapely.distance(solid, shapely.points(points)))
    np.testing.assert_allclose(maze.point_clearances(points), wanted, atol=1e-9)
