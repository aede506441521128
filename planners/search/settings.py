"""How finely a planning problem is tabulated and simulated, what plans cost, and how OMPL is asked.

The searches' own settings stand beside them: `beam`, `lattice`, `runs`, `track`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResolutionSettings:
    """Accuracy of what the searches are given; lengths in body lengths.

    Attributes
    ----------
    field : float
        Spacing of the distance field, where the maze is small enough. Smaller takes memory, larger sends more
        bodies to the exact distance.
    fine_field, fine_nodes : float, int
        The same, and most nodes, of the finer field: it errs by 1.4 mm beside 7 mm with the built-in robot.
        Where a coarse one lets cycles pass that touch, nine of ten are simulated in vain.
    nearest_m : float
        Beyond the field's error, so that the exact search for the nearest wall finds one for certain.
    detour_times, detour : float
        Longer detours than so many times the shortest way, and so much more, are not in the map by heading.
        Larger takes time and memory; smaller leaves out ways that turn elsewhere.
    most_deviation : float
        Plans keep this much room at most for a stiffness's deviation (10 mm of the built-in robot). What a
        cycle may be off would close most mazes where a stiffness is known within a factor; the driver sees
        and learns every cycle.
    step_s : float
        Integration step of searches: a cycle's heading errs by 0.2 to 0.3 mrad (root mean square), with half
        of the step by 0.05.
    long_s, shortest : float
        Errors add up: ways that take longer than `long_s` get shorter steps, at least this share of
        `step_s`; else certificates refuse plans of a hundred cycles again and again.
    """

    field: float = 0.0212
    fine_field: float = 0.00424
    fine_nodes: int = 1_500_000
    nearest_m: float = 0.001
    detour_times: float = 1.5
    detour: float = 16.0
    most_deviation: float = 0.0424
    step_s: float = 0.002
    long_s: float = 30.0
    shortest: float = 1 / 3


@dataclass(frozen=True)
class CostSettings:
    """What plans cost.

    Attributes
    ----------
    time_share : float
        Of a second per second where time is not the cost: else the slowest plan would cost no more.
    near_widths, near_factor : float
        Within so many body widths of a wall a way costs up to so many times more (cost "clearance").
    typical_over_least : float
        Cost of a typical metre over one with the cheapest gait, straight and steady (cost "air").
    start_up_s, start_up_air : float
        Extra cost of a start from rest, with cost "air" the latter.
    slow : float
        Share of the top speed; slower gaits are left out of the cost of a metre.
    """

    time_share: float = 0.3
    near_widths: float = 2.0
    near_factor: float = 3.0
    typical_over_least: float = 1.3
    start_up_s: float = 0.6
    start_up_air: float = 1.5
    slow: float = 0.1


@dataclass(frozen=True)
class CostMapSettings:
    """The map of costs to go by place.

    Attributes
    ----------
    nodes, most_nodes : int
        To which the grid grows, and beyond which it is coarsened even where walls are thin.
    finest : float
        Share of half the body's width below which the spacing does not go.
    blocked : float
        Share of half the body's width within which of a wall nodes are blocked: less than 1 by the little by
        which the centre of mass of a bent body leaves its centre line.
    comfort : float
        Times the reach of the fastest gait is room enough for every gait at full speed. Larger keeps ways
        in the middle of corridors.
    least_comfort : float
        Share of the speed that is left where there is no such room.
    unfitting : float
        Share of the slimmest gait's speed where not even that gait fits.
    least_speed : float
        Share of the top speed that is reckoned with anywhere.
    """

    nodes: int = 40_000
    most_nodes: int = 1_500_000
    finest: float = 0.3
    blocked: float = 0.6
    comfort: float = 1.5
    least_comfort: float = 0.3
    unfitting: float = 0.25
    least_speed: float = 0.1


@dataclass(frozen=True)
class HeadingMapSettings:
    """The map of costs to go by place, course and direction of travel.

    Attributes
    ----------
    coarse, fine : float
        Nodes to the chord of the tightest turn by one course. Below 1.7 a turn and a straight move end alike;
        5 tells ways apart that differ by a millimetre or two, which is worth it while there are few states.
    few_states, most_states : int
        States up to which the grid is as fine as `fine`, and up to which it is at all: about 100 bytes each
        while the map is made.
    coarsening : float
        Factor on the spacing until the states are few enough.
    slow : float
        Share of the top speed; slower turning gaits are not counted on.
    same_radius : float
        Gaits up to so many times a radius count as turning by it.
    """

    coarse: float = 1.7
    fine: float = 5.0
    few_states: int = 250_000
    most_states: int = 1_500_000
    coarsening: float = 1.25
    slow: float = 0.2
    same_radius: float = 1.05


@dataclass(frozen=True)
class HeuristicSettings:
    """The estimate of the cost to go from the end of a cycle.

    Attributes
    ----------
    most_gain : float
        A point of the body may promise at most so many times the time of the way to it: one that promises
        more lies behind a wall.
    dead_end_s : float
        Added where the head is in a dead end.
    """

    most_gain: float = 5.0
    dead_end_s: float = 1.0


@dataclass(frozen=True)
class FollowSettings:
    """How a geometric path is turned into gaits.

    Attributes
    ----------
    spacing : float
        Body lengths between the nodes of the reference.
    patience : float
        Times the cycles that the path should take after which following it ends.
    cycle_s : float
        Duration of a cycle by which those are reckoned.
    """

    spacing: float = 0.127
    patience: float = 4.0
    cycle_s: float = 0.5


@dataclass(frozen=True)
class RouteSettings:
    """OMPL's geometric planners: the strip that stands for the body; lengths in body lengths.

    Attributes
    ----------
    step : float
        Between the poses at which a path is checked and given back. Larger misses posts.
    before : float
        Before the goal, from where the way to it gives the heading there.
    slowest : float
        Body lengths per second; slower gaits do not make routes.
    strip_points : int
        Of the strip, at which distances to walls are looked up.
    goal : float
        Distance from the goal's pose at which a path may end.
    easy : float
        Radius of the comfortable assumption over the tightest one.
    straight : float
        Radius assumed where no gait turns.
    """

    step: float = 0.0847
    before: float = 0.636
    slowest: float = 0.212
    strip_points: int = 7
    goal: float = 0.0424
    easy: float = 1.3
    straight: float = 4.24


@dataclass(frozen=True)
class CycleControlSettings:
    """OMPL's control planners over cycles; lengths in body lengths.

    Attributes
    ----------
    most_cycles : int
        That one control is held. More reach farther at once, and touch more often on the way.
    slack : float
        Beyond the margin, for what happens between the samples of a cycle.
    away : float
        That what is not in the goal is at least away from it.
    """

    most_cycles: int = 6
    slack: float = 0.00212
    away: float = 0.0424


RESOLUTION = ResolutionSettings()
COST = CostSettings()
COST_MAP = CostMapSettings()
HEADING_MAP = HeadingMapSettings()
HEURISTIC = HeuristicSettings()
FOLLOW = FollowSettings()
ROUTE = RouteSettings()
CYCLE_CONTROL = CycleControlSettings()
