"""Foreign formats: micromouse text, MovingAI maps and scenarios, ROS maps, BARN worlds."""

import math
import os

import numpy as np
import pytest
from PIL import Image

from planners.maze.load import load_maze
from planners.maze.places import Goal, Pose
from srs_opt.errors import InputError

MICROMOUSE = """\
o---o---o---o
| G     |   |
o   o---o   o
|   |       |
o   o---o   o
| S |       |
o---o---o---o
"""


def test_micromouse_walls_are_a_fifteenth_of_a_cell(tmp_path):
    path = tmp_path / "m.txt"
    path.write_text(MICROMOUSE)
    maze = load_maze(path)
    half = 0.006  # 12 mm walls at the contest's 0.18 m
    assert maze.bounds == pytest.approx((-half, -half, 0.54 + half, 0.54 + half))
    middle = 0.09 - half
    points = [(0.09, 0.09), (0.09, 0.27), (0.27, 0.27), (0.45, 0.27), (0.27, 0.36 + half)]
    # the last but one cell is open to its left; the nearest wall is a stub's end
    np.testing.assert_allclose(
        maze.point_clearances(points), [middle, middle, middle, middle, 0.0], atol=1e-12
    )
    assert maze.point_clearances([(0.42, 0.36)])[0] == pytest.approx(
        0.06 - half
    )  # beside the post at (0.36, 0.36)
    assert maze.goal is not None and maze.goal.boxes == (pytest.approx((0.0, 0.36, 0.18, 0.54)),)
    assert maze.goal.reached(0.01, 0.37, 0.0)


def test_micromouse_start_depends_on_the_robot(tmp_path):
    path = tmp_path / "m.txt"
    path.write_text(MICROMOUSE.replace("o", "+"))
    maze = load_maze(path, 0.36, robot_length_m=0.3, margin_m=0.01)
    # north: the face of the lower wall is at 0.012
    assert maze.start == Pose(
        pytest.approx(0.18), pytest.approx(0.012 + 0.01 + 0.15), pytest.approx(math.pi / 2)
    )


def test_classic_micromouse_without_letters_follows_the_contest(tmp_path):
    path = tmp_path / "c.txt"
    line, open_row = "o" + "---o" * 16, "o" + "   o" * 16
    cells = "|" + "   |" + "    " * 14 + "   |"
    path.write_text("\n".join([line, *[cells, open_row] * 15, cells, line]))
    maze = load_maze(path)
    assert maze.start is not None and maze.start.heading == pytest.approx(math.pi / 2)
    assert maze.goal is not None and len(maze.goal.boxes) == 4
    assert (maze.goal.x, maze.goal.y) == (pytest.approx(1.44), pytest.approx(1.44))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected a micromouse maze"),
        ("hello\nworld\nxyz\n", "expected"),
        (MICROMOUSE.replace("G", "X"), "m.txt:2: column 3: found 'X'"),
        (MICROMOUSE.replace("G", "S"), "2 start cells"),
        (MICROMOUSE.replace("| S |", "* S |"), "m.txt:6: column 1: found '*'"),
        (MICROMOUSE.replace("o   o---o", "o   o-- o", 1), "found '-- '"),
        (
            MICROMOUSE.replace("o   o---o   o\n|   |", "x   o---o   o\n|   |", 1),
            "m.txt:3: column 1: found 'x'",
        ),
        (MICROMOUSE + "o\n", "expected a micromouse maze"),
    ],
)
def test_micromouse_refusals(tmp_path, text, words):
    path = tmp_path / "m.txt"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_maze(path)
    assert words in str(caught.value)


MAP = "type octile\nheight 3\nwidth 5\nmap\n.....\n.@TW.\nGS..O\n"


