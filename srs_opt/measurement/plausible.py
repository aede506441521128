"""Ranges outside which a value cannot be what its column says: mostly units wrong by a thousand."""

from __future__ import annotations

import math

from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import Row

TURN = 2 * math.pi


def factor_of_thousand(ratio: float) -> str:
    """Return the prefix that explains a ratio found/expected: 'milli' for 1000, 'micro', 'kilo' or ''.

    A value in milli-units is a thousand times too large a number.
    """
    if not ratio > 0 or not math.isfinite(ratio):
        return ""
    for prefix, factor in (("milli", 1e3), ("micro", 1e6), ("kilo", 1e-3), ("nano", 1e9)):
        if 1 / 3 < ratio / factor < 3:
            return prefix
    return ""


def bend_rad(pressure_kpa: float, robot: Robot) -> float:
    """Return by how much a pressure bends a segment, rad."""
    return robot.curvature_per_pressure_1_m_kpa * pressure_kpa * robot.segment_length_m


def check_robot(robot: Robot, file: str, report: Report) -> None:
    """Report a robot whose mass or size cannot be meant in kg and m."""
    density = robot.link_mass_kg / (robot.pitch_m * max(robot.body_width_m, 1e-3) ** 2)
    message = f"link_mass_kg: {robot.link_mass_kg:g} kg in {robot.pitch_m:g} m of body"
    if density > 3e4:
        report.error(file, None, f"{message} is denser than lead: in grams?")
    elif density < 0.5:
        report.error(file, None, f"{message} is lighter than air: lengths not in metres?")
    if robot.friction_normal < robot.friction_tangential:
        report.warn(
            file,
            None,
            f"friction_normal {robot.friction_normal:g} is below friction_tangential "
            f"{robot.friction_tangential:g}: this body has no wheels, and goes along its wave",
        )
    if robot.tau1_s > 20 or robot.tau2_s > 20:
        report.error(file, None, f"tau1_s, tau2_s: {robot.tau1_s:g}, {robot.tau2_s:g} s: in milliseconds?")


def check_trial_row(
    row: Row, values: dict[str, float], kind: str, robot: Robot, rate_hz: float, report: Report
) -> None:
    """Report values of a row of trials.csv that no run of this robot can have."""

    def error(message: str) -> None:
        report.error(row.file, row.line, message)

    frequency, duration, pressure = values["frequency_hz"], values["duration_s"], values["pressure_kpa"]
    if duration <= 0:
        error(f"duration_s: must be above 0, found {duration:g}")
    if kind == "gait":
        _check_frequency(row, frequency, duration, rate_hz, report)
    elif frequency < 0:
        error(f"frequency_hz: must not be negative, found {frequency:g}")
    bend = bend_rad(pressure, robot)
    if pressure < 0:
        error(f"pressure_kpa: must not be negative, found {pressure:g}")
    elif bend > TURN:
        hint = " (in pascals?)" if bend / 1000 > 0.01 else ""
        error(f"pressure_kpa: {pressure:g} kPa would bend a segment by {bend:.3g} rad{hint}")
    elif bend < 0.01 and kind == "gait":
        hint = " (in megapascals?)" if bend * 1000 > 0.02 else ""
        error(f"pressure_kpa: {pressure:g} kPa would bend a segment by only {bend:.3g} rad{hint}")
    for column in ("phase_lag_rad", "heading_rad"):
        if abs(values[column]) > TURN + 1e-3:
            error(f"{column}: expected radians within one turn, found {values[column]:g} (degrees?)")
    if abs(values["offset"]) >= 1 and kind == "gait":
        report.warn(
            row.file, row.line, f"offset: {values['offset']:g} is 1 or more, so the valves never switch"
        )


def _check_frequency(row: Row, frequency: float, duration: float, rate_hz: float, report: Report) -> None:
    if frequency <= 0:
        report.error(row.file, row.line, f"frequency_hz: must be above 0, found {frequency:g}")
    elif rate_hz > 0 and frequency > rate_hz / 4:
        hint = " (in millihertz?)" if frequency >= 100 else ""
        message = f"frequency_hz: {frequency:g} Hz is too fast for a camera of {rate_hz:g} Hz{hint}"
        report.error(row.file, row.line, message)
    elif 0 < frequency * duration < 0.05:
        message = f"frequency_hz: {frequency:g} Hz makes {frequency * duration:.2g} cycles in the trial"
        report.error(row.file, row.line, f"{message} (in kilohertz?)")
    elif 0 < frequency * duration < 1:
        message = f"frequency_hz: the trial lasts {frequency * duration:.2g} cycles, less than one"
        report.warn(row.file, row.line, message)
