"""What fits to markers and bench tests are tuned by."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ShapeSettings:
    """Pose and curvatures from the markers of one frame.

    Attributes
    ----------
    prior_bend_rad : float
        Standard deviation of a segment's bend before anything is seen. It matters where markers are lost:
        smaller pulls strongly bent segments towards straight, larger leaves frames with few markers
        undetermined.
    far_m, far_rad : float
        Prior deviations of position and heading: nothing is known of them.
    iterations : int
        Of Levenberg-Marquardt, at most.
    least_gain : float
        Drop of twice the negative log posterior below which a frame's fit has ended.
    undetermined_share : float
        Posterior over prior variance above which a combination of curvatures owes more to the prior than to
        the markers.
    """

    prior_bend_rad: float = 0.5
    far_m: float = 1e3
    far_rad: float = 1e2
    iterations: int = 40
    least_gain: float = 1e-6
    undetermined_share: float = 0.5


@dataclass(frozen=True)
class SmootherSettings:
    """Shape over time.

    Attributes
    ----------
    start_log10 : tuple
        Of the intensities of position, heading and curvature, where the search for the likeliest ones begins:
        those of gaits at about 1 Hz.
    tuning_frames : int
        On which they are found: three seconds at 120 Hz. The time grows with them.
    tuning_iterations : int
        Of the path for each intensity that is tried; it starts from the last one's.
    iterations : int
        Of the path at most.
    least_gain : float
        Drop of twice the negative log posterior below which the path's fit has ended.
    """

    start_log10: tuple[float, float, float] = (-0.5, 1.5, 5.5)
    tuning_frames: int = 360
    tuning_iterations: int = 6
    iterations: int = 30
    least_gain: float = 1e-3


@dataclass(frozen=True)
class SteadyMotionSettings:
    """Speed, turn rate and radius of a trial.

    Attributes
    ----------
    harmonics : int
        Of the valve frequency in the cycle's shape. Fewer leave shape that counts as noise; more fit noise.
    fine : int
        Points of a cycle over which its speed is averaged; the mean of a smooth periodic function converges
        exponentially in them.
    least_cycles : int
        After the transient; without a second one nothing tells how well a cycle repeats.
    least_blocks, most_blocks : int
        Of the jackknife: with fewer cycles than `least_blocks` half cycles are left out.
    straight_lengths : float
        A radius beyond so many robot lengths is called straight.
    settled_level : float
        At which a cycle more may not raise the mean square.
    settled_variance : float
        Mean square over the camera's up to which the second half counts as settled.
    """

    harmonics: int = 5
    fine: int = 720
    least_cycles: int = 2
    least_blocks: int = 4
    most_blocks: int = 12
    straight_lengths: float = 100.0
    settled_level: float = 0.99
    settled_variance: float = 1.5


@dataclass(frozen=True)
class StepTestSettings:
    """The actuator's response from step tests.

    Attributes
    ----------
    largest_q : float
        Of q = ((tau1 - tau2)/(tau1 + tau2))^2; at 1 the faster time constant is 0.
    grid : int
        Nodes of equal probability in each direction by which the distribution of (s, q) is carried to the
        time constants.
    trend_level : float
        Probability of the trend below which C0 is given as a curve over pressure.
    """

    largest_q: float = 0.999
    grid: int = 150
    trend_level: float = 0.01


@dataclass(frozen=True)
class BendingSettings:
    """The bending stiffness from step tests of the whole snake.

    Attributes
    ----------
    friction_speed_m_s : float
        Over which dry friction is smoothed. A tenth changes the loss of bend by 0.1 % of itself and doubles
        the time; ten times as much loses 3 %.
    tolerance_m_s : float
        Of the integration: a tenth of the smoothing.
    starts_1_n_m2 : tuple of float
        Flexibilities from the best of which the fit starts: EI from 0.2 down to 0.002 N m^2.
    least_1_n_m2 : float
        Flexibility: an EI of 50 is rigid for any snake.
    iterations : int
        Of Gauss-Newton, at most.
    settled_share : float
        Step over flexibility at which the fit has ended.
    detected_sd : float
        Standard deviations from zero from which the flexibility gives a stiffness.
    scaled_gain : float
        Of twice the log likelihood: how much better another scale has to explain the tests than a bending
        moment.
    doubtful_misfit : float
        Squared residuals over their expectation from which it is told that friction does not explain the
        steps on the ground.
    """

    friction_speed_m_s: float = 3e-5
    tolerance_m_s: float = 3e-6
    starts_1_n_m2: tuple[float, ...] = (5.0, 50.0, 200.0, 500.0)
    least_1_n_m2: float = 0.02
    iterations: int = 12
    settled_share: float = 1e-3
    detected_sd: float = 2.0
    scaled_gain: float = 10.0
    doubtful_misfit: float = 2.0


SHAPE = ShapeSettings()
SMOOTHER = SmootherSettings()
STEADY = SteadyMotionSettings()
STEP_TEST = StepTestSettings()
BENDING = BendingSettings()