def test_movingai_map(tmp_path):
    path = tmp_path / "a.map"
    path.write_text(MAP)
    maze = load_maze(path, 1.0)
    assert maze.bounds == (0, 0, 5, 3)
    assert maze.start is None and maze.goal is None
    # the first row is the top; . G S are free, @ O T W are not
    centres = [(x + 0.5, 2.5 - y) for y in range(3) for x in range(5)]
    walls = "".join("#" if c == 0 else "." for c in maze.point_clearances(centres))
    assert walls == "....." + ".###." + "....#"
    assert load_maze(path).bounds == pytest.approx((0, 0, 0.5, 0.3))
    assert load_maze(path, 1.0, scale=3.0).bounds == (0, 0, 15, 9)


@pytest.mark.parametrize("header", ["version 1", "version 1.0"])
def test_movingai_scenario(tmp_path, header):
    (tmp_path / "a.map").write_bytes(MAP.replace("\n", "\r\n").encode())
    scenario = tmp_path / "a.map.scen"
    rows = ["0\tmaps/dao/a.map\t5\t3\t0\t0\t4\t0\t4.0", "1\ta.map\t5\t3\t0\t2\t4\t1\t6.2"]
    scenario.write_text("\n".join([header, *rows]) + "\n")
    maze = load_maze(scenario, 10.0)  # room enough all round: the heading is the goal's direction
    assert maze.start == Pose(pytest.approx(5), pytest.approx(25), pytest.approx(0.0))
    assert maze.goal == Goal(pytest.approx(45), pytest.approx(25), pytest.approx(5))
    tight = load_maze(scenario, 0.25).start  # near the left and upper bounds: slanting is safest
    assert tight is not None and tight.heading == pytest.approx(-math.pi / 4)
    second = load_maze(f"{scenario}#2", 0.4)
    assert second.start is not None and second.goal is not None
    assert (second.start.x, second.start.y) == pytest.approx((0.2, 0.2))
    assert (second.goal.x, second.goal.y) == pytest.approx((1.8, 0.6))
    with pytest.raises(InputError, match="no number 3"):
        load_maze(f"{scenario}#3")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.map", "", "a.map:1: found ''; expected a MovingAI map"),
        ("a.map", MAP.replace("height 3", "height x"), "a.map:2"),
        ("a.map", MAP.replace("height 3", "height 4"), "height 4"),
        ("a.map", MAP.replace("height 3", "height 2"), "height 2"),
        ("a.map", MAP.replace("width 5", "width 6"), "a.map:5: 5 cells, but the header says width 6"),
        ("a.map", MAP.replace("width 5", "width 999999999"), "cells"),
        ("a.map", MAP.replace("height 3\nwidth 5", "height 99999999\nwidth 99999999"), "too many"),
        ("a.map", MAP.replace("@", "%"), "a.map:6: column 2: unknown cell '%'"),
        ("a.scen", "version 2\n", "expected 'version 1' or 'version 1.0'"),
        ("a.scen", "version 1\n", "no scenario"),
        ("a.scen", "version 1\n0 a.map 5 3 0 0\n", "a.scen:2"),
        ("a.scen", "version 1\n0 a.map 5 3 0 0 5 0 1.0\n", "outside the map"),
        ("a.scen", "version 1\n0 gone.map 5 3 0 0 4 0 1.0\n", "put the .map file beside"),
    ],
)
def test_movingai_refusals(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        load_maze(tmp_path / name)
    assert words in str(caught.value)


def ros_map(folder, pixels, name="m.pgm", **keys):
    image = pixels if isinstance(pixels, Image.Image) else Image.fromarray(np.array(pixels, dtype=np.uint8))
    image.save(folder / name)
    record = {"image": name, "resolution": 0.5, "origin": [0.0, 0.0, 0.0], "negate": 0, **keys}
    path = folder / "m.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in record.items() if value is not None))
    return path


def cells_of(path) -> list[str]:
    raster = load_maze(path).raster
    assert raster is not None
    return ["".join("#" if cell else "." for cell in row) for row in raster.occupied[::-1]]


LEVELS = [[0, 100, 205, 255]]  # occupied, unknown, unknown, free


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({}, "###."),
        ({"negate": 1}, ".###"),
        ({"negate": "true"}, ".###"),
        ({"free_thresh": 0.25}, "###."),  # 205 is what savers write for unknown
        ({"mode": "trinary", "occupied_thresh": 0.65, "free_thresh": 0.196}, "###."),
        ({"mode": "scale"}, "##.."),  # 0.61 is above, 0.196 below the middle of the thresholds
        ({"mode": "raw"}, ".###"),  # percent: 0 free, 100 occupied, above unknown
    ],
)
def test_ros_modes(tmp_path, keys, expected):
    assert cells_of(ros_map(tmp_path, LEVELS, **keys)) == [expected]


