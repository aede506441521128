"""ROS map_server maps: a YAML file beside an image; every cell is free, occupied or unknown.

``trinary``: free where the occupancy probability is below free_thresh, occupied where it is above
occupied_thresh, unknown between; grey level 205, which map savers write for unknown cells, is unknown
whatever the thresholds (with free_thresh 0.25, a saver's default, its probability of 0.196 counts as free).
``scale``: free where the probability, scaled between the thresholds, is below one half. ``raw``: the pixel
is the occupancy in percent, free below 50, unknown above 100. Transparent pixels are unknown. The map may
be turned: its origin has a yaw.
"""

from __future__ import annotations

import io
import os
import warnings
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.maze import MAX_EXTENT_M, Maze
from planners.maze.places import Pose
from planners.maze.raster import MAX_CELLS, Raster, Unknown
from planners.maze.settings import MAP_FILE
from planners.maze.walls import Walls
from srs_opt.document import Document, load_schema, validate
from srs_opt.errors import InputError
from srs_opt.files import read_bytes

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""The map_server's customary thresholds, for files that name none."""
MAX_IMAGE_BYTES = 256_000_000
FORMATS = ("PPM", "PNG", "BMP", "JPEG", "TIFF")
IMAGES = "PGM, PNG, BMP, JPEG or TIFF image"
UNKNOWN_GREY = 205


def maze_from_map_server(document: Document, unknown: Unknown = "wall") -> Maze:
    """Return the maze of a parsed map_server file, without start and goal.

    Parameters
    ----------
    document : Document
    unknown : {"wall", "free"}
        What unknown cells are taken for.

    Raises
    ------
    InputError
        Naming the file, the line and the key.
    """
    validate(document, load_schema("planners.maze", "ros_map.schema.json"))
    value = document.value
    cell = float(value["resolution"])
    x, y, yaw = map(float, value["origin"])
    grey, level_error = _pixels(_image_path(document, value["image"]))
    occupied, unseen = _cells(document, grey, level_error)
    if unknown == "wall":
        occupied |= unseen
    else:
        occupied &= ~unseen
    seen_all = not unseen.any()
    raster = Raster(
        np.ascontiguousarray(occupied[::-1]),
        cell,
        Pose(x, y, yaw),
        None if seen_all else np.ascontiguousarray(unseen[::-1]),
    )
    if max(map(abs, raster.bounds())) > MAX_EXTENT_M:
        raise document.error(
            ("resolution",), f"the map reaches beyond {MAX_EXTENT_M:g} m; is it in metres per pixel?"
        )
    # a turned map does not fill the box around it: the corners are outside, hence wall
    corners = shapely.get_parts(shapely.difference(shapely.box(*raster.bounds()), raster.frame()))
    solid = [(corner, 0.0) for corner in corners if corner.area > 1e-9 * cell * cell]
    return Maze(Path(document.source).stem, raster.bounds(), Walls.of(solid), raster, source=document.source)


def _image_path(document: Document, name: str) -> Path:
    """Return the image's path: beside the YAML file, absolute, from the home folder, or a file:// address."""
    place = ("image",)
    if "\0" in name:
        raise document.error(place, "the file name contains a null byte")
    if name.startswith("file:"):
        address = urlsplit(name)
        if address.netloc not in ("", "localhost"):
            raise document.error(place, f"'{name[:80]}' names another computer; expected file:///path")
        name = url2pathname(address.path)
    elif "://" in name:
        raise document.error(place, f"cannot look up '{name[:80]}'; expected a path or file:///path")
    try:
        path = Path(document.source).parent / Path(name).expanduser()
        os.stat(path)
    except (OSError, RuntimeError) as error:  # a home folder that cannot be told is a RuntimeError
        why = getattr(error, "strerror", None) or str(error)
        raise document.error(place, f"cannot read {name[:200]}: {why}; expected a {IMAGES}") from error
    return path


def _pixels(path: Path) -> tuple[NDArray[np.float32], int]:
    """Return grey levels (rows, columns), 0 black to 255, transparent NaN, and how far they may be off."""
    from PIL import Image, UnidentifiedImageError

    data = read_bytes(path, f"a map image ({IMAGES})", MAX_IMAGE_BYTES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its own size warning: ours is an error, below
            with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                width, height = image.size
                if width * height > MAX_CELLS:
                    raise InputError(f"{path}: {width} x {height} pixels are too many (limit {MAX_CELLS})")
                return _grey(image), MAP_FILE.lossy_levels if image.format == "JPEG" else 0
    except InputError:
        raise
    except UnidentifiedImageError as error:  # its own message shows an object's address
        raise InputError(f"{path}: not a readable {IMAGES}") from error
    except Image.DecompressionBombError as error:
        raise InputError(f"{path}: too many pixels (limit {MAX_CELLS})") from error
    except Exception as error:  # the decoders raise whatever they like on damaged files
        why = "" if "object at 0x" in str(error) else f": {str(error)[:80]}"
        raise InputError(f"{path}: not a readable {IMAGES}{why}") from error


def _grey(image: Any) -> NDArray[np.float32]:
    if image.mode.startswith("I"):  # 16 bits
        return np.asarray(np.asarray(image, dtype=np.float32) / np.float32(257), dtype=np.float32)
    if image.mode in ("L", "1"):
        return np.asarray(image.convert("L"), dtype=np.float32)
    channels = np.asarray(image.convert("RGBA"))
    grey: NDArray[np.float32] = channels[..., :3].mean(axis=-1, dtype=np.float32)
    grey[channels[..., 3] < 255] = np.nan
    return grey


def _cells(
    document: Document, grey: NDArray[np.float32], level_error: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which cells are occupied and which are unknown."""
    value = document.value
    mode = value.get("mode", "trinary")
    transparent = np.isnan(grey)
    if mode == "raw":
        percent = np.rint(grey)
        return (percent >= 50) & (percent <= 100), transparent | (percent > 100)
    free, full = (
        float(value.get("free_thresh", FREE_THRESH)),
        float(value.get("occupied_thresh", OCCUPIED_THRESH)),
    )
    if free >= full:
        raise document.error(
            ("free_thresh",), f"must be less than occupied_thresh ({full:g}), found {free:g}"
        )
    probability = grey / 255 if value.get("negate", 0) else (255 - grey) / 255
    if mode == "scale":
        return probability >= (free + full) / 2, transparent
    occupied = probability > full
    unknown = transparent | (np.abs(grey - UNKNOWN_GREY) <= level_error) & ~occupied
    return occupied, unknown | ~occupied & ~(probability < free)
