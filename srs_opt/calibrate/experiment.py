"""The trials of a data set held against the model: residuals, normal equations, readings."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.instruments import NAME, reading_equations, readings
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import Noise, track_of
from srs_opt.calibrate.normal_equations import NormalEquations
from srs_opt.calibrate.trial_simulation import TRIAL, tolerance_for
from srs_opt.calibrate.trials import Extra, Point, Request, Trials
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Bench, Trial
from srs_opt.parallel import HERE, Executor


class Experiment:
    """The trials of a data set and the model that is held against them.

    Parameters
    ----------
    model : Model
    trials : sequence of Trial
    noise : Noise, or float
        A number is the standard deviation per coordinate of white noise, m.
    bench : Bench, optional
        Readings of other instruments to hold the model against too.
    where : Executor, optional
        Who simulates the trials; the results are the same.
    groups : sequence of sequences of Trial, optional
        Trials that are asked for together, the most important first; default: all at once.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        noise: Noise | float,
        bench: Bench | None = None,
        where: Executor = HERE,
        groups: Sequence[Sequence[Trial]] = (),
    ) -> None:
        self.model, self.trials = model, tuple(trials)
        self.noise = noise if isinstance(noise, Noise) else Noise(noise)
        self.readings = readings(model, bench) if bench is not None else ()
        count = sum(track.size for track in map(track_of, self.trials) if track is not None)
        self.keeps = count <= TRIAL.most_kept_values
        tolerance = tolerance_for(count, self.noise.white_sd_m)
        self.work = Trials(model, self.trials, self.noise, tolerance, keeps=self.keeps)
        ordered = [sorted(group, key=lambda t: -t.frequency_hz) for group in groups or (self.trials,)]
        costs = [{t.name: float(t.time_s[-1]) for t in group} for group in ordered]
        self._shared = where.share(self.work, costs)
        self._rest = bench, where, groups

    def with_generic_terms(self) -> Experiment:
        """Return the same trials held against the model with the terms of the grammar as its effects."""
        model = Model(self.model.robot, self.model.name, generic=True)
        return Experiment(model, self.trials, self.noise, *self._rest)

    @property
    def sd_m(self) -> float:
        """White noise per coordinate."""
        return self.noise.white_sd_m

    def with_noise(self, noise: Noise) -> Experiment:
        """Return the same trials, and what is remembered of them, under another noise."""
        other = copy(self)
        other.noise = noise
        return other

    def _ask(self, trials: Sequence[Trial], request: Request) -> dict[str, Any]:
        found = self._shared.ask([t.name for t in trials], request)
        for answer in found.values():
            if isinstance(answer, NoAnswerError):
                raise answer
        return found

    def residuals(self, trials: Sequence[Trial], point: Point) -> list[np.ndarray]:
        """Return measured minus predicted, (T, 2 M), of several trials at `point`.

        Raises
        ------
        NoAnswerError
            If a trial cannot be simulated there.
        """
        return list(self._ask(trials, Request(point)).values())

    def normal_equations(
        self,
        point: Point,
        coordinates: Sequence[Coordinate],
        trials: Sequence[Trial] | None = None,
        extra: Extra | None = None,
        *,
        stale: bool = False,
        rough: bool = False,
    ) -> dict[str, NormalEquations]:
        """Return the normal equations of several trials.

        With `stale` the derivatives may be those of the last request for the same coordinates, which costs a
        fifth; the residuals are always those at `point`. With `rough` motions are good enough for a model
        that leaves a large misfit.

        Raises
        ------
        NoAnswerError
            If a trial cannot be simulated there.
        """
        stale = stale and self.keeps
        request = Request(point, tuple(coordinates), extra, stale, rough, self.noise)
        found: dict[str, NormalEquations] = self._ask(self.trials if trials is None else trials, request)
        if self.readings and found:
            further = next(iter(found.values())).raw.shape[0] - 1 - len(coordinates)
            found[NAME] = reading_equations(self.readings, point.values, coordinates, further)
        return found


__all__ = ["Experiment", "Point"]
