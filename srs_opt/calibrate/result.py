"""What a calibration found: the robot with error bars, correlations, and what the data could not tell."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.calibrate.candidates import entry_after
from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.fit_settings import CALIBRATION_REPORT
from srs_opt.calibrate.noise import Noise
from srs_opt.result import Result
from srs_opt.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Calibration(Result):
    """A calibrated robot.

    Attributes
    ----------
    robot : Robot
        With calibrated values, their relative_sd and sources.
    parameters, sd : dict
        Estimates and standard deviations, in the parameters' units; of the robot's effects the fit's
        coordinates (a size, or its components; logarithms of scales).
    correlation : array (K, K)
        Of the parameters, in their order.
    unidentifiable : tuple of str
        Directions about which the data say no more than the bench did.
    before, after : float
        Root mean square misfit over the noise, at the bench values and at the estimates.
    off_bench : mapping
        By how many of its deviations each value lies from its bench value.
    noise : Noise or None
        That the tracks show; None from maps.
    set_aside : mapping
        Trials that could not be used or contradict their entry or the others, and why.
    sd_with_tracks : dict or None
        For a calibration from maps alone: the deviations that tracks of the same gaits would leave.
    """

    robot: Robot
    parameters: dict[str, float]
    sd: dict[str, float]
    correlation: np.ndarray
    unidentifiable: tuple[str, ...]
    before: float
    after: float
    off_bench: Mapping[str, float] = field(default_factory=dict)
    noise: Noise | None = None
    set_aside: Mapping[str, str] = field(default_factory=dict)
    sd_with_tracks: dict[str, float] | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader should not overlook: values far from where the bench had them."""
        return bench_warnings(self.off_bench)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of the command."""
        names = list(self.parameters)
        return {
            "parameters": self.parameters,
            "sd": self.sd,
            "unidentifiable": list(self.unidentifiable),
            "misfit": {"before": self.before, "after": self.after},
            "warnings": list(self.warnings),
            "noise": None if self.noise is None else asdict(self.noise),
            "set_aside": [{"trial": name, "reason": why} for name, why in self.set_aside.items()],
            "data": "tracks" if self.sd_with_tracks is None else "maps",
            "sd_with_tracks": self.sd_with_tracks,
            "correlation": {
                a: {b: round(float(self.correlation[i, j]), 4) for j, b in enumerate(names)}
                for i, a in enumerate(names)
            },
            "robot": self.robot.to_record(),
        }

    def in_words(self) -> str:
        """Return the misfit before and after, and what was calibrated."""
        return f"misfit over noise {self.before:.3f} -> {self.after:.3f}; {', '.join(self.parameters)}"

    def figure(self) -> Figure:
        """Return a bar per value: its distance from the bench value, in deviations of the bench."""
        from srs_opt.calibrate.figures import bench_figure

        return bench_figure(self, CALIBRATION_REPORT.off_bench_sd)


def bench_warnings(off_bench: Mapping[str, float]) -> tuple[str, ...]:
    """Return a line for every value that lies further from its bench value than the bench can be wrong."""
    return tuple(
        f"{name} lies {abs(off):.1f} standard deviations {'above' if off > 0 else 'below'} its bench value: "
        "the bench is wrong, or the value makes up for something that the model lacks"
        for name, off in off_bench.items()
        if abs(off) > CALIBRATION_REPORT.off_bench_sd
    )


def calibrated_robot(robot: Robot, fit: Fit) -> Robot:
    """Return `robot` with the fit's values; fixed values and v_s, a nuisance of the fit, stay."""
    changes, deviations, sources = {}, dict(robot.relative_sd), dict(robot.sources)
    for coordinate in fit.coordinates:
        if not coordinate.effect and coordinate.reported:
            name = coordinate.name
            changes[name] = getattr(robot, name) * math.exp(fit.point.values[name])
            deviations[name] = fit.sd[name]
            sources[name] = "calibrated"
    effects = [entry_after(entry, fit) for entry in robot.effects]
    return robot.with_values(**changes, effects=effects, relative_sd=deviations, sources=sources)


def calibration(
    robot: Robot, fit: Fit, before: float, after: float, noise: Noise | None = None
) -> Calibration:
    """Return the calibration behind a fit of the base coordinates."""
    corrected = calibrated_robot(robot, fit)
    index = [i for i, c in enumerate(fit.coordinates) if c.reported]
    names = [fit.coordinates[i].name for i in index]
    values = {n: fit.point.values[n] if "." in n else float(getattr(corrected, n)) for n in names}
    sds = {n: fit.sd[n] if "." in n else values[n] * fit.sd[n] for n in names}
    covariance = fit.covariance[np.ix_(index, index)]
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return Calibration(
        corrected,
        values,
        sds,
        covariance / size[:, None] / size,
        unidentifiable([fit.coordinates[i] for i in index], covariance),
        before,
        after,
        fit.off_bench,
        noise,
    )


def unidentifiable(coordinates: list[Coordinate], covariance: np.ndarray) -> tuple[str, ...]:
    """Return the directions whose posterior deviation is nearly their prior's.

    Directions are the eigenvectors of the posterior covariance in units of the priors.
    """
    prior = np.array([c.prior_sd for c in coordinates])
    # eigenvalue 1: the data say nothing there
    values, vectors = np.linalg.eigh(covariance / prior[:, None] / prior)
    found = []
    for value, vector in zip(values, vectors.T):
        if math.sqrt(max(value, 0.0)) >= CALIBRATION_REPORT.uninformed_share:
            # the largest have a name whatever they are: of twelve alike values each has a part of 0.29
            least = min(CALIBRATION_REPORT.named_part, 0.99 * float(np.abs(vector).max()))
            parts = [(abs(w), w, c.name) for w, c in zip(vector, coordinates) if abs(w) > least]
            parts.sort(reverse=True)
            # in logarithms a direction is a product of powers; its sign is that of the largest part
            sign = math.copysign(1.0, parts[0][1])
            words = [name if w * sign > 0 else f"1/{name}" for _, w, name in parts]
            found.append(" * ".join(words))
    return tuple(found)
