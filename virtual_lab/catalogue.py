"""The effects that the laboratory can hide: the listed ones and those that are in no list.

Sizes are what a lab would start to wonder at. An effect is absent when its size, the first parameter,
is zero; the others say where or at what scale. Links and segments count from 1 at the tail.

Those in no list:

- quadratic_drag: every link, -drag |v| v, as when ploughing through sawdust;
- hose_spring: link 1, stiffness times the distance to (ax, ay) beyond the slack, towards that point;
- hose_torsion: a constant torque on the body, left when positive;
- carpet_edge: mu_t times 1 + extra where the place along `direction` exceeds edge_m (blurred over 1 cm);
- floor_waves: a floor of slope ``slope cos(2 pi s / wavelength)`` along `direction`;
- stiff_wheel: mu_t of one link times 1 + excess;
- worn_wheels: mu_n changes evenly along the body, by `gradient` in all, more at the head when positive;
- sideways_stiction: the term across the wheels times 1 + excess exp(-(v_n/speed)^2);
- bend_unloads: normal force times 1 - per_curv |mean curvature of the neighbouring segments|, at least 0;
- bend_steers: wheels turn by per_curv times that mean curvature;
- crosstalk: each segment also gets `ratio` of its neighbours' commands;
- slow_valve: one segment's left valve opens late by delay_s, its other switches are on time;
- tank_empties, compressor_ripple: the pressure's share is exp(-per_s t), 1 + ratio sin(2 pi f t);
- warming_silicone: both time constants times 1 + per_s t;
- leaking_segment: C0 of one segment times 1 - loss;
- lopsided_chambers: C0 times 1 + ratio to the left, 1 - ratio to the right (in the sign of the command);
- long_segment: one chamber longer by the share `extra`; payload: a mass on one link;
- lens_barrel: image times 1 + per_m2 r^2; rolling_shutter: link i is seen (i - 1) delay_s late;
- with --engine dart only: seized_wheel (a wheel that does not turn: its tyre slides), loose_wheel (one that
  slides along its axle by play_m to either side);
- swaying_camera: image shifted by amplitude sin(2 pi f t) along `direction`; clock_drift: t (1 + per_s).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from virtual_lab.errors import LabError


@dataclass(frozen=True)
class EffectKind:
    """One effect that can be hidden.

    Attributes
    ----------
    name : str
    parameters : tuple of str
        The size first.
    typical : float
        Typical size, in the size parameter's unit.
    signed : bool
        Whether the drawn size takes either sign. Sizes whose negative would make a passive part deliver
        energy, or the robot collapse, are drawn positive.
    part : str
        valves, bending, body, wheels, tether, room or camera.
    scales : mapping
        Typical values of parameters that are neither sizes nor places.
    listed : bool
        Whether the effect is in the list that models of this robot know.
    """

    name: str
    parameters: tuple[str, ...]
    typical: float
    signed: bool
    part: str
    scales: Mapping[str, float] = field(default_factory=dict)
    listed: bool = True

    @property
    def size(self) -> str:
        """Name of the size parameter."""
        return self.parameters[0]


def _listed(name: str, words: str, typical: float, signed: bool, part: str, **scales: float) -> EffectKind:
    return EffectKind(name, tuple(words.split()), typical, signed, part, scales)


def _unlisted(name: str, words: str, typical: float, signed: bool, part: str, **scales: float) -> EffectKind:
    return EffectKind(name, tuple(words.split()), typical, signed, part, scales, listed=False)


_LISTED = (
    _listed("tether_drag", "force_n", 0.035, False, "tether"),
    _listed("tether_viscous", "damping", 0.25, False, "tether"),
    _listed("tether_pull", "force_n ax_m ay_m", 0.03, False, "tether"),
    _listed("tether_weight", "load_n", 0.20, False, "tether"),
    _listed("gap_length", "extra_m", 0.008, True, "body"),
    _listed("gap_bending", "ratio", 0.6, True, "body"),
    _listed("chamber_stretch", "per_curv2", 2e-4, False, "body"),
    _listed("bending_resistance", "ratio", 0.18, False, "bending"),
    _listed("curvature_bias", "bias", 1.2, True, "bending"),
    _listed("segment_bias", "bias segment", 3.0, True, "bending"),
    _listed("dead_time", "delay_s", 0.03, False, "valves"),
    _listed("fill_exhaust_asymmetry", "ratio", 0.5, True, "bending"),
    _listed("supply_droop", "per_hz", 0.10, False, "bending"),
    _listed("curvature_stiffening", "per_curv2", 6e-4, False, "bending"),
    _listed("bending_compliance", "flexibility relaxation_s", 200.0, False, "bending", relaxation_s=0.005),
    _listed("hysteresis", "ratio width", 0.35, False, "bending", width=4.0),
    _listed("viscous_rolling", "damping", 0.06, False, "wheels"),
    _listed("stribeck", "excess speed", 1.0, False, "wheels", speed=0.08),
    _listed("reverse_friction", "excess", 2.0, False, "wheels"),
    _listed("slip_rate", "per_speed", 8.0, False, "wheels"),
    _listed("floor_slope", "angle direction", 0.006, False, "room"),
    _listed("head_mass", "extra_kg", 0.02, True, "body"),
    _listed("wheel_toe", "angle", 0.03, True, "wheels"),
    _listed("single_wheel_toe", "angle link", 0.10, True, "wheels"),
    _listed("marker_offset", "dx_m dy_m", 0.004, True, "camera"),
    _listed("camera_scale", "scale", 0.03, True, "camera"),
    _listed("camera_tilt", "per_m", 0.03, True, "camera"),
    _listed("clock_offset", "offset_s", 0.03, True, "camera"),
)

_UNLISTED = (
    # what the tether, the floor and the wheels can do beyond the list
    _unlisted("quadratic_drag", "drag", 0.35, False, "wheels"),
    _unlisted("hose_spring", "stiffness ax_m ay_m slack_m", 0.10, False, "tether", slack_m=0.3),
    _unlisted("hose_torsion", "torque_n_m", 1.5e-3, True, "tether"),
    _unlisted("carpet_edge", "extra direction edge_m", 2.0, False, "room", edge_m=0.08),
    _unlisted("floor_waves", "slope wavelength_m direction", 0.02, False, "room", wavelength_m=0.25),
    _unlisted("stiff_wheel", "excess link", 5.0, False, "wheels"),
    _unlisted("worn_wheels", "gradient", 0.8, True, "wheels"),
    _unlisted("sideways_stiction", "excess speed", 0.6, False, "wheels", speed=0.03),
    _unlisted("bend_unloads", "per_curv", 0.025, False, "wheels"),
    _unlisted("bend_steers", "per_curv", 0.006, True, "wheels"),
    # pneumatics and silicone
    _unlisted("crosstalk", "ratio", 0.20, False, "bending"),
    _unlisted("slow_valve", "delay_s segment", 0.08, False, "valves"),
    _unlisted("tank_empties", "per_s", 0.06, False, "bending"),
    _unlisted("compressor_ripple", "ratio frequency_hz", 0.25, False, "bending", frequency_hz=0.35),
    _unlisted("warming_silicone", "per_s", 0.12, False, "bending"),
    _unlisted("leaking_segment", "loss segment", 0.15, False, "bending"),
    _unlisted("lopsided_chambers", "ratio", 0.08, True, "bending"),
    _unlisted("long_segment", "extra segment", 0.35, True, "body"),
    _unlisted("payload", "extra_kg link", 0.03, False, "body"),
    # the camera
    _unlisted("lens_barrel", "per_m2", 0.05, True, "camera"),
    _unlisted("rolling_shutter", "delay_s", 0.012, True, "camera"),
    _unlisted(
        "swaying_camera", "amplitude_m frequency_hz direction", 0.006, False, "camera", frequency_hz=0.6
    ),
    _unlisted("clock_drift", "per_s", 0.015, True, "camera"),
)

LISTED: dict[str, EffectKind] = {kind.name: kind for kind in _LISTED}
UNLISTED: dict[str, EffectKind] = {kind.name: kind for kind in _UNLISTED}
KINDS: dict[str, EffectKind] = {**LISTED, **UNLISTED}
# in no list either, and only where trials run in the physics engine
_ENGINE = (
    _unlisted("seized_wheel", "seized link", 1.0, False, "wheels"),
    _unlisted("loose_wheel", "play_m link", 0.002, False, "wheels"),
)
ENGINE_KINDS: dict[str, EffectKind] = {kind.name: kind for kind in _ENGINE}


def find_kind(name: str) -> EffectKind:
    """Return the effect called `name`.

    Raises
    ------
    LabError
        There is none; the message suggests the nearest name.
    """
    known = {**KINDS, **ENGINE_KINDS}
    if name not in known:
        import difflib

        near = difflib.get_close_matches(name, known, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else f"; known: {', '.join(known)}"
        raise LabError(f"no effect is called '{name}'{hint}")
    return known[name]


def check_effect(effect: Mapping[str, object], links: int) -> dict[str, float]:
    """Return the parameters of ``{"name": ..., parameter: value}``, complete and numeric.

    Raises
    ------
    LabError
        A parameter is missing, unknown, not finite, or names a link or segment that is not there.
    """
    import math

    kind = find_kind(str(effect.get("name")))
    given = {key: value for key, value in effect.items() if key != "name"}
    for key in given:
        if key not in kind.parameters:
            raise LabError(
                f"effect '{kind.name}' has no parameter '{key}'; it has {', '.join(kind.parameters)}"
            )
    values: dict[str, float] = {}
    for key in kind.parameters:
        if key in given:
            value = given[key]
        elif key in kind.scales:
            value = kind.scales[key]
        else:
            raise LabError(f"effect '{kind.name}' needs '{key}'")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise LabError(f"effect '{kind.name}': '{key}' must be a finite number, found {value!r}")
        values[key] = float(value)
    for key, last in (("segment", links - 1), ("link", links)):
        if key in values and values[key] not in range(1, last + 1):
            raise LabError(f"effect '{kind.name}': {key} {values[key]:g} is not one of 1 to {last}")
    return values
