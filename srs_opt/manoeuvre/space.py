"""The room that the body keeps to: a polygon, and how far inside of it points lie."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from srs_opt.document import load_schema, read_yaml, validate
from srs_opt.errors import InputError


@dataclass(frozen=True, eq=False)
class Space:
    """A region of the plane in the frame of the start: origin at the centre of mass, x along the heading.

    Attributes
    ----------
    region : shapely geometry
    """

    region: Any

    def depth(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far inside (negative: outside) points (n, 2) lie, m, and the derivative by the point."""
        edge = self.region.boundary
        at = shapely.points(points)
        nearest = shapely.get_coordinates(
            shapely.line_interpolate_point(edge, shapely.line_locate_point(edge, at))
        )
        away = points - nearest
        distance = np.hypot(*away.T)
        side = np.where(shapely.contains_properly(self.region, at), 1.0, -1.0)
        jacobian = side[:, None] * away / np.maximum(distance, 1e-9)[:, None]
        return side * distance, jacobian


def load_space(path: str) -> Space:
    """Read a space file (schema: space.schema.json): a polygon, or a corridor along a line.

    Raises
    ------
    InputError
        If the file is no such thing or its outline crosses itself.
    """
    document = read_yaml(path, "a space (polygon or corridor)")
    validate(document, load_schema("srs_opt.manoeuvre", "space.schema.json"))
    record = document.value
    if "polygon" in record:
        region = shapely.Polygon(record["polygon"])
        key = "polygon"
    else:
        key = "corridor"
        corridor = record["corridor"]
        line = shapely.LineString(corridor["line"])
        region = line.buffer(corridor["width_m"] / 2, cap_style="flat", join_style="mitre")
    if (
        not region.is_valid
        or region.is_empty
        or region.geom_type != "Polygon"
        or not math.isfinite(region.area)
    ):
        raise document.error((key,), "the outline crosses itself or holds no area")
    return Space(region)


__all__ = ["InputError", "Space", "load_space"]
