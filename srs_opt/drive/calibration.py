"""Correcting the simulated drive by a measured map, with what is left uncertain.

Two factors, on speed and on radius, each with the scatter that no factor explains (a random-effects
mean: DerSimonian and Laird). The paper's (l + L_o)/l for the radius is the simplest such factor.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from srs_opt.document import read_yaml
from srs_opt.errors import InputError
from srs_opt.files import write_json
from srs_opt.geometry import rotate
from srs_opt.measurement.weighted_mean import weighted_mean


@dataclass(frozen=True)
class Factor:
    """A factor between measured and simulated values.

    `sd` is the standard deviation of the factor; `scatter_sd` that of single gaits about it (relative).
    """

    value: float = 1.0
    sd: float = 0.0
    scatter_sd: float = 0.0
    gaits: int = 0

    @property
    def relative_sd(self) -> float:
        """Relative standard deviation of what the drive predicts for one gait."""
        return math.hypot(self.sd / self.value, self.scatter_sd)


@dataclass(frozen=True)
class DriveCalibration:
    """Fitted factors on speed and radius."""

    speed: Factor = Factor()
    radius: Factor = Factor()

    def motion(self, speed: float | np.ndarray, turn_rate: float | np.ndarray) -> tuple:  # type: ignore[type-arg]
        """Return calibrated speed and turn rate (speed over radius)."""
        # turn rate = speed / radius, each with its own factor
        return speed * self.speed.value, turn_rate * self.speed.value / self.radius.value

    def inverse_motion(self, speed: float | np.ndarray, turn_rate: float | np.ndarray) -> tuple:  # type: ignore[type-arg]
        """Undo `motion`."""
        return speed / self.speed.value, turn_rate * self.radius.value / self.speed.value

    def deviations(self, speed: float, turn_rate: float) -> tuple[float, float]:
        """Return the standard deviations of a calibrated speed and turn rate."""
        turn_relative = math.hypot(self.speed.relative_sd, self.radius.relative_sd)
        return abs(speed) * self.speed.relative_sd, abs(turn_rate) * turn_relative

    def displacement(self, displacement: np.ndarray) -> np.ndarray:
        """Return the calibrated rigid displacement of a cycle: arc stretched by speed, bent by radius."""
        dx, dy, turn = displacement
        new_turn = turn * self.speed.value / self.radius.value
        chord = (
            # a chord is 2 radius sin(turn/2)
            self.radius.value * math.sin(new_turn / 2) / math.sin(turn / 2)
            if abs(turn) > 1e-9
            else self.speed.value
        )
        bend = (new_turn - turn) / 2  # the chord lies half the turn away from the heading
        x, y = rotate(bend, dx, dy)
        return np.array([chord * x, chord * y, new_turn])

    def margin_m(self, distance_m: float, sigmas: float = 2.0) -> float:
        """Return the clearance that uncertain speed and radius cost over `distance_m` between corrections."""
        sideways = 0.5 * distance_m * math.hypot(self.speed.relative_sd, self.radius.relative_sd)
        return sigmas * math.hypot(self.speed.relative_sd * distance_m, sideways)


NO_CALIBRATION = DriveCalibration()


def fit_factor(simulated: np.ndarray, measured: np.ndarray, sd: np.ndarray) -> Factor:
    """Return the factor measured/simulated of positive values, in logarithms, weights 1/(sd^2 + scatter^2).

    Parameters
    ----------
    simulated, measured, sd : array (n,)
        `sd` is the standard deviation of each measured value; not-a-number rows are left out.
    """
    good = np.isfinite(simulated) & np.isfinite(measured) & (simulated > 0) & (measured > 0)
    if not good.any():
        return Factor()
    ratio = np.log(measured[good] / simulated[good])
    # a stated deviation of zero would outweigh all others: 0.01 % at least
    relative_sd = np.maximum(np.nan_to_num(sd[good]) / measured[good], 1e-4)
    mean = weighted_mean(ratio, relative_sd)
    value = math.exp(mean.value)
    return Factor(value, value * mean.sd, mean.scatter, mean.tests)


def fit_calibration(
    simulated_speed: np.ndarray,
    simulated_radius: np.ndarray,
    measured_speed: np.ndarray,
    speed_sd: np.ndarray,
    measured_radius: np.ndarray,
    radius_sd: np.ndarray,
) -> DriveCalibration:
    """Fit both factors from rows of a measured map and the same gaits simulated.

    Raises
    ------
    InputError
        If no row has a measured and a simulated speed.
    """
    speed = fit_factor(np.abs(simulated_speed), np.abs(measured_speed), speed_sd)
    if speed.gaits == 0:
        raise InputError("the measured map has no speed that can be compared with the simulation")
    return DriveCalibration(speed, fit_factor(np.abs(simulated_radius), np.abs(measured_radius), radius_sd))


def save_calibration(calibration: DriveCalibration, path: Path | str) -> Path:
    """Write drive.json."""
    return write_json(path, {"version": 1, **asdict(calibration)})


def load_calibration(path: Path | str) -> DriveCalibration:
    """Read drive.json.

    Raises
    ------
    InputError
        If the file is not a drive calibration.
    """
    document = read_yaml(path, "a drive calibration (JSON)")
    try:
        record = document.value
        factors = [_factor(record[name]) for name in ("speed", "radius")]
        if record["version"] != 1 or any(f.value <= 0 for f in factors):
            raise ValueError
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: expected a drive calibration of version 1 (speed, radius factors)"
        ) from error
    return DriveCalibration(*factors)


def _factor(record: dict[str, float]) -> Factor:
    return Factor(
        float(record["value"]), float(record["sd"]), float(record["scatter_sd"]), int(record["gaits"])
    )
