"""What a gait is judged by, how programs of one cycle are set up and where they begin.

Merits are those of the objectives, whose unit is such that 0.001 matters little (`Objective.merit`). The
stages of the search stand in `search_settings`, the tables in `table_settings`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GoalSettings:
    """When a gait is what was asked for.

    Attributes
    ----------
    least_speed_m_s : float
        Least speed of gaits whose objective alone would bring the robot to a stop (transport, turn, slim).
    least_turn_rad_s : float
        Least turn rate where only the side of a turn is wanted. Zero would let a straight gait pass for a
        turn.
    turn_error : float
        Share by which a wanted radius or turn rate may be missed: switches on whole ticks seldom meet it
        exactly.
    straight_rad_s : float
        Turn rate below which a gait counts as straight; about one degree per second.
    frequency_excess : float
        Share by which a period of whole ticks may leave the frequency limits where none lies within.
    least_ticks : int
        Ticks in a period at least: fewer hold no wave.
    bore_over_width : float
        Assumed bore of an air chamber over the body's width; 1.3 ml a chamber for the built-in robot. The
        cost of transport's air goes with its square.
    """

    least_speed_m_s: float = 0.02
    least_turn_rad_s: float = 0.05
    turn_error: float = 0.02
    straight_rad_s: float = 0.02
    frequency_excess: float = 2e-3
    least_ticks: int = 4
    bore_over_width: float = 1 / 6


@dataclass(frozen=True)
class FeasibilitySettings:
    """How a limit on the curvature is refused before any search.

    Attributes
    ----------
    instants : int
        Of the cycle, at which the curvature is evaluated. Half finds its peak to 0.1 %.
    switch_half_width : float
        Of a switch, in cycles: sharp, since nothing is differentiated here.
    excess : float
        Share by which the limit may be exceeded, as certificates let it be.
    """

    instants: int = 200
    switch_half_width: float = 1e-3
    excess: float = 0.01


@dataclass(frozen=True)
class ScoreSettings:
    """How simulated gaits are compared.

    Attributes
    ----------
    miss_weight : float
        Merit that a miss of 1 costs. Smaller: a gait that breaks a limit may win by its speed.
    lever : float
        Distance at which a turn rate's error counts as one of speed, body lengths (0.1 m of the built-in
        robot, nearly half of it).
    band_miss_per_m : float
        Miss of a metre of band too much.
    small_merit : float
        Merit (m/s, where speed counts) below which tolerances on the merit shrink with it.
    least_scale : float
        To this at least: below, tolerances are lost to the simulation's own.
    """

    miss_weight: float = 5.0
    lever: float = 0.423728813559322
    band_miss_per_m: float = 10.0
    small_merit: float = 0.1
    least_scale: float = 0.01


@dataclass(frozen=True)
class CollocationSettings:
    """The nonlinear programs.

    Attributes
    ----------
    other_robots_share : float
        Share of the tolerated error of a turn that robots other than the first may use: one gait cannot
        give every robot the same turn. The rest of it is left to rounding to ticks.
    curvature_switch_half_width : float
        Half width, in cycles, over which switches are spread where an objective's formulas see the
        curvature.
    switch_half_width : float
        Half width of a switch over the mean element where switches may lie anywhere in an element. Smaller:
        a switch may fall between nodes; larger: the valves switch more slowly than they do.
    straight_turn_rad : float
        Turn per cycle below which the guess takes the mean path for a line: the centre of rotation of a
        smaller one is lost to rounding.
    fastest_turn_rad_s, fastest_m_s : float
        Bounds of unknowns that nothing else bounds; far beyond what a body does.
    coincident_cycles : float
        Switches closer than this are one instant, and their order is free.
    met_over_coincident : float
        Multiples of that within which two switches at the optimum have met and exchange their order.
    largest_refinement : float
        Parts at most into which an element is split at once: the estimate's order does not hold further
        out.
    feasible_factor : float
        IPOPT's ``theta_max_fact``. Starts are simulated motions, nearly feasible: steps that leave their
        neighbourhood follow the linearized friction to where nothing holds any more, and dozens of
        iterations find no way back.
    roaming_factor : float
        The same for the tightest turn, which lies far from every start: there solves may pass through what
        is no motion.
    """

    other_robots_share: float = 0.75
    curvature_switch_half_width: float = 0.01
    switch_half_width: float = 0.5
    straight_turn_rad: float = 1e-6
    fastest_turn_rad_s: float = 30.0
    fastest_m_s: float = 1e3
    coincident_cycles: float = 1e-7
    met_over_coincident: float = 1e3
    largest_refinement: float = 3.0
    feasible_factor: float = 3.0
    roaming_factor: float = 1e4


@dataclass(frozen=True)
class DutyBiasSettings:
    """How far a gait is biased to one side to turn it.

    Attributes
    ----------
    largest_bias : float
        Cycles by which on-intervals may grow at the expense of off-intervals.
    first_step, step_growth : float
        First step of the bias, cycles, and the growth of the following ones, until the wanted turn is
        passed.
    most_bisections : int
        Evaluations at most after that.
    least_share : float
        Of a cycle, that every interval keeps: less, and a valve hardly switches.
    """

    largest_bias: float = 0.35
    first_step: float = 0.02
    step_growth: float = 1.5
    most_bisections: int = 12
    least_share: float = 0.04


@dataclass(frozen=True)
class StartSettings:
    """Where searches begin.

    Attributes
    ----------
    friction_speed_m_s : float
        Smoothing of the friction with which starts are biased towards the wanted turn: with the robot's own
        the turn rate jumps with the bias.
    turn_tolerance_rad_s : float
        To which a start's turn rate is brought to a wanted radius.
    smoothed_turn_rad_s, rough_turn_rad_s : float
        The same with smoothed friction, and of searches for tight turns and pivots.
    steered_rad_s : float
        Turn rate from which those start.
    least_waves, wave_range : float
        Quasi-random waves: least number of waves on the body and the range of it, where one more link than
        there are segments holds a wave: from three quarters of a wave to one and a half.
    phase_range_rad : float
        Of each segment's phase besides.
    pressure_shares, waves_on_body : tuple of float
        Plain waves: pressures over the largest, and waves on the body.
    """

    friction_speed_m_s: float = 0.1
    turn_tolerance_rad_s: float = 0.02
    smoothed_turn_rad_s: float = 0.05
    rough_turn_rad_s: float = 0.1
    steered_rad_s: float = 0.5
    least_waves: float = 0.7
    wave_range: float = 0.9
    phase_range_rad: float = 0.4
    pressure_shares: tuple[float, ...] = (0.45, 0.55, 0.7, 0.85, 1.0)
    waves_on_body: tuple[float, ...] = (0.7, 0.85)


@dataclass(frozen=True)
class StiffnessSettings:
    """Bodies of unknown stiffness.

    Attributes
    ----------
    interval_sd : float
        Standard deviations of its logarithm to either side that a stiffness known with one stands for.
    least_sd : float
        Relative deviation below which one body is enough: speeds within 4 % of a stiffness hardly differ.
    least_published_m_s : float
        Speed of the published gait below which nothing can be said relative to it.
    silicone_n_m2 : tuple of float
        Bending stiffnesses that silicone segments of the built-in robot's size may have.
    most_links : int
        Compiling the compliant model of longer robots takes minutes.
    """

    interval_sd: float = 2.0
    least_sd: float = 0.02
    least_published_m_s: float = 1e-3
    silicone_n_m2: tuple[float, ...] = (0.02, 0.005, 0.002)
    most_links: int = 12


@dataclass(frozen=True)
class ReportSettings:
    """What a search's report mentions.

    Attributes
    ----------
    at_limit : float
        Share of a bound within which an unknown stands at it.
    least_price : float
        Merit that is worth a line.
    least_gain_percent : float
        Gain of more intervals per cycle that is told: less is what rounding and the search's tolerance
        explain.
    """

    at_limit: float = 1e-4
    least_price: float = 1e-6
    least_gain_percent: float = 0.5


@dataclass(frozen=True)
class CertificateSettings:
    """When a gait counts as certified.

    Attributes
    ----------
    cycles : int
        Simulated for the periodicity gap and for the start from rest. Fewer would refuse gaits that
        accelerate slowly; more only take time.
    speed_error : float
        Of the simulated speed: up to which the optimizer's may differ. Smaller, gaits are refused for the
        error of their mesh; larger, collocated orbits pass that are not the simulated one.
    speed_floor : float
        Of that difference, for gaits that hardly move: body lengths per second.
    gap : float
        Change of velocity and shape over `cycles`, over their size. What integration leaves is smaller.
    standing_start : float
        Of the steady speed: up to which the last of `cycles` cycles from rest may differ.
    limit_excess, constraint_excess : float
        Of a limit (band, curvature), and of an objective's own constraint: by which it may be exceeded
        after switches are rounded to ticks, which moves them by half a tick.
    apart_widths : float
        Body widths along the body from which on two parts may touch: half a turn of the body's own width.
        Smaller: neighbours count as touching; larger: a tighter curl goes unseen.
    """

    cycles: int = 50
    speed_error: float = 0.005
    speed_floor: float = 0.00212
    gap: float = 1e-3
    standing_start: float = 0.01
    limit_excess: float = 0.01
    constraint_excess: float = 0.01
    apart_widths: float = 1.6


GOAL = GoalSettings()
FEASIBILITY = FeasibilitySettings()
SCORE = ScoreSettings()
COLLOCATION = CollocationSettings()
DUTY_BIAS = DutyBiasSettings()
START = StartSettings()
STIFFNESS = StiffnessSettings()
REPORT = ReportSettings()
CERTIFICATE = CertificateSettings()
