"""What an effect is: everything about it in one object, which every part of the program asks.

Hooks say where it enters the equations; each is optional. A hook gets the effect's own parameters `e` (a
mapping from name to expression). Parameters of an effect that sits at one place (`Place`) arrive as vectors
over all segments or links, zero where it does not act, so that one compiled model serves every place.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from srs_opt.effects.parameter import EffectParameter, Place
from srs_opt.geometry import turn_back_by

Symbols = Mapping[str, ca.SX]
KINDS = ("tether", "room", "body", "ground", "actuation", "measurement", "clock")


@dataclass(frozen=True)
class LinkState:
    """What a force on the links may depend on; vectors are (N, 1), lengths m, speeds m/s.

    Room coordinates are for effects that know where the robot is; velocities stand in
    the robot's frame, and so do the forces that a hook returns.

    Attributes
    ----------
    cos, sin : SX (N, 1)
        Of the links' headings in the robot's frame, which stands at `heading` in the room.
    along, across : SX (N, 1)
        Speeds in wheel axes.
    curvature : SX (N, 1)
        Mean of the neighbouring segments, 1/m.
    time_s : SX
        Since the start of the motion, for effects that are `timed`; else zero.
    """

    room_x: ca.SX
    room_y: ca.SX
    heading: ca.SX
    v_x: ca.SX
    v_y: ca.SX
    mass: ca.SX
    gravity: ca.SX
    friction_speed: ca.SX
    cos: ca.SX
    sin: ca.SX
    along: ca.SX
    across: ca.SX
    curvature: ca.SX
    time_s: ca.SX = field(default_factory=lambda: ca.SX(0))


@dataclass(frozen=True)
class Actuation:
    """What acts on the segments; vectors are (N-1, 1).

    Attributes
    ----------
    valve : SX
        States of the valves, -1 to 1.
    kappa : SX
        Curvatures, 1/m.
    pressure_kpa : SX
    time_s : SX
        Since the start of the motion, for effects that are `timed`; else zero.
    memory : SX
        The effect's own state; zero where it has none.
    """

    valve: ca.SX
    kappa: ca.SX
    pressure_kpa: ca.SX
    time_s: ca.SX
    memory: ca.SX


@dataclass(frozen=True)
class Effect:
    """An effect that a model of the robot can lack (absent when its size, the first parameter, is zero).

    Attributes
    ----------
    name : str
    kind : {"tether", "room", "body", "ground", "actuation", "measurement", "clock"}
        What it acts on. Effects of the room know where the robot is; those of measurement and clock never
        enter the dynamics.
    parameters : tuple of EffectParameter
        The size first. Their kinds say how they are fitted.
    what, look : str
        In plain words: what it is; what to look at on the robot to confirm it.
    instrument : str, optional
        Quantity of ``bench/checks.csv`` that measures it directly.
    through_tether : bool
        Whether trials without a tether are free of it (default: those of kind tether).
    gap_extra, gap_ratio : hooks of the geometry; added to the gap (m) and to the gaps' bending ratio.
    stretch : hook (e, curvature without load); the share by which the chambers are longer.
    extra_mass, extra_load : hooks; added to link masses (kg, with weight) and to normal forces (N).
    wheel_angle : hook; added to the wheels' angle against their link (rad).
    rolling_factor, skidding_factor : hooks (e, speed); multiply the Coulomb term along, across.
    rolling_force : hook (e, speed along the wheel); extra force along the wheel (N).
    wheel_factors : hook (e, LinkState); factors on the Coulomb terms along and across.
    steering : hook (e, curvature at the links); added to the wheels' angle (rad).
    link_force : hook (e, LinkState); forces (fx, fy) on the links in the robot's frame.
    flexibility, relaxation : hooks (e); added to 1/EI of the segments (1/(N m^2), which makes the bends
        coordinates of their own); the material's relaxation time where the robot has none (s).
    gain, bias : hooks (e, frequency) and (e); factor on C0, offset of the curvature target (1/m).
    command : hook (e, Actuation); the states of the valves that the pressure acts with.
    slow_down : hook (e, valve, kappa); factor on both time constants.
    slowness : hook (e, Actuation); the same, for what depends on more.
    restoring : hook (e, kappa, memory); added to the restoring curvature.
    memory_rate : hook (e, dkappa, memory); rate of the effect's own state per segment.
    state_rate : hook (e, Actuation); the same, for what depends on the valves.
    delay : hook (e); added to the valves' delay, s.
    marker : hook (e, x, y, theta); where the camera's markers sit, room coordinates (m).
    camera : hook (e, x, y); where a point of the room is seen (m).
    clock, clock_rate : hooks (e); the sample labelled t was taken at t (1 + clock_rate) + clock.
    marker_lag : hook (e); by how much later every marker is seen than the one before it, from the tail on, s.
    timed : bool
        Whether its hooks depend on the time since the start of the motion.
    """

    name: str
    kind: str
    parameters: tuple[EffectParameter, ...]
    what: str = ""
    look: str = ""
    instrument: str | None = None
    through_tether: bool | None = None
    gap_extra: Callable[[Symbols], ca.SX] | None = None
    gap_ratio: Callable[[Symbols], ca.SX] | None = None
    stretch: Callable[[Symbols, ca.SX], ca.SX] | None = None
    extra_mass: Callable[[Symbols, int], ca.SX] | None = None
    extra_load: Callable[[Symbols, int], ca.SX] | None = None
    wheel_angle: Callable[[Symbols, int], ca.SX] | None = None
    rolling_factor: Callable[[Symbols, ca.SX], ca.SX] | None = None
    skidding_factor: Callable[[Symbols, ca.SX], ca.SX] | None = None
    rolling_force: Callable[[Symbols, ca.SX], ca.SX] | None = None
    link_force: Callable[[Symbols, LinkState], tuple[ca.SX, ca.SX]] | None = None
    wheel_factors: Callable[[Symbols, LinkState], tuple[ca.SX, ca.SX]] | None = None
    steering: Callable[[Symbols, ca.SX], ca.SX] | None = None
    flexibility: Callable[[Symbols], ca.SX] | None = None
    relaxation: Callable[[Symbols], ca.SX] | None = None
    gain: Callable[[Symbols, ca.SX], ca.SX] | None = None
    bias: Callable[[Symbols], ca.SX] | None = None
    command: Callable[[Symbols, Actuation], ca.SX] | None = None
    slow_down: Callable[[Symbols, ca.SX, ca.SX], ca.SX] | None = None
    slowness: Callable[[Symbols, Actuation], ca.SX] | None = None
    restoring: Callable[[Symbols, ca.SX, ca.SX], ca.SX] | None = None
    memory_rate: Callable[[Symbols, ca.SX, ca.SX], ca.SX] | None = None
    state_rate: Callable[[Symbols, Actuation], ca.SX] | None = None
    delay: Callable[[Mapping[str, Any]], Any] | None = None
    marker: Callable[[Symbols, ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]] | None = None
    camera: Callable[[Symbols, ca.SX, ca.SX], tuple[ca.SX, ca.SX]] | None = None
    clock: Callable[[Mapping[str, Any]], Any] | None = None
    clock_rate: Callable[[Mapping[str, Any]], Any] | None = None
    marker_lag: Callable[[Mapping[str, Any]], Any] | None = None
    timed: bool = False

    @property
    def size(self) -> EffectParameter:
        """The parameter whose zero means that the effect is absent."""
        return self.parameters[0]

    @property
    def place(self) -> Place | None:
        """The parameter that says where it sits, if it sits at one place."""
        return next((p for p in self.parameters if isinstance(p, Place)), None)

    @property
    def hooks(self) -> frozenset[str]:
        """Names of the hooks that it has."""
        return frozenset(name for name in HOOKS if getattr(self, name) is not None)

    @property
    def bends(self) -> bool:
        """Whether it makes the body bend under load, which takes the compliant model."""
        return self.flexibility is not None

    @property
    def in_equations(self) -> bool:
        """Whether it enters the equations of motion (delays act on the valves' schedule instead)."""
        return bool(self.hooks - OUTSIDE)

    @property
    def seen_by_camera(self) -> bool:
        """Whether it changes where points are seen."""
        return self.marker is not None or self.camera is not None

    @property
    def nonlinear_actuator(self) -> bool:
        """Whether the curvature loses its closed form."""
        return self.timed or bool(self.hooks & {"slow_down", "slowness", "restoring", "state_rate"})

    @property
    def remembers(self) -> bool:
        """Whether the segments have a further state, the effect's own."""
        return bool(self.hooks & {"memory_rate", "state_rate"})

    @property
    def knows_the_room(self) -> bool:
        """Whether the motion depends on place in the room, or on time (no periodic orbit then)."""
        return self.timed or self.kind == "room"

    @property
    def of_tether(self) -> bool:
        """Whether it acts through the tether, so that trials without one are free of it."""
        return self.kind == "tether" if self.through_tether is None else self.through_tether


# hooks that act on the valves' schedule, or on what is seen
OUTSIDE = frozenset({"delay", "marker", "camera", "clock", "clock_rate", "marker_lag"})
HOOKS = tuple(f.name for f in dataclasses.fields(Effect) if str(f.type).startswith("Callable"))


def on_link(count: int, index: int, value: Any) -> ca.SX:
    """Return a vector over all links with `value` on one of them."""
    vector = ca.SX.zeros(count, 1)
    vector[index] = value
    return vector


def to_body_frame(fx: ca.SX, fy: ca.SX, heading: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return a force that stands in the room's axes in those of a frame at `heading`."""
    return turn_back_by(ca.cos(heading), ca.sin(heading), fx, fy)