@pytest.mark.parametrize("name", ["m.pgm", "m.png"])
def test_ros_first_pixel_row_is_the_top(tmp_path, name):
    path = ros_map(tmp_path, [[0, 255, 255], [255, 255, 255]], name)
    assert cells_of(path) == ["#..", "..."]
    assert load_maze(path).point_clearances([(0.25, 0.75), (1.25, 0.75), (0.25, 0.25)]).tolist() == [
        0.0,
        0.25,
        0.25,
    ]


def test_ros_plain_pgm_colour_and_transparency(tmp_path):
    path = ros_map(tmp_path, LEVELS)
    (tmp_path / "m.pgm").write_text("P2\n# by hand\n4 1\n255\n0 100 205 255\n")
    assert cells_of(path) == ["###."]
    rgba = np.full((1, 3, 4), 255, dtype=np.uint8)
    rgba[0, 1, 3] = 100
    rgba[0, 2, :3] = (0, 30, 60)
    assert cells_of(ros_map(tmp_path, Image.fromarray(rgba), "m.png")) == [".##"]
    deep = Image.fromarray(np.array([[0, 65535]], dtype=np.uint16))
    assert cells_of(ros_map(tmp_path, deep, "m.png")) == ["#."]


def test_ros_origin_turns_the_map(tmp_path):
    path = ros_map(tmp_path, [[255, 255, 255, 0], [255, 255, 255, 255]], origin=[1.0, 2.0, math.pi / 6])
    maze = load_maze(path)
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)

    def world(u, v):
        return 1.0 + c * u - s * v, 2.0 + s * u + c * v

    # the map is 2 m x 1 m, the occupied pixel its upper right corner
    points = [world(1.0, 0.4), world(1.75, 0.75), world(1.25, 0.75), world(-0.01, 0.5), world(1.0, 1.01)]
    np.testing.assert_allclose(maze.point_clearances(points), [0.4, 0, 0.25, 0, 0], atol=1e-9)
    assert maze.bounds == pytest.approx((1.0 - s, 2.0, 1.0 + 2 * c, 2.0 + 2 * s + c))


def test_ros_refusals(tmp_path):
    path = ros_map(tmp_path, LEVELS)
    cases = [
        ({"image": "gone.pgm"}, "m.yaml:1: image: cannot read"),
        ({"image": "."}, "is a folder"),
        ({"image": "loop.pgm"}, "image: cannot read"),
        ({"image": "junk.pgm"}, "not a readable PGM, PNG"),
        ({"image": "cut.png"}, "not a readable PGM, PNG"),
        ({"image": "huge.pgm"}, "too many"),
        ({"image": None}, "'image' is missing"),
        ({"resolution": None}, "'resolution' is missing"),
        ({"resolution": 0}, "greater than 0"),
        ({"resolution": ".nan"}, "finite"),
        ({"origin": "[0, 0]"}, "at least 3"),
        ({"negate": 2}, "negate"),
        ({"mode": "ternary"}, "mode"),
        ({"free_thresh": 0.7}, "less than occupied_thresh"),
    ]
    os.symlink("loop.pgm", tmp_path / "loop.pgm")
    (tmp_path / "junk.pgm").write_bytes(os.urandom(1000))
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (50, 50), dtype=np.uint8)).save(
        tmp_path / "cut.png"
    )
    (tmp_path / "cut.png").write_bytes((tmp_path / "cut.png").read_bytes()[:700])
    (tmp_path / "huge.pgm").write_bytes(b"P5 40000 40000 255\n")
    for keys, words in cases:
        path = ros_map(tmp_path, LEVELS, **keys) if "image" not in keys else path
        if "image" in keys:
            rest = "resolution: 0.5\norigin: [0, 0, 0]\n"
            path.write_text((f"image: {keys['image']}\n" if keys["image"] else "") + rest)
        with pytest.raises(InputError) as caught:
            load_maze(path)
        assert words in str(caught.value), keys


