"""The maze generator: the same seed the same maze, every cell reachable, loops only where braided."""

import json
import random
from collections import deque

import numpy as np
import pytest

from planners.generate.__main__ import main
from planners.generate.passages import CellMaze, braided, goal_cells, perfect
from planners.maze.load import load_maze
from planners.maze.placement import check_placement
from planners.maze.places import RobotSize


def openings(maze: CellMaze, cell):
    row, column = cell
    rows, columns = maze.along.shape[0], maze.across.shape[1]
    around = [
        ((row, column + 1), maze.along[row, column + 1]),
        ((row, column - 1), maze.along[row, column]),
        ((row + 1, column), maze.across[row + 1, column]),
        ((row - 1, column), maze.across[row, column]),
    ]
    return [other for other, wall in around if not wall and 0 <= other[0] < rows and 0 <= other[1] < columns]


def reachable(maze: CellMaze) -> set:
    seen, queue = {maze.start}, deque([maze.start])
    while queue:
        for other in openings(maze, queue.popleft()):
            if other not in seen:
                seen.add(other)
                queue.append(other)
    return seen


def cells(size):
    return [(r, c) for r in range(size) for c in range(size)]


@pytest.mark.parametrize("method", ["depth-first", "wilson"])
@pytest.mark.parametrize("size", [4, 5, 7, 16])
def test_perfect_maze_is_a_tree(size, method):
    for seed in range(5):
        maze = perfect(size, random.Random(seed), method)
        assert reachable(maze) == set(cells(size))
        passages = sum(len(openings(maze, cell)) for cell in cells(size)) // 2
        loops = 1 if size % 2 == 0 else 0  # the open 2 x 2 goal is the only ring
        assert passages == size * size - 1 + loops
        assert maze.across[0].all() and maze.across[-1].all()
        assert maze.along[:, 0].all() and maze.along[:, -1].all()
        assert openings(maze, maze.start) == [(1, 0)]
        goals = goal_cells(size)
        assert sum(other not in goals for goal in goals for other in openings(maze, goal)) == 1


@pytest.mark.parametrize(("braid", "left"), [(0.0, 1.0), (0.5, 0.5), (1.0, 0.0)])
def test_braiding_removes_the_wanted_share_of_dead_ends(braid, left):
    for seed in range(5):
        before, after = perfect(16, random.Random(seed)), braided(16, random.Random(seed), braid)
        closed = {before.start, *before.goals}

        def ends(maze, closed=closed):
            return sum(len(openings(maze, cell)) == 1 for cell in cells(16) if cell not in closed)

        assert ends(after) <= left * ends(before) + 1
        assert reachable(after) == set(cells(16))
        assert (before.across & ~after.across).sum() + (before.along & ~after.along).sum() <= ends(before)
        assert not (after.across & ~before.across).any()
        assert openings(after, after.start) == [(1, 0)]


STYLES = ["perfect", "braided", "rooms", "corridor"]


@pytest.mark.parametrize("style", STYLES)
def test_same_seed_same_file(style, tmp_path, capsys):
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        assert (
            main(["--style", style, "--seed", str(seed), "--out", str(tmp_path / f"{name}.yaml"), "--quiet"])
            == 0
        )
    a, b, c = ((tmp_path / f"{name}.yaml").read_bytes() for name in "abc")
    assert a == b
    assert a != c
    assert capsys.readouterr().out == ""
    check_placement(load_maze(tmp_path / "a.yaml"), RobotSize())


@pytest.mark.parametrize("style", ["perfect", "braided"])
def test_text_and_yaml_are_the_same_maze(style, tmp_path, capsys):
    common = ["--style", style, "--cells", "9", "--cell", "0.27", "--seed", "2", "--json"]
    assert main([*common, "--out", str(tmp_path / "m.yaml")]) == 0
    record = json.loads(capsys.readouterr().out)
    assert main([*common, "--out", str(tmp_path), "--format", "txt"]) == 0
    text = json.loads(capsys.readouterr().out)
    assert text["file"].endswith(f"{style}-2.txt")
    assert text["fingerprint"] == record["fingerprint"]
    yaml, micromouse = load_maze(tmp_path / "m.yaml"), load_maze(text["file"], 0.27)
    assert micromouse.fingerprint == record["fingerprint"]
    points = np.random.default_rng(0).uniform(0, 9 * 0.27, (300, 2))
    np.testing.assert_allclose(yaml.point_clearances(points), micromouse.point_clearances(points), atol=2e-6)
    assert yaml.start is not None and micromouse.start is not None
    assert (yaml.start.x, yaml.start.y) == pytest.approx((micromouse.start.x, micromouse.start.y), abs=1e-6)


def test_corridor_has_the_wanted_width(tmp_path):
    path = tmp_path / "c.yaml"
    options = ["--width", "0.115", "--length", "0.4", "--cell", "0.3", "--seed", "4", "--quiet"]
    assert main(["--style", "corridor", *options, "--out", str(path)]) == 0
    maze = load_maze(path)
    middle = (maze.bounds[0] + maze.bounds[2]) / 2
    across = np.stack([np.full(4001, middle), np.linspace(0, maze.bounds[3], 4001)], axis=1)
    assert 2 * maze.point_clearances(across).max() == pytest.approx(0.115, abs=4e-4)


def test_rooms_are_all_reachable(tmp_path):
    from scipy.ndimage import label

    from planners.maze.field import DistanceField

    for seed in range(6):
        path = tmp_path / f"r{seed}.yaml"
        assert (
            main(["--style", "rooms", "--cells", "10", "--seed", str(seed), "--out", str(path), "--quiet"])
            == 0
        )
        maze = load_maze(path)
        assert len(maze.walls) >= 6
        assert label(DistanceField.of(maze, 0.01).values > 0.08)[1] == 1  # one region, doors are 0.216 m wide


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--cells", "2"], "--cells: expected 4 to 200"),
        (["--cells", "1000"], "--cells: expected 4 to 200"),
        (["--style", "braided", "--braid", "2"], "--braid"),
        (["--wall", "0.3"], "--wall"),
        (["--style", "rooms", "--width", "1.0"], "--width"),
        (["--style", "rooms", "--format", "txt"], "cells only"),
        (["--out", "m.txt", "--format", "yaml"], "contradicts"),
    ],
)
def test_refusals(options, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(options) == 2
    told = capsys.readouterr()
    assert words in told.err
    assert told.err.count("\n") == 1
    assert told.out == ""
    assert not list(tmp_path.iterdir())
