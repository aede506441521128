"""Generic effects: what is in no list, described by terms of a grammar.

A term says what acts (friction along or across the wheels, load, mass, force, moment, the wheels'
direction; a segment's length, gain or time; the camera), on what it depends (nothing, direction of motion,
speed, curvature, place on the body or in the room, side, neighbours, time, pressure), and where it sits: all
links or segments, or any one. Each is an `Effect` as those of the library are, named ``generic_...``, so that
a robot file can hold it. They are asked only after the listed effects have failed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from srs_opt.effects.effect import Actuation, Effect, LinkState, Symbols, to_body_frame
from srs_opt.effects.parameter import Component, Direction, EffectParameter, Scale, link, segment

# what acts
ALONG, ACROSS = "friction along the wheels", "friction across the wheels"
LOAD, FORCE, STEERING = "load or mass", "force", "direction of the wheels"
LENGTH = "length"
GAIN, TIME, CAMERA = "actuator's gain", "actuator's time", "camera"

BLUR_M_S = 2e-4  # half the width of a change with the direction of motion, as in reverse_friction
EDGE_BLUR_M = 0.005  # of a line on the floor: a wheel's width
LEAST = 0.02  # what is left of friction or load at least where a term would take all and more


@dataclass(frozen=True)
class Term:
    """One term of the grammar.

    Attributes
    ----------
    effect : Effect
    acts, depends : str
    words : str
        Sentence with the fields of `sentence`.
    shown : tuple
        What is shown of the size: what is added to it, what it is multiplied by, and its unit then.
    """

    effect: Effect
    acts: str
    depends: str
    words: str
    shown: tuple[float, float, str] = (0.0, 1.0, "")

    def sentence(self, entry: Mapping[str, Any], sd: Mapping[str, float]) -> str:
        """Return what a robot file's entry says, in words, with the size's standard deviation."""
        offset, factor, unit = self.shown
        size = entry[self.effect.size.name]
        spread = sd.get(self.effect.size.name)
        value = offset + factor * size
        fields = {k: f"{v:.3g}" for k, v in entry.items() if isinstance(v, (int, float))}
        fields["size"] = _with_spread(value, factor * spread if spread else None, unit)
        fields["amount"] = _with_spread(abs(value), factor * spread if spread else None, unit)
        fields["more"], fields["heavier"] = ("more", "heavier") if size > 0 else ("less", "lighter")
        fields["grows"] = "grows" if size > 0 else "falls"
        return self.words.format(**fields)


def _with_spread(value: float, spread: float | None, unit: str) -> str:
    """Return a value to the digits that its deviation leaves, with the deviation."""
    from math import floor, log10

    end = f" {unit}" if unit else ""
    if not spread:
        return f"{value:.3g}{end}"
    digits = max(0, 1 - floor(log10(spread)))
    return f"{value:.{digits}f} \N{PLUS-MINUS SIGN} {spread:.{digits}f}{end}"


Factor = Callable[[Symbols, LinkState], ca.SX]


def _along(factor: Factor) -> dict[str, Any]:
    return {"wheel_factors": lambda e, s: (ca.fmax(factor(e, s), LEAST), 1.0)}


def _across(factor: Factor) -> dict[str, Any]:
    return {"wheel_factors": lambda e, s: (1.0, ca.fmax(factor(e, s), LEAST))}


def _on_both(factor: Factor) -> dict[str, Any]:
    def both(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
        f = ca.fmax(factor(e, s), LEAST)
        return f, f

    return {"wheel_factors": both}


def _sign(v: ca.SX) -> ca.SX:
    return ca.tanh(v / BLUR_M_S)


def _place_on_body(count: int) -> ca.DM:
    """Return where the links stand on the body, -1/2 at the tail to 1/2 at the head."""
    return ca.DM([k / (count - 1) - 0.5 for k in range(count)])


def _towards(e: Symbols, s: LinkState) -> ca.SX:
    """Return how far the links have gone in the effect's direction in the room, m."""
    return ca.cos(e["direction"]) * s.room_x + ca.sin(e["direction"]) * s.room_y


def _with_grain(e: Symbols, s: LinkState) -> ca.SX:
    """Return the cosine between a link's rolling and the effect's direction in the room."""
    turned = s.heading - e["direction"]
    return (s.cos * ca.cos(turned) - s.sin * ca.sin(turned)) * _sign(s.along)


def _beyond_edge(e: Symbols, s: LinkState) -> ca.SX:
    return (1 + ca.tanh((_towards(e, s) - e["edge_m"]) / (2 * EDGE_BLUR_M))) / 2


