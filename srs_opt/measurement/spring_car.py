"""Friction from the spring car (paper, (16) and Fig. 7): mu = k dL_max / (m g), breakaway."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.friction import FrictionEstimate
from srs_opt.measurement.records import DIRECTIONS, SpringCarTest


def coefficient(test: SpringCarTest, gravity_m_s2: float = 9.81) -> float:
    """Return (16) for one pull; m is the mass of the test car."""
    return test.spring_n_m * test.deflection_m / (test.car_mass_kg * gravity_m_s2)


def breakaway_friction(
    tests: Sequence[SpringCarTest], gravity_m_s2: float = 9.81
) -> dict[str, FrictionEstimate]:
    """Return mean, standard deviation and standard error of (16) for each direction pulled.

    The largest deflection is reached just before the car moves, so this is breakaway friction. For sliding
    friction see `srs_opt.measurement.tow.analyse_tow`.

    Raises
    ------
    InputError
        If there is no test.
    """
    if not tests:
        raise InputError("no spring-car tests (bench/spring_car.csv) to take friction from")
    found = {}
    for direction in DIRECTIONS:
        values = np.array([coefficient(t, gravity_m_s2) for t in tests if t.direction == direction])
        if not len(values):
            continue
        sd = float(values.std(ddof=1)) if len(values) > 1 else None
        error = None if sd is None else sd / len(values) ** 0.5
        mean = float(values.mean())
        found[direction] = FrictionEstimate(direction, "breakaway", mean, sd, error, len(values))
    return found
