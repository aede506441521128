"""Our maze YAML: what it means, what it refuses, and that saving keeps it."""

import math
from pathlib import Path

import numpy as np
import pytest

from planners.maze.load import load_maze
from planners.maze.maze import Maze
from planners.maze.placement import check_placement, placement_problem
from planners.maze.places import Goal, Pose, RobotSize
from planners.maze.save import maze_to_yaml
from srs_opt.errors import InputError

MAZES = sorted((Path(__file__).parents[2] / "mazes").glob("*.*"))
HEAD = "bounds: [0, 0, 4, 3]\n"


@pytest.fixture
def load(tmp_path):
    def from_text(text: str, **options) -> Maze:
        path = tmp_path / "m.yaml"
        path.write_text(text)
        return load_maze(path, **options)

    return from_text


def test_every_kind_of_wall(load):
    maze = load(
        HEAD
        + "walls:\n"
        + "  - {segment: [[1, 1], [2, 1]], thickness: 0.1}\n"
        + "  - {box: [0, 2, 0.5, 2.5]}\n"
        + "  - {polygon: [[3, 0.5], [3.5, 0.5], [3.5, 1]]}\n"
        + "  - {disc: [3, 2, 0.3]}\n"
        + "start: {x: 0.5, y: 0.5, heading: 0.1}\n"
        + "goal: {x: 3.5, y: 2.5, radius: 0.1, heading: 1e-1, heading_tolerance: 0.2}\n"
    )
    points = [(1.5, 0.7), (0.8, 2.2), (3.25, 0.6), (3.0, 1.5)]
    np.testing.assert_allclose(maze.point_clearances(points), [0.25, 0.3, 0.0, 0.2], atol=1e-12)
    assert maze.start == Pose(0.5, 0.5, 0.1)
    assert maze.goal == Goal(3.5, 2.5, 0.1, 0.1, 0.2)
    assert check_placement(maze, RobotSize()) == (maze.start, maze.goal)


def test_grid_first_row_is_the_top(load):
    maze = load('grid: {cell: 0.5, rows: ["#..", "S.G"]}')
    assert maze.bounds == (0, 0, 1.5, 1.0)
    np.testing.assert_allclose(
        maze.point_clearances([(0.25, 0.75), (0.25, 0.3), (0.75, 0.75)]), [0, 0.2, 0.25]
    )
    assert maze.goal is not None and maze.goal.boxes == ((1.0, 0.0, 1.5, 0.5),)
    size = RobotSize()  # back to the closed left side, facing right
    assert maze.start == Pose(size.margin_m + size.length_m / 2, 0.25, 0.0)


def test_grid_beside_walls_and_within_wider_bounds(load):
    maze = load(
        'bounds: [-1, -1, 2, 2]\ngrid: {cell: 0.5, origin: [0, 0], rows: ["##"]}\n'
        "walls: [{disc: [-0.5, 0.25, 0.1]}]"
    )
    np.testing.assert_allclose(
        maze.point_clearances([(-0.2, 0.25), (1.5, 0.25), (0.5, 1.0)]), [0.2, 0.5, 0.5]
    )


def test_scale_leaves_the_robot_its_size(load):
    text = 'grid: {cell: 0.25, rows: ["S.G"]}'
    double = load(text, scale=2.0, robot_length_m=0.3, margin_m=0.01)
    assert double.bounds == (0, 0, 1.5, 0.5)
    assert double.start is not None and double.start.x == pytest.approx(0.16)


