"""ROS map_server maps: a YAML file beside a PGM or PNG image; unknown space is wall.

``trinary``: free where the occupancy probability is below free_thresh. ``scale``: free where it is,
scaled between the thresholds, below one half. ``raw``: the pixel is the occupancy in percent, free below
50, unknown above 100. Transparent pixels are unknown. The map may be turned: its origin has a yaw.
"""

from __future__ import annotations

import io
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.maze import MAX_EXTENT_M, Maze
from planners.maze.places import Pose
from planners.maze.raster import MAX_CELLS, Raster
from planners.maze.walls import Walls
from srs_opt.document import Document, load_schema, validate
from srs_opt.errors import InputError
from srs_opt.files import read_bytes

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""The map_server's customary thresholds, for files that name none."""
MAX_IMAGE_BYTES = 256_000_000
FORMATS = ("PPM", "PNG", "BMP")


def maze_from_map_server(document: Document) -> Maze:
    """Return the maze of a parsed map_server file, without start and goal.

    Raises
    ------
    InputError
        Naming the file, the line and the key.
    """
    validate(document, load_schema("planners.maze", "ros_map.schema.json"))
    value = document.value
    cell = float(value["resolution"])
    x, y, yaw = map(float, value["origin"])
    image = _image_path(document, value["image"])
    occupied = _occupied(document, _pixels(image))
    raster = Raster(np.ascontiguousarray(occupied[::-1]), cell, Pose(x, y, yaw))
    if max(map(abs, raster.bounds())) > MAX_EXTENT_M:
        raise document.error(
            ("resolution",), f"the map reaches beyond {MAX_EXTENT_M:g} m; is it in metres per pixel?"
        )
    # a turned map does not fill the box around it: the corners are outside, hence wall
    corners = shapely.get_parts(shapely.difference(shapely.box(*raster.bounds()), raster.frame()))
    solid = [(corner, 0.0) for corner in corners if corner.area > 1e-9 * cell * cell]
    return Maze(Path(document.source).stem, raster.bounds(), Walls.of(solid), raster, source=document.source)


def _image_path(document: Document, name: str) -> Path:
    path = Path(document.source).parent / name
    place = ("image",)
    if "\0" in name:
        raise document.error(place, "the file name holds a zero byte")
    try:
        os.stat(path)
    except OSError as error:
        raise document.error(
            place, f"cannot read {path}: {error.strerror}; expected a PGM or PNG image"
        ) from error
    return path


def _pixels(path: Path) -> NDArray[np.float32]:
    """Return grey levels from 0 (black) to 255, shape (rows, columns); transparent pixels are NaN."""
    from PIL import Image

    data = read_bytes(path, "a map image (PGM, PNG)", MAX_IMAGE_BYTES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its own size warning: ours is an error, below
            with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                width, height = image.size
                if width * height > MAX_CELLS:
                    raise InputError(f"{path}: {width} x {height} pixels are too many (limit {MAX_CELLS})")
                return _grey(image)
    except InputError:
        raise
    except Image.DecompressionBombError as error:
        raise InputError(f"{path}: too many pixels (limit {MAX_CELLS})") from error
    except Exception as error:  # the decoders raise whatever they like on damaged files
        raise InputError(f"{path}: not a readable PGM or PNG image: {str(error)[:80]}") from error


def _grey(image: Any) -> NDArray[np.float32]:
    if image.mode.startswith("I"):  # 16 bits
        return np.asarray(image, dtype=np.float32) / np.float32(257)
    if image.mode in ("L", "1"):
        return np.asarray(image.convert("L"), dtype=np.float32)
    channels = np.asarray(image.convert("RGBA"))
    grey: NDArray[np.float32] = channels[..., :3].mean(axis=-1, dtype=np.float32)
    grey[channels[..., 3] < 255] = np.nan
    return grey


def _occupied(document: Document, grey: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where the map is occupied or unknown."""
    value = document.value
    mode = value.get("mode", "trinary")
    if mode == "raw":
        percent = np.rint(grey)
        return ~(percent < 50)
    free, full = (
        float(value.get("free_thresh", FREE_THRESH)),
        float(value.get("occupied_thresh", OCCUPIED_THRESH)),
    )
    if free >= full:
        raise document.error(
            ("free_thresh",), f"must be less than occupied_thresh ({full:g}), found {free:g}"
        )
    probability = grey / 255 if value.get("negate", 0) else (255 - grey) / 255
    limit = free if mode == "trinary" else (free + full) / 2
    return ~(probability < limit)  # written so that not-a-number is occupied
