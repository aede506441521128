"""How a plan is certified, how its search is mended and shared among planners, when a maze is too narrow."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.manoeuvre.settings import REGULATOR


@dataclass(frozen=True)
class PlanCertificateSettings:
    """The fresh simulation of a whole plan; lengths in body lengths.

    Attributes
    ----------
    tolerance : float
        Of the coarsest integration, body lengths per second: at two lengths per second it errs by 0.0001 in
        40. With four times as much, most mazes of 16 x 16 cells ask for a third tolerance, in twice the time.
    stair_share : float
        Steps of the ramps of pressure, of the regulator's; with the search's they alone would err by 2 mm in
        20 m.
    finer : float
        Factor between the tolerances of two levels; 16 is twice as many steps.
    levels : int
        Tolerances at most; the last errs by a few micrometres in a hundred metres.
    error_ratio : float
        Of the errors of two levels at least; 15 to 113 was seen over 94 m. 2.5 would double the bound.
    error_share : float
        Of the clearance, that the bound on the error may be before the next level is asked.
    first_bodies : int
        Bodies per cycle that are looked at while cycles are integrated.
    in_wall : float
        Overlap of one of them that ends the integration: no error of the coarser one explains it in a
        hundred metres. Smaller could end plans that the finer integration passes.
    compared : int
        Every so many nodes of the coarser integration are compared with the finer one: errors change within
        cycles, not within steps.
    exact_below : float
        Clearance below which it is measured exactly; above, the table's lower bound will do.
    small_margin : float
        Margin below which the body is looked at twice as often: every 2 ms it moves 0.004 body lengths.
    look_nodes : int
        For what holds between two looks every so many nodes, 6 ms apart, are measured: the deviations change
        slowly.
    """

    tolerance: float = 1.06e-5
    stair_share: float = 0.25
    finer: float = 16.0
    levels: int = 4
    error_ratio: float = 4.0
    error_share: float = 0.1
    first_bodies: int = 12
    in_wall: float = 0.02
    compared: int = 4
    exact_below: float = 0.127
    small_margin: float = 0.0127
    look_nodes: int = 3

    @property
    def stair_s(self) -> float:
        """Steps of the ramps of pressure at the coarsest level, s."""
        return REGULATOR.stair_s * self.stair_share


@dataclass(frozen=True)
class NarrownessSettings:
    """When a maze is said to be too narrow; lengths in body lengths.

    Attributes
    ----------
    nodes : int
        Of the distance field, that the widest route is looked for on at most; more are thinned.
    halvings : int
        Of the range of clearances: 14 leave 0.1 mm of a metre.
    body_points : int
        Of the straight body at the start, whose passages are followed.
    spare_widths : float
        Body widths by which the widest route may be narrower than the slimmest gait's envelope before the
        search is given up: a thin gate can be passed with a little less. Larger searches in vain for longer.
    slowest : float
        Body lengths per second; a gait slower than this does not get anywhere.
    weaker : tuple of float
        Pressures tried outside the table, relative to its slimmest gait.
    """

    nodes: int = 700_000
    halvings: int = 14
    body_points: int = 65
    spare_widths: float = 0.1
    slowest: float = 0.0424
    weaker: tuple[float, ...] = (0.85, 0.7, 0.55, 0.4)


@dataclass(frozen=True)
class MendingSettings:
    """How search and certificate work together; lengths in body lengths.

    Attributes
    ----------
    chunk : int
        Nodes between looks at the clock.
    width_nodes : int
        Nodes before the widths of the maze are judged.
    back : int
        Cycles before a failure from where the way is searched again, so many more at every attempt.
    attempts : int
        Searches begun before the solver gives up.
    more_slack : float
        Clearance added to the search's at every failed certificate. Smaller needs more attempts, larger
        closes narrow ways.
    least_slack : float
        Of the last search: what happens between the samples of a cycle is left to the certificate. Corridors
        with 0.2 % of a body length to spare are found with it; not at first, as more plans then have to be
        mended.
    fine_halvings : int
        Of cells near walls, in the planner "fine".
    """

    chunk: int = 50
    width_nodes: int = 100
    back: int = 3
    attempts: int = 12
    more_slack: float = 0.00212
    least_slack: float = 0.000424
    fine_halvings: int = 3


@dataclass(frozen=True)
class PortfolioSettings:
    """How much work each planner gets.

    Attributes
    ----------
    first_nodes, nodes_per_s : int, float
        Cycles that our searches look at in the first round, at least and per second of way; doubled every
        round. One beam along a way of 150 s takes 3000, and the certificate may send it back a few times:
        with too few, OMPL's planners are asked while a plan is being mended.
    run_nodes : int
        Of the search over runs where the first beam has failed: corridors take it 10 to 650.
    first_iterations : int
        Of another planner in the first round; doubled every round.
    rounds : int
        After which planning ends.
    wider : tuple of int
        Widths of the beams that look for better plans, one after the other.
    """

    first_nodes: int = 3000
    nodes_per_s: float = 60.0
    run_nodes: int = 600
    first_iterations: int = 1000
    rounds: int = 5
    wider: tuple[int, ...] = (50, 150, 500, 1500)


PLAN_CERTIFICATE = PlanCertificateSettings()
NARROWNESS = NarrownessSettings()
MENDING = MendingSettings()
PORTFOLIO = PortfolioSettings()
