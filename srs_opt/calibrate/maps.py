"""Calibration from maps alone: speeds and curvatures of steady gaits' paths, which tell less than tracks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate, base_coordinates
from srs_opt.calibrate.data_settings import MAP_DATA
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import fit, start_point
from srs_opt.calibrate.fit_settings import DERIVATIVE
from srs_opt.calibrate.forms import form_of_entry
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.normal_equations import NormalEquations, solve
from srs_opt.calibrate.objective import priors, sum_eliminated
from srs_opt.calibrate.result import Calibration, calibration
from srs_opt.effects import known_effects
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Wave
from srs_opt.measurement.records import DataSet, MapRow, Trial
from srs_opt.orbit.body import integrator
from srs_opt.orbit.sensitivity import sensitivity
from srs_opt.orbit.steady import Orbit, steady_gaits
from srs_opt.robot import Robot


def fit_maps(
    dataset: DataSet, model: str | None = None, report: Callable[[str], None] | None = None
) -> Calibration:
    """Fit the robot's parameters to speed and path curvature of every row of maps.csv.

    The robot's own effects are part of the model, and those with a deviation are fitted, unless they leave
    steady gaits as they are (a camera's, the room's): these stay as the file says.
    Derivatives come from the steady gait's own solve. What scatters from run to run is friction and
    curvature per pressure, as the model says, and what the stated deviations hold beyond that. The result
    also says what tracks of the same gaits would have told.

    Raises
    ------
    NoAnswerError
        If no gait of the maps has a steady state.
    """
    base = (*base_coordinates(dataset.robot), *_effects_seen(dataset.robot, report))
    # rows are independent runs: none stands for several
    found = fit(Maps(dataset, model, base), base, report=report, correlated=1.0)
    before, after = math.sqrt(found.start_misfit_ratio), math.sqrt(found.misfit_ratio)
    result = calibration(dataset.robot, found, before, after)
    return replace(result, sd_with_tracks=_sd_with_tracks(dataset, model, base, Point(found.point.values)))


class Maps:
    """The rows of maps.csv, held against steady gaits.

    Parameters
    ----------
    dataset : DataSet
    model : {"complex", "simplified", "compliant"} or None
    base : sequence of Coordinate
        Robot parameters and parts of the robot's own effects.
    """

    def __init__(self, dataset: DataSet, model: str | None, base: Sequence[Coordinate]) -> None:
        self.robot, self.model = dataset.robot, model
        self.rows = dict(enumerate(dataset.maps))
        self.trials: tuple[Trial, ...] = ()
        bench = self._paths(start_point(base), base)
        if not bench:
            raise NoAnswerError("no gait of the maps has a steady state with this robot")
        self.rows = {k: self.rows[k] for k in bench}
        names = [c.name for c in base]
        scattered = [names.index(n) for n in SCATTER_SD]
        spread = {k: jacobian[:, scattered] * list(SCATTER_SD.values()) for k, (_, jacobian) in bench.items()}
        own = _own_variance(self.rows, spread, self.robot.length_m)
        self._whitening = {
            k: np.linalg.inv(_root(row, spread[k], own, self.robot.length_m)) for k, row in self.rows.items()
        }

    def normal_equations(
        self,
        point: Point,
        coordinates: Sequence[Coordinate],
        trials: Sequence[Trial] | None = None,
        *,
        stale: bool = False,
        rough: bool = False,
    ) -> dict[str, NormalEquations]:
        """Return the normal equations of every row, the derivatives always fresh and the orbits fine.

        Raises
        ------
        NoAnswerError
            If a gait that has a steady state with the bench values has none at `point`.
        """
        none = np.zeros(0)
        found = {}
        paths = self._paths(point, coordinates)
        for k, row in self.rows.items():
            if k not in paths:
                raise NoAnswerError(f"row {k + 1} of the maps has no steady state with these parameters")
            value, jacobian = paths[k]
            both = self._whitening[k] @ np.column_stack([jacobian, _measured(row) - value])
            found[f"map row {k + 1}"] = NormalEquations(both.T @ both, 2, (), none, none)
        return found

    def _paths(
        self, point: Point, coordinates: Sequence[Coordinate]
    ) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        robot = robot_at(self.robot, point.values)
        moves = [parameter_moves(self.robot, point.values, c, self.model) for c in coordinates]
        gaits = [_wave(robot, row).gait() for row in self.rows.values()]
        return {
            k: path(robot, orbit, moves, self.model)
            for k, orbit in zip(self.rows, steady_gaits(robot, gaits, self.model))
            if not isinstance(orbit, NoAnswerError)
        }


def robot_at(robot: Robot, values: Mapping[str, float]) -> Robot:
    """Return `robot` with its parameters and its own effects moved to a fit's coordinates."""
    changes = {n: getattr(robot, n) * math.exp(v) for n, v in values.items() if "." not in n}
    effects = []
    for entry in robot.effects:
        form = form_of_entry(entry)
        start = form.values(entry)
        effects.append({**entry, **form.entry({n: values.get(n, v) for n, v in start.items()})})
    return robot.with_values(**changes, effects=effects)


