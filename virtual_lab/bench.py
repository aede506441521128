"""What the laboratory's other instruments measure: steps, spring car, tow, checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from virtual_lab import kernel
from virtual_lab.assemble import assemble, is_soft
from virtual_lab.files import write_table
from virtual_lab.simulate import run
from virtual_lab.trials import Schedule, Trial
from virtual_lab.truth import Truth

_NO_RHYTHM_HZ = 1e-9  # a single step has no frequency for the supply to droop with


@dataclass(frozen=True)
class Instruments:
    """How the bench works; `lifted` values are over those on the ground.

    Attributes
    ----------
    lifted_curvature, lifted_time : float
        A lifted segment bends further and faster than one that rubs on the ground (paper, Fig. 6), by these
        ratios where the body follows its valves whatever the load; a soft one does so by itself.
    breakaway : float
        Breakaway friction, which the spring car measures, over sliding friction.
    curvature_sd_1_m, spring_sd, tow_sd_n, load_sd_n, ruler_sd, light_sd_s, level_sd_rad : float
        Standard deviations of the readings (`spring_sd` relative).
    """

    lifted_curvature: float = 1.08
    lifted_time: float = 0.85
    breakaway: float = 1.06
    step_rate_hz: float = 100.0
    step_s: float = 0.8
    curvature_sd_1_m: float = 0.15
    spring_sd: float = 0.04
    tow_sd_n: float = 0.002
    load_sd_n: float = 0.005
    ruler_sd: float = 0.002
    light_sd_s: float = 0.002
    level_sd_rad: float = 0.0005


def write_bench(
    folder: Path, truth: Truth, rng: np.random.Generator, instruments: Instruments = Instruments()
) -> None:
    """Write bench/steps.csv, spring_car.csv, tow.csv and checks.csv into a data set's folder."""
    write_table(
        folder / "bench" / "steps.csv",
        ("test", "segment", "condition", "pressure_kpa", "time_s", "curvature_1_m"),
        step_rows(truth, rng, instruments),
    )
    write_table(
        folder / "bench" / "spring_car.csv",
        ("direction", "spring_n_m", "car_mass_kg", "deflection_m"),
        spring_rows(truth, rng, instruments),
    )
    write_table(
        folder / "bench" / "tow.csv",
        ("speed_m_s", "force_n", "with_tether"),
        tow_rows(truth, rng, instruments),
    )
    write_table(
        folder / "bench" / "checks.csv", ("quantity", "value", "sd"), check_rows(truth, rng, instruments)
    )


def step_rows(
    truth: Truth,
    rng: np.random.Generator,
    instruments: Instruments,
    pressures_kpa: Sequence[float] = (41.0, 55.0),
) -> list[tuple[str, int, str, str, str, str]]:
    """Return the readings of one step to the left per segment, pressure and condition."""
    rows = []
    times = np.arange(round(instruments.step_s * instruments.step_rate_hz)) / instruments.step_rate_hz
    hidden = dict(truth.hidden())
    seen = times + hidden.get("clock_offset", {}).get("offset_s", 0.0)
    for condition in ("lifted", "ground"):
        lab = truth if condition == "ground" else _lifted(truth, instruments)
        for pressure in pressures_kpa:
            for segment in range(1, truth.parameters.links):
                name = f"{condition}-{pressure:g}-{segment}"
                schedule = Schedule(((segment, 0.0, 10.0),), 10.0)
                trial = Trial(name, _NO_RHYTHM_HZ, pressure, schedule=schedule, kind="step")
                kappa = run(lab, trial, seen).kappa[:, segment - 1]
                kappa = kappa + instruments.curvature_sd_1_m * rng.standard_normal(len(kappa))
                rows += [
                    (name, segment, condition, f"{pressure:.1f}", f"{t:.4f}", f"{k:.4f}")
                    for t, k in zip(times, kappa)
                ]
    return rows


def _lifted(truth: Truth, instruments: Instruments) -> Truth:
    p = truth.parameters
    if is_soft(truth):
        return replace(truth, parameters=replace(p, friction_tangential=0.0, friction_normal=0.0))
    return replace(
        truth,
        parameters=replace(
            p,
            curvature_per_pressure_1_m_kpa=p.curvature_per_pressure_1_m_kpa * instruments.lifted_curvature,
            tau1_s=p.tau1_s * instruments.lifted_time,
            tau2_s=p.tau2_s * instruments.lifted_time,
        ),
    )


