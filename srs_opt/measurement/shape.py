"""Shape from markers (paper, 3.3): pose and curvatures per frame, by least squares on the chain's geometry.

N + 2 unknowns stand against 2 N coordinates, yet one combination of curvatures is hard to see: bending
neighbours in opposite directions leaves all chord directions alone and shows only in the chords' lengths,
to second order. A weak prior on curvature keeps such frames finite; `Shape.determined` names them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.chain import (
    Chain,
    chain_of,
    headings,
    link_positions,
    marker_jacobian,
    marker_positions,
)
from srs_opt.measurement.fit_settings import SHAPE
from srs_opt.measurement.records import Array
from srs_opt.measurement.spots import Spots
from srs_opt.robot import Robot


@dataclass(frozen=True, eq=False)
class Shape:
    """Pose and curvatures frame by frame.

    Attributes
    ----------
    centre_m : ndarray, shape (T, 2)
        Centre of mass of the links.
    heading_rad : ndarray, shape (T,)
        Mean heading, continuous in time.
    curvature_1_m : ndarray, shape (T, N-1)
        Segment curvatures, tail to head.
    covariance : ndarray, shape (T, N+2, N+2)
        Of (p_x, p_y, theta, kappa_1 ...), prior included.
    misfit : ndarray, shape (T,)
        Sum of squared residuals over the marker variance.
    determined : ndarray of bool, shape (T,)
        False where some combination of curvatures owes more to the prior than to the markers.
    prior_sd_1_m : float
        Standard deviation of the curvature prior.
    """

    centre_m: Array
    heading_rad: Array
    curvature_1_m: Array
    covariance: Array
    misfit: Array
    determined: np.ndarray
    prior_sd_1_m: float

    @property
    def configuration(self) -> Array:
        """Return (p_x, p_y, theta, kappa ...) per frame, shape (T, N+2)."""
        return np.column_stack([self.centre_m, self.heading_rad, self.curvature_1_m])

    @property
    def curvature_sd_1_m(self) -> Array:
        """Return the standard deviation of each curvature, shape (T, N-1)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)[:, 3:])


def shape_from_markers(
    robot: Robot,
    markers_m: Array,
    marker_sd_m: float,
    prior_sd_1_m: float | None = None,
    spots: Spots | None = None,
) -> Shape:
    """Fit pose and curvatures to each frame.

    Parameters
    ----------
    robot : Robot
    markers_m : ndarray, shape (T, M, 2)
        In the order of `spots`, NaN where lost; swapped labels are put right first
        (`srs_opt.measurement.labels`).
    marker_sd_m : float
        Standard deviation of a coordinate.
    prior_sd_1_m : float, optional
        Standard deviation of the weak prior on curvature; default half a radian of bend per segment.
    spots : tuple of Spot, optional
        Where the markers sit; default on every link's centre, tail to head.

    Raises
    ------
    InputError
        If the array does not fit the robot or holds no position at all.
    """
    chain = chain_of(robot, spots)
    points = np.asarray(markers_m, dtype=float)
    if points.ndim != 3 or points.shape[1:] != (chain.markers, 2):
        raise InputError(f"markers of shape {points.shape}: expected (frames, {chain.markers}, 2)")
    if not np.isfinite(points).any():
        raise InputError("every marker is lost in every frame: there is no shape to find")
    if prior_sd_1_m is None:
        prior_sd_1_m = SHAPE.prior_bend_rad / chain.segment_length_m
    start = first_guess(chain, points)
    # next to no prior on place and heading, a weak one on curvature
    prior = np.array(
        [SHAPE.far_m**-2, SHAPE.far_m**-2, SHAPE.far_rad**-2, *[prior_sd_1_m**-2] * (chain.links - 1)]
    )
    q, cost = _levenberg_marquardt(chain, points, marker_sd_m, prior, start)
    information, _ = _normal_equations(chain, points, marker_sd_m, q)
    covariance: Array = np.linalg.inv(information + np.diag(prior)).astype(float)
    # posterior over prior variance in the direction that is known least: near 1 the markers tell nothing of
    # it
    spread = np.linalg.eigvalsh(covariance[:, 3:, 3:])[:, -1] / prior_sd_1_m**2
    # the markers' part of the cost alone
    misfit = cost - (q**2 * prior).sum(axis=1)
    told = spread < SHAPE.undetermined_share
    return Shape(q[:, :2], q[:, 2], q[:, 3:], covariance, misfit, told, float(prior_sd_1_m))


def residuals(chain: Chain, points: Array, q: Array) -> Array:
    """Return measured minus modelled coordinates, zero where lost, shape (T, 2 M)."""
    gap = points - marker_positions(chain, q)
    # a lost marker pulls at nothing
    return np.where(np.isfinite(gap), gap, 0.0).reshape(len(points), -1)


def _normal_equations(chain: Chain, points: Array, sd: float, q: Array) -> tuple[Array, Array]:
    """Return J^T J / sd^2, shape (T, n, n), and J^T residual / sd^2, shape (T, n), over the seen markers."""
    jacobian = marker_jacobian(chain, q) * np.isfinite(points)[..., None]
    jacobian = jacobian.reshape(len(points), -1, chain.unknowns)
    transposed = jacobian.transpose(0, 2, 1) / sd**2
    return transposed @ jacobian, (transposed @ residuals(chain, points, q)[..., None])[..., 0]


