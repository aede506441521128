"""Cost as the work grows: links, trials, map points, maze area; with exponents."""

from __future__ import annotations

import itertools
import math
import random
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.section import Section, best_time, exponent, growth_picture
from planners.generate.passages import braided
from planners.maze.field import DistanceField
from planners.maze.maze import Maze
from planners.maze.micromouse import read_micromouse
from planners.maze.places import RobotSize
from planners.search.costmap import cost_map
from srs_opt.calibrate.coordinates import base_coordinates
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.objective import sum_eliminated
from srs_opt.gait import Wave
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.orbit.body import integrator
from srs_opt.orbit.period_map import monodromy_kernel
from srs_opt.orbit.steady import steady_gaits
from srs_opt.robot import wpi_srs
from srs_opt.simulate import compiled
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

Curve = tuple[list[float], list[float]]


def run(quick: bool) -> Section:
    studies = {
        "links": (_links, [3, 5] if quick else [5, 10, 20, 50]),
        "simulated trials": (_trials, [4, 16] if quick else [10, 30, 100, 300, 1000]),
        "fitted trials": (_fitted, [4, 12] if quick else [10, 30, 100, 300, 1000]),
        "map points": (_points, [16, 64] if quick else [10, 30, 100, 300, 1000]),
        "maze area (m²)": (_area, [4, 8] if quick else [8, 16, 32, 64]),
    }
    rows, pictures, ratios = [], [], {}
    for name, (study, sizes) in studies.items():
        curves = study(sizes)
        for label, (n, cost) in curves.items():
            shown = ", ".join(f"{size:g}: {c:.3g}" for size, c in zip(n, cost))
            rows.append([name, label, shown, f"{exponent(n, cost):.2f}"])
            if not quick and "compiling" not in label:
                ratios[f"{name}, {label}, exponent"] = exponent(n, cost)
        if not quick:
            pictures.append(growth_picture("growth_" + "_".join(name.split()[:2]), name, curves))
    notes = ["Processor times in s. Compiling happens once per structure and machine; code is kept."]
    return Section("Growth", ["what grows", "time of", "size: s", "exponent"], rows, notes, ratios, pictures)


def _links(sizes: list[int]) -> dict[str, Curve]:
    compiling, period, gait_s = [], [], []
    for links in sizes:
        robot = wpi_srs().with_values(links=links)
        run = integrator(robot)
        before = compiled.compile_seconds
        monodromy_kernel(run.structure)
        compiling.append(max(compiled.compile_seconds - before, 1e-3))
        # two waves of moderate bend along any body
        gait = Wave.uniform(links - 1, 1.5, 40.0, 2 * math.pi / (links - 1)).gait()
        timeline = Timeline.of_gait(gait, 2.0)
        period.append(best_time(lambda: run.integrate(timeline, run.rest()), 3))  # noqa: B023
        gait_s.append(best_time(lambda: steady_gaits(robot, [gait] * 4), 2) / 4)  # noqa: B023
    n = [float(s) for s in sizes]
    curves = {"2 s of motion": (n, period), "a steady gait": (n, gait_s)}
    if min(compiling) > 2e-3:  # nothing was in the cache
        curves["compiling"] = (n, compiling)
    return curves


def _trials(sizes: list[int]) -> dict[str, Curve]:
    run = Integrator(wpi_srs())
    timelines = [
        Timeline.of_gait(Wave.uniform(4, f, 50, 1.2).gait(), 2.0) for f in np.linspace(1, 2, max(sizes))
    ]
    costs = [
        best_time(lambda: run_batched([run.travel(t, run.rest()) for t in timelines[:size]]), 2)  # noqa: B023
        for size in sizes
    ]
    return {"2 s of motion each": ([float(s) for s in sizes], costs)}


def _fitted(sizes: list[int]) -> dict[str, Curve]:
    """One step of a calibration; trials of a generated set, over and over under new names."""
    from benchmarks.discrepancy import generate
    from srs_opt.measurement.dataset import load_dataset

    with tempfile.TemporaryDirectory() as scratch:
        generate(Path(scratch) / "set", "null", (), 1)
        dataset = load_dataset(Path(scratch) / "set")
    base = base_coordinates(dataset.robot)
    point, model = start_point(base), Model(dataset.robot)
    costs = []
    for size in sizes:
        trials = [replace(t, name=f"t{k}") for k, t in zip(range(size), itertools.cycle(dataset.trials))]
        costs.append(
            best_time(  # a new experiment each time: nothing is known of its trials
                lambda: sum_eliminated(Experiment(model, trials, 0.001).normal_equations(point, base)),  # noqa: B023
                2 if size <= 100 else 1,
            )
        )
    return {"a step of calibration": ([float(s) for s in sizes], costs)}


def _points(sizes: list[int]) -> dict[str, Curve]:
    costs = []
    for size in sizes:
        points = grid_points(list(np.linspace(1, 2, size)), [48.0], [0.4], [math.pi / 2])
        costs.append(best_time(lambda: map_at(wpi_srs(), "complex", points), 2))  # noqa: B023
    return {"a map": ([float(s) for s in sizes], costs)}


def _area(cells: list[int]) -> dict[str, Curve]:
    """Mazes of more and more cells of 0.3 m: wall distances, then the way to the goal from everywhere."""
    robot, gaits = wpi_srs(), shipped_table().for_planning()
    area, tables, ways = [], [], []
    for size in cells:
        maze = _maze(size)
        area.append((0.3 * size) ** 2)
        tables.append(best_time(lambda: DistanceField.of(maze, 0.01), 2))  # noqa: B023
        field = DistanceField.of(maze, 0.01)
        ways.append(best_time(lambda: cost_map(field, maze.goal, gaits, robot.body_width_m / 2), 2))  # noqa: B023
    return {"wall distances": (area, tables), "ways to the goal": (area, ways)}


def _maze(size: int) -> Maze:
    robot = wpi_srs()
    cells = braided(size, random.Random(0), 0.5)
    return read_micromouse(cells.to_text(), "", 0.3, RobotSize(robot.length_m, robot.body_width_m / 2, 0.005))
