"""How other orbits are looked for, how derivatives are taken, and how many gaits are searched together."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AttractorSettings:
    """Other stable orbits of a gait.

    Attributes
    ----------
    starts : tuple of float
        Forward speeds from which the motion is simulated, over body lengths per period; no snake of this
        kind reaches one. Each costs a simulation until the motion repeats; fewer may miss an orbit.
    same : float
        Orbits whose dynamic states, scaled to speeds, differ by less are one, body lengths per second;
        Newton closes them to 1e-9.
    """

    starts: tuple[float, ...] = (-0.5, 0.25, 0.5, 0.75, 1.0)
    same: float = 0.00847457627118644


@dataclass(frozen=True)
class EnvelopeSettings:
    """The swept band.

    Attributes
    ----------
    samples : int
        Body shapes per cycle: it errs by less than 0.1 mm, with half of them by 1 mm.
    """

    samples: int = 96


@dataclass(frozen=True)
class DifferenceSettings:
    """Steps of finite differences.

    Attributes
    ----------
    velocity_m_s : float
        Of the dynamic states at a cycle's start, scaled to speeds: far below any smoothing speed of
        friction; rounding costs 1e-8 of a derivative.
    actuator : float
        Of an actuator's state, over its size: central differences err by about 1e-10 from rounding and by
        less from curvature.
    """

    velocity_m_s: float = 1e-8
    actuator: float = 1e-6


@dataclass(frozen=True)
class ChainSettings:
    """Many gaits' orbits.

    Attributes
    ----------
    chains : int
        Searched side by side, to share calls of the compiled step.
    length : int
        Gaits per chain, in which one's orbit is the guess for the next; every chain begins from rest.
    """

    chains: int = 8
    length: int = 12


ATTRACTOR = AttractorSettings()
ENVELOPE = EnvelopeSettings()
DIFFERENCE = DifferenceSettings()
CHAIN = ChainSettings()
