"""What the search for manoeuvres decides by.

Lengths are in body lengths, except where users are told them in metres.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EndSettings:
    """When the end of a manoeuvre is reached; in metres, as the command's help and the documentation say it.

    Attributes
    ----------
    rest_speed_m_s, rest_curvature_1_m : float
        Below both the robot is at rest. Half would ask for another tau_1 of venting, 0.06 s, and change the
        pose by less than 1 mm.
    pose_m, pose_rad : float
        Tolerances of an end pose.
    gait_speed_m_s, gait_curvature_share : float
        Of the state in which a gait is joined, the latter over the gait's largest curvature: what is left
        decays by the gait's multipliers, within a cycle or two.
    """

    rest_speed_m_s: float = 0.01
    rest_curvature_1_m: float = 0.5
    pose_m: float = 0.002
    pose_rad: float = 0.01
    gait_speed_m_s: float = 0.02
    gait_curvature_share: float = 0.03


@dataclass(frozen=True)
class ConstraintSettings:
    """How constraints of all kinds are weighed against each other, as lengths.

    Attributes
    ----------
    lever : float
        Turns angles into lengths: 0.1 m of the built-in robot.
    rest_speed_s, gait_speed_s : float
        Turn speeds at the end into lengths, large enough that a violation costs more than it gains: a robot
        stops within a fraction of a second, but the last 0.02 m/s of a fast gait take a second.
    bend : float
        Turns curvatures into lengths, likewise; squared body lengths (0.03 m^2 of the built-in robot).
    spare : float
        Beyond a line, heading or wall, for the integration's error and ticks: 0.1 mm of the built-in robot,
        0.2 ms of way.
    inside : float
        Share of an end's tolerances that the optimization uses; the rest is left to ticks.
    interval_s : float
        Between instants at which the body is measured; it moves 5 mm meanwhile.
    curvature_step_1_m : float
        Of the central difference of the body's outline by a curvature.
    """

    lever: float = 0.423728813559322
    rest_speed_s: float = 0.5
    gait_speed_s: float = 5.0
    bend: float = 0.538638322321172
    spare: float = 0.000423728813559322
    inside: float = 0.8
    interval_s: float = 0.01
    curvature_step_1_m: float = 1e-6


@dataclass(frozen=True)
class ManoeuvreCertificateSettings:
    """The certificate.

    Attributes
    ----------
    finer : float
        Ratio of the tolerances of the two integrations, and of the coarser one's to the usual.
    ratio : float
        Of their errors at least, as in the planner's certificate.
    error : float
        Of the end's place and heading that a certificate may have: 0.5 mm of the built-in robot.
    """

    finer: float = 16.0
    ratio: float = 4.0
    error: float = 0.00211864406779661


@dataclass(frozen=True)
class ManoeuvreSolverSettings:
    """Sequential linear programming in a trust region.

    Attributes
    ----------
    penalty_s : float
        Seconds per body length of violation; a manoeuvre's own price is about 2 s. An exact (L1) penalty
        has to exceed the multipliers: smaller, and violating an end pays; larger, and steps along a limit
        become short.
    step_fractions : tuple of float
        Of a step, simulated side by side; the best is taken.
    first_reach_s, least_reach_s, most_reach_s : float
        Trust region of the switch times: at first, where the solver ends, and at most. Sticking friction
        bends the merit within some milliseconds.
    pressure_kpa_per_s : float
        Change of the pressure that a step may make, per second of reach.
    space_s : float
        Price of a body length of the disc's radius where it is the objective.
    time_beside : float
        Weight of the time where it is not the objective.
    satisfied : float
        Violation that counts as none: 0.2 mm of the built-in robot.
    gain_s : float
        Merit that a step must gain not to count as idle.
    most_idle : int
        Idle steps in a row after which the solver ends.
    step_s : float
        Of the integration. Out of rest derivatives err by 20 % with 2.5 ms, by 1 % with 1 ms; coarser ones
        cost 0.5 to 2 % of the merit.
    fill_s_kpa : float
        Price of a fill where air is the objective, seconds per kPa: 0.02 s at 50 kPa, so that a manoeuvre's
        air counts about as much as its time would. Smaller: `gain_s` ends the search earlier; larger: the
        penalty on violations counts for less beside it.
    many_rows, worst_times : int, float
        From so many constraints on, many of which tell of one overlap, the worst violation so many times
        over stands for their sum. Smaller and larger: a body in a wall counts less or more beside the time.
    kept, kept_per_s, kept_reach_s : float
        Rows of a linear program: those with less to spare than `kept` body lengths and `kept_per_s` of them
        per second of reach, or of `kept_reach_s`. Smaller: steps that overrun a row left out; larger: larger
        programs.
    least_duration_s : float
        That a linear step leaves of a manoeuvre. Smaller: a misled step may take away the whole of it;
        larger: very short ones cannot be found.
    duration_reaches, radius_per_s : float
        Trust region of the duration, in reaches, and of the disc's radius, body lengths per second of reach.
        Smaller: more steps; larger: the motion at the end, and so the model of it, is another.
    """

    penalty_s: float = 4.720000000000001
    step_fractions: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)
    first_reach_s: float = 0.02
    least_reach_s: float = 3e-4
    most_reach_s: float = 0.08
    pressure_kpa_per_s: float = 50.0
    space_s: float = 4.720000000000001
    time_beside: float = 0.02
    satisfied: float = 0.000847457627118644
    gain_s: float = 2e-4
    most_idle: int = 4
    step_s: float = 0.00125
    fill_s_kpa: float = 4e-4
    many_rows: int = 60
    worst_times: float = 3.0
    kept: float = 0.21186440677966104
    kept_per_s: float = 6.3559322033898304
    kept_reach_s: float = 0.01
    least_duration_s: float = 0.05
    duration_reaches: float = 4.0
    radius_per_s: float = 21.186440677966104


@dataclass(frozen=True)
class WaveStartSettings:
    """Simulated waves from which the optimization begins.

    Attributes
    ----------
    plans : int
        Simulated at most, several lengths of time per wave where the end is not merely passed.
    waves : int
        Per start that is wanted.
    frequency_hz, lag_rad : (low, high)
        Ranges from which waves are drawn.
    pressure_span : float
        Share of the limits' width that random pressures take; below it waves are slow.
    lengths : int
        Lengths of time that are tried per wave.
    least_s : float
        Before which no line or heading counts as passed.
    vent_s : float
        Venting with which a stop's first draft ends.
    settlings : float
        Time constants that a gait takes to be reached; more only makes the longest start longer.
    same_merit : float
        Relative difference of merits of starts that are taken for the same.
    """

    plans: int = 960
    waves: int = 30
    frequency_hz: tuple[float, float] = (1.2, 4.5)
    lag_rad: tuple[float, float] = (0.6, 1.6)
    pressure_span: float = 0.4
    lengths: int = 6
    least_s: float = 0.25
    vent_s: float = 0.45
    settlings: float = 3.0
    same_merit: float = 0.004


@dataclass(frozen=True)
class WavePopulationSettings:
    """Populations of waves that change on the way.

    Attributes
    ----------
    knots : int
        Of the frequency. Four lose 1 % of a standing start; eight gain nothing.
    size : int
        Waves per generation.
    generations : int
        A standing start gains 0.1 % in as many more.
    first_generations : int
        Generations' worth of steady waves, the best of which is the population's middle.
    longer : float
        Time that a population has over the best steady wave's, where the end is merely passed.
    instants : int
        At which a wave's sign is evaluated; switches between them are interpolated.
    limits_hz : (low, high)
        Of the frequency.
    spread_hz, spread_phase, spread_lag, spread_offset, spread_kpa, spread_log_time : float
        Standard deviations of the first generation.
    """

    knots: int = 6
    size: int = 24
    generations: int = 160
    first_generations: int = 10
    longer: float = 1.15
    instants: int = 1500
    limits_hz: tuple[float, float] = (0.3, 6.0)
    spread_hz: float = 0.6
    spread_phase: float = 1.5
    spread_lag: float = 0.3
    spread_offset: float = 0.3
    spread_kpa: float = 6.0
    spread_log_time: float = 0.2


@dataclass(frozen=True)
class ManoeuvreSearchSettings:
    """The whole search.

    Attributes
    ----------
    coarse_friction_m_s : float
        Smoothing of the friction for a start's first steps: sticking links do not feel small changes of
        their valves.
    coarse_steps, first_steps, last_steps : int
        Of the solver with that friction, from every start, and from the best.
    rough_step_s : float
        Integration of starts and of softened friction.
    fine_step_s : float
        Integration of ticks: errs by less than a tenth of a millimetre per metre.
    pool : int
        Optima that are perturbed. More spread the effort; one gets stuck.
    perturbations_s : tuple of float
        Standard deviations of a perturbation's switch times, taken in turn.
    perturbation_stretch, perturbation_kpa : float
        Of its stretch in time, as a share, and of its pressure.
    refined_share : float
        Share of the best merit within which a perturbed optimum is refined.
    tick_rounds : int
        Of moves by one tick at most.
    tick_lengths : int
        Durations, tick by tick, that rounding begins with.
    """

    coarse_friction_m_s: float = 0.02
    coarse_steps: int = 8
    first_steps: int = 14
    last_steps: int = 60
    rough_step_s: float = 0.0025
    fine_step_s: float = 0.0005
    pool: int = 4
    perturbations_s: tuple[float, ...] = (0.015, 0.035)
    perturbation_stretch: float = 0.03
    perturbation_kpa: float = 2.0
    refined_share: float = 0.015
    tick_rounds: int = 12
    tick_lengths: int = 4


@dataclass(frozen=True)
class RegulatorSettings:
    """A change of the pressure between two gaits, in manoeuvres and in plans.

    Attributes
    ----------
    settle_s : float
        Time that a change takes where no rate is given.
    stair_s : float
        A ramp is integrated in stairs of this length at most. What they leave falls with its square: a
        heading that is off by 0.01 mrad per change of gait. Half of it costs a plan's search a sixth more
        steps.
    """

    settle_s: float = 0.1
    stair_s: float = 0.0125

    @property
    def stairs(self) -> int:
        """Number of stairs of a change."""
        return max(round(self.settle_s / self.stair_s), 1)


END = EndSettings()
CONSTRAINT = ConstraintSettings()
MANOEUVRE_CERTIFICATE = ManoeuvreCertificateSettings()
MANOEUVRE_SOLVER = ManoeuvreSolverSettings()
WAVE_START = WaveStartSettings()
WAVE_POPULATION = WavePopulationSettings()
MANOEUVRE_SEARCH = ManoeuvreSearchSettings()
REGULATOR = RegulatorSettings()
