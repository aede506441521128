"""Readings of other instruments as measured values of the fit: scale, ruler, light, level, tow tests."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.fit_settings import DERIVATIVE, PRIOR
from srs_opt.calibrate.model import Conditions, Model, Values
from srs_opt.calibrate.normal_equations import NormalEquations
from srs_opt.effects import known_effects
from srs_opt.effects.effect import LinkState
from srs_opt.measurement.instruments import INSTRUMENTS, Instrument, Scene
from srs_opt.measurement.records import Bench, Check, TowTest
from srs_opt.model.compliant import CompliantModel
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Structure, effect_symbols
from srs_opt.model.registry import build

NAME = "(bench)"  # stands among the trials' names


@dataclass(frozen=True)
class Reading:
    """One value that an instrument showed, and what the model says that it should show."""

    value: float
    sd: float
    expected: Callable[[Values], float]


def check_expectations(model: Model) -> Mapping[str, Callable[[Values], float]]:
    """Return what each known check should read, by its quantity: asked of the effects' own hooks."""
    still = Conditions(0.0, 1.0)
    known = tuple(INSTRUMENTS.all().values())
    function = _instrument_readings(model.full, model.camera, known)

    def reads(k: int) -> Callable[[Values], float]:
        def expected(values: Values) -> float:
            packed = model.pack(values, still)
            return float(function(packed.p, packed.camera, packed.clock_s)[k])

        return expected

    return {instrument.name: reads(k) for k, instrument in enumerate(known)}


@lru_cache(maxsize=8)
def _instrument_readings(
    structure: Structure, seen: tuple[str, ...], instruments: tuple[Instrument, ...]
) -> ca.Function:
    """Return ``(p, camera, clock_s) -> (readings)`` for the straight robot at rest."""
    parameters, m, _ = build(structure)
    clock = ca.SX.sym("clock")
    effects = [known_effects()[name] for name in seen]
    own = {e.name: effect_symbols(e, structure.links) for e in effects}
    camera = ca.vertcat(*(v for symbols in own.values() for v in symbols.values()))
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    seen_x, seen_y = x, y
    for effect in effects:
        if effect.camera:
            seen_x, seen_y = effect.camera(own[effect.name], seen_x, seen_y)
    across = ca.Function("across", [x, y, camera], [ca.jacobian(seen_y, y)])
    tilt = ca.SX(0)
    state = _resting(m)
    for effect, e in parameters.effects:
        if effect.link_force and effect.knows_the_room and not effect.of_tether:
            fx, fy = effect.link_force(e, state)
            tilt = tilt + ca.vertcat(fx[0], fy[0]) / (m.mass[0] * parameters["gravity_m_s2"])
    # 1e-24 keeps the root differentiable on a level floor
    sine = ca.sqrt(ca.sumsqr(tilt) + 1e-24)
    assert isinstance(m, CompliantModel)
    scene = Scene(
        load_n=m.normal_force(),
        magnification=lambda at_m: across(at_m, 0, camera),
        clock_s=clock,
        floor_rad=ca.asin(sine),
        flexibility_1_n_m2=1 / m.stiffness(),
        parameter=lambda name: parameters[name],
    )
    shown = [ca.SX(instrument.reads(scene)) for instrument in instruments]
    straight = [ca.substitute(r, m.shape, ca.SX.zeros(m.shape.shape)) for r in shown]
    return ca.Function("readings", [parameters.vector, camera, clock], [ca.vertcat(*straight)])


def _resting(m: Mechanics) -> LinkState:
    """Return the links at the room's origin, at rest."""
    zero, p = ca.SX.zeros(m.links, 1), m.parameters
    speed = p["friction_speed_m_s"]
    pose = zero, zero, ca.SX(0), zero, zero, m.mass, p["gravity_m_s2"], speed
    return LinkState(*pose, ca.SX.ones(m.links, 1), zero, zero, zero, zero)


def readings(model: Model, bench: Bench) -> tuple[Reading, ...]:
    """Return the bench readings that bear on the model's coordinates."""
    known = check_expectations(model)
    found = [_check(c, known[c.quantity]) for c in bench.checks if c.quantity in known and c.sd > 0]
    return (*found, *(_tow(model, test) for test in bench.tow))


def _check(check: Check, expected: Callable[[Values], float]) -> Reading:
    return Reading(check.value, check.sd, expected)


def _tow(model: Model, test: TowTest) -> Reading:
    """Return a tow test's reading; every pull has its own friction, as every trial has."""
    conditions = Conditions(0.0, 1.0, test.with_tether)
    sd = math.hypot(PRIOR.tow_sd_n, SCATTER_SD["friction_tangential"] * test.force_n)

    # in which direction of the room the robot was towed is not recorded
    level = {c.name: 0.0 for f in model.forms for c in f.sizes if f.effect.name in _of_the_floor()}

    def expected(values: Values) -> float:
        p = model.pack({**values, **level}, conditions).p
        return float(_tow_force(model.full)(test.speed_m_s, p))

    return Reading(test.force_n, sd, expected)


def _of_the_floor() -> set[str]:
    return {name for name, e in known_effects().items() if e.knows_the_room and not e.of_tether}


@lru_cache(maxsize=8)
def _tow_force(structure: Structure) -> ca.Function:
    """Return ``(speed, p) -> force`` that tows the straight robot from its head."""
    parameters, m, _ = build(structure)
    speed = ca.SX.sym("speed")
    forces = m.forces(ca.SX.zeros(3, 1), speed, ca.SX(0), ca.SX(0))
    shape = ca.vertcat(m.shape, m.shape_rate)
    total = ca.substitute(-ca.sum1(forces.x), shape, ca.SX.zeros(shape.shape))
    return ca.Function("tow", [speed, parameters.vector], [total])


def reading_equations(
    found: Sequence[Reading], values: Values, coordinates: Sequence[Coordinate], extra: int
) -> NormalEquations:
    """Return the readings' normal equations over `coordinates` and `extra` columns that they do not touch."""
    rows = np.zeros((len(found), len(coordinates) + extra + 1))
    now = {**{c.name: c.start for c in coordinates}, **values}
    for i, reading in enumerate(found):
        rows[i, -1] = (reading.value - reading.expected(now)) / reading.sd
        for k, c in enumerate(coordinates):
            h = DERIVATIVE.central_step * c.typical
            ends = [reading.expected({**now, c.name: now[c.name] + s * h}) for s in (1, -1)]
            rows[i, k] = (ends[0] - ends[1]) / (2 * h) / reading.sd
    none = np.zeros(0)
    return NormalEquations(rows.T @ rows, len(found), (), none, none)
