"""When the valves started, from the first motion of the markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from srs_opt.errors import NoAnswerError
from srs_opt.geometry import turn_onto
from srs_opt.measurement.chain import Chain, chain_of, marker_positions
from srs_opt.measurement.noise import noise_sd
from srs_opt.measurement.records import Array
from srs_opt.measurement.run_in import likely_start_s, run_in_s
from srs_opt.measurement.spots import Spots
from srs_opt.measurement.take_settings import ONSET
from srs_opt.measurement.valve_wave import ValveWave, first_curvatures
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Onset:
    """Start of the valves on the camera's clock; a dead time of the valves is part of it.

    `doubt` says why the start is bracketed by the first motion; empty when the fit stands. `moving` tells
    that the take begins in mid-gait: then the start is that of a run-in of whole cycles before the take, or a
    later one. `left` is the share of the shapes' change that the fit leaves.
    """

    time_s: float
    sd_s: float
    doubt: str = ""
    moving: bool = False
    left: float = 0.0


def find_onset(
    robot: Robot, wave: ValveWave, time_s: Array, markers_m: Array, spots: Spots | None = None
) -> Onset:
    """Fit the shapes of the first cycles with those that the valve wave gives, whatever way the robot moves.

    Fitted are the start and factors on C0 and on the time constants; position and heading are free in every
    frame, so friction does not matter. The start lies within the take, at most the actuator's settling time
    before the first motion seen. Where the fit leaves too much, it is the middle of that bracket. The
    deviation counts neighbouring residuals as the correlated values that they are.

    Parameters
    ----------
    robot : Robot
        Its geometry, C0, tau_1 and tau_2.
    wave : ValveWave
        What the valves were told to do.
    time_s : ndarray, shape (T,)
    markers_m : ndarray, shape (T, M, 2)
        Tracks, in the order of `spots`, that begin before the motion does.
    spots : tuple of Spot, optional
        Where the markers sit; default on every link's centre.

    Raises
    ------
    NoAnswerError
        If the robot never moves or has no valve wave.
    """
    if not wave.frequency_hz > 0:
        raise NoAnswerError("without a valve wave the start cannot be found: give valve_start_s by hand")
    moving = first_motion(markers_m.reshape(len(markers_m), -1), noise_sd(markers_m))
    if moving is None:
        raise NoAnswerError("the markers never move: give valve_start_s by hand")
    if moving < ONSET.quiet_frames:
        return find_phase(robot, wave, time_s, markers_m, spots)
    running: Onset | None = None
    if _drifts(
        markers_m.reshape(len(markers_m), -1)[: max(moving // 2, ONSET.quiet_frames)], noise_sd(markers_m)
    ):
        running = find_phase(robot, wave, time_s, markers_m, spots)
        if not running.doubt:
            return running
    centre, settle = float(time_s[moving]), robot.tau1_s + robot.tau2_s
    window = (time_s > centre - 2 * settle) & (time_s < centre + ONSET.cycles / wave.frequency_hz)
    time, points = time_s[window], markers_m[window]
    low, high = max(centre - settle, float(time_s[0])), centre + float(np.median(np.diff(time_s)))
    grid = np.linspace(low, centre, ONSET.grid)
    found = _fitted(robot, wave, time, points, chain_of(robot, spots), grid, (low, high))
    bracket = float((high - low) / np.sqrt(12))  # the deviation of what lies anywhere in an interval
    if found.left > ONSET.most_left or found.edge:
        # the start may lie before the first frame, and what was taken for rest be the slow first bend
        running = running or find_phase(robot, wave, time_s, markers_m, spots)
        if running.left < min(found.left, ONSET.most_left):
            return running
        reason = (
            found.complaint
            if found.left > ONSET.most_left
            else "the best start lies at the end of what the first motion allows"
        )
        return Onset((low + high) / 2, bracket, reason)
    return Onset(found.start_s, min(found.sd_s, bracket))


def find_phase(
    robot: Robot, wave: ValveWave, time_s: Array, markers_m: Array, spots: Spots | None = None
) -> Onset:
    """Return when the valves started, for a take that begins in motion.

    As `find_onset` fits the first cycles' shapes; every phase of the wave is tried, and that it has only just
    begun. Of the starts with the same phase, the first is whole cycles (`run_in_s`) before the take; a later
    one is taken where the body's first cycles say so.
    """
    period = 1 / wave.frequency_hz
    first = float(time_s[0])
    window = time_s < first + 2 * ONSET.cycles * period
    run_in = run_in_s(wave.frequency_hz)
    chain = chain_of(robot, spots)

    def fitted(latest: float, low: float, high: float) -> _Fitted:
        grid = latest - period * np.arange(ONSET.phases) / ONSET.phases
        return _fitted(robot, wave, time_s[window], markers_m[window], chain, grid, (low, high))

    latest = first - run_in
    running = fitted(latest, latest - 1.5 * period, latest + 0.5 * period)
    start = latest - (latest - running.start_s) % period
    just_begun = fitted(first, first - 1.25 * period, first)
    later = start + period * np.arange(round(run_in / period) + 1)
    starts = np.append(later[later < just_begun.start_s - period / 2], just_begun.start_s)
    noise = noise_sd(markers_m)
    chosen = likely_start_s(robot, wave, time_s, markers_m, spots, noise, starts)
    found = just_begun if chosen == just_begun.start_s else running
    bracket = float(period / np.sqrt(12))
    if found.left > ONSET.most_left:
        return Onset(chosen, bracket, found.complaint, True, found.left)
    return Onset(chosen, min(found.sd_s, bracket), "", True, found.left)


@dataclass(frozen=True)
class _Fitted:
    """Best start, its deviation, what is left of the shapes' change, whether it lies at a bound."""

    start_s: float
    sd_s: float
    left: float
    edge: bool

    @property
    def complaint(self) -> str:
        return f"the bends seen are not those of the gait ({100 * self.left:.0f} % of them are left)"