def _drag(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    speed = ca.sqrt(s.v_x**2 + s.v_y**2 + s.friction_speed**2)
    return -e["drag"] * speed * s.v_x, -e["drag"] * speed * s.v_y


def _own_force(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    along, across = e["along_n"], e["across_n"]
    return s.cos * along - s.sin * across, s.sin * along + s.cos * across


def _spring(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    fx = e["pull_x_n"] - e["stiffness"] * s.room_x
    fy = e["pull_y_n"] - e["stiffness"] * s.room_y
    return to_body_frame(fx, fy, s.heading)


def _couple(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    """Return a moment as opposite forces on tail and head, across the line between them."""
    c, h = ca.cos(s.heading), ca.sin(s.heading)
    dx, dy = s.room_x[-1] - s.room_x[0], s.room_y[-1] - s.room_y[0]
    ahead, left = c * dx + h * dy, c * dy - h * dx
    per_m = e["moment"] / (ahead**2 + left**2)
    fx, fy = ca.SX.zeros(s.v_x.shape), ca.SX.zeros(s.v_y.shape)
    fx[0], fy[0], fx[-1], fy[-1] = per_m * left, -per_m * ahead, -per_m * left, per_m * ahead
    return fx, fy


def _neighbours(e: Symbols, a: Actuation) -> ca.SX:
    zero = ca.SX.zeros(1, 1)
    return a.valve + e["ratio"] * (ca.vertcat(zero, a.valve[:-1]) + ca.vertcat(a.valve[1:], zero))


def _lens(e: Symbols, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    stretch = 1 + e["per_m2"] * (x**2 + y**2)
    return stretch * x, stretch * y


def _one_sided(side: float) -> Callable[[Symbols, ca.SX, ca.SX], ca.SX]:
    return lambda e, valve, kappa: 1 + e["ratio"] * (side * valve + ca.fabs(valve)) / 2


def _p(name: str, unit: str, typical: float, lower: float | None = None) -> EffectParameter:
    if lower is None:
        return EffectParameter(name, unit, typical)
    return EffectParameter(name, unit, typical, lower)


_AT = {FORCE: "on", LOAD: "of"}
_LOOK = {
    ALONG: "tow the unpowered robot, and turn its wheels by hand one after the other",
    ACROSS: "drag the wheel pairs sideways one after the other and read the force",
    LOAD: "put a scale under the wheels of every link",
    FORCE: "watch what the robot drags, what pulls it and what it touches",
    STEERING: "sight along the wheels of every link while its segments are bent",
    LENGTH: "lay a ruler along every segment and gap",
    GAIN: "pressurize one segment after the other, left and right, and read the curvatures",
    TIME: "film a step of one segment after the other, left and right",
    CAMERA: "film a ruler at several places of the picture, and a stopwatch",
}


@dataclass(frozen=True)
class _Entry:
    name: str
    kind: str
    acts: str
    depends: str
    parameters: tuple[EffectParameter, ...]
    words: str
    hooks: dict[str, Any] = field(hash=False)
    shown: tuple[float, float, str] = (0.0, 1.0, "")

    def term(self) -> Term:
        place = next((p.name for p in self.parameters if p.name in ("link", "segment")), None)
        where = f" {_AT.get(self.acts, 'of')} one {place}" if place else ""
        what = f"{self.acts}{where}, {self.depends}" if self.depends else f"{self.acts}{where}"
        effect = Effect(
            f"generic_{self.name}", self.kind, self.parameters, what=what, look=_LOOK[self.acts], **self.hooks
        )
        return Term(effect, self.acts, self.depends, self.words, self.shown)


_FACTOR = (1.0, 1.0, "")
_GRAMS = (0.0, 1000.0, "g")
_PERCENT = (0.0, 100.0, "%")
_MN = (0.0, 1000.0, "mN")
_ENTRIES = (
    # friction along the wheels
    _Entry("along_link", "ground", ALONG, "", (_p("excess", "", 2.0, -1), link()),
           "link {link} rolls {size} times as hard as the others",
           _along(lambda e, s: 1 + e["excess"]), _FACTOR),
    _Entry("along_direction_link", "ground", ALONG, "by direction of motion",
           (_p("excess", "", 2.0, -1), link()),
           "link {link} rolls backwards {size} times as hard as forwards",
           _along(lambda e, s: 1 + e["excess"] * (1 - _sign(s.along)) / 2), _FACTOR),
    _Entry("along_speed_link", "ground", ALONG, "with speed", (_p("damping", "N s/m", 0.2, 0), link()),
           "rolling resistance of link {link} grows with its speed, by {size}",
           {"rolling_force": lambda e, v: -e["damping"] * v}, (0.0, 1.0, "N s/m")),
    _Entry("along_body", "ground", ALONG, "with place on the body", (_p("gradient", "", 0.8),),
           "rolling resistance {grows} from tail to head, by {amount} of its mean",
           _along(lambda e, s: 1 + e["gradient"] * _place_on_body(s.along.shape[0])), _PERCENT),
    _Entry("along_curvature", "ground", ALONG, "with curvature", (_p("per_curvature", "m", 0.03),),
           "rolling resistance {grows} with curvature, by {amount} of it per 1/m",
           _along(lambda e, s: 1 + e["per_curvature"] * ca.fabs(s.curvature)), _PERCENT),
    _Entry("along_place", "room", ALONG, "with place in the room",
           (_p("per_m", "1/m", 1.0, 0), Direction("direction", "rad", 0.0)),
           "rolling resistance grows towards {direction} rad in the room, by {size} of it per metre",
           _along(lambda e, s: 1 + e["per_m"] * _towards(e, s)), _PERCENT),
    _Entry("along_edge", "room", ALONG, "with place in the room",
           (_p("excess", "", 1.5, 0), Direction("direction", "rad", 0.0), Scale("edge_m", "m", 0.1)),
           "rolling resistance is {size} times as large beyond a line {edge_m} m from the room's origin "
           "towards {direction} rad",
           _along(lambda e, s: 1 + e["excess"] * _beyond_edge(e, s)), _FACTOR),
    _Entry("along_grain", "room", ALONG, "with direction in the room",
           (_p("excess", "", 0.5, 0), Direction("direction", "rad", 0.0)),
           "rolling towards {direction} rad in the room is {size} harder, and back as much easier",
           _along(lambda e, s: 1 + e["excess"] * _with_grain(e, s)), _PERCENT),
    # friction across the wheels
    _Entry("across_link", "ground", ACROSS, "", (_p("excess", "", 0.6, -1), link()),
           "link {link} slides sideways {size} times as hard as the others",
           _across(lambda e, s: 1 + e["excess"]), _FACTOR),
    _Entry("across_body", "ground", ACROSS, "with place on the body", (_p("gradient", "", 0.8),),
           "friction across the wheels {grows} from tail to head, by {amount} of its mean",
           _across(lambda e, s: 1 + e["gradient"] * _place_on_body(s.across.shape[0])), _PERCENT),
    _Entry("across_side", "ground", ACROSS, "by direction of motion", (_p("excess", "", 0.5),),
           "sliding to the left meets {amount} {more} friction than the mean of both sides",
           _across(lambda e, s: 1 + e["excess"] * _sign(s.across)), _PERCENT),
    _Entry("across_slow", "ground", ACROSS, "with speed",
           (_p("excess", "", 0.6, -1), Scale("speed", "m/s", 0.03)),
           "friction across the wheels is {size} times as large at rest, and falls back within {speed} m/s",
           _across(lambda e, s: 1 + e["excess"] * ca.exp(-((s.across / e["speed"]) ** 2))), _FACTOR),
    _Entry("across_curvature", "ground", ACROSS, "with curvature", (_p("per_curvature", "m", 0.03),),
           "friction across the wheels {grows} with curvature, by {amount} of it per 1/m",
           _across(lambda e, s: 1 + e["per_curvature"] * ca.fabs(s.curvature)), _PERCENT),
    _Entry("across_place", "room", ACROSS, "with place in the room",
           (_p("per_m", "1/m", 0.5, 0), Direction("direction", "rad", 0.0)),
           "friction across the wheels grows towards {direction} rad in the room, by {size} of it per metre",
           _across(lambda e, s: 1 + e["per_m"] * _towards(e, s)), _PERCENT),
    # load, mass
    _Entry("load_link", "ground", LOAD, "", (_p("extra_n", "N", 0.15), link()),
           "the wheels of link {link} carry {amount} {more} than its weight",
           {"extra_load": lambda e, n: e["extra_n"]}, _MN),
    _Entry("mass_link", "body", LOAD, "", (_p("extra_kg", "kg", 0.02), link()),
           "link {link} is {amount} {heavier} than the others",
           {"extra_mass": lambda e, n: e["extra_kg"]}, _GRAMS),
    _Entry("load_curvature", "ground", LOAD, "with curvature", (_p("per_curvature", "m", 0.025),),
           "the load on the wheels {grows} with curvature, by {amount} of it per 1/m",
           _on_both(lambda e, s: 1 + e["per_curvature"] * ca.fabs(s.curvature)), _PERCENT),
    # forces, moments
    _Entry("force_link", "ground", FORCE, "",
           (_p("along_n", "N", 0.02), Component("across_n", "N", 0.02), link()),
           "a steady force acts on link {link}: {size} along it and {across_n} N to its left",
           {"link_force": _own_force}, _MN),
    _Entry("force_place_link", "room", FORCE, "with place in the room",
           (_p("stiffness", "N/m", 0.1), Component("pull_x_n", "N", 0.03),
            Component("pull_y_n", "N", 0.03), link()),
           "link {link} is held by something elastic fixed in the room: {size}, with {pull_x_n} and "
           "{pull_y_n} N at the room's origin",
           {"link_force": _spring}, (0.0, 1.0, "N/m")),
    _Entry("force_speed", "ground", FORCE, "with speed", (_p("drag", "N s^2/m^2", 0.35, 0),),
           "every link is braked with the square of its speed, by {size}",
           {"link_force": _drag}, (0.0, 1.0, "N s^2/m^2")),
    _Entry("moment", "ground", FORCE, "", (_p("moment", "N m", 1.5e-3),),
           "a steady moment of {size} turns the body (+ is left)",
           {"link_force": _couple}, (0.0, 1000.0, "mN m")),
    _Entry("steering_curvature", "ground", STEERING, "with curvature", (_p("per_curvature", "m", 0.006),),
           "the wheels turn with the curvature beside them, by {size} per 1/m",
           {"steering": lambda e, curvature: e["per_curvature"] * curvature}, (0.0, 1000.0, "mrad")),
    # segments
    _Entry("length_segment", "body", LENGTH, "", (_p("extra", "", 0.3, -0.8), segment()),
           "the chamber of segment {segment} is {size} times as long as the others",
           {"stretch": lambda e, no_load: e["extra"]}, _FACTOR),
    _Entry("gain_segment", "actuation", GAIN, "", (_p("ratio", "", 0.1, -0.9), segment()),
           "segment {segment} bends {size} times as far as the others",
           {"gain": lambda e, frequency: 1 + e["ratio"]}, _FACTOR),
    _Entry("gain_side", "actuation", GAIN, "by side", (_p("ratio", "", 0.08),),
           "all segments bend {amount} {more} to the left, and as much the other way to the right",
           {"command": lambda e, a: a.valve + e["ratio"] * a.valve**2}, _PERCENT),
    _Entry("gain_neighbours", "actuation", GAIN, "with the neighbours' valves", (_p("ratio", "", 0.2),),
           "every segment also follows its neighbours' valves, with {size} of their pressure",
           {"command": _neighbours}, _PERCENT),
    _Entry("gain_time", "actuation", GAIN, "with time", (_p("per_s", "1/s", 0.06),),
           "the pressure decays from the start of a trial on, at a rate of {size} per second",
           {"command": lambda e, a: a.valve * ca.exp(-e["per_s"] * a.time_s), "timed": True}, _PERCENT),
    _Entry("gain_pressure", "actuation", GAIN, "with pressure", (_p("per_kpa", "1/kPa", 0.004),),
           "the curvature per pressure {grows} with pressure, by {amount} of it per kPa",
           {"command": lambda e, a: a.valve * (1 + e["per_kpa"] * (a.pressure_kpa - 50.0))}, _PERCENT),
    _Entry("time_segment", "actuation", TIME, "", (_p("ratio", "", 0.4, -0.8), segment()),
           "segment {segment} takes {size} times as long as the others",
           {"slow_down": lambda e, valve, kappa: 1 + e["ratio"]}, _FACTOR),
    _Entry("time_left_segment", "actuation", TIME, "by side", (_p("ratio", "", 0.6, -0.8), segment()),
           "segment {segment} takes {size} times as long while its left chamber fills",
           {"slow_down": _one_sided(1.0)}, _FACTOR),
    _Entry("time_right_segment", "actuation", TIME, "by side", (_p("ratio", "", 0.6, -0.8), segment()),
           "segment {segment} takes {size} times as long while its right chamber fills",
           {"slow_down": _one_sided(-1.0)}, _FACTOR),
    _Entry("time_drift", "actuation", TIME, "with time", (_p("per_s", "1/s", 0.12),),
           "all segments become slower during a trial, by {size} per second",
           {"slowness": lambda e, a: ca.fmax(1 + e["per_s"] * a.time_s, LEAST), "timed": True}, _PERCENT),
    # camera
    _Entry("camera_lens", "measurement", CAMERA, "with place in the room", (_p("per_m2", "1/m^2", 0.05),),
           "the picture is stretched with the square of the distance from its origin, by {size} per m^2",
           {"camera": _lens}, _PERCENT),
    _Entry("camera_clock", "clock", CAMERA, "with time", (_p("rate", "", 0.015),),
           "the camera's clock and the valves' part by {size} of the time",
           {"clock_rate": lambda e: e["rate"]}, _PERCENT),
)  # fmt: skip

TERMS: dict[str, Term] = {term.effect.name: term for term in (entry.term() for entry in _ENTRIES)}
