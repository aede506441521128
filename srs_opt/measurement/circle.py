"""Circle through a track (paper, Fig. 10): Taubin's algebraic fit, then geometric least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.measurement.records import Array


@dataclass(frozen=True)
class Circle:
    """A fitted circle.

    Attributes
    ----------
    centre_m : (float, float)
    radius_m : float
        Signed: + when the track runs counter-clockwise (to the left).
    radius_sd_m : float
        Standard deviation for independent errors of the points.
    residual_m : float
        Root mean square distance of the points from the circle.
    arc_rad : float
        Angle that the track covers; short arcs tell little about the radius.
    """

    centre_m: tuple[float, float]
    radius_m: float
    radius_sd_m: float
    residual_m: float
    arc_rad: float


def fit_circle(points_m: Array) -> Circle:
    """Fit a circle to points in order of time, shape (T, 2); NaN rows are left out.

    Raises
    ------
    InputError
        If there are fewer than four points.
    NoAnswerError
        If the points lie on a line.
    """
    points = np.asarray(points_m, dtype=float)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 4:
        raise InputError(f"a circle needs four or more points, found {len(points)}")
    from scipy.optimize import least_squares

    middle = points.mean(axis=0)
    # centred and of unit size: squares of coordinates far from the origin would cancel
    scale = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean())) or 1.0
    unit = (points - middle) / scale

    def gaps(p: Array) -> Array:
        return np.asarray(np.hypot(unit[:, 0] - p[0], unit[:, 1] - p[1]) - p[2])

    start = taubin(unit)
    fit = least_squares(gaps, start, method="lm", x_scale=[1.0, 1.0, 1.0])
    a, b, radius = fit.x
    # ten thousand times the track's size is a line
    if not fit.success or not np.isfinite(fit.x).all() or radius > 1e4:
        raise NoAnswerError("the points lie on a straight line: no circle fits them")
    # least_squares' cost is half the sum of squares
    variance = 2 * fit.cost / (len(unit) - 3)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * variance
    angle = np.unwrap(np.arctan2(unit[:, 1] - b, unit[:, 0] - a))
    # the trend of the angle tells the sense of turning, whatever single steps do
    turn = float(np.polyfit(np.arange(len(angle)), angle, 1)[0])
    return Circle(
        centre_m=(float(a * scale + middle[0]), float(b * scale + middle[1])),
        radius_m=float(np.copysign(radius * scale, turn)),
        radius_sd_m=float(np.sqrt(covariance[2, 2]) * scale),
        residual_m=float(np.sqrt((fit.fun**2).mean()) * scale),
        arc_rad=float(np.ptp(angle)),
    )


def taubin(points: Array) -> Array:
    """Return centre and radius of Taubin's algebraic fit (1991) by singular values, shape (3,)."""
    middle = points.mean(axis=0)
    centred = points - middle
    square = (centred**2).sum(axis=1)
    mean = float(square.mean())
    if mean == 0:
        raise NoAnswerError("all points are the same: no circle fits them")
    # least singular vector of (z, x, y) with the squares z centred and scaled: Taubin's normalisation
    table = np.column_stack([(square - mean) / (2 * np.sqrt(mean)), centred])
    _, _, right = np.linalg.svd(table, full_matrices=False)
    a = right[2].copy()
    a[0] /= 2 * np.sqrt(mean)
    if abs(a[0]) < 1e-12:
        raise NoAnswerError("the points lie on a straight line: no circle fits them")
    offset = -mean * a[0]
    centre = -a[1:] / (2 * a[0])
    radius = np.sqrt(a[1] ** 2 + a[2] ** 2 - 4 * a[0] * offset) / (2 * abs(a[0]))
    return np.array([*(centre + middle), radius])
