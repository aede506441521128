"""Shape over time by an optimal smoother: pose, curvatures and their rates, with standard deviations.

Prior: every component of the configuration is an integrated Wiener process (its rate is a random walk) of
some intensity. Given the markers, the most probable path is found by Gauss-Newton on all frames at once
(an iterated Rauch-Tung-Striebel smoother in information form: block-tridiagonal, so the work grows with the
number of frames), and the intensities are those of greatest marginal likelihood (Laplace).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.chain import Chain, chain_of, marker_jacobian
from srs_opt.measurement.fit_settings import SHAPE, SMOOTHER
from srs_opt.measurement.records import Array
from srs_opt.measurement.shape import first_guess, residuals
from srs_opt.measurement.spots import Spots
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Intensity:
    """Intensities of the driving noise: m^2/s^3, rad^2/s^3, 1/(m^2 s^3)."""

    position: float
    heading: float
    curvature: float

    def per_component(self, chain: Chain) -> Array:
        """Return one intensity per component of a configuration."""
        return np.array([self.position] * 2 + [self.heading] + [self.curvature] * (chain.links - 1))


@dataclass(frozen=True, eq=False)
class SmoothShape:
    """Smoothed motion of the robot; every ``..._sd`` is a posterior standard deviation.

    Attributes
    ----------
    time_s : ndarray, shape (T,)
    centre_m, velocity_m_s : ndarray, shape (T, 2)
    heading_rad, turn_rate_rad_s : ndarray, shape (T,)
    curvature_1_m, curvature_rate_1_ms : ndarray, shape (T, N-1)
    sd : ndarray, shape (T, 2 (N+2))
        Standard deviations of (centre, heading, curvatures) and then of their rates.
    covariance : ndarray, shape (T, 2 (N+2), 2 (N+2))
    intensity : Intensity
    """

    time_s: Array
    centre_m: Array
    velocity_m_s: Array
    heading_rad: Array
    turn_rate_rad_s: Array
    curvature_1_m: Array
    curvature_rate_1_ms: Array
    covariance: Array
    intensity: Intensity

    @property
    def sd(self) -> Array:
        """Return the standard deviations of configuration and rates."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def curvature_sd_1_m(self) -> Array:
        """Return the standard deviation of each curvature, shape (T, N-1)."""
        n = 3 + self.curvature_1_m.shape[1]
        return self.sd[:, 3:n]


@dataclass(frozen=True, eq=False)
class _Problem:
    """Markers of one trial and what the smoother needs to know of them."""

    chain: Chain
    time_s: Array
    points: Array
    sd: float

    def part(self, frames: int) -> _Problem:
        return _Problem(self.chain, self.time_s[:frames], self.points[:frames], self.sd)


def smooth_shape(
    robot: Robot,
    time_s: Array,
    markers_m: Array,
    marker_sd_m: float,
    intensity: Intensity | None = None,
    spots: Spots | None = None,
) -> SmoothShape:
    """Smooth the shape over a trial.

    Parameters
    ----------
    robot : Robot
    time_s : ndarray, shape (T,)
        Increasing; gaps are allowed.
    markers_m : ndarray, shape (T, M, 2)
        In the order of `spots`, NaN where lost.
    marker_sd_m : float
    intensity : Intensity, optional
        Of the prior; found by maximum likelihood when not given (give it to smooth many trials alike).
    spots : tuple of Spot, optional
        Where the markers sit; default on every link's centre, tail to head.

    Raises
    ------
    InputError
        If time does not increase or there are fewer than four frames.
    """
    time, points = np.asarray(time_s, dtype=float), np.asarray(markers_m, dtype=float)
    if len(time) < 4 or not np.all(np.diff(time) > 0):
        raise InputError("smoothing needs four or more frames with increasing times")
    problem = _Problem(chain_of(robot, spots), time, points, marker_sd_m)
    if intensity is None:
        intensity = likeliest_intensity(problem)
    z, blocks = _most_probable(problem, intensity.per_component(problem.chain), _start(problem))
    n = problem.chain.unknowns
    return SmoothShape(
        time_s=time,
        centre_m=z[:, :2],
        velocity_m_s=z[:, n : n + 2],
        heading_rad=z[:, 2],
        turn_rate_rad_s=z[:, n + 2],
        curvature_1_m=z[:, 3:n],
        curvature_rate_1_ms=z[:, n + 3 :],
        covariance=_marginals(*blocks),
        intensity=intensity,
    )


