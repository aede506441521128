"""How a fit goes: when it has converged, when it is given up, how steps are limited."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FitSettings:
    """Gauss-Newton with damping, on derivatives that are kept while they predict what a step gains.

    Attributes
    ----------
    iterations : int
        Of a calibration, at most.
    refit_iterations : int
        Of a fit that begins at the bench's values, because a trial is left out.
    converged_deviance : float
        That the derivatives still promise when a fit has ended: a fifth of a standard deviation. Double saves
        an iteration here and there and moves values by 0.3 of a deviation.
    unexplained_inflation : float
        Variance inflation from which on a fit does not explain the data, and need not be known well.
    rough_inflation : float
        Variance inflation above which a misfit hides the errors of a simulation `rough_tolerance` times as
        rough.
    rough_tolerance : float
        Times the tolerance of trials, for such fits.
    rough_gain_share : float
        Share of such a misfit that need not be gained.
    stale_gain_share : float
        Share of the misfit; derivatives of an earlier point that promise less are not worth a step.
    trusted_share : float
        Of the gain that derivatives promise: with no larger error they serve for the next step too. Smaller:
        derivatives, which cost five times a misfit, are taken more often; larger: more steps gain little.
    hopeless_deviance, hopeless_share : float
        Deviance, and share of the one to beat, that even the linearisation promises to stay behind it, where
        a fit is given up.
    least_iterations : int
        Before that is believed.
    catch_up_share : float
        Share of the distance to the one to beat that may be left after each step of a fit that catches up.
    damping_up, damping_down : float
        Factors on the damping after a step that lost, and after one whose derivatives were right.
    least_damping, first_damping, most_damping : float
        Relative to the diagonal: below the least none; the first after a step that lost; above the most a fit
        is given up.
    most_idle : int
        Steps that gain nothing, at which a fit is given up.
    scatter_parts : tuple of float
        Parts of a step that the scatter of a trial may go instead, whose misfit rose against what the
        derivatives promised.
    trials_per_diverging : int
        Only where that is no more than one trial in so many: else the step was too long.
    jitter_per_value : float
        Deviance per measured value that a new mesh of the integration may cost. Too small: jitter is taken
        for a loss, and the step is damped.
    """

    iterations: int = 12
    refit_iterations: int = 20
    converged_deviance: float = 0.05
    unexplained_inflation: float = 3.0
    rough_inflation: float = 25.0
    rough_tolerance: float = 5.0
    rough_gain_share: float = 0.01
    stale_gain_share: float = 0.03
    trusted_share: float = 0.25
    hopeless_deviance: float = 300.0
    hopeless_share: float = 0.1
    least_iterations: int = 2
    catch_up_share: float = 0.5
    damping_up: float = 4.0
    damping_down: float = 0.3
    least_damping: float = 0.001
    first_damping: float = 0.02
    most_damping: float = 1e4
    most_idle: int = 2
    scatter_parts: tuple[float, ...] = (0.5, 0.2, 0.0)
    trials_per_diverging: int = 3
    jitter_per_value: float = 2e-5


@dataclass(frozen=True)
class ObjectiveSettings:
    """Misfit, priors and scatter, and the step that derivatives ask for.

    Attributes
    ----------
    correlated_values : float
        Values of a track that a smooth misfit makes count as one. Half: parameters follow a wrong model's
        misfit further from the bench; double: fits that are nearly right stay near the bench.
    inflation_sd : float
        Standard deviations by which the misfit may exceed its expectation without that.
    longest_log_step : float
        Of a robot parameter's logarithm in one step: a factor of two.
    most_scatter_sd : float
        Standard deviations that a trial's own friction and curvature may have.
    held_rounds : int
        Of finding out whose scatter is at its limit.
    probe_share : float
        Share of a step at which the second derivative along it is looked at. Smaller: rounding and jitter;
        larger: third derivatives.
    most_acceleration : float
        Length of the geodesic acceleration over that of the step, as its authors recommend.
    least_eigenvalue : float
        Of scaled normal equations, over the largest: below it a direction is unknown.
    """

    correlated_values: float = 100.0
    inflation_sd: float = 4.0
    longest_log_step: float = 0.7
    most_scatter_sd: float = 5.0
    held_rounds: int = 12
    probe_share: float = 0.1
    most_acceleration: float = 0.75
    least_eigenvalue: float = 1e-12


@dataclass(frozen=True)
class DerivativeSettings:
    """Differences by which motions are derived.

    Attributes
    ----------
    perturbation : float
        Of a coordinate's typical size: rounding then costs 1e-8 of a derivative, the second derivative of a
        motion through the steepest friction 1e-4.
    central_step : float
        Of a typical size, for central differences of what is cheap and smooth: readings, packings, entries.
        The truncation error is second order in it.
    stiff_share : float
        Of a typical flexibility: a body as stiff as that moves by 0.1 % other than to first order.
    """

    perturbation: float = 1e-7
    central_step: float = 1e-4
    stiff_share: float = 1e-3


@dataclass(frozen=True)
class PriorSettings:
    """What is known before any data, beside the bench.

    Attributes
    ----------
    friction_speed_range_m_s : tuple
        Of the smoothing of dry friction, one standard deviation to either side of its logarithm's middle.
    fixed_sd : float
        Relative prior deviation of a value that the robot file fixes: far below what any data could resolve
        (about 1e-4), so that tenfold either way changes no answer.
    log_typical : float
        Change of the logarithm of an effect's scale that begins to matter.
    tow_sd_n : float
        Of a force balance, beside the scatter of friction from pull to pull.
    log_nearness_sd : float
        Of the logarithm of how near the point is at which an effect of the room sits: a factor of two either
        way. Smaller: a point elsewhere is not found; larger: one far away explains anything smooth.
    """

    friction_speed_range_m_s: tuple[float, float] = (0.0003, 0.003)
    fixed_sd: float = 1e-9
    log_typical: float = 0.3
    tow_sd_n: float = 0.002
    log_nearness_sd: float = 0.7


@dataclass(frozen=True)
class CalibrationReportSettings:
    """What is told beside the values.

    Attributes
    ----------
    off_bench_sd : float
        Standard deviations of the bench; by chance one value in 370 lies further off.
    unexplained_misfit : float
        Root mean square misfit over the noise from which it is said that the model does not explain the data.
    uninformed_share : float
        Posterior over prior deviation above which the data told nothing.
    named_part : float
        Part of a value in such a direction (of unit length) from which on it is named. Smaller: long products
        of values that hardly matter; larger: a direction of many values would have no name.
    """

    off_bench_sd: float = 3.0
    unexplained_misfit: float = 1.1
    uninformed_share: float = 0.9
    named_part: float = 0.3


FIT = FitSettings()
OBJECTIVE = ObjectiveSettings()
DERIVATIVE = DerivativeSettings()
PRIOR = PriorSettings()
CALIBRATION_REPORT = CalibrationReportSettings()
