"""Readings of other instruments as measured values of the fit: scale, ruler, light, level, tow tests."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.gram import TrialGram
from srs_opt.calibrate.model import Conditions, Model, Values
from srs_opt.measurement.records import Bench, Check, TowTest
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build

NAME = "(bench)"  # stands among the trials' names
TOW_SD_N = 0.002


@dataclass(frozen=True)
class Reading:
    """One value that an instrument showed, and what the model says that it should show."""

    value: float
    sd: float
    expected: Callable[[Values], float]


def check_expectations(model: Model) -> Mapping[str, Callable[[Values], float]]:
    """Return what each known check should read, by its quantity."""
    g, mass = model.robot.gravity_m_s2, model.robot.link_mass_kg

    def link_weight(values: Values) -> float:
        return mass * math.exp(values.get("link_mass_kg", 0.0)) * g

    return {
        "tail_load_n": lambda v: link_weight(v) + v.get("tether_weight.load_n", 0.0),
        "head_load_n": lambda v: link_weight(v) + g * v.get("head_mass.extra_kg", 0.0),
        "ruler_scale": _ruler,
        "ruler_scale_at_1m": lambda v: _ruler(v) * (1 + v.get("camera_tilt.per_m", 0.0) * _ruler(v)),
        "valve_light_delay_s": lambda v: -v.get("clock_offset.offset_s", 0.0),
        "floor_angle_rad": lambda v: math.hypot(v.get("floor_slope.x", 0.0), v.get("floor_slope.y", 0.0)),
    }


def _ruler(values: Values) -> float:
    return 1 + values.get("camera_scale.scale", 0.0)


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
    sd = math.hypot(TOW_SD_N, SCATTER_SD["friction_tangential"] * test.force_n)

    def expected(values: Values) -> float:
        p = model.pack({k: v for k, v in values.items() if not k.startswith("floor_slope")}, conditions)
        return float(_tow_force(model.full)(test.speed_m_s, p))

    return Reading(test.force_n, sd, expected)


@lru_cache(maxsize=8)
def _tow_force(structure: Structure) -> ca.Function:
    """Return ``(speed, p) -> force`` that tows the straight robot from its head."""
    parameters, m, _ = build(structure)
    speed = ca.SX.sym("speed")
    forces = m.forces(ca.SX.zeros(3, 1), speed, ca.SX(0), ca.SX(0))
    zero = ca.SX.zeros(m.kappa.shape)
    total = ca.substitute(-ca.sum1(forces.x), ca.vertcat(m.kappa, m.dkappa), ca.vertcat(zero, zero))
    return ca.Function("tow", [speed, parameters.vector], [total])


def reading_gram(
    found: Sequence[Reading], values: Values, coordinates: Sequence[Coordinate], extra: int
) -> TrialGram:
    """Return the readings' normal equations over `coordinates` and `extra` columns that they do not touch."""
    rows = np.zeros((len(found), len(coordinates) + extra + 1))
    now = {**{c.name: c.start for c in coordinates}, **values}
    for i, reading in enumerate(found):
        rows[i, -1] = (reading.value - reading.expected(now)) / reading.sd
        for k, c in enumerate(coordinates):
            h = 1e-4 * c.typical
            ends = [reading.expected({**now, c.name: now[c.name] + s * h}) for s in (1, -1)]
            rows[i, k] = (ends[0] - ends[1]) / (2 * h) / reading.sd
    none = np.zeros(0)
    return TrialGram(rows.T @ rows, len(found), (), none, none)