def likeliest_intensity(problem: _Problem) -> Intensity:
    """Return the intensities of greatest marginal likelihood (first few seconds of the trial)."""
    from scipy.optimize import minimize

    part = problem.part(SMOOTHER.tuning_frames)
    state = {"z": _start(part)}

    def cost(log10: np.ndarray) -> float:
        # a simplex may wander: its intensities stay numbers
        spread = Intensity(*(10.0 ** np.clip(log10, -8, 12))).per_component(part.chain)
        z, (diagonal, coupling) = _most_probable(
            part, spread, state["z"], iterations=SMOOTHER.tuning_iterations
        )
        # a warm start for the next intensities, which are near
        state["z"] = z
        factor = _banded_cholesky(diagonal, coupling)
        log_det = 2 * np.log(factor[0]).sum()
        # log det of the prior's precision, as it depends on the intensities: spread^-2 per step and component
        prior_log_det = -2 * (len(z) - 1) * np.log(spread).sum()
        return float(_objective(part, spread, z) + log_det - prior_log_det) / 2

    start = np.array(SMOOTHER.start_log10)
    simplex = start + np.vstack([np.zeros(3), np.eye(3)])
    options: dict[str, Any] = {"xatol": 0.05, "fatol": 0.2, "maxfev": 80, "initial_simplex": simplex}
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    return Intensity(*(float(v) for v in 10.0**found.x))


def _start(problem: _Problem) -> Array:
    guess = first_guess(problem.chain, problem.points)
    return np.column_stack([guess, np.zeros_like(guess)])


def _first_prior(problem: _Problem) -> tuple[Array, Array]:
    """Return mean and precision of the first state: near the first guess, slow, hardly bent."""
    chain = problem.chain
    bend = SHAPE.prior_bend_rad / chain.segment_length_m
    sds = [SHAPE.far_m, SHAPE.far_m, SHAPE.far_rad, *[bend] * (chain.links - 1)]
    rates = [1.0, 1.0, 10.0, *[20 * bend] * (chain.links - 1)]
    return np.zeros(2 * chain.unknowns), np.array([*sds, *rates]) ** -2.0


def _transition_gap(problem: _Problem, z: Array) -> tuple[Array, Array, Array]:
    """Return steps dt (T-1, 1) and what q and its rate do beyond coasting."""
    n, step = problem.chain.unknowns, np.diff(problem.time_s)[:, None]
    q, rate = z[:, :n], z[:, n:]
    return step, q[1:] - q[:-1] - step * rate[:-1], rate[1:] - rate[:-1]


def _objective(problem: _Problem, spread: Array, z: Array) -> float:
    """Return minus twice the log posterior, up to a constant."""
    mean, precision = _first_prior(problem)
    step, a, b = _transition_gap(problem, z)
    # w' W w with W the inverse covariance of an integrated Wiener process, see `_prior_blocks`
    process = ((12 / step**3) * a**2 - (12 / step**2) * a * b + (4 / step) * b**2) / spread
    misfit = residuals(problem.chain, problem.points, z[:, : problem.chain.unknowns])
    return float((misfit**2).sum() / problem.sd**2 + process.sum() + ((z[0] - mean) ** 2 * precision).sum())


def _most_probable(
    problem: _Problem, spread: Array, start: Array, iterations: int | None = None
) -> tuple[Array, tuple[Array, Array]]:
    """Return the most probable path (T, 2n) and the blocks of its information matrix."""
    iterations = SMOOTHER.iterations if iterations is None else iterations
    z, cost, damping = start, _objective(problem, spread, start), 1e-6
    prior_blocks = _prior_blocks(problem, spread)
    blocks, gradient = _linearise(problem, spread, z, prior_blocks)
    for _ in range(iterations):
        step = _solve(blocks[0], blocks[1], gradient, damping)
        new_cost = _objective(problem, spread, z + step)
        if new_cost <= cost:
            gain, z, cost = cost - new_cost, z + step, new_cost
            damping = max(damping * 0.1, 1e-9)
            blocks, gradient = _linearise(problem, spread, z, prior_blocks)
            if gain < SMOOTHER.least_gain:
                break
        else:
            damping *= 30.0
            if damping > 1e6:
                break
    return z, blocks


