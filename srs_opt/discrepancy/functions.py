"""Smooth functions that a gap's residuals are projected on: where on the body, against what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.noise import Noise
from srs_opt.calibrate.observe import Prediction
from srs_opt.calibrate.smooth_variance import Amplitudes
from srs_opt.geometry import quarter_turn, unit_vectors
from srs_opt.measurement.records import Trial


@dataclass(frozen=True)
class Group:
    """Columns that answer one question.

    Attributes
    ----------
    where, against : str
        Part of the motion, and what the residual varies with.
    columns : tuple of int
        Among the residual functions.
    """

    where: str
    against: str
    columns: tuple[int, ...]


@dataclass(frozen=True)
class ResidualFunctions:
    """Builds the functions for a trial; centres of the conditions come from the whole set.

    Attributes
    ----------
    markers : int
        1 for tracks of the centre of mass.
    centres, spreads : tuple of float
        Of frequency, pressure and offset.
    """

    markers: int
    centres: tuple[float, float, float]
    spreads: tuple[float, float, float]

    @staticmethod
    def of(trials: tuple[Trial, ...]) -> ResidualFunctions:
        """Return the functions for a set of trials."""
        table = np.array([(t.frequency_hz, t.pressure_kpa, t.offset) for t in trials])
        # a condition that never changes makes no column: divided by infinity
        spread = np.where(table.std(axis=0) > 0, table.std(axis=0), np.inf)
        first = trials[0].markers_m
        markers = 1 if first is None else first.shape[1]
        return ResidualFunctions(markers, tuple(table.mean(axis=0)), tuple(spread))

    @property
    def parts(self) -> tuple[tuple[str, int], ...]:
        """Parts of the motion, each with its number of patterns."""
        if self.markers == 1:
            return (("motion along", 1), ("motion across", 1))
        bends = min(3, self.markers - 2)
        found = (
            ("motion along", 1),
            ("motion across", 1),
            ("heading", 1),
            ("bending of the body", bends),
            ("length of the body", 1),
        )
        return tuple(part for part in found if part[1])

    def groups(self) -> tuple[Group, ...]:
        """Return the groups in the order of the columns."""
        found, start = [], 0
        for where, patterns in self.parts:
            for against, count in _AGAINST:
                found.append(Group(where, against, tuple(range(start, start + patterns * count))))
                start += patterns * count
        for against, count in (("place in the room", 4), ("direction in the room", 4)):
            found.append(Group("picture", against, tuple(range(start, start + count))))
            start += count
        return tuple(found)

    def amplitudes(self, trials: Sequence[Trial], first: int) -> dict[str, Amplitudes]:
        """Return what smooth errors of every trial are made of: columns, counted from `first`.

        The picture's drift is a shift that grows evenly, about its mean; what repeats with the gait are
        its waves in any pattern.
        """
        return {t.name: self._amplitudes(first, max(float(np.ptp(t.time_s)), 1e-9)) for t in trials}

    def _amplitudes(self, first: int, duration_s: float) -> Amplitudes:
        drift: dict[int, float] = {}
        systematic: dict[int, float] = {}
        for group in self.groups():
            own = [first + k for k in group.columns]
            if group.against == "time" and group.where in ("motion along", "motion across"):
                drift |= {own[0]: 0.5 / UNIT_M, own[1]: 1 / (UNIT_M * duration_s)}
            if group.against == "gait phase":
                systematic |= dict.fromkeys(own, 1 / UNIT_M)
        return Amplitudes(drift, systematic)

    def repeated_sd(self, noise: Noise) -> np.ndarray:
        """Return by how much errors that repeat with the gait move every column alike in all trials."""
        with_gait = ("gait phase", "frequency", "pressure", "steering offset")
        size = noise.systematic_m / UNIT_M
        return np.concatenate(
            [np.full(len(g.columns), size * (g.against in with_gait)) for g in self.groups()]
        )

    def __call__(self, trial: Trial, prediction: Prediction) -> np.ndarray:
        """Return the functions at a trial's values, (T, 2 M, columns), in millimetres."""
        frames = trial.time_s.size
        points = prediction.points.reshape(frames, -1, 2)
        patterns = _patterns(points, prediction.pose[:, 2], self.parts)
        times = _times(trial, self.centres, self.spreads)
        columns = [
            pattern * function[:, None]
            for group in patterns
            for functions in times
            for pattern in group
            for function in functions
        ]
        columns += _room(points, trial.time_s)
        # a coefficient of 1 is a millimetre: columns of sizes that compare with the noise's
        return UNIT_M * np.stack(columns, axis=2)


UNIT_M = 1e-3
_AGAINST = (
    ("time", 2),
    ("gait phase", 4),
    ("frequency", 3),
    ("pressure", 3),
    ("steering offset", 3),
)


def _patterns(
    points: np.ndarray, heading: np.ndarray, parts: tuple[tuple[str, int], ...]
) -> list[list[np.ndarray]]:
    """Return displacement patterns of the markers, (T, 2 M) each, by part of the motion."""
    along = unit_vectors(heading)[:, None, :]
    across = quarter_turn(along)
    count = points.shape[1]
    place = np.linspace(-1, 1, count) if count > 1 else np.zeros(1)

    def pattern(direction: np.ndarray, weight: np.ndarray) -> np.ndarray:
        return np.asarray((direction * weight[None, :, None]).reshape(len(heading), -1))

    # nearly orthogonal over the markers, so that parts of the motion do not imitate each other
    legendre = [np.polynomial.Legendre.basis(k)(place) for k in range(5)]
    known = {
        "motion along": [pattern(along, legendre[0])],
        "motion across": [pattern(across, legendre[0])],
        "heading": [pattern(across, legendre[1])],
        "bending of the body": [pattern(across, legendre[k]) for k in (2, 3, 4)],
        "length of the body": [pattern(along, legendre[1])],
    }
    return [known[name][:n] for name, n in parts]


def _times(
    trial: Trial, centres: tuple[float, float, float], spreads: tuple[float, float, float]
) -> list[list[np.ndarray]]:
    t = trial.time_s
    one = np.ones_like(t)
    phase = 2 * math.pi * t / trial.period_s if math.isfinite(trial.period_s) else 0 * t
    waves = [np.cos(phase), np.sin(phase), np.cos(2 * phase), np.sin(2 * phase)]
    conditions = (trial.frequency_hz, trial.pressure_kpa, trial.offset)
    scaled = [(v - c) / s for v, c, s in zip(conditions, centres, spreads)]
    # about the mean, so that constant and trend do not imitate each other
    return [[one, t - t.mean()], waves, *([v * f for f in (one, *waves[:2])] for v in scaled)]


def _room(points: np.ndarray, time_s: np.ndarray) -> list[np.ndarray]:
    x, y = points[..., 0], points[..., 1]
    zero, one = np.zeros_like(x), np.ones_like(x)
    t = np.broadcast_to(time_s[:, None], x.shape)
    # an affine map of the picture, and its drift
    pairs = [(x, zero), (zero, x), (y, zero), (zero, y), (one, zero), (zero, one), (t, zero), (zero, t)]
    return [np.stack(pair, axis=2).reshape(len(time_s), -1) for pair in pairs]
