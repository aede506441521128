"""Kinds of effect parameters: what each means, its bounds, and so how it is fitted.

The kind, not the name, decides what a robot file may hold and in which coordinates a fit moves: see
`srs_opt.calibrate.forms`.
"""

from __future__ import annotations

from dataclasses import dataclass

INFINITY = float("inf")


@dataclass(frozen=True)
class EffectParameter:
    """A size, as it stands: fitted itself, between its bounds.

    The first parameter of an effect is its size: at zero the effect is absent. ``lower=0`` makes it one that
    physics keeps from crossing zero; without a lower bound it may.

    Attributes
    ----------
    name, unit : str
    typical : float
        Size at which a laboratory would start to wonder; for other kinds the value that a robot file may
        leave out.
    lower, upper : float
        Physical bounds.
    exclusive : bool
        Whether the lower bound itself is out of bounds.
    """

    name: str
    unit: str
    typical: float
    lower: float = -INFINITY
    upper: float = INFINITY
    exclusive: bool = False

    @property
    def default(self) -> float:
        """What a robot file that leaves it out means."""
        return self.typical


@dataclass(frozen=True)
class Component(EffectParameter):
    """A further component of a size that is a vector; fitted beside the first, zero by default."""

    @property
    def default(self) -> float:
        """Zero."""
        return 0.0


@dataclass(frozen=True)
class Direction(EffectParameter):
    """The angle (rad) in which the size points; size and angle are fitted as two components."""


@dataclass(frozen=True)
class Towards(EffectParameter):
    """A coordinate (m) of the point that the size points to; an effect has two, x and y.

    Size and point are fitted as the two components of the pull seen from the room's origin, and the logarithm
    of the point's nearness, one over its distance.
    """


@dataclass(frozen=True)
class Scale(EffectParameter):
    """A positive scale that means nothing at zero size; its logarithm is fitted.

    `spread` is the standard deviation of the logarithm about that of the typical value: 0.7 is a factor of
    two either way. Half of it hides effects at unusual scales, double lets scales run away in poor data.
    """

    lower: float = 0.0
    exclusive: bool = True
    spread: float = 0.7


@dataclass(frozen=True)
class Place(EffectParameter):
    """Where the effect sits: a link or a segment, from 1 at the tail; every place is a candidate.

    The effect's other parameters reach its hooks as vectors over all places, zero where it does not act.
    """

    typical: float = 1
    of: str = "segment"

    def count(self, links: int) -> int:
        """Return how many places a robot with that many links has."""
        return links if self.of == "link" else links - 1


def segment() -> Place:
    """Return the place of an effect that sits in one segment."""
    return Place("segment", "", of="segment")


def link() -> Place:
    """Return the place of an effect that sits at one link."""
    return Place("link", "", of="link")
