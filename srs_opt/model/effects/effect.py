"""What an effect is: parameters with bounds, and where it enters the model.

Every hook is optional. A hook gets the effect's own parameters `e` (a mapping;
a place parameter, ``segment`` or ``link``, arrives as a 0/1 weight vector over
all segments or links, so that one compiled model serves every place).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

Symbols = Mapping[str, ca.SX]
INFINITY = float("inf")


@dataclass(frozen=True)
class EffectParameter:
    """One parameter of an effect: its unit, physical bounds and typical size.

    `place` is "segment" or "link" for an integer that says where; otherwise None.
    """

    name: str
    unit: str
    typical: float
    lower: float = -INFINITY
    upper: float = INFINITY
    place: str | None = None
    exclusive: bool = False


@dataclass(frozen=True)
class LinkState:
    """What an external force may depend on; vectors are (N, 1), lengths m, speeds m/s.

    Room coordinates are for effects that know where the robot is; velocities stand in
    the robot's frame, and so do the forces that a hook returns.
    """

    room_x: ca.SX
    room_y: ca.SX
    heading: ca.SX
    v_x: ca.SX
    v_y: ca.SX
    mass: ca.SX
    gravity: ca.SX
    friction_speed: ca.SX


@dataclass(frozen=True)
class Effect:
    """An effect that a model of the robot can lack (absent when its size, the first parameter, is zero).

    Attributes
    ----------
    kind : {"actuation", "body", "ground", "tether", "room", "measurement"}
    gap_extra, gap_ratio : hooks of the geometry; added to the gap (m) and to the gaps' bending ratio.
    extra_mass, extra_load : hooks; added to link masses (kg, with weight) and to normal forces (N).
    wheel_angle : hook; added to the wheels' angle against their link (rad).
    rolling_factor, skidding_factor : hooks (e, speed); multiply the Coulomb term along, across.
    rolling_force : hook (e, speed along the wheel); extra force along the wheel (N).
    link_force : hook (e, LinkState); forces (fx, fy) on the links in the robot's frame.
    gain, bias : hooks (e, frequency) and (e); factor on C0, offset of the curvature target (1/m).
    slow_down : hook (e, valve, kappa); factor on both time constants.
    restoring : hook (e, kappa, memory); added to the restoring curvature.
    memory_rate : hook (e, dkappa, memory); rate of the effect's own state per segment.
    delay : hook (e); added to the valves' delay, s.
    marker, camera : hooks of the measurement; see `model.measurement`.
    clock : hook (e); the sample labelled t was taken at t + clock.
    """

    name: str
    kind: str
    parameters: tuple[EffectParameter, ...]
    gap_extra: Callable[[Symbols], ca.SX] | None = None
    gap_ratio: Callable[[Symbols], ca.SX] | None = None
    extra_mass: Callable[[Symbols, int], ca.SX] | None = None
    extra_load: Callable[[Symbols, int], ca.SX] | None = None
    wheel_angle: Callable[[Symbols, int], ca.SX] | None = None
    rolling_factor: Callable[[Symbols, ca.SX], ca.SX] | None = None
    skidding_factor: Callable[[Symbols, ca.SX], ca.SX] | None = None
    rolling_force: Callable[[Symbols, ca.SX], ca.SX] | None = None
    link_force: Callable[[Symbols, LinkState], tuple[ca.SX, ca.SX]] | None = None
    gain: Callable[[Symbols, ca.SX], ca.SX] | None = None
    bias: Callable[[Symbols], ca.SX] | None = None
    slow_down: Callable[[Symbols, ca.SX, ca.SX], ca.SX] | None = None
    restoring: Callable[[Symbols, ca.SX, ca.SX], ca.SX] | None = None
    memory_rate: Callable[[Symbols, ca.SX, ca.SX], ca.SX] | None = None
    delay: Callable[[Mapping[str, Any]], Any] | None = None
    marker: Callable[[Symbols, ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]] | None = None
    camera: Callable[[Symbols, ca.SX, ca.SX], tuple[ca.SX, ca.SX]] | None = None
    clock: Callable[[Mapping[str, Any]], Any] | None = None

    @property
    def size(self) -> EffectParameter:
        """The parameter whose zero means that the effect is absent."""
        return self.parameters[0]

    @property
    def nonlinear_actuator(self) -> bool:
        """Whether the curvature loses its closed form."""
        return self.slow_down is not None or self.restoring is not None

    @property
    def knows_the_room(self) -> bool:
        """Whether the motion depends on where in the room the robot is (no periodic orbit then)."""
        return self.kind == "room"
