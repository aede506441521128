"""What maps look like in the wild: unknown cells, byte-order marks, image addresses, odd endings."""

import codecs

import numpy as np
import pytest
from PIL import Image

from planners.maze.load import load_maze
from planners.maze.save import maze_to_yaml
from srs_opt.errors import InputError

MICROMOUSE = "+---+---+---+\n|     G |   |\n+   +---+   +\n| S     |   |\n+---+---+---+\n"
MOVINGAI = "type octile\nheight 2\nwidth 5\nmap\n.G3aS\n@OTW.\n"


def saved_map(folder, grey, name="m.png", image=None, **keys):
    pixels = Image.fromarray(np.array(grey, dtype=np.uint8))
    pixels.save(folder / name)
    record = {"image": image or name, "resolution": 0.02, "origin": [0, 0, 0], "negate": 0, **keys}
    (folder / "m.yaml").write_text("".join(f"{k}: {v}\n" for k, v in record.items()))
    return folder / "m.yaml"


@pytest.fixture
def band(tmp_path):
    """A free map with a band of unknown cells across, as a saver with free_thresh 0.25 writes it."""
    grey = np.full((50, 100), 254)
    grey[:, 45:55] = 205
    grey[20, 10] = 0
    return saved_map(tmp_path, grey, free_thresh=0.25, occupied_thresh=0.65)


def test_unknown_cells_are_walls_unless_asked_otherwise(band):
    wall, free = load_maze(band), load_maze(band, unknown="free")
    assert wall.raster.occupied[:, 45:55].all() and wall.raster.occupied.sum() == 501
    assert free.raster.occupied.sum() == 1
    assert wall.point_clearances([(1.0, 0.5)])[0] == 0.0 < free.point_clearances([(1.0, 0.5)])[0]
    for maze in (wall, free):
        assert maze.raster.unknown.sum() == 500
        assert maze.scaled(2.0).raster.unknown.sum() == 500


def test_a_map_without_unknown_cells_has_no_mask(tmp_path):
    assert load_maze(saved_map(tmp_path, [[0, 254], [254, 254]])).raster.unknown is None


def test_unknown_cells_of_our_own_grid_survive_writing(band, tmp_path):
    path = tmp_path / "ours.yaml"
    path.write_text(maze_to_yaml(load_maze(band)))
    assert load_maze(path).raster.occupied.sum() == 501
    assert load_maze(path, unknown="free").raster.occupied.sum() == 1
    assert load_maze(path).raster.unknown.sum() == 500


def test_unknown_cells_have_a_colour_of_their_own(band):
    from matplotlib.figure import Figure

    from planners.maze.draw import draw_maze

    figure = Figure()
    axes = figure.subplots()
    draw_maze(axes, load_maze(band))
    images = [image.get_array() for image in axes.images]
    colors = [np.unique(image[image[..., 3] > 0], axis=0) for image in images]
    assert [len(color) for color in colors] == [1, 1]
    assert not np.array_equal(*colors)
    assert (images[1][..., 3] > 0).sum() == 500
    assert "unknown" in axes.get_legend_handles_labels()[1][0]


@pytest.mark.parametrize("ending", ["jpg", "tif"])
def test_jpeg_and_tiff(tmp_path, ending):
    grey = np.full((40, 40), 254)
    grey[:8], grey[24:32] = 0, 205  # whole blocks of JPEG
    maze = load_maze(saved_map(tmp_path, grey, f"m.{ending}", free_thresh=0.25))
    assert maze.raster.occupied[::-1][:8].all() and maze.raster.occupied[::-1][24:32].all()
    assert not maze.raster.occupied[::-1][10:22].any()
    assert maze.raster.unknown[::-1][24:32].all()