def parameter_moves(
    robot: Robot, values: Mapping[str, float], coordinate: Coordinate, model: str | None
) -> dict[str, float]:
    """Return the derivatives of the model's parameters, by name, by one coordinate of a fit.

    By central differences of the packing, which is smooth where an effect is present: their error is
    second order in `DerivativeSettings.central_step`.
    """
    if not coordinate.effect:
        name = coordinate.name
        return {name: getattr(robot, name) * math.exp(values.get(name, 0.0))}
    h = DERIVATIVE.central_step * coordinate.typical
    here = values.get(coordinate.name, coordinate.start)
    ends = []
    for side in (1, -1):
        run = integrator(robot_at(robot, {**values, coordinate.name: here + side * h}), model)
        ends.append(run.pack(1.0, 1.0))
    moved = (ends[0] - ends[1]) / (2 * h)
    return {n: float(d) for n, d in zip(run.parameters.names, moved) if d}


def path(
    robot: Robot, orbit: Orbit, moves: Sequence[Mapping[str, float]], model: str | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return speed (m/s) and curvature (1/m, + left) of a gait's path, and their derivatives (2, K).

    `moves` holds what each of K coordinates does to the model's parameters (`parameter_moves`).
    """
    forward = math.copysign(1.0, orbit.speed_m_s)
    speed, turn = abs(orbit.speed_m_s), orbit.turn_rate_rad_s
    by = sensitivity(robot, orbit, model).robot
    jacobian = np.empty((2, len(moves)))
    for k, move in enumerate(moves):
        by_speed, by_turn = sum((by[n] * d for n, d in move.items()), np.zeros(2))
        # curvature = turn rate / speed: the quotient rule; forwards is what maps hold
        jacobian[:, k] = forward * by_speed, (by_turn - turn / speed * forward * by_speed) / speed
    return np.array([speed, turn / speed]), jacobian


def _effects_seen(robot: Robot, report: Callable[[str], None] | None) -> list[Coordinate]:
    """Return the free parts of the robot's effects that steady gaits show; tell of those that they do not."""
    seen: list[Coordinate] = []
    for entry in robot.effects:
        effect, free = known_effects()[entry["name"]], form_of_entry(entry).refitted(entry)
        if effect.in_equations and not effect.knows_the_room:
            seen += free
        elif report:
            report(f"effect {effect.name} stays as the robot file says: maps of steady gaits cannot show it")
    return seen


def _wave(robot: Robot, row: MapRow) -> Wave:
    return Wave.uniform(robot.segments, row.frequency_hz, row.pressure_kpa, row.phase_lag_rad, row.offset)


def _measured(row: MapRow) -> np.ndarray:
    return np.array([row.speed_m_s, 0.0 if row.radius_m is None else 1 / row.radius_m])


def _own_variance(
    rows: Mapping[int, MapRow], spread: Mapping[int, np.ndarray], length_m: float
) -> np.ndarray:
    """Return the variance (2,) of one run that the scatter of friction and curvature does not explain.

    Pooled over all rows: from a few replicates alone a deviation is hardly known.
    """
    excess: list[list[float]] = [[], []]
    for k, row in rows.items():
        # sd of 1/r to first order: sd(r) / r^2
        stated = (row.speed_sd_m_s, (row.radius_sd_m or 0.0) / row.radius_m**2 if row.radius_m else 0.0)
        for i, sd in enumerate(stated):
            if sd > 0:
                excess[i].append(sd**2 - float(spread[k][i] @ spread[k][i]))
    least = np.array([MAP_DATA.least_speed_sd * length_m, MAP_DATA.least_curvature_sd / length_m])
    pooled = np.array([np.mean(e) if e else 0.0 for e in excess])
    return np.asarray(np.maximum(pooled, least**2))


def _root(row: MapRow, scatter: np.ndarray, own: np.ndarray, length_m: float) -> np.ndarray:
    """Return the Cholesky factor of a row's covariance: that of one run over the number of replicates."""
    # the mean over replicates, each with its own friction and curvature
    covariance = (scatter @ scatter.T + np.diag(own)) / max(row.replicates, 1)
    if row.radius_m is None:
        covariance[1, 1] += (MAP_DATA.straight_curvature_sd / length_m) ** 2
    return np.asarray(np.linalg.cholesky(covariance))


def _sd_with_tracks(
    dataset: DataSet, model: str | None, base: Sequence[Coordinate], point: Point
) -> dict[str, float]:
    """Return the deviations that one track of every gait, as the data set's camera sees it, would leave."""
    rows = dataset.maps[:: math.ceil(len(dataset.maps) / MAP_DATA.tracks)]
    time_s = np.arange(round(MAP_DATA.track_s * dataset.rate_hz)) / dataset.rate_hz
    blank = np.zeros((time_s.size, dataset.robot.links, 2))
    trials = [
        Trial(
            f"map row {k}", row.frequency_hz, row.pressure_kpa, row.offset, row.phase_lag_rad, 0.0,
            MAP_DATA.track_s, time_s, blank,
        )
        for k, row in enumerate(rows)
    ]  # fmt: skip
    experiment = Experiment(Model(dataset.robot, model), trials, dataset.marker_sd_m)
    # information adds up: that of some gaits, times all over some
    total = sum_eliminated(experiment.normal_equations(point, base)) * (len(dataset.maps) / len(rows))
    covariance = solve(total, range(len(base)), *priors(base, point)).covariance
    size = {
        c.name: 1.0 if c.effect else getattr(dataset.robot, c.name) * math.exp(point.values[c.name])
        for c in base
    }
    return {
        c.name: size[c.name] * float(sd) for c, sd in zip(base, np.sqrt(np.diag(covariance))) if c.reported
    }
