"""The compliant model: what 500 s of undulation cost beside the complex model, and known values."""

from __future__ import annotations

import math

from benchmarks.section import Section, best_time
from srs_opt.gait import Wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot, wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

STIFFNESSES = (None, 0.02, 0.01, 0.005, 0.003, 0.002)
# (offset, stiffness) -> speed m/s or radius m, of an independent program, from rest
KNOWN_SPEED = {None: 0.231, 0.02: 0.233, 0.01: 0.272, 0.005: 0.246, 0.003: 0.224, 0.002: 0.239}
KNOWN_RADIUS = {None: 0.248, 0.02: 0.246, 0.01: 0.246, 0.005: 0.236, 0.003: 0.225, 0.002: 0.210}
LIMIT = 3.0  # time over the complex model's at 0.005 N m^2


def soft(stiffness: float | None) -> Robot:
    """Return the built-in robot with a bending stiffness; friction smoothed as for the known values."""
    return wpi_srs().with_values(friction_speed_m_s=0.001, bending_stiffness_n_m2=stiffness)


def run(quick: bool) -> Section:
    """Simulate and compare."""
    duration, tries = (20.0, 5) if quick else (500.0, 3)
    rows, ratios, rigid = [], {}, {}
    for stiffness in STIFFNESSES:
        row = ["rigid" if stiffness is None else f"{stiffness:g}"]
        for label, offset in (("straight", 0.0), ("turning", 0.4)):
            gait = Wave.uniform(4, 2.0, 55.0, math.pi / 2, offset).gait()
            robot = soft(stiffness).with_values(friction_speed_m_s=0.002)
            integrator, timeline = Integrator(robot), Timeline.of_gait(gait, duration)
            rest = integrator.rest()
            integrator.integrate(timeline, rest)
            seconds = best_time(lambda: integrator.integrate(timeline, rest), tries)  # noqa: B023
            over = seconds / rigid.setdefault(label, seconds)
            row += [f"{500 / duration * seconds:.2f}", f"{over:.2f}"]
            if stiffness == 0.005:
                ratios[f"{label}, time over complex at 0.005"] = over
        straight, turning = (
            steady_gait(soft(stiffness), Wave.uniform(4, 2.0, 55.0, math.pi / 2, offset).gait())
            for offset in (0.0, 0.4)
        )
        row += [f"{straight.speed_m_s:.4f}", f"{KNOWN_SPEED[stiffness]:.3f}"]
        row += [f"{turning.radius_m:.4f}", f"{KNOWN_RADIUS[stiffness]:.3f}"]
        rows.append(row)
    columns = ["EI (N m²)", "straight: s per 500 s", "over complex", "turning: s per 500 s", "over complex"]
    columns += ["speed (m/s)", "known", "radius at offset 0.4 (m)", "known"]
    notes = [
        f"Published gait, 2 Hz, 55 kPa; every period integrated from rest; goal {LIMIT:g} times the complex "
        "model's time at 0.005 N m². Known values: an independent program, friction smoothed at 1 mm/s."
    ]
    return Section("Compliant model: time and known values", columns, rows, notes, ratios)