def test_given_places_win(load):
    maze = load(HEAD + "start: {x: 1, y: 1}\n", start=Pose(2, 2, 1.0), goal=Goal(3, 1))
    assert maze.start == Pose(2, 2, 1.0)
    assert maze.goal == Goal(3, 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a maze"),
        ("[1, 2]", "not a maze"),
        ("walls: []", "'bounds' is missing"),
        ("bounds: [0, 0, 4]", "m.yaml:1: bounds: needs at least 4"),
        ("bounds: [0, 0, 4, .nan]", "finite"),
        ("bounds: [0, 0, 4, 1e400]", "finite"),
        ("bounds: [4, 0, 0, 3]", "xmin < xmax"),
        ("bounds: [0, 0, 1e9, 3]", "at most"),
        ("bounds: [0, 0, 4, yes]", "expected a number"),
        (HEAD + "wals: []", "m.yaml:2: wals: unknown key 'wals' (did you mean 'walls'?)"),
        (
            HEAD + "walls:\n  - {boxx: [0, 0, 1, 1]}",
            "m.yaml:3: walls[0].boxx: unknown key 'boxx' (did you mean 'box'?)",
        ),
        (HEAD + "walls:\n  - {}", "exactly one of segment, box, polygon, disc, found none"),
        (HEAD + "walls:\n  - {box: [0, 0, 1, 1], disc: [1, 1, 1]}", "found box and disc"),
        (HEAD + "walls:\n  - {segment: [[0, 0], [1, 1]]}", "'thickness' is missing"),
        (HEAD + "walls:\n  - {box: [0, 0, 1, 1], thickness: 1}", "belongs to a segment"),
        (HEAD + "walls:\n  - {segment: [[1, 1], [1, 1]], thickness: 1}", "both ends"),
        (HEAD + "walls:\n  - {segment: [[0, 0], [1, 1]], thickness: -1}", "greater than 0"),
        (HEAD + "walls:\n  - {disc: [1, 1, 0]}", "radius must be greater"),
        (HEAD + "walls:\n  - {polygon: [[0, 0], [1, 1]]}", "at least 3"),
        (HEAD + "walls:\n  - {polygon: [[0, 0], [1, 1], [1, 0], [0, 1]]}", "not a simple outline"),
        (HEAD + "walls:\n  - {polygon: [[0, 0], [1, 1], [2, 2]]}", "walls[0].polygon"),
        (HEAD + "walls:\n  - {polygon: [[0, 0], [1, .inf], [2, 2]]}", "finite"),
        (HEAD + "start: {x: 1}", "'y' is missing"),
        (HEAD + "start: {x: 1, y: 2, headin: 0}", "did you mean 'heading'?"),
        (HEAD + "goal: {x: 1}", "'y' is missing"),
        (HEAD + "goal: {x: 1, y: 1, boxes: [[0, 0, 1, 1]]}", "not both"),
        ('grid: {cell: 0.1, rows: ["..", "..."]}', "3 cells, but the first row has 2"),
        ('grid: {cell: 0.1, rows: ["..x"]}', "unknown cell 'x'"),
        ('grid: {cell: 0.1, rows: ["SS"]}', "2 start cells"),
        ('grid: {cell: 0.1, rows: [""]}', "row is empty"),
        ("grid: {cell: 0.1, rows: []}", "at least 1"),
        (HEAD + 'grid: {cell: 5, rows: ["."]}', "beyond the bounds"),
        ('bounds: [0, 0, 1e5, 1e5]\ngrid: {cell: 1e-3, rows: ["."]}', "too small"),
        ("bounds: [0, 0, 1, 1]\nbounds: [0, 0, 1, 1]", "given twice"),
    ],
)
def test_refusals_name_the_place(load, text, words):
    with pytest.raises(InputError) as caught:
        load(text)
    message = str(caught.value)
    assert words in message
    assert "m.yaml" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("places", "place", "kind"),
    [
        ("goal: {x: 3, y: 1}", "start", "missing"),
        ("start: {x: 3, y: 1}", "goal", "missing"),
        ("start: {x: 5, y: 1}\ngoal: {x: 3, y: 1}", "start", "outside"),
        ("start: {x: 1, y: 1}\ngoal: {x: 3, y: 1}", "start", "wall"),
        ("start: {x: 0.8, y: 1}\ngoal: {x: 3, y: 1}", "start", "body"),
        ("start: {x: 0.5, y: 0.5}\ngoal: {x: 3, y: -1}", "goal", "outside"),
        ("start: {x: 0.5, y: 0.5}\ngoal: {x: 1, y: 1}", "goal", "wall"),
    ],
)
def test_bad_places_are_told(load, places, place, kind):
    maze = load(HEAD + "walls: [{box: [0.9, 0.9, 1.1, 1.1]}]\n" + places)
    problem = placement_problem(maze, RobotSize())
    assert problem is not None
    assert (problem.place, problem.kind) == (place, kind)
    with pytest.raises(InputError, match=place):
        check_placement(maze, RobotSize())


@pytest.mark.parametrize("path", MAZES, ids=lambda path: path.name)
def test_shipped_mazes_hold_the_robot(path):
    start, goal = check_placement(load_maze(path, 0.36 if path.suffix == ".txt" else None), RobotSize())
    assert math.hypot(start.x - goal.x, start.y - goal.y) > 0.3


@pytest.mark.parametrize("path", MAZES, ids=lambda path: path.name)
def test_saving_keeps_a_maze(path, tmp_path):
    maze = load_maze(path)
    copy = tmp_path / "copy.yaml"
    copy.write_text(maze_to_yaml(maze, "two\nlines"))
    again = load_maze(copy)
    assert again.name == maze.name
    np.testing.assert_allclose(again.bounds, maze.bounds, atol=1e-6)
    xmin, ymin, xmax, ymax = maze.bounds
    points = np.random.default_rng(0).uniform((xmin, ymin), (xmax, ymax), (500, 2))
    np.testing.assert_allclose(again.point_clearances(points), maze.point_clearances(points), atol=2e-6)
    assert again.goal is not None and maze.goal is not None
    assert (again.goal.x, again.goal.y) == pytest.approx((maze.goal.x, maze.goal.y), abs=1e-6)
    assert again.start is not None and again.start.heading == pytest.approx(maze.start.heading, abs=1e-6)


def test_narrow_and_no_way_have_the_widths_they_claim():
    folder = MAZES[0].parent
    narrow = load_maze(folder / "narrow.yaml")
    assert 2 * narrow.point_clearances([(1.2, 0.30)])[0] == pytest.approx(0.082)
    no_way = load_maze(folder / "no_way.yaml")
    assert 2 * no_way.point_clearances([(1.0, 0.30)])[0] == pytest.approx(0.046)