def test_addresses_of_images(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    folder = tmp_path / "a folder"
    folder.mkdir()
    Image.new("L", (4, 4), 254).save(folder / "m.png")
    for image in ("~/a folder/m.png", (folder / "m.png").as_uri(), "./a folder/m.png"):
        assert load_maze(saved_map(tmp_path, [[254]], "x.png", image)).width_m == pytest.approx(0.08)
    for image, words in (("http://a.b/m.png", "expected a path"), ("file://other/m.png", "another computer")):
        with pytest.raises(InputError, match=words):
            load_maze(saved_map(tmp_path, [[254]], "x.png", image))


@pytest.mark.parametrize("text", [MICROMOUSE, MOVINGAI])
@pytest.mark.parametrize("ending", [".map", ".txt", ".yaml", ""])
def test_content_decides_and_a_byte_order_mark_does_not_matter(tmp_path, text, ending):
    path = tmp_path / f"m{ending}"
    path.write_bytes(codecs.BOM_UTF8 + text.encode())
    maze = load_maze(path)
    if text == MOVINGAI:  # letters and digits of weighted maps are ground
        assert (~maze.raster.occupied).sum() == 6
    else:
        assert maze.start is not None and len(maze.goal.boxes) == 1


def numbers(cells):
    """Write mms lines of (column, row): walls, letters of NESW."""
    lines = [f"{x} {y} " + " ".join(str(int(side in walls)) for side in "NESW") for (x, y), walls in cells]
    return "\n".join(lines)


def test_mms_numbers(tmp_path):
    """Two by two cells; only one of its two cells tells of the wall between (0, 0) and (1, 0)."""
    path = tmp_path / "m.num"
    path.write_text(numbers([((0, 0), "WSE"), ((0, 1), "WN"), ((1, 0), "SE"), ((1, 1), "NE")]))
    maze = load_maze(path, 0.2)
    assert maze.point_clearances([(0.2, 0.1)])[0] == 0.0  # the wall
    assert maze.point_clearances([(0.1, 0.2), (0.3, 0.2), (0.2, 0.3)]).min() > 0.05  # openings
    assert maze.start.heading == pytest.approx(np.pi / 2)
    assert len(maze.goal.boxes) == 4
    for text, words in (("0 0 1 0 0", "expected"), ("0 0 1 0 0 1\n0 2 1 0 0 1", "one for each of 1 x 3")):
        path.write_text(text)
        with pytest.raises(InputError, match=words):
            load_maze(path)


def test_maz_bytes(tmp_path):
    cells = np.zeros((16, 16), dtype=np.uint8)  # column, row
    cells[0, 0] = 2 | 4 | 8  # the start: walls to the east, south and west
    (tmp_path / "m.maz").write_bytes(cells.tobytes())
    maze = load_maze(tmp_path / "m.maz")
    assert maze.start.heading == pytest.approx(np.pi / 2)
    assert maze.point_clearances([(0.18, 0.09), (0.09, 0.18)]).tolist() == pytest.approx([0.0, 0.084])
    assert len(maze.goal.boxes) == 4


WORLD = """<sdf><world><include><uri>model://sun</uri></include>
<include><uri>model://{}</uri><name>a</name><pose>2 3 0 0 0 1.5707963</pose></include></world></sdf>"""
MODEL = """<sdf><model name="crate"><pose>1 0 0 0 0 0</pose><link><collision><geometry>
<box><size>0.4 0.2 0.3</size></box></geometry></collision></link></model></sdf>"""


def test_included_models(tmp_path):
    path = tmp_path / "w.world"
    path.write_text(WORLD.format("unit_box"))
    np.testing.assert_allclose(load_maze(path).walls.boxes(), [[1.5, 2.5, 2.5, 3.5]], atol=1e-6)
    path.write_text(WORLD.format("crate"))
    with pytest.raises(InputError, match=r"no model\.sdf"):
        load_maze(path)
    (tmp_path / "models" / "crate").mkdir(parents=True)
    (tmp_path / "models" / "crate" / "model.sdf").write_text(MODEL)
    np.testing.assert_allclose(load_maze(path).walls.boxes(), [[1.9, 3.8, 2.1, 4.2]], atol=1e-6)


def test_messages_show_no_python_objects(tmp_path):
    path = saved_map(tmp_path, [[0]])
    (tmp_path / "m.png").write_bytes(b"not an image")
    with pytest.raises(InputError) as caught:
        load_maze(path)
    assert "object at" not in str(caught.value) and "b'" not in str(caught.value)
