"""The model in the fit's coordinates: compiled structures with effects built in, and their packed parameters.

What the coordinates make of the parameters is one CasADi function, and its Jacobian is how the coordinates
move them: no effect has code of its own here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.forms import Form, form_of_entry, forms_of
from srs_opt.effects import all_effects, generic_effects, known_effects
from srs_opt.effects.effect import OUTSIDE, Effect
from srs_opt.model.parameters import COMPLIANCE_PARAMETERS, Structure, effect_symbols
from srs_opt.model.registry import build
from srs_opt.robot import Robot
from srs_opt.simulate.zero_copy import ZeroCopy

# hooks that only change a parameter of the robot, which is packed changed: no equation has to hold them
_FOLDED = {
    "gain": "curvature_per_pressure_1_m_kpa",
    "gap_extra": "gap_length_m",
    "flexibility": "bending_stiffness_n_m2",
    "relaxation": "bending_relaxation_s",
}
_CONDITIONS = ("pressure_kpa", "frequency_hz", "tether")

Values = Mapping[str, float]


@dataclass(frozen=True)
class Conditions:
    """What of a trial enters the equations."""

    pressure_kpa: float
    frequency_hz: float
    tether: bool = True


@dataclass(frozen=True)
class Packed:
    """Numbers for the equations; or their derivatives, one more axis by coordinate.

    Attributes
    ----------
    p : array (P,)
        Parameters of the full structure.
    camera : array (C,)
        Parameters of the effects that change where points are seen.
    delay_s, clock_s, clock_rate, marker_lag_s : array (1,)
        Of the valves, beyond the robot's own; the sample labelled t was taken at t (1 + rate) + clock, of
        each marker a lag later than of the one before it.
    """

    p: np.ndarray
    camera: np.ndarray
    delay_s: np.ndarray
    clock_s: np.ndarray
    clock_rate: np.ndarray
    marker_lag_s: np.ndarray


class Model:
    """One robot's equations in the fit's coordinates.

    Effects are compiled in three groups, by their hooks: none (or none that the equations must hold), those
    that leave the actuators linear, and all. So calibration is fast, and whatever a search combines is
    compiled once. Where the robot or an effect is soft, the same groups stand in the compliant model.

    Parameters
    ----------
    robot : Robot
        Bench values; effects that the robot file names are part of the model, at the file's values where
        nothing else is asked.
    model : {"complex", "simplified", "compliant"}, optional
        Default: what the robot file asks for. Under a rigid one a stiffness of the robot does not count.
    generic : bool
        Whether effects are those of the grammar (`srs_opt.effects.generic`), not the listed ones.

    Attributes
    ----------
    camera : tuple of str
        The effects that change where points are seen: those of the markers before the camera's.
    clock_drifts : bool
        Whether an effect makes the camera's clock run fast or slow.
    markers_lag : bool
        Whether an effect makes the camera see one marker after the other.

    Raises
    ------
    InputError
        If the compliant model is asked for a robot without a stiffness.
    """

    def __init__(self, robot: Robot, model: str | None = None, *, generic: bool = False) -> None:
        self.robot, self.name, self.generic = robot, model or robot.own_model, generic
        if self.name == "compliant":
            # raises where the robot has no stiffness
            Structure.of(robot, self.name)
        self._bends = self.name == "compliant" and robot.has_stiffness
        rigid, links = "complex" if self.name == "compliant" else self.name, robot.links
        listed = generic_effects() if generic else all_effects()
        present = [known_effects()[str(e["name"])] for e in robot.effects]
        effects = (*listed.values(), *(e for e in dict.fromkeys(present) if e.name not in listed))
        self.camera = tuple(
            e.name for e in sorted(effects, key=lambda e: e.marker is None) if e.seen_by_camera
        )
        self.clock_drifts = any(e.clock_rate for e in effects)
        self.markers_lag = any(e.marker_lag for e in effects)
        linear = tuple(e for e in effects if not e.nonlinear_actuator)
        groups = [_occurrences(group) for group in ((), linear, effects)]
        self.rigid, self.soft = (
            tuple(Structure(m, links, robot.friction_law, group) for group in groups)
            for m in (rigid, "compliant")
        )
        self._levels = tuple(frozenset(group) for group in groups)
        self.full = self.soft[-1]
        self.links, self.segments = links, links - 1
        self.names = _layout(self.full, self.full)
        index = {name: i for i, name in enumerate(self.names)}
        self._kept = {
            s: np.array([index[n] for n in _layout(s, self.full)]) for s in (*self.rigid, *self.soft)
        }
        self.forms = tuple(f for e in effects for f in forms_of(e, links))
        own = [(form_of_entry(e), e) for e in robot.effects]
        self.own: dict[str, float] = {}
        for form, entry in own:
            self.own |= form.values(entry)
        starts = {c.name: c.start for f in self.forms for c in f.coordinates}
        # without pressure and frequency, which come with the trial
        self._names = (*self.full.parameter_names[: -len(_CONDITIONS) + 1], *starts)
        self._column = {name: k for k, name in enumerate(self._names)}
        defaults = {**dict.fromkeys(self._names, 0.0), **starts, **self.own}
        self._defaults = np.array([defaults[name] for name in self._names])
        robot_names = self._names[: len(self._names) - len(starts)]
        self._bench = np.array([getattr(robot, n) or COMPLIANCE_PARAMETERS.get(n, 0.0) for n in robot_names])
        self._bending = {c.name for f in self.forms if f.effect.bends for c in f.sizes[:1]}

    def structure(
        self, values: Values, coordinates: Sequence[Coordinate] = ()
    ) -> tuple[Structure, np.ndarray]:
        """Return the smallest structure with the effects of `values`, and where its parameters are.

        Effects that only `coordinates` name, for derivatives at zero, are in it too.
        """
        both = {**self.own, **values}
        present = {name.split(".")[0] for name, v in both.items() if "." in name and v != 0}
        present = (present | {c.effect for c in coordinates}) & self._levels[2]
        # the smallest group that holds them all: fewer operations per step
        level = next(k for k, effects in enumerate(self._levels) if present <= effects)
        structure = (self.soft if self.is_soft(values) else self.rigid)[level]
        return structure, self._kept[structure]

    @property
    def can_bend(self) -> bool:
        """Whether effects may make the body bend under load: the simplified model has no such body."""
        return self.name != "simplified"

    def is_soft(self, values: Values) -> bool:
        """Return whether the body bends under load at `values`."""
        asked = self.can_bend and any({**self.own, **values}.get(n, 0.0) for n in self._bending)
        return self._bends or asked

    def softens(self, coordinate: Coordinate, values: Values) -> bool:
        """Return whether a body that is rigid at `values` begins to bend along `coordinate`."""
        return coordinate.name in self._bending and self.can_bend and not self.is_soft(values)

    def pack(self, values: Values, conditions: Conditions) -> Packed:
        """Return the numbers for the equations at `values`."""
        self._set(self._packing, values, conditions)
        # copies: the next call writes into the same buffers
        return Packed(*(result.reshape(-1).copy() for result in self._packing.results))

    def seeds(self, values: Values, conditions: Conditions, coordinates: Sequence[Coordinate]) -> Packed:
        """Return the derivatives of `pack` by `coordinates`, arrays (..., coordinates)."""
        columns = [self._column[c.name] for c in coordinates]
        self._set(self._jacobian, values, conditions)
        # a buffer holds a matrix column by column
        return Packed(*(result[columns].T.copy() for result in self._jacobian.results))

    def default(self, name: str) -> float:
        """Return a coordinate's value where a point says nothing."""
        return float(self._defaults[self._column[name]])

    def _set(self, function: ZeroCopy, values: Values, conditions: Conditions) -> None:
        coordinates, bench, now = function.arguments
        # the buffer still holds the last point: what this one does not name goes back to its default
        coordinates[0] = self._defaults
        for name, value in values.items():
            coordinates[0, self._column[name]] = value
        bench[0] = self._bench
        now[0] = conditions.pressure_kpa, conditions.frequency_hz, conditions.tether
        function.evaluate()

    @cached_property
    def _packing(self) -> ZeroCopy:
        return ZeroCopy(_functions(self.full, self.forms, self._names, self.camera)[0])

    @cached_property
    def _jacobian(self) -> ZeroCopy:
        return ZeroCopy(_functions(self.full, self.forms, self._names, self.camera)[1])

    def __getstate__(self) -> dict[str, object]:  # buffers do not travel
        return {k: v for k, v in self.__dict__.items() if k not in ("_packing", "_jacobian")}