CYLINDER = (
    "<model name='c{i}'><pose frame=''>{x} {y} 0.5 0 0 0</pose><link name='l'><collision name='c'><geometry>"
    "<cylinder><radius>0.075</radius><length>1</length></cylinder></geometry></collision></link></model>"
)
PLANE = "<model name='g'><link><collision><geometry><plane/></geometry></collision></link></model>"


def world(*models: str) -> str:
    return (
        "<?xml version='1.0'?><sdf version='1.6'><world name='default'>" + "".join(models) + "</world></sdf>"
    )


def test_barn_cylinders(tmp_path):
    path = tmp_path / "w.world"
    path.write_text(world(PLANE, CYLINDER.format(i=0, x=0, y=0), CYLINDER.format(i=1, x=1, y=2)))
    maze = load_maze(path)
    assert len(maze.walls) == 2
    assert maze.bounds == pytest.approx((-4.075, -4.075, 5.075, 6.075))
    np.testing.assert_allclose(maze.point_clearances([(0.3, 0.4), (1.0, 1.9), (1, 1)]), [0.425, 0.025, 0.925])


def test_world_boxes_and_nested_poses(tmp_path):
    path = tmp_path / "w.world"
    box = (
        "<model name='b'><pose>1 2 0 0 0 1.5707963267948966</pose><link><pose>1 0 0 0 0 0</pose>"
        "<collision><geometry><box><size>0.4 0.2 1</size></box></geometry></collision></link></model>"
    )
    state = "<state><model name='b'><pose>5 2 0 0 0 1.5707963267948966</pose></model></state>"
    path.write_text(world(box))
    # the link is 1 m ahead of the model, at (1, 3); turned by 90 degrees the box is 0.2 wide and 0.4 high
    np.testing.assert_allclose(
        load_maze(path).point_clearances([(1.3, 3.0), (1.0, 3.5)]), [0.2, 0.3], atol=1e-9
    )
    path.write_text(world(box, state))
    np.testing.assert_allclose(load_maze(path).point_clearances([(5.3, 3.0)]), [0.2], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "w.world:1: not valid XML"),
        ("<sdf><world></sdf>", "w.world:1: not valid XML"),
        ("<sdf/>", "no <world>"),
        (world(PLANE), "no obstacles"),
        (world(CYLINDER.format(i=0, x="nan", y=0)), "model 'c0': pose is 'nan 0 0.5 0 0 0'"),
        (world(CYLINDER.format(i=0, x="1e300", y=0)), "expected 6 finite numbers"),
        (world(CYLINDER.format(i=0, x=0, y=0).replace("0.5 0 0 0", "0.5 1.57 0 0")), "tilted"),
        (world(CYLINDER.format(i=0, x=0, y=0).replace("0.075", "-1")), "greater than 0"),
        (world(CYLINDER.format(i=0, x=0, y=0).replace("cylinder", "mesh")), "shape 'mesh'"),
        (world("<include><uri>model://jersey_barrier</uri></include>"), "<include>"),
        ('<!DOCTYPE a [<!ENTITY b "c">]>' + "<sdf/>", "entity"),
    ],
)
def test_world_refusals(tmp_path, text, words):
    path = tmp_path / "w.world"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_maze(path)
    assert words in str(caught.value)
