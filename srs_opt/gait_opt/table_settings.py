"""What gait tables hold, and when one of their gaits is near enough to a wanted motion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TableSettings:
    """How a table's gaits are built and looked up.

    Attributes
    ----------
    near_m_s : float
        Distance of a wanted motion up to which a gait is played. Half the step between the table's speeds:
        half of it refuses what is nearly there, double plays what is not. The firmware has the same.
    lever_m : float
        Turn rates weigh as speeds at this distance, half the built-in robot's length. The firmware has the
        same.
    steady_weight : int
        Of a gait's steady motion beside its next cycle, where one is chosen. With less a controller that is
        asked for the same motion all the time changes between gaits whose first cycles correct each other.
        An integer, since the firmware counts in integers.
    pressure_kpa : (float, float)
        Limits of the pressure, wider than a single gait's: slim gaits need less.
    stages : tuple of (float, int, float, int)
        From a neighbour's optimum: smoothing speed (m/s; the last is the robot's own), elements, reach of
        the switches (cycles), repeats.
    band_excess : float
        Share by which a finished gait's band may exceed the wanted one.
    radius_error : float
        Share by which its radius may miss the wanted one.
    wider_m_s_per_m : float
        On other ticks: speed that a metre of wider band counts as. 5 mm wider is as bad as 1 cm/s off.
    slowest_replayed_m_s : float
        Another robot's gait below this speed serves no plan.
    """

    near_m_s: float = 0.05
    lever_m: float = 0.1
    steady_weight: int = 4
    pressure_kpa: tuple[float, float] = (20.0, 55.0)
    stages: tuple[tuple[float, int, float, int], ...] = ((0.004, 60, 0.06, 3), (0.0, 70, 0.03, 2))
    band_excess: float = 0.01
    radius_error: float = 0.03
    wider_m_s_per_m: float = 2.0
    slowest_replayed_m_s: float = 0.01


@dataclass(frozen=True)
class TableContentSettings:
    """Which gaits a table asks for.

    Gathering speed at a is like rolling on wheels whose friction is larger by a/g: what is the fastest then
    accelerates best. For the built-in robot the two loads stand for 0.15 and 0.34 m/s2: what gathers the
    last speed, and what sets off from rest.

    Attributes
    ----------
    radii : tuple of float
        Over the length of the robot's segments, wide to tight.
    straight_bands : tuple of float
        Total widths of the swept band of straight gaits, over the body's. A planner takes the slimmest that
        fits: between neighbours of the list it loses speed, and every entry costs an optimization.
    turn_bands : tuple of tuple
        The same of turns, by radius.
    strong_load, strong_bands, strong_turn_bands
        Share by which the rolling friction is larger, and the bands that are asked for under it.
    rush_load, rush_turn_bands
        The same for setting off from rest.
    quick_radii, quick_straight_bands : tuple of float
        Of a quick table: enough to see how a new robot goes and to plan through a wide maze.
    """

    radii: tuple[float, ...] = (4.0, 1.6, 0.9, 0.6, 0.45)
    straight_bands: tuple[float, ...] = (1.95, 1.8, 1.65, 1.5, 1.4, 1.36, 1.3)
    turn_bands: tuple[tuple[float, ...], ...] = (
        (1.75, 1.5, 1.35),
        (1.75, 1.5, 1.35),
        (1.75, 1.5),
        (1.75, 1.5, 1.4),
        (1.6,),
    )
    strong_load: float = 0.35
    strong_bands: tuple[float, ...] = (1.95, 1.75, 1.6)
    strong_turn_bands: tuple[tuple[float, ...], ...] = ((), (1.75,), (1.75,), (1.75,), ())
    rush_load: float = 0.8
    rush_turn_bands: tuple[tuple[float, ...], ...] = ((), (), (), ())
    quick_radii: tuple[float, ...] = (1.6, 0.6)
    quick_straight_bands: tuple[float, ...] = (1.65,)


@dataclass(frozen=True)
class CompanionSettings:
    """A straight gait's turning companions.

    Attributes
    ----------
    offsets : tuple of float
        Of the wave, to either side: its on-intervals are longer by asin(offset) / pi of the cycle.
    slowest_m_s : float
        Companions below this speed are left out.
    """

    offsets: tuple[float, ...] = (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.9)
    slowest_m_s: float = 0.03


@dataclass(frozen=True)
class DriverGaitSettings:
    """Slow gaits and pivots for a driver, and the evolutionary search for them.

    Attributes
    ----------
    slow_m_s : tuple of float
        Wanted straight speeds, forward. Steps are such that what lies between two wishes is no farther than
        `TableSettings.near_m_s` from one of them.
    turns : tuple of (float, float)
        Wanted speeds (m/s) with turn rates (rad/s, to the left).
    pivots_rad_s : tuple of float
        Wanted turn rates on the spot.
    first_waves : int
        Random waves that the search begins with.
    parents, children : int
        Best waves of the pool of which the next generation is made, and its size.
    generations, least_generations : int
        Per wanted motion at most, and at least before `near_enough_m_s` ends them.
    near_enough_m_s : float
        Miss with which the search ends.
    mutation : float
        Largest standard deviation of a mutation, as a share of a parameter's range.
    mutation_decades : float
        Decades below it over which standard deviations are drawn: large ones find, small ones refine.
    wider_m_s_per_m : float
        Speed that a metre of band counts as: of two gaits alike the slimmer, but the motion counts first.
    """

    slow_m_s: tuple[float, ...] = (0.02, 0.05, 0.1, 0.15)
    turns: tuple[tuple[float, float], ...] = (
        (0.05, 0.5),
        *((v, w) for v in (0.1, 0.2) for w in (0.5, 1.0, 1.5, 2.0)),
        (0.35, 0.5),
    )
    pivots_rad_s: tuple[float, ...] = (0.3, 0.6, 1.0, 1.5)
    first_waves: int = 600
    parents: int = 8
    children: int = 32
    generations: int = 14
    least_generations: int = 5
    near_enough_m_s: float = 0.004
    mutation: float = 0.3
    mutation_decades: float = 1.5
    wider_m_s_per_m: float = 0.05


TABLE = TableSettings()
TABLE_CONTENT = TableContentSettings()
COMPANION = CompanionSettings()
DRIVER_GAIT = DriverGaitSettings()
