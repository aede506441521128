"""Any bytes under any name: a maze or one line of complaint, nothing else, and soon."""

import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planners.maze.load import ENDINGS, load_maze
from planners.maze.maze import Maze
from planners.maze.placement import placement_problem
from planners.maze.places import RobotSize
from srs_opt.errors import InputError

FUZZ = settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    derandomize=True,
)
SEEDS = {
    ".yaml": b"name: a\nbounds: [0, 0, 4, 3]\nwalls:\n  - {segment: [[1, 1], [2, 1]], thickness: 0.1}\n"
    b"  - {polygon: [[3, 0.5], [3.5, 0.5], [3.5, 1]]}\ngrid: {cell: 0.5, rows: ['S.#', '..G']}\n"
    b"start: {x: 0.5, y: 0.5, heading: 0.1}\ngoal: {x: 3.5, y: 2.5, radius: 0.1}\n",
    ".yml": b"image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0.1]\nnegate: 0\nmode: scale\n",
    ".map": b"type octile\nheight 3\nwidth 5\nmap\n.....\n.@TW.\nGS..O\n",
    ".scen": b"version 1.0\n0\tm.map\t5\t3\t0\t0\t4\t0\t4.0\n",
    ".txt": b"o---o---o\n| S   G |\no---o---o\n",
    ".world": b"<?xml version='1.0'?><sdf version='1.6'><world name='default'><model name='c'><pose frame=''>"
    b"1 2 0.5 0 0 0</pose><link name='l'><collision name='c'><geometry><cylinder><radius>0.075</radius>"
    b"</cylinder></geometry></collision></link></model></world></sdf>",
}
PGM = b"P5 5 3 255\n" + bytes(range(240, 255))
WORDS = [
    b"-",
    b"0",
    b"9" * 30,
    b"1e308",
    b".nan",
    b"[",
    b"{",
    b"\x00",
    b"\xff\xfe",
    b"<",
    b"&a *a",
    b"!!set",
    b"\n",
    b" ",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "m.pgm").write_bytes(PGM)
    (folder / "m.map").write_bytes(SEEDS[".map"])
    return folder


@st.composite
def damaged(draw, seed: bytes) -> bytes:
    """Return `seed` with a few pieces cut, doubled or replaced."""
    data = seed
    for _ in range(draw(st.integers(1, 4))):
        i = draw(st.integers(0, len(data)))
        j = min(len(data), i + draw(st.integers(0, 12)))
        piece = draw(st.sampled_from([b"", data[i:j] * 2, *WORDS]) | st.binary(max_size=6))
        data = data[:i] + piece + data[j:]
    return data


def read(path, data: bytes) -> None:
    """Read `data` as the file `path`; a maze must also be usable, a complaint one line."""
    path.write_bytes(data)
    try:
        maze = load_maze(path)
    except InputError as error:
        message = str(error)
        assert str(path.parent) in message
        assert len(message) < 1000
        return
    assert isinstance(maze, Maze)
    assert np.isfinite(maze.bounds).all() and maze.width_m > 0 and maze.height_m > 0
    assert np.isfinite(
        maze.point_clearances([(maze.bounds[0] + maze.width_m / 3, maze.bounds[1] + 0.01)])
    ).all()
    placement_problem(maze, RobotSize())
    assert len(maze.fingerprint) == 16


@pytest.mark.parametrize("ending", [*sorted(ENDINGS), ".bin", ""])
@FUZZ
@given(data=st.binary(max_size=300))
def test_any_bytes(folder, ending, data):
    read(folder / f"any{ending}", data)


@pytest.mark.parametrize("ending", sorted(SEEDS))
@FUZZ
@given(data=st.data())
def test_damaged_files(folder, ending, data):
    content = data.draw(damaged(SEEDS[ending]))
    read(folder / f"damaged{ending}", content)
    read(folder / "guessed", content)


@FUZZ
@given(data=damaged(PGM) | st.binary(max_size=200))
def test_damaged_images(folder, data):
    (folder / "image.pgm").write_bytes(data)
    read(folder / "image.yaml", SEEDS[".yml"].replace(b"m.pgm", b"image.pgm"))


@pytest.mark.parametrize("ending", sorted(SEEDS))
@pytest.mark.parametrize(
    "junk",
    [
        np.random.default_rng(0).bytes(10_000_000),
        b"[" * 10_000_000,
        b"- 1\n" * 2_500_000,
        b"o---" * 2_500_000,
        b"type octile\nheight 10\nwidth 10\nmap\n" + b"." * 10_000_000,
        b"<a>" * 3_300_000,
        b"a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
        + b"".join(
            b"%c: &%c [%s]\n" % (98 + i, 98 + i, b", ".join([b"*%c" % (97 + i)] * 10)) for i in range(12)
        ),
    ],
    ids=["noise", "brackets", "list", "posts", "long row", "tags", "aliases"],
)
def test_junk_is_refused_soon(folder, ending, junk):
    path = folder / f"junk{ending}"
    path.write_bytes(junk)
    begun = time.process_time()
    with pytest.raises(InputError, match="junk"):
        load_maze(path)
    assert time.process_time() - begun < 5


@pytest.mark.parametrize("ending", sorted(ENDINGS))
def test_missing_folder_loop(folder, ending):
    (folder / f"folder{ending}").mkdir()
    (folder / f"loop{ending}").symlink_to(f"loop{ending}")
    for name, words in (("gone", "no such file"), ("folder", "is a folder"), ("loop", "symbolic link")):
        with pytest.raises(InputError, match=words):
            load_maze(folder / f"{name}{ending}")


@pytest.mark.parametrize(
    "options", [{"cell_m": 0.0}, {"cell_m": float("nan")}, {"scale": -1.0}, {"scale": float("inf")}]
)
def test_absurd_options(folder, options):
    (folder / "ok.map").write_bytes(SEEDS[".map"])
    with pytest.raises(InputError, match="must be a number"):
        load_maze(folder / "ok.map", **options)


def test_absurd_extents(folder):
    (folder / "ok.map").write_bytes(SEEDS[".map"])
    with pytest.raises(InputError, match="reaches beyond"):
        load_maze(folder / "ok.map", 9e4)
    (folder / "ok.yaml").write_bytes(SEEDS[".yaml"])
    with pytest.raises(InputError, match="own lengths"):
        load_maze(folder / "ok.yaml", 0.1)
