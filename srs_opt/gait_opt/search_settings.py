"""The stages of the search for one gait: reaches, meshes, populations, tolerances.

Merits are those of the objectives, whose unit is such that 0.001 matters little (`Objective.merit`).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContinuationSettings:
    """The continuation in the friction's smoothing.

    Attributes
    ----------
    frequency_reach_hz : float
        Reach of the frequency per reach of the switches (cycles). A stage whose reach binds is repeated:
        smaller ones take more solves.
    pressure_reach : float
        The same of the pressure, in units of 50 kPa.
    reach : float
        Cycles that the switches may move in one solve while the friction is smooth.
    smooth_stages : tuple of (float, int)
        Smoothing speeds (m/s) with the elements of their meshes. The smoother, the fewer optima there are
        and the farther they lie from those of the robot's own friction.
    middle_stage : (float, int)
        Between these and the sharp ones, for robots whose own friction is sharper than `middle_below_m_s`.
    middle_below_m_s : float
    sharp_m_s : tuple of float
        The stages after them. Larger ratios of neighbours: starts are poor, and solves fail; smaller ones:
        more solves.
    sharp_elements : int
        Of their meshes: friction that nearly sticks changes within a small part of the cycle.
    least_ratio : float
        A stage is left out where it is smoothed by less than this over the robot's own.
    quick_m_s : tuple of float
        Stages of a quick search, which ends at twice the robot's own smoothing or at that itself.
    quick_elements : tuple of (float, int)
        Smoothing speed (m/s) down to which a quick stage's mesh has so many elements.
    finest_quick_elements : int
        Elements below the last of these.
    quick_smooth_m_s : float
        Down to which quick stages have the full reach.
    uniform_share : float
        Of the mesh; the rest follows the simulation's steps. 1 ignores where the motion is stiff, 0 leaves
        few elements for what moves away from there.
    state_limit : float
        Bound of the scaled states, each of which is about 1 in the start.
    """

    frequency_reach_hz: float = 3.0
    pressure_reach: float = 4.0
    reach: float = 0.1
    smooth_stages: tuple[tuple[float, int], ...] = ((0.1, 40), (0.03, 40), (0.01, 50))
    middle_stage: tuple[float, int] = (0.004, 64)
    middle_below_m_s: float = 0.003
    sharp_m_s: tuple[float, ...] = (0.002, 0.001, 0.0005)
    sharp_elements: int = 80
    least_ratio: float = 1.5
    quick_m_s: tuple[float, ...] = (0.1, 0.03, 0.01, 0.004, 0.002, 0.001)
    quick_smooth_m_s: float = 0.01
    quick_elements: tuple[tuple[float, int], ...] = ((0.1, 24), (0.03, 28), (0.01, 36), (0.004, 50))
    finest_quick_elements: int = 60
    uniform_share: float = 0.5
    state_limit: float = 4.0


@dataclass(frozen=True)
class GaitSearchSettings:
    """The whole search.

    Attributes
    ----------
    carried_starts : int
        Starts, the best by smoothed friction, that are carried to the robot's own. With one, a start that
        is best only by smoothed friction wins; each costs the last stages, which take longest.
    same_optimum : float
        Merits closer than this are one optimum.
    exact_reach : float
        Cycles that the switches may move in the last stage.
    near_reach, moved_reach : float
        The same for earlier results that keep the new limits, and for those that had to move.
    moved_friction_m_s, moved_elements, moved_stage_reach, moved_repeats
        Of the stage that those that had to move go through first: friction that forgives, on a coarse mesh.
    beyond_fastest : float
        Share by which a wanted speed may exceed the fastest gait's before it is refused: that search's own
        error.
    scatter : float
        Share by which the best start may exceed the second. More: nothing confirms it, and populations
        follow.
    kept_miss : float
        Miss below which an earlier gait keeps the limits.
    """

    carried_starts: int = 2
    same_optimum: float = 1e-3
    exact_reach: float = 0.01
    near_reach: float = 0.05
    moved_reach: float = 0.02
    moved_friction_m_s: float = 0.01
    moved_elements: int = 36
    moved_stage_reach: float = 0.1
    moved_repeats: int = 2
    beyond_fastest: float = 0.03
    scatter: float = 0.03
    kept_miss: float = 5e-3


@dataclass(frozen=True)
class PopulationSettings:
    """Populations of simulated gaits (CMA-ES).

    Attributes
    ----------
    size : int
        Gaits per generation. Half finds the nearest optimum; double takes twice the time.
    evaluations : int
        Gaits per population: what nine unknowns take to come to rest.
    agreement : float
        Share by which the scores of two populations differ that found the same.
    together : int
        Populations between two looks at whether they agree, however many processes run them.
    spread : float
        Of the first generation, in units of the limits' widths and of the cycle.
    settled : float
        Spread of the scores at which a population has come to rest.
    """

    size: int = 20
    evaluations: int = 3000
    agreement: float = 0.01
    together: int = 2
    spread: float = 0.2
    settled: float = 1e-4


@dataclass(frozen=True)
class FromRestSettings:
    """The search by simulation from rest, for soft bodies with several orbits.

    Attributes
    ----------
    misled : float
        Relative difference of collocation and simulation from rest beyond which the collocated orbit is
        another one, and this search follows.
    spread_cycles : float
        Of the first generation's switches. Half finds the start again; double is waste.
    spread_limits : float
        Of its frequency and pressure, in units of their limits' widths.
    generations, members : int
        Of the population; twice as many gain below 0.3 %.
    settled : float
        Merit: the search ends where generations differ by less.
    """

    misled: float = 0.05
    spread_cycles: float = 0.02
    spread_limits: float = 0.15
    generations: int = 40
    members: int = 12
    settled: float = 3e-4


@dataclass(frozen=True)
class FreeValveSettings:
    """Valves without a given pattern: the relaxed problem and its rounding.

    Attributes
    ----------
    elements : int
        Of the relaxed problem; valve levels have the same grid.
    friction_speed_m_s : float
        Smoothing of the friction in it.
    first_level : float
        Size of the first guess's valve levels: off their bounds, from which an interior point moves slowly.
    stages : tuple of (float, int, float, int)
        By which a rounded gait is taken to the robot's own friction: smoothing speed (m/s; the last is the
        robot's own), elements, reach of the switches (cycles), repeats.
    reach : float
        Cycles that its switches may move in the last optimization.
    least_dwells, notch_dwells : float
        Length, in dwell times, below which a rounded pulse is dropped, and of a notch that is cut where
        there are fewer pulses than asked for: a notch at the dwell itself could not move.
    places : int
        Instants per element at which sum-up rounding decides.
    """

    elements: int = 40
    friction_speed_m_s: float = 0.01
    first_level: float = 0.8
    stages: tuple[tuple[float, int, float, int], ...] = (
        (0.01, 60, 0.05, 6),
        (0.004, 70, 0.03, 3),
        (0.0, 80, 0.02, 2),
    )
    reach: float = 0.01
    least_dwells: float = 1.05
    notch_dwells: float = 1.5
    places: int = 25


@dataclass(frozen=True)
class SwitchTimeSettings:
    """The optimization of exact switch times.

    Attributes
    ----------
    rounds : int
        Solves at most, each with one order of switches and one mesh.
    elements, most_elements : int
        Of the first mesh, and from which it is not refined further.
    defect : float
        Tolerated between nodes, over the states' sizes.
    gain : float
        Merit below which another round is not worth its time.
    loss : float
        Merit by which a solve's simulated gait may fall short while its claimed speed still counts.
    """

    rounds: int = 6
    elements: int = 90
    most_elements: int = 160
    defect: float = 5e-3
    gain: float = 1e-5
    loss: float = 1e-3


@dataclass(frozen=True)
class RoundingSettings:
    """From the optimum to whole ticks.

    Attributes
    ----------
    turn_tolerance_rad_s : float
        To which the turn is put right after rounding.
    largest_bias : float
        Cycles by which on-intervals may be biased for that.
    loss : float
        Merit that rounding, or an exactly straight gait, may cost before something better is looked for.
    rounds : int
        Times that less is asked for where the finished gait exceeds a limit.
    """

    turn_tolerance_rad_s: float = 5e-3
    largest_bias: float = 0.1
    loss: float = 1e-3
    rounds: int = 3


@dataclass(frozen=True)
class TickSearchSettings:
    """The search on the controller's ticks.

    Attributes
    ----------
    periods : int
        About the optimum's, in ticks. Half miss the even period beside an odd one; double find no more.
    searched_starts : int
        Rounded gaits, the best ones, from which the search goes on.
    most_trials : int
        Simulations per start; a search on four segments ends after about half of them.
    pressure_steps : tuple of float
        Shares by which the pressure moves.
    gain : float
        Merit that a move must gain.
    """

    periods: int = 4
    searched_starts: int = 2
    most_trials: int = 220
    pressure_steps: tuple[float, ...] = (0.02, 0.004)
    gain: float = 1e-5


CONTINUATION = ContinuationSettings()
GAIT_SEARCH = GaitSearchSettings()
POPULATION = PopulationSettings()
FROM_REST = FromRestSettings()
FREE_VALVES = FreeValveSettings()
SWITCH_TIMES = SwitchTimeSettings()
ROUNDING = RoundingSettings()
TICK_SEARCH = TickSearchSettings()