def spring_rows(
    truth: Truth, rng: np.random.Generator, instruments: Instruments, repeats: int = 6
) -> list[tuple[str, str, str, str]]:
    """Return the largest deflections of the spring that pulls a test car, (16): mu = k dL / (m g)."""
    p = truth.parameters
    rows = []
    for direction, mu, spring, car in (
        ("tangential", p.friction_tangential, 5.0, 0.100),
        ("normal", p.friction_normal, 50.0, 0.100),
    ):
        for _ in range(repeats):
            deflection = mu * instruments.breakaway * car * p.gravity_m_s2 / spring
            deflection *= 1.0 + instruments.spring_sd * rng.standard_normal()
            rows.append((direction, f"{spring:.1f}", f"{car:.4f}", f"{deflection:.6f}"))
    return rows


def tow_force(truth: Truth, speed_m_s: float, *, tether: bool = True) -> float:
    """Return the force (N) that tows the straight, unpowered robot along +x at the room's origin."""
    trial = Trial("tow", 1.0, 0.0, kind="still", tether=tether)
    tables = assemble(truth, trial, 1.0)
    ground, links = tables.ground, tables.links
    chain = np.zeros((truth.parameters.links, kernel.CHAIN_COLUMNS))
    segments = truth.parameters.links - 1
    lengths = np.zeros((segments, 3))
    lengths[:, 0] = tables.lengths
    kernel.set_chain(np.zeros((segments, 4)), lengths, ground, chain)
    state = np.array([0.0, 0.0, 0.0, speed_m_s, 0.0, 0.0])
    forces = [
        kernel.link_force(i, speed_m_s, 0.0, 1.0, 0.0, state, chain, links, ground)[0]
        for i in range(len(links))
    ]
    return -float(sum(forces))


def tow_rows(
    truth: Truth,
    rng: np.random.Generator,
    instruments: Instruments,
    speeds_m_s: Sequence[float] = (0.05, 0.1, 0.2, 0.3, 0.4),
    repeats: int = 3,
) -> list[tuple[str, str, str]]:
    """Return towing forces at several speeds, with and without the tether."""
    rows = []
    for word, tether in (("yes", True), ("no", False)):
        for speed in speeds_m_s:
            force = tow_force(truth, speed, tether=tether)
            for _ in range(repeats):
                reading = force * (1.0 + truth.scatter.friction_tangential * rng.standard_normal())
                reading += instruments.tow_sd_n * rng.standard_normal()
                rows.append((f"{speed:.3f}", f"{reading:.5f}", word))
    return rows


def check_rows(
    truth: Truth, rng: np.random.Generator, instruments: Instruments
) -> list[tuple[str, str, str]]:
    """Return readings of a scale, a ruler, a light and a level.

    ``tail_load_n``, ``head_load_n``: a scale under the first and the last wheel pair.
    ``ruler_scale``: length in the picture over length, for a short ruler at the room's origin;
    ``ruler_scale_at_1m``: the same at x = 1 m, for a ruler along y.
    ``valve_light_delay_s``: label of the picture in which a light on the valve's command comes on,
    less the command's time. ``floor_angle_rad``: a level.
    """
    tables = assemble(truth, Trial("still", 1.0, 0.0, kind="still"), 1.0)
    hidden = dict(truth.hidden())
    scale = 1.0 + hidden.get("camera_scale", {}).get("scale", 0.0)
    tilt = 1.0 + hidden.get("camera_tilt", {}).get("per_m", 0.0) * scale
    lens = 1.0 + hidden.get("lens_barrel", {}).get("per_m2", 0.0) * (scale * tilt) ** 2
    slope = math.hypot(tables.ground[kernel.SLOPE_X], tables.ground[kernel.SLOPE_Y])
    readings = (
        ("tail_load_n", float(tables.links[0, kernel.LOAD]), instruments.load_sd_n),
        ("head_load_n", float(tables.links[-1, kernel.LOAD]), instruments.load_sd_n),
        ("ruler_scale", scale, instruments.ruler_sd),
        ("ruler_scale_at_1m", scale * tilt * lens, instruments.ruler_sd),
        ("valve_light_delay_s", -hidden.get("clock_offset", {}).get("offset_s", 0.0), instruments.light_sd_s),
        ("floor_angle_rad", math.asin(slope / truth.parameters.gravity_m_s2), instruments.level_sd_rad),
    )
    return [(q, f"{value + sd * rng.standard_normal():.6f}", f"{sd:.6f}") for q, value, sd in readings]
