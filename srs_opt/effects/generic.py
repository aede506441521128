"""Generic effects: what is in no list, described by terms of a grammar.

A term says what acts (friction along or across the wheels, load, mass, force, moment, the wheels'
direction; a segment's length, gain or time; the camera), on what it depends (nothing, direction of motion,
speed, curvature, place on the body or in the room, side, neighbours, time, pressure), and where it sits: all
links or segments, or any one. Each is an `Effect` as those of the library are, named ``generic_...``, so that
a robot file can hold it. They are asked only after the listed effects have failed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.generic_hooks import (
    across,
    along,
    beyond_edge,
    couple,
    drag,
    late,
    lens,
    neighbours,
    on_both,
    one_sided,
    own_force,
    place_on_body,
    sign,
    slack,
    spring,
    swing,
    towards,
    with_grain,
)
from srs_opt.effects.parameter import Component, Direction, EffectParameter, Scale, link, segment
from srs_opt.effects.settings import TERM

# what acts
ALONG, ACROSS = "friction along the wheels", "friction across the wheels"
LOAD, FORCE, STEERING = "load or mass", "force", "direction of the wheels"
LENGTH = "length"
GAIN, TIME, CAMERA = "actuator's gain", "actuator's time", "camera"
STIFFNESS, SLACK = "actuator's stiffness", "actuator's slack"


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
    STIFFNESS: "bend one segment after the other by hand, and compare the pressures that hold the same bend",
    SLACK: "bend one segment after the other to and fro by hand, and look where it stays",
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


def _swings(name: str, frequency_hz: float) -> _Entry:
    """Return the term of a pressure that swings, looked for from a frequency on: a fit leads so far."""
    sizes = _p("ratio", "", 0.15), Component("ahead", "", 0.15)
    parameters = (*sizes, Scale("frequency_hz", "Hz", frequency_hz, spread=0.4))
    words = "the pressure swings at {frequency_hz} Hz: by {size} in phase with a trial's start, {ahead} ahead"
    hooks = {"command": swing, "timed": True}
    return _Entry(name, "actuation", GAIN, "at a frequency", parameters, words, hooks, (0.0, 1.0, ""))


_FACTOR = (1.0, 1.0, "")
_GRAMS = (0.0, 1000.0, "g")
_PERCENT = (0.0, 100.0, "%")
_MN = (0.0, 1000.0, "mN")
_LAG = Scale("lag_s", "s", 0.06)
_ENTRIES = (
    # friction along the wheels
    _Entry("along_link", "ground", ALONG, "", (_p("excess", "", 2.0, -1), link()),
           "link {link} rolls {size} times as hard as the others",
           along(lambda e, s: 1 + e["excess"]), _FACTOR),
    _Entry("along_direction_link", "ground", ALONG, "by direction of motion",
           (_p("excess", "", 2.0, -1), link()),
           "link {link} rolls backwards {size} times as hard as forwards",
           along(lambda e, s: 1 + e["excess"] * (1 - sign(s.along)) / 2), _FACTOR),
    _Entry("along_speed_link", "ground", ALONG, "with speed", (_p("damping", "N s/m", 0.2, 0), link()),
           "rolling resistance of link {link} grows with its speed, by {size}",
           {"rolling_force": lambda e, v: -e["damping"] * v}, (0.0, 1.0, "N s/m")),
    _Entry("along_body", "ground", ALONG, "with place on the body", (_p("gradient", "", 0.8),),
           "rolling resistance {grows} from tail to head, by {amount} of its mean",
           along(lambda e, s: 1 + e["gradient"] * place_on_body(s.along.shape[0])), _PERCENT),
    _Entry("along_curvature", "ground", ALONG, "with curvature", (_p("per_curvature", "m", 0.03),),
           "rolling resistance {grows} with curvature, by {amount} of it per 1/m",
           along(lambda e, s: 1 + e["per_curvature"] * ca.fabs(s.curvature)), _PERCENT),
    _Entry("along_place", "room", ALONG, "with place in the room",
           (_p("per_m", "1/m", 1.0, 0), Direction("direction", "rad", 0.0)),
           "rolling resistance grows towards {direction} rad in the room, by {size} of it per metre",
           along(lambda e, s: 1 + e["per_m"] * towards(e, s)), _PERCENT),
    _Entry("along_edge", "room", ALONG, "with place in the room",
           (_p("excess", "", 1.5, 0), Direction("direction", "rad", 0.0), Scale("edge_m", "m", 0.1)),
           "rolling resistance is {size} times as large beyond a line {edge_m} m from the room's origin "
           "towards {direction} rad",
           along(lambda e, s: 1 + e["excess"] * beyond_edge(e, s)), _FACTOR),
    _Entry("along_grain", "room", ALONG, "with direction in the room",
           (_p("excess", "", 0.5, 0), Direction("direction", "rad", 0.0)),
           "rolling towards {direction} rad in the room is {size} harder, and back as much easier",
           along(lambda e, s: 1 + e["excess"] * with_grain(e, s)), _PERCENT),
    # friction across the wheels
    _Entry("across_link", "ground", ACROSS, "", (_p("excess", "", 0.6, -1), link()),
           "link {link} slides sideways {size} times as hard as the others",
           across(lambda e, s: 1 + e["excess"]), _FACTOR),
    _Entry("across_body", "ground", ACROSS, "with place on the body", (_p("gradient", "", 0.8),),
           "friction across the wheels {grows} from tail to head, by {amount} of its mean",
           across(lambda e, s: 1 + e["gradient"] * place_on_body(s.across.shape[0])), _PERCENT),
    _Entry("across_side", "ground", ACROSS, "by direction of motion", (_p("excess", "", 0.5),),
           "sliding to the left meets {amount} {more} friction than the mean of both sides",
           across(lambda e, s: 1 + e["excess"] * sign(s.across)), _PERCENT),
    _Entry("across_slow", "ground", ACROSS, "with speed",
           (_p("excess", "", 0.6, -1), Scale("speed", "m/s", 0.03)),
           "friction across the wheels is {size} times as large at rest, and falls back within {speed} m/s",
           across(lambda e, s: 1 + e["excess"] * ca.exp(-((s.across / e["speed"]) ** 2))), _FACTOR),
    _Entry("across_curvature", "ground", ACROSS, "with curvature", (_p("per_curvature", "m", 0.03),),
           "friction across the wheels {grows} with curvature, by {amount} of it per 1/m",
           across(lambda e, s: 1 + e["per_curvature"] * ca.fabs(s.curvature)), _PERCENT),
    _Entry("across_place", "room", ACROSS, "with place in the room",
           (_p("per_m", "1/m", 0.5, 0), Direction("direction", "rad", 0.0)),
           "friction across the wheels grows towards {direction} rad in the room, by {size} of it per metre",
           across(lambda e, s: 1 + e["per_m"] * towards(e, s)), _PERCENT),
    # load, mass
    _Entry("load_link", "ground", LOAD, "", (_p("extra_n", "N", 0.15), link()),
           "the wheels of link {link} carry {amount} {more} than its weight",
           {"extra_load": lambda e, n: e["extra_n"]}, _MN),
    _Entry("mass_link", "body", LOAD, "", (_p("extra_kg", "kg", 0.02), link()),
           "link {link} is {amount} {heavier} than the others",
           {"extra_mass": lambda e, n: e["extra_kg"]}, _GRAMS),
    _Entry("load_curvature", "ground", LOAD, "with curvature", (_p("per_curvature", "m", 0.025),),
           "the load on the wheels {grows} with curvature, by {amount} of it per 1/m",
           on_both(lambda e, s: 1 + e["per_curvature"] * ca.fabs(s.curvature)), _PERCENT),
    # forces, moments
    _Entry("force_link", "ground", FORCE, "",
           (_p("along_n", "N", 0.02), Component("across_n", "N", 0.02), link()),
           "a steady force acts on link {link}: {size} along it and {across_n} N to its left",
           {"link_force": own_force}, _MN),
    _Entry("force_place_link", "room", FORCE, "with place in the room",
           (_p("stiffness", "N/m", 0.1), Component("pull_x_n", "N", 0.03),
            Component("pull_y_n", "N", 0.03), link()),
           "link {link} is held by something elastic fixed in the room: {size}, with {pull_x_n} and "
           "{pull_y_n} N at the room's origin",
           {"link_force": spring}, (0.0, 1.0, "N/m")),
    _Entry("force_speed", "ground", FORCE, "with speed", (_p("drag", "N s^2/m^2", 0.35, 0),),
           "every link is braked with the square of its speed, by {size}",
           {"link_force": drag}, (0.0, 1.0, "N s^2/m^2")),
    _Entry("moment", "ground", FORCE, "", (_p("moment", "N m", 1.5e-3),),
           "a steady moment of {size} turns the body (+ is left)",
           {"link_force": couple}, (0.0, 1000.0, "mN m")),
    _Entry("steering_curvature", "ground", STEERING, "with curvature", (_p("per_curvature", "m", 0.006),),
           "the wheels turn with the curvature beside them, by {size} per 1/m",
           {"steering": lambda e, curvature: e["per_curvature"] * curvature}, (0.0, 1000.0, "mrad")),
    _Entry("along_time", "ground", ALONG, "with time", (_p("per_s", "1/s", 0.1),),
           "rolling resistance {grows} during a trial, by {amount} of it per second",
           {**along(lambda e, s: 1 + e["per_s"] * s.time_s), "timed": True}, _PERCENT),
    _Entry("across_time", "ground", ACROSS, "with time", (_p("per_s", "1/s", 0.1),),
           "friction across the wheels {grows} during a trial, by {amount} of it per second",
           {**across(lambda e, s: 1 + e["per_s"] * s.time_s), "timed": True}, _PERCENT),
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
           {"command": neighbours}, _PERCENT),
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
           {"slow_down": one_sided(1.0)}, _FACTOR),
    _Entry("time_right_segment", "actuation", TIME, "by side", (_p("ratio", "", 0.6, -0.8), segment()),
           "segment {segment} takes {size} times as long while its right chamber fills",
           {"slow_down": one_sided(-1.0)}, _FACTOR),
    _Entry("lag_left_segment", "actuation", TIME, "by side", (_p("ratio", "", 0.6, 0), _LAG, segment()),
           "{size} of the pressure reach the left chamber of segment {segment} late, by {lag_s} s",
           late(1.0), _PERCENT),
    _Entry("lag_right_segment", "actuation", TIME, "by side", (_p("ratio", "", 0.6, 0), _LAG, segment()),
           "{size} of the pressure reach the right chamber of segment {segment} late, by {lag_s} s",
           late(-1.0), _PERCENT),
    _Entry("stiffness_segment", "actuation", STIFFNESS, "", (_p("ratio", "", 0.2, -0.9), segment()),
           "segment {segment} is {size} times as stiff as the others",
           {"restoring": lambda e, kappa, memory: e["ratio"] * kappa}, _FACTOR),
    _Entry("slack_segment", "actuation", SLACK, "",
           (_p("ratio", "", 0.4, 0), Scale("width", "1/m", 4.0), segment()),
           "segment {segment} lags behind its pressure by {size} of {width} 1/m whichever way it goes",
           {"restoring": lambda e, kappa, memory: e["ratio"] * memory,
            "memory_rate": slack},
           _PERCENT),
    _swings("gain_swing_slow", 0.25),
    _swings("gain_swing", 0.6),
    _swings("gain_swing_fast", 1.4),
    _Entry("time_drift", "actuation", TIME, "with time", (_p("per_s", "1/s", 0.12),),
           "all segments become slower during a trial, by {size} per second",
           {"slowness": lambda e, a: ca.fmax(1 + e["per_s"] * a.time_s, TERM.least_factor), "timed": True},
           _PERCENT),
    # camera
    _Entry("camera_lens", "measurement", CAMERA, "with place in the room", (_p("per_m2", "1/m^2", 0.05),),
           "the picture is stretched with the square of the distance from its origin, by {size} per m^2",
           {"camera": lens}, _PERCENT),
    _Entry("camera_clock", "clock", CAMERA, "with time", (_p("rate", "", 0.015),),
           "the camera's clock and the valves' part by {size} of the time",
           {"clock_rate": lambda e: e["rate"]}, _PERCENT),
    _Entry("camera_rows", "clock", CAMERA, "with place on the body", (_p("lag_s", "s", 0.012),),
           "the camera sees every marker {size} later than the one before it, from the tail on",
           {"marker_lag": lambda e: e["lag_s"]}, (0.0, 1000.0, "ms")),
)  # fmt: skip

TERMS: dict[str, Term] = {term.effect.name: term for term in (entry.term() for entry in _ENTRIES)}
