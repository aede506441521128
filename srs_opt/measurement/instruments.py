"""Instruments beside the camera: what each reads on a robot, documented or modelled. One object each.

A reading stands in ``bench/checks.csv`` under the instrument's name. Calibration compares it with what the
model says, with all effects that act on it; `discrepancy` proposes the instrument that separates two
explanations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from srs_opt.registry import Registry
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Scene:
    """The straight robot at rest, and what instruments see there, as CasADi expressions.

    Attributes
    ----------
    load_n : SX (N, 1)
        What each wheel pair carries.
    magnification : callable
        x (m) -> length across the picture at (x, 0) over true length.
    clock_s : SX
        By how much tracks are later than the valves.
    floor_rad : SX
        Angle of the floor.
    flexibility_1_n_m2 : SX
        1/EI of a segment, chamber and gap in series.
    parameter : callable
        Name of a model's parameter -> its value.
    """

    load_n: Any
    magnification: Callable[[float], Any]
    clock_s: Any
    floor_rad: Any
    flexibility_1_n_m2: Any
    parameter: Callable[[str], Any]


@dataclass(frozen=True)
class Instrument:
    """An instrument that shows one number.

    Attributes
    ----------
    name : str
        The quantity, unit included, as ``bench/checks.csv`` names it.
    what : str
        What to do, as a proposal names it.
    sd : float
        Standard deviation of a reading, as a proposal assumes it.
    documented : callable
        Robot file -> what it reads by that file alone.
    reads : callable
        Scene -> what it reads by the model.
    """

    name: str
    what: str
    sd: float
    documented: Callable[[Robot], float]
    reads: Callable[[Scene], Any]


def _load_n(robot: Robot) -> float:
    return robot.link_mass_kg * robot.gravity_m_s2


def _flexibility(robot: Robot) -> float:
    chamber = 1 / robot.bending_stiffness_n_m2 if robot.bending_stiffness_n_m2 else 0.0
    gap = robot.gap_length_m / robot.segment_length_m
    return chamber + (gap / robot.gap_stiffness_n_m2 if robot.gap_stiffness_n_m2 else 0.0)


def _library() -> Mapping[str, Instrument]:
    ruler = "a ruler in the picture"
    found = (
        Instrument(
            "valve_light_delay_s", "a light on the valve's command", 0.002,
            lambda robot: robot.valve_delay_s, lambda scene: -scene.clock_s,
        ),
        Instrument("ruler_scale", ruler, 0.002, lambda robot: 1.0, lambda scene: scene.magnification(0.0)),
        Instrument(
            "ruler_scale_at_1m", f"{ruler} at x = 1 m", 0.002,
            lambda robot: 1.0, lambda scene: scene.magnification(1.0),
        ),
        Instrument(
            "tail_load_n", "a scale under the tail's wheels", 0.005, _load_n, lambda scene: scene.load_n[0]
        ),
        Instrument(
            "head_load_n", "a scale under the head's wheels", 0.005, _load_n, lambda scene: scene.load_n[-1]
        ),
        Instrument(
            "floor_angle_rad", "a level on the floor", 0.001,
            lambda robot: 0.0, lambda scene: scene.floor_rad,
        ),
        # four pairs of steps know 1/EI to 3 to 5 % at 0.002 to 0.02 N m^2
        Instrument(
            "bending_flexibility_1_n_m2",
            "steps of single segments, lifted and on the ground, bench/steps.csv",
            8.0, _flexibility, lambda scene: scene.flexibility_1_n_m2,
        ),
    )  # fmt: skip
    return {instrument.name: instrument for instrument in found}


INSTRUMENTS: Registry[Instrument] = Registry(
    "instrument", _library, lambda thing: isinstance(thing, Instrument)
)


def register_instrument(instrument: Instrument) -> Instrument:
    """Make an instrument of your own known: its readings in ``bench/checks.csv`` then count in calibration.

    Raises
    ------
    InputError
        If the name is taken or no plain word.
    """
    return INSTRUMENTS.register(instrument)
