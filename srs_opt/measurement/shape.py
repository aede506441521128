"""Shape from markers (paper, 3.3): pose and curvatures per frame, by least squares on the chain's geometry.

N + 2 unknowns stand against 2 N coordinates, yet one combination of curvatures is hard to see: bending
neighbours in opposite directions leaves all chord directions alone and shows only in the chords' lengths,
to second order. A weak prior on curvature keeps such frames finite; `Shape.determined` names them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.chain import Chain, chain_of, link_positions, position_jacobian
from srs_opt.measurement.records import Array
from srs_opt.robot import Robot

PRIOR_BEND_RAD = 0.5
FAR_M, FAR_RAD = 1e3, 1e2
ITERATIONS = 40


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
    robot: Robot, markers_m: Array, marker_sd_m: float, prior_sd_1_m: float | None = None
) -> Shape:
    """Fit pose and curvatures to each frame.

    Parameters
    ----------
    robot : Robot
    markers_m : ndarray, shape (T, N, 2)
        Tail to head, NaN where lost (put swapped labels right first, `srs_opt.measurement.labels`).
    marker_sd_m : float
        Standard deviation of a coordinate.
    prior_sd_1_m : float, optional
        Standard deviation of the weak prior on curvature; default half a radian of bend per segment.

    Raises
    ------
    InputError
        If the array does not fit the robot or holds no position at all.
    """
    chain = chain_of(robot)
    points = np.asarray(markers_m, dtype=float)
    if points.ndim != 3 or points.shape[1:] != (chain.links, 2):
        raise InputError(f"markers of shape {points.shape}: expected (frames, {chain.links}, 2)")
    if not np.isfinite(points).any():
        raise InputError("every marker is lost in every frame: there is no shape to find")
    if prior_sd_1_m is None:
        prior_sd_1_m = PRIOR_BEND_RAD / chain.segment_length_m
    start = first_guess(chain, points)
    prior = np.array([FAR_M**-2, FAR_M**-2, FAR_RAD**-2, *[prior_sd_1_m**-2] * (chain.links - 1)])
    q, cost = _levenberg_marquardt(chain, points, marker_sd_m, prior, start)
    information, _ = _normal_equations(chain, points, marker_sd_m, q)
    covariance: Array = np.linalg.inv(information + np.diag(prior)).astype(float)
    spread = np.linalg.eigvalsh(covariance[:, 3:, 3:])[:, -1] / prior_sd_1_m**2
    misfit = cost - (q**2 * prior).sum(axis=1)
    return Shape(q[:, :2], q[:, 2], q[:, 3:], covariance, misfit, spread < 0.5, float(prior_sd_1_m))


def residuals(chain: Chain, points: Array, q: Array) -> Array:
    """Return measured minus modelled coordinates, zero where lost, shape (T, 2 N)."""
    gap = points - link_positions(chain, q)
    return np.where(np.isfinite(gap), gap, 0.0).reshape(len(points), -1)


def _normal_equations(chain: Chain, points: Array, sd: float, q: Array) -> tuple[Array, Array]:
    """Return J^T J / sd^2, shape (T, n, n), and J^T residual / sd^2, shape (T, n), over the seen markers."""
    jacobian = position_jacobian(chain, q) * np.isfinite(points)[..., None]
    jacobian = jacobian.reshape(len(points), -1, chain.unknowns)
    transposed = jacobian.transpose(0, 2, 1) / sd**2
    return transposed @ jacobian, (transposed @ residuals(chain, points, q)[..., None])[..., 0]


def _cost(chain: Chain, points: Array, sd: float, prior: Array, q: Array) -> Array:
    return (residuals(chain, points, q) ** 2).sum(axis=1) / sd**2 + (q**2 * prior).sum(axis=1)


def _levenberg_marquardt(
    chain: Chain, points: Array, sd: float, prior: Array, start: Array
) -> tuple[Array, Array]:
    """Minimise every frame's misfit plus prior, each with its own damping; return q and the cost."""
    q, damping = start.copy(), np.full(len(points), 1e-3)
    cost = _cost(chain, points, sd, prior, q)
    active = np.arange(len(points))
    for _ in range(ITERATIONS):
        matrix, slope = _normal_equations(chain, points[active], sd, q[active])
        matrix = matrix + np.diag(prior)
        slope = slope - q[active] * prior
        scale = np.diagonal(matrix, axis1=1, axis2=2) * damping[active, None]
        step = np.linalg.solve(matrix + scale[..., None] * np.eye(len(prior)), slope[..., None])[..., 0]
        trial = q[active] + step
        new = _cost(chain, points[active], sd, prior, trial)
        better = new <= cost[active]
        gain = cost[active] - new
        q[active[better]], cost[active[better]] = trial[better], new[better]
        damping[active] *= np.where(better, 0.1, 10.0)
        active = active[~(better & (gain < 1e-6)) & (damping[active] < 1e8)]
        if not len(active):
            break
    return q, cost


def first_guess(chain: Chain, points: Array) -> Array:
    """Return configurations that match the chords' directions with the least curvature, shape (T, N + 2).

    A chord points along the mean heading of its two links, whatever the gap: N-1 linear equations for N
    headings, the missing one being the least sum of squared curvatures.
    """
    filled = _fill(chain, points)
    chords = np.diff(filled, axis=1)
    direction = np.unwrap(np.arctan2(chords[..., 1], chords[..., 0]), axis=1)
    turns = np.diff(direction, axis=1)
    n = chain.links
    mean_of_pairs = (np.eye(n - 2, n - 1) + np.eye(n - 2, n - 1, 1)) * chain.segment_length_m / 2
    curvature = turns @ np.linalg.pinv(mean_of_pairs).T
    relative = np.column_stack([np.zeros(len(turns)), np.cumsum(curvature * chain.segment_length_m, axis=1)])
    pairs = (relative[:, :-1] + relative[:, 1:]) / 2
    heading = (direction - pairs).mean(axis=1) + relative.mean(axis=1)
    return np.column_stack([filled.mean(axis=1), np.unwrap(heading), curvature])


def _fill(chain: Chain, points: Array) -> Array:
    """Fill lost positions for the first guess: along time, then along the chain."""
    filled = points.copy()
    frames = np.arange(len(points))
    for marker in range(chain.links):
        seen = np.isfinite(points[:, marker, 0])
        for axis in range(2) if seen.any() else ():
            filled[:, marker, axis] = np.interp(frames, frames[seen], points[seen, marker, axis])
    present = np.flatnonzero(np.isfinite(filled[0, :, 0]))
    if len(present) == chain.links:
        return filled
    if len(present) == 1:  # nothing tells the heading: lay the chain along x
        place = (np.arange(chain.links) - present[0]) * chain.pitch_m
        return np.asarray(filled[:, present] + np.stack([place, 0 * place], axis=-1))
    for marker in set(range(chain.links)) - set(present.tolist()):
        below, above = present[present < marker], present[present > marker]
        a, b = (below[-1], above[0]) if len(below) and len(above) else present[[0, -1]]
        share = (marker - a) / (b - a)
        filled[:, marker] = (1 - share) * filled[:, a] + share * filled[:, b]
    return filled