def _prior_blocks(problem: _Problem, spread: Array) -> tuple[Array, Array]:
    """Return the prior's information: diagonal blocks (T, 2n, 2n), blocks (k, k+1) (T-1, 2n, 2n)."""
    n, frames = problem.chain.unknowns, len(problem.time_s)
    step = np.diff(problem.time_s)[:, None]
    # inverse of spread [[dt^3/3, dt^2/2], [dt^2/2, dt]], the covariance of an integrated Wiener process
    qq, qr, rr = 12 / step**3 / spread, -6 / step**2 / spread, 4 / step / spread
    diagonal, coupling = np.zeros((frames, 2 * n, 2 * n)), np.zeros((frames - 1, 2 * n, 2 * n))
    i, j = np.arange(n), np.arange(n) + n
    _, precision = _first_prior(problem)
    diagonal[0] = np.diag(precision)
    # w = z_{k+1} - F z_k with F = [[1, dt], [0, 1]]: information F^T W F, -F^T W, W
    diagonal[1:, i, i] += qq
    diagonal[1:, i, j] += qr
    diagonal[1:, j, i] += qr
    diagonal[1:, j, j] += rr
    mixed, rates = step * qq + qr, step**2 * qq + 2 * step * qr + rr
    diagonal[:-1, i, i] += qq
    diagonal[:-1, i, j] += mixed
    diagonal[:-1, j, i] += mixed
    diagonal[:-1, j, j] += rates
    coupling[:, i, i] = -qq
    coupling[:, i, j] = -qr
    coupling[:, j, i] = -mixed
    coupling[:, j, j] = -(step * qr + rr)
    return diagonal, coupling


def _linearise(
    problem: _Problem, spread: Array, z: Array, prior: tuple[Array, Array]
) -> tuple[tuple[Array, Array], Array]:
    """Return the information matrix's blocks at `z` and minus half the gradient of the objective there."""
    chain, n = problem.chain, problem.chain.unknowns
    diagonal, coupling = prior[0].copy(), prior[1]
    mean, precision = _first_prior(problem)
    gradient = -(prior[0] @ z[..., None])[..., 0]
    gradient[:-1] -= (coupling @ z[1:, :, None])[..., 0]
    gradient[1:] -= (coupling.transpose(0, 2, 1) @ z[:-1, :, None])[..., 0]
    gradient[0] += precision * mean
    jacobian = marker_jacobian(chain, z[:, :n]) * np.isfinite(problem.points)[..., None]
    jacobian = jacobian.reshape(len(z), -1, n)
    transposed = jacobian.transpose(0, 2, 1) / problem.sd**2
    diagonal[:, :n, :n] += transposed @ jacobian
    gradient[:, :n] += (transposed @ residuals(chain, problem.points, z[:, :n])[..., None])[..., 0]
    return (diagonal, coupling), gradient


def _banded(diagonal: Array, coupling: Array) -> Array:
    """Return the block-tridiagonal matrix in LAPACK's lower banded form."""
    frames, size = diagonal.shape[:2]
    # a[i, j] stands at band[i - j, j]; below the diagonal blocks stands the coupling's transpose
    band = np.zeros((2 * size, frames, size))
    for row in range(size):
        for column in range(row + 1):
            band[row - column, :, column] = diagonal[:, row, column]
        for column in range(size):
            band[size + row - column, :-1, column] = coupling[:, column, row]
    return band.reshape(2 * size, frames * size)


def _banded_cholesky(diagonal: Array, coupling: Array) -> Array:
    from scipy.linalg import cholesky_banded

    return np.asarray(cholesky_banded(_banded(diagonal, coupling), lower=True, check_finite=False))


def _solve(diagonal: Array, coupling: Array, gradient: Array, damping: float) -> Array:
    from scipy.linalg import cho_solve_banded

    size = diagonal.shape[1]
    damped = diagonal.copy()
    # Levenberg-Marquardt, relative to the diagonal
    damped[:, np.arange(size), np.arange(size)] *= 1 + damping
    factor = _banded_cholesky(damped, coupling)
    step = cho_solve_banded((factor, True), gradient.ravel(), check_finite=False)
    return np.asarray(step).reshape(gradient.shape)


def _marginals(diagonal: Array, coupling: Array) -> Array:
    """Return the covariance of each frame's state: the diagonal blocks of the inverse."""
    frames = len(diagonal)
    inverse = np.empty_like(diagonal)
    gains = np.empty_like(coupling)
    inverse[0] = np.linalg.inv(diagonal[0])
    for k in range(frames - 1):
        # forward elimination, then the smoother's backward pass
        gains[k] = inverse[k] @ coupling[k]
        inverse[k + 1] = np.linalg.inv(diagonal[k + 1] - coupling[k].T @ gains[k])
    covariance = inverse
    # in place from the end: entry k needs k + 1 and its own filtered value only
    for k in range(frames - 2, -1, -1):
        covariance[k] = inverse[k] + gains[k] @ covariance[k + 1] @ gains[k].T
    symmetric: Array = (covariance + covariance.transpose(0, 2, 1)) / 2
    return symmetric
