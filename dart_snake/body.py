"""What the snake is made of, in numbers: links with wheels, segments that bend, a floor."""

from __future__ import annotations

from dataclasses import dataclass

WHEEL_RADIUS_M = 0.010
# Of a link's mass, what the wheel's spin adds to it along the wheels. The engine's Gauss-Seidel sweeps take
# longer the smaller it is: 0.05 lowers the published gait's speed by 0.15 %, 0.01 by 0.03 %, 0.002 by less
# than 0.01 %.
SPIN_SHARE = 0.01


@dataclass(frozen=True)
class Link:
    """A carrier with one wheel.

    Attributes
    ----------
    mass_kg, inertia_kg_m2 : float
        Of carrier and wheel together; inertia about the vertical.
    axle_friction, tyre_friction : float
        Friction torque of the axle over weight and wheel radius; Coulomb friction of the tyre in all
        directions.
    axle_damping_n_s_m : float
        Further resistance to rolling, over the speed along the wheel.
    load_n : float
        Weight on the wheel beyond that of the link.
    toe_rad : float
        Of the wheel against the link, counter-clockwise.
    seized : bool
        The wheel does not turn.
    play_m : float
        How far the wheel can slide along its axle, to either side.
    """

    mass_kg: float = 0.030
    inertia_kg_m2: float = 1e-6
    axle_friction: float = 0.043
    tyre_friction: float = 0.57
    axle_damping_n_s_m: float = 0.0
    load_n: float = 0.0
    toe_rad: float = 0.0
    seized: bool = False
    play_m: float = 0.0


@dataclass(frozen=True)
class Body:
    """A chain of links, joined by segments that bend and short straight gaps.

    Attributes
    ----------
    links : tuple of Link
        From the tail to the head.
    segment_lengths_m : tuple of float
        Of the chambers, one less than links.
    gap_m : float
        Length between two chambers; half of it lies on either side of a link.
    width_m : float
        The body is a capsule of this width.
    gravity_m_s2 : float
    stiffness_n_m2, gap_stiffness_n_m2 : float or None
        Bending stiffness EI of chambers and gaps; None: they follow the actuators, or stay straight, whatever
        the load.
    relaxation_s : float
        Relaxation time of the material.
    """

    links: tuple[Link, ...]
    segment_lengths_m: tuple[float, ...]
    gap_m: float
    width_m: float = 0.040
    gravity_m_s2: float = 9.81
    stiffness_n_m2: float | None = None
    gap_stiffness_n_m2: float | None = None
    relaxation_s: float = 0.005

    def __post_init__(self) -> None:
        if len(self.links) != len(self.segment_lengths_m) + 1:
            raise ValueError(f"{len(self.links)} links do not go with {len(self.segment_lengths_m)} segments")

    @property
    def half_length_m(self) -> float:
        """Distance of the tail link from the middle of the straight body."""
        return (sum(self.segment_lengths_m) + len(self.segment_lengths_m) * self.gap_m) / 2


@dataclass(frozen=True)
class Hinge:
    """A vertical hinge of the chain.

    Attributes
    ----------
    segment : int
        That it belongs to, from 0.
    ahead_m : float
        From the hinge (or link 1) before it, when straight.
    share : float
        Of the segment's bend that it makes; 0 in a gap, which only yields.
    stiffness_n_m : float or None
        Torque over angle; None: it is driven.
    """

    segment: int
    ahead_m: float
    share: float
    stiffness_n_m: float | None


def hinges_of(body: Body, pairs: int) -> tuple[list[Hinge], list[float]]:
    """Return the hinges from tail to head, and for every link but the first how far it is from the last of
    them.

    Every chamber is cut into `pairs` equal arcs, and every arc bends in two hinges at a third of its length
    from its middle. So its chord comes out right to the fourth power of its bend, where equal pieces would
    leave the second: one pair per chamber errs by less than 1e-4 of its length at a bend of 0.7 rad.
    """
    hinges: list[Hinge] = []
    to_links: list[float] = []
    soft_gap = body.gap_stiffness_n_m2
    for segment, length in enumerate(body.segment_lengths_m):
        arc = length / pairs
        places = [arc * (k + 0.5 + side / 3) for k in range(pairs) for side in (-1, 1)]
        count = len(places)
        stiffness = None if body.stiffness_n_m2 is None else body.stiffness_n_m2 * count / length
        marks = [(body.gap_m / 2 + place, 1 / count, stiffness) for place in places]
        if soft_gap is not None and body.gap_m > 0:
            half = 2 * soft_gap / body.gap_m  # of half a gap, which bends in its middle
            marks = [
                (body.gap_m / 4, 0.0, half), *marks, (length + 3 * body.gap_m / 4, 0.0, half)
            ]  # fmt: skip
        last = 0.0
        for place, share, torque in marks:
            before = to_links[-1] if segment and last == 0.0 else 0.0  # the first hinges on from the link
            hinges.append(Hinge(segment, before + place - last, share, torque))
            last = place
        to_links.append(length + body.gap_m - last)
    return hinges, to_links
