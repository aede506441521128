"""``python -m planners.generate``: a seeded maze as a file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from srs_opt.command import Answer, Parser, make_parser, positive_float, positive_int, run_command
from srs_opt.errors import InputError

if TYPE_CHECKING:
    from planners.maze.maze import Maze
    from planners.maze.places import RobotSize

STYLES = ("perfect", "braided", "rooms", "corridor")
MAX_CELLS = 200
MIN_M, MAX_M = 0.001, 100.0  # of a cell, and of a corridor


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m planners.generate",
        "Make a maze: contest-like (perfect or braided), rooms with doors, or one narrow corridor.\n"
        "The same options and seed give the same file. Lengths in metres.",
        "python -m planners.generate --style braided --cells 16 --cell 0.36 --seed 3 --out mazes/b3.yaml",
        robot=False,
    )
    parser.out_may_be_a_file = True
    parser.add_argument("--style", choices=STYLES, default="perfect", help="kind of maze (default perfect)")
    parser.add_argument(
        "--cells", type=positive_int, default=16, metavar="N", help="cells a side (default 16)"
    )
    parser.add_argument(
        "--cell", type=positive_float, default=0.36, metavar="M", help="cell size, m (default 0.36)"
    )
    parser.add_argument(
        "--wall", type=positive_float, metavar="M", help="wall thickness, m (default 12/180 of a cell)"
    )
    parser.add_argument(
        "--braid",
        type=float,
        default=0.5,
        metavar="SHARE",
        help="share of dead ends opened, 0 to 1 (default 0.5)",
    )
    parser.add_argument(
        "--method", choices=("depth-first", "wilson"), default="depth-first", help="how passages are carved"
    )
    parser.add_argument(
        "--width",
        type=positive_float,
        metavar="M",
        help="width of doors or of the corridor, m (default 0.6 of a cell)",
    )
    parser.add_argument(
        "--length", type=positive_float, default=0.5, metavar="M", help="corridor length, m (default 0.5)"
    )
    parser.add_argument(
        "--robot",
        type=Path,
        metavar="FILE",
        help="robot to be placed at the start (default: the built-in WPI SRS)",
    )
    parser.add_argument("--margin", type=positive_float, default=0.005, metavar="M", help="its clearance, m")
    parser.add_argument(
        "--format", choices=("yaml", "txt"), help="our YAML, or micromouse text (default: by --out)"
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Make the maze and write it."""
    from planners.maze.save import maze_to_yaml
    from srs_opt.files import write_text

    _check(options)
    path = _path(options)
    maze, text = _generate(options, _robot_size(options))
    if path.suffix == ".txt":
        if text is None:
            raise InputError(f"--format txt: micromouse text has cells only; write {options.style} as yaml")
        write_text(path, text)
    else:
        write_text(path, maze_to_yaml(maze, _comment(options)))
    assert maze.start is not None  # every style sets one
    record = {
        "file": str(path),
        "style": options.style,
        "seed": options.seed,
        "bounds": list(maze.bounds),
        "walls": len(maze.walls),
        "start": [maze.start.x, maze.start.y, maze.start.heading],
        "fingerprint": maze.fingerprint,
    }
    size = f"{maze.width_m:.2f} x {maze.height_m:.2f} m"
    return Answer(
        record, f"{options.style} maze, {size}, {len(maze.walls)} walls, seed {options.seed}", files=(path,)
    )


def _check(options: argparse.Namespace) -> None:
    if not 4 <= options.cells <= MAX_CELLS:
        raise InputError(f"--cells: expected 4 to {MAX_CELLS}, found {options.cells}")
    for name in ("cell", "length"):
        value = getattr(options, name)
        if not MIN_M <= value <= MAX_M:
            raise InputError(f"--{name}: expected {MIN_M:g} to {MAX_M:g} m, found {value:g}")
    if not 0 <= options.braid <= 1:
        raise InputError(f"--braid: expected a share from 0 to 1, found {options.braid}")
    options.wall = options.wall or options.cell * 12 / 180
    if options.wall >= options.cell / 2:
        raise InputError(f"--wall: {options.wall:g} m is too thick for cells of {options.cell:g} m")
    options.width = options.width or 0.6 * options.cell
    if options.style == "rooms" and options.width > options.cell - options.wall:
        raise InputError(f"--width: a door of {options.width:g} m does not fit a cell of {options.cell:g} m")


def _path(options: argparse.Namespace) -> Path:
    """Return the file: --out itself when it names one, else one in that folder."""
    out: Path = options.out
    if out.suffix in (".yaml", ".yml", ".txt"):
        if options.format and (out.suffix == ".txt") != (options.format == "txt"):
            raise InputError(f"--out {out}: the ending contradicts --format {options.format}")
        return out
    return out / f"{options.style}-{options.seed}.{options.format or 'yaml'}"


def _robot_size(options: argparse.Namespace) -> RobotSize:
    from planners.maze.places import RobotSize
    from srs_opt.robot import load_robot, wpi_srs

    robot = load_robot(options.robot) if options.robot else wpi_srs()
    return RobotSize(robot.length_m, robot.body_width_m / 2, options.margin)


def _generate(options: argparse.Namespace, robot: RobotSize) -> tuple[Maze, str | None]:
    """Return the maze, and its micromouse text where it is made of cells."""
    import random
    from dataclasses import replace

    from planners.generate.areas import corridor, rooms
    from planners.generate.passages import braided, perfect
    from planners.maze.micromouse import read_micromouse

    rng = random.Random(options.seed)
    name = f"{options.style} {options.seed}"
    if options.style == "rooms":
        maze = rooms(options.cells, options.cell, options.wall, options.width, rng, robot)
        return replace(maze, name=name), None
    if options.style == "corridor":
        return replace(corridor(options.cell, options.width, options.length, rng, robot), name=name), None
    if options.style == "braided":
        cells = braided(options.cells, rng, options.braid, options.method)
    else:
        cells = perfect(options.cells, rng, options.method)
    text = cells.to_text()
    maze = read_micromouse(text, name, options.cell, robot, wall_m=options.wall)
    return replace(maze, name=name), text


def _comment(options: argparse.Namespace) -> str:
    words = f"--style {options.style} --cells {options.cells} --cell {options.cell:g} --seed {options.seed}"
    if options.style == "braided":
        words += f" --braid {options.braid:g}"
    if options.style in ("rooms", "corridor"):
        words += f" --width {options.width:g}"
    return f"Made by: python -m planners.generate {words}"


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    raise SystemExit(main())