def _cost(chain: Chain, points: Array, sd: float, prior: Array, q: Array) -> Array:
    cost: Array = (residuals(chain, points, q) ** 2).sum(axis=1) / sd**2 + (q**2 * prior).sum(axis=1)
    return cost


def _levenberg_marquardt(
    chain: Chain, points: Array, sd: float, prior: Array, start: Array
) -> tuple[Array, Array]:
    """Minimise every frame's misfit plus prior, each with its own damping; return q and the cost."""
    q, damping = start.copy(), np.full(len(points), 1e-3)
    cost = _cost(chain, points, sd, prior, q)
    active = np.arange(len(points))
    for _ in range(SHAPE.iterations):
        matrix, gradient = _normal_equations(chain, points[active], sd, q[active])
        matrix = matrix + np.diag(prior)
        gradient = gradient - q[active] * prior
        # Marquardt: relative to the diagonal, as lengths, angles and curvatures stand side by side
        scale = np.diagonal(matrix, axis1=1, axis2=2) * damping[active, None]
        step = np.linalg.solve(matrix + scale[..., None] * np.eye(len(prior)), gradient[..., None])[..., 0]
        trial = q[active] + step
        new = _cost(chain, points[active], sd, prior, trial)
        better = new <= cost[active]
        gain = cost[active] - new
        q[active[better]], cost[active[better]] = trial[better], new[better]
        damping[active] *= np.where(better, 0.1, 10.0)
        # frames that have settled, or cannot, take no further part
        active = active[~(better & (gain < SHAPE.least_gain)) & (damping[active] < 1e8)]
        if not len(active):
            break
    return q, cost


def first_guess(chain: Chain, points: Array) -> Array:
    """Return configurations that match the chords' directions with the least curvature, shape (T, N + 2).

    A chord between two places of the centre line points along the mean heading between them, to first order:
    M-1 linear equations for N headings, the missing ones being those of the least sum of squared curvatures.
    """
    filled, along = _on_centre_line(chain, _fill(chain, points))
    chords = np.diff(filled, axis=1)
    direction = np.unwrap(np.arctan2(chords[..., 1], chords[..., 0]), axis=1)
    turned = _turned(chain, along)
    # the pseudo-inverse gives the least squares' solution of least curvature
    curvature = np.diff(direction, axis=1) @ np.linalg.pinv(np.diff(turned, axis=0)).T
    # every chord tells the tail's heading, less what the curvatures have turned it by
    tail = (direction - curvature @ turned.T).mean(axis=1)
    q = np.column_stack([np.zeros((len(filled), 2)), np.zeros(len(filled)), curvature])
    q[:, 2] = np.unwrap(tail - headings(chain, q)[:, 0])
    q[:, :2] = (filled - _line_positions(chain, q, along)).mean(axis=1)
    return q


def _on_centre_line(chain: Chain, filled: Array) -> tuple[Array, Array]:
    """Return the means of markers at one place along the robot, in order, and the places, m from the tail."""
    # to 0.1 mm: markers on both sides of one place are one place
    along = np.round(chain.straight_m[:, 0], 4)
    places = np.unique(along)
    means = np.stack([filled[:, along == place].mean(axis=1) for place in places], axis=1)
    return means, places


def _turned(chain: Chain, along: Array) -> Array:
    """Return by how much curvatures turn the chord from each place to the next against the tail, (K-1, N-1).

    That is the mean, between the places, of the way gone through each chamber.
    """
    starts = np.arange(chain.links - 1) * chain.pitch_m + chain.gap_length_m / 2
    l = chain.segment_length_m

    def integral(s: Array) -> Array:  # of clip(s - start, 0, l)
        inside = np.clip(s[:, None] - starts, 0, l)
        return np.asarray(inside**2 / 2 + l * np.maximum(s[:, None] - starts - l, 0))

    return np.asarray(np.diff(integral(along), axis=0) / np.diff(along)[:, None])


def _line_positions(chain: Chain, q: Array, along: Array) -> Array:
    """Return the places `along` the centre line for configurations whose centre is at the origin."""
    links = link_positions(chain, q)
    nodes = np.arange(chain.links) * chain.pitch_m
    k = np.clip(np.searchsorted(nodes, along, side="right") - 1, 0, chain.links - 2)
    share = ((along - nodes[k]) / chain.pitch_m)[:, None]
    return np.asarray((1 - share) * links[:, k] + share * links[:, k + 1])


def _fill(chain: Chain, points: Array) -> Array:
    """Fill lost positions for the first guess: along time, then along the chain."""
    filled: Array = points.copy()
    frames, count = np.arange(len(points)), chain.markers
    for marker in range(count):
        seen = np.isfinite(points[:, marker, 0])
        for axis in range(2) if seen.any() else ():
            filled[:, marker, axis] = np.interp(frames, frames[seen], points[seen, marker, axis])
    present = np.flatnonzero(np.isfinite(filled[0, :, 0]))
    if len(present) == count:
        return filled
    straight = chain.straight_m
    if len(present) == 1:  # nothing tells the heading: lay the chain along x
        return np.asarray(filled[:, present] + straight - straight[present])
    for marker in set(range(count)) - set(present.tolist()):
        below, above = present[present < marker], present[present > marker]
        a, b = (below[-1], above[0]) if len(below) and len(above) else present[[0, -1]]
        share = (straight[marker, 0] - straight[a, 0]) / ((straight[b, 0] - straight[a, 0]) or 1.0)
        filled[:, marker] = (1 - share) * filled[:, a] + share * filled[:, b]
    return filled