def _in_compiled_equations(effect: Effect) -> bool:
    folded = effect.hooks <= {*_FOLDED, *OUTSIDE} and effect.place is None
    return effect.in_equations and not folded


def _occurrences(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Return the names of the effects that the equations must hold, as often as they stand there."""
    return tuple(e.name for e in effects if _in_compiled_equations(e) for _ in range(Form(e).copies))


def _layout(structure: Structure, full: Structure) -> tuple[str, ...]:
    """Return the packed names with effects numbered as in the full structure."""
    names = []
    for name in build(structure)[0].names:
        head, _, rest = name.partition(".")
        if rest:
            effect = rest.split(".")[0]
            copy = int(head) - structure.effects.index(effect)
            name = f"{full.effects.index(effect) + copy}.{rest}"
        names.append(name)
    return tuple(names)


@lru_cache(maxsize=8)
def _functions(
    full: Structure, forms: tuple[Form, ...], names: tuple[str, ...], seen: tuple[str, ...]
) -> tuple[ca.Function, ca.Function]:
    """Return ``(coordinates, bench, conditions) -> (p, camera, delay, clock, rate, lag)``, and Jacobians."""
    z, now = ca.SX.sym("z", len(names)), ca.SX.sym("now", len(_CONDITIONS))
    values = {name: z[k] for k, name in enumerate(names)}
    robot_names = [n for n in names if "." not in n]
    bench = ca.SX.sym("bench", len(robot_names))
    robot = {n: bench[k] * ca.exp(values[n]) for k, n in enumerate(robot_names)}
    robot |= {"pressure_kpa": now[0], "frequency_hz": now[1]}
    own = {e.name: [_over_places(e, forms, values, now[2], c) for c in range(Form(e).copies)]
           for e in dict.fromkeys(f.effect for f in forms)}  # fmt: skip
    known = known_effects()
    delay, clock, rate, lag = ca.SX(0), ca.SX(0), ca.SX(0), ca.SX(0)
    for name, copies in own.items():
        effect, e = known[name], copies[0]
        if not _in_compiled_equations(effect):
            if effect.gain:
                robot[_FOLDED["gain"]] *= effect.gain(e, now[1])
            if effect.gap_extra:
                robot[_FOLDED["gap_extra"]] += effect.gap_extra(e)
            if effect.flexibility:
                stiffness = robot[_FOLDED["flexibility"]]
                # springs in series: 1/EI' = 1/EI + flexibility
                robot[_FOLDED["flexibility"]] = stiffness / (1 + stiffness * effect.flexibility(e))
            if effect.relaxation:
                own_time = robot[_FOLDED["relaxation"]]
                robot[_FOLDED["relaxation"]] = ca.if_else(own_time > 0, own_time, effect.relaxation(e))
        delay = delay + effect.delay(e) if effect.delay else delay
        clock = clock + effect.clock(e) if effect.clock else clock
        rate = rate + effect.clock_rate(e) if effect.clock_rate else rate
        lag = lag + effect.marker_lag(e) if effect.marker_lag else lag
    p = [robot[n] for n in full.parameter_names]
    for k, name in enumerate(full.effects):
        p += list(own[name][k - full.effects.index(name)].values())
    camera = [v for name in seen for v in own[name][0].values()]
    outputs = [ca.vertcat(*p), ca.vertcat(*camera), delay, clock, rate, lag]
    inputs = [z, bench, now]
    jacobian = [ca.densify(ca.jacobian(o, z)) for o in outputs]
    options = {"cse": True}
    return ca.Function("pack", inputs, outputs, options), ca.Function("seeds", inputs, jacobian, options)


def _over_places(
    effect: Effect, forms: Sequence[Form], values: Mapping[str, ca.SX], tether: ca.SX, copy: int
) -> dict[str, ca.SX]:
    """Return an effect's parameters as its hooks get them, of size zero where conditions switch it off."""
    mine = [f.parameters(values, copy) for f in forms if f.effect is effect]
    found = {name: ca.vertcat(*(m[name] for m in mine)) for name in effect_symbols(effect, 3)}
    if effect.of_tether:
        found[effect.size.name] = found[effect.size.name] * tether
    return found


__all__ = ["Conditions", "Model", "Packed", "Values"]