def _fitted(
    robot: Robot,
    wave: ValveWave,
    time: Array,
    points: Array,
    chain: Chain,
    grid: Array,
    limits: tuple[float, float],
) -> _Fitted:
    """Fit start, C0 and time constants to the shapes, from the best starts of `grid`."""
    from scipy.optimize import least_squares

    z = points[..., 0] + 1j * points[..., 1]

    def gaps(p: Array) -> Array:
        # p: start, factor on C_0, factor on both time constants of (14)
        kappa = p[1] * first_curvatures(robot, wave, time - p[0], p[2])
        return _shape_gaps(chain, kappa, z)

    low, high = limits
    costs = [float((gaps(np.array([start, 1.0, 1.0])) ** 2).sum()) for start in grid]
    least, most = ONSET.factor_range
    bounds = ([low, least, least], [high, most, most])
    fits = [
        least_squares(gaps, [grid[k], 1.0, 1.0], bounds=bounds, x_scale=[0.01, 0.1, 0.1], diff_step=1e-5)
        # the best start and the fourth best: the grid's neighbours lead to the same minimum
        for k in np.argsort(costs)[:6:3]
    ]
    fit = min(fits, key=lambda f: float(f.cost))
    still = _shape_gaps(chain, np.zeros((len(time), chain.links - 1)), z)
    left = float(np.sqrt(2 * fit.cost / max(float(still @ still), 1e-30)))
    # every frame has a turn and a shift of its own
    variance = 2 * fit.cost / max(len(fit.fun) - 3 * len(time) - 3, 1)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * variance * _correlated(fit.fun, len(time))
    edge = bool(min(fit.x[0] - low, high - fit.x[0]) < 1e-6)
    return _Fitted(float(fit.x[0]), float(np.sqrt(max(covariance[0, 0], 0.0))), left, edge)


def _correlated(residual: Array, frames: int) -> float:
    """Return by how much correlation from frame to frame raises a variance: (1 + r)/(1 - r), r at lag one."""
    rows = residual.reshape(2, frames, -1)
    r = float((rows[:, 1:] * rows[:, :-1]).sum() / max(float((rows**2).sum()), 1e-30))
    # 0.98: with r = 1 nothing would be known at all
    r = min(max(r, 0.0), 0.98)
    return (1 + r) / (1 - r)


def _shape_gaps(chain: Chain, kappa: Array, z: NDArray[np.complex128]) -> Array:
    """Return seen minus modelled positions after the best turn and shift of every frame, flat."""
    q = np.concatenate([np.zeros((len(kappa), 3)), kappa], axis=1)
    model = marker_positions(chain, q)
    seen = np.isfinite(z)
    count = np.maximum(seen.sum(axis=1, keepdims=True), 1)
    z = np.where(seen, z, 0.0)
    m = np.where(seen, model[..., 0] + 1j * model[..., 1], 0.0)
    z = np.where(seen, z - z.sum(axis=1, keepdims=True) / count, 0.0)
    m = np.where(seen, m - m.sum(axis=1, keepdims=True) / count, 0.0)
    gap = z - np.exp(1j * turn_onto(m, z, axis=1))[:, None] * m
    return np.concatenate([gap.real.ravel(), gap.imag.ravel()])


def _drifts(flat: Array, sd: float) -> bool:
    """Whether coordinates (T, n) that ought to be at rest show a trend beyond their noise."""
    flat = flat[:, np.isfinite(flat).all(axis=0)]
    if not flat.size:
        return False
    steps = np.arange(len(flat)) - (len(flat) - 1) / 2
    trend = steps @ flat / (steps @ steps)
    # of noise alone: trends over their deviations, squared, one per coordinate
    chi2 = float((trend**2).sum() * (steps @ steps)) / max(sd, 1e-9) ** 2
    drifts: bool = chi2 > flat.shape[1] + ONSET.drift_sd * np.sqrt(2 * flat.shape[1])
    return drifts


def first_motion(flat: Array, sd: float) -> int | None:
    """Return the frame from which on the coordinates leave their rest (three frames in a row)."""
    import warnings

    rest = np.full(flat.shape[1], np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", category=RuntimeWarning)  # a marker lost throughout the rest
        rest = np.nanmedian(flat[: ONSET.quiet_frames], axis=0)
        off = np.nanmax(np.abs(flat - rest), axis=1)
    beyond = np.nan_to_num(off) > ONSET.threshold_sd * max(sd, 1e-9)
    run = beyond[:-2] & beyond[1:-1] & beyond[2:]
    return int(np.argmax(run)) if run.any() else None
