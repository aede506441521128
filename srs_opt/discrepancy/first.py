"""What to record where the data cannot be tested: trials that would show most effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from srs_opt.calibrate.candidates import all_candidates, fitted_coordinates
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import Noise
from srs_opt.calibrate.objective import priors, projected, sum_eliminated
from srs_opt.discrepancy.design import NOTHING, NextExperiment
from srs_opt.discrepancy.gap_settings import DETECTION, FIRST
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import DataSet, Trial


def first_experiment(dataset: DataSet, noise: Noise, model: str | None = None) -> NextExperiment | None:
    """Return the trials to record; their power is the median over the known effects at typical size.

    What the set's own gaits (of trials or maps) can do is what is proposed, frequency and pressure within a
    quarter of theirs.
    """
    from scipy.special import chdtri, chndtr

    trials = _trials(dataset)
    coordinates = fitted_coordinates(dataset.robot)
    candidates = [c for c in all_candidates(dataset.robot.links) if not c.form.effect.bends]
    sizes = [c.sizes[0] for c in candidates]
    point = start_point((*coordinates, *sizes))
    try:
        experiment = Experiment(Model(dataset.robot, model), trials, noise)
        equations = experiment.normal_equations(
            Point({**point.values, **{c.name: 0.0 for c in sizes}}), (*coordinates, *sizes)
        )
    except NoAnswerError:
        return None
    total, fitted = sum_eliminated(equations), len(coordinates)
    precision, _ = priors(coordinates, point)
    _, left = projected(total, fitted, precision)
    limit = chdtri(1, DETECTION.name_level / len(candidates))
    powers: dict[str, float] = {}
    for k, candidate in enumerate(candidates):
        # the deviance expected of the effect at typical size: noncentrality of the test
        gain = candidate.sizes[0].typical ** 2 * float(left[k, k])
        found = float(1 - chndtr(limit, 1, max(gain, 1e-9)))
        powers[candidate.effect] = min(found, powers.get(candidate.effect, 1.0))
    sure = sum(p > FIRST.shown_power for p in powers.values())
    frequencies = sorted({t.frequency_hz for t in trials})
    pressures = sorted({t.pressure_kpa for t in trials})
    what = (
        f"record tracks of every link in {len(trials)} trials of {trials[0].duration_s:.2g} s "
        f"({frequencies[0]:.3g} to {frequencies[-1]:.3g} Hz, {pressures[0]:.3g} to {pressures[-1]:.3g} kPa, "
        f"straight and turning): they show {sure} of {len(powers)} known effects at typical size"
    )
    return NextExperiment(
        what, (NOTHING, "any known effect"), round(float(np.median(list(powers.values()))), 3)
    )


def _trials(dataset: DataSet) -> list[Trial]:
    gaits = _gaits(dataset)
    duration_s = max(FIRST.duration_s, FIRST.cycles / min(f for f, *_ in gaits))
    time_s = np.arange(int(duration_s * FIRST.rate_hz)) / FIRST.rate_hz
    unseen = np.zeros((time_s.size, dataset.robot.links, 2))
    plain = Trial("", 1.0, 0.0, 0.0, 0.0, 0.0, duration_s, time_s, unseen)
    return [
        replace(
            plain, name=f"t{k}", frequency_hz=f, pressure_kpa=p, offset=o, phase_lag_rad=lag,
            heading_rad=k * np.pi / 2,
        )
        for k, (f, p, o, lag) in enumerate(gaits)
    ]  # fmt: skip


def _gaits(dataset: DataSet) -> Sequence[tuple[float, float, float, float]]:
    """Return (frequency, pressure, offset, phase lag) of what to record."""
    own = [
        (t.frequency_hz, t.pressure_kpa, t.offset, t.phase_lag_rad)
        for t in dataset.trials
        if t.kind == "gait"
    ]
    own += [(m.frequency_hz, m.pressure_kpa, m.offset, m.phase_lag_rad) for m in dataset.maps]
    own = sorted({g for g in own if g[0] > 0})
    if len(own) >= FIRST.trials:
        step = len(own) / FIRST.trials
        return [own[int(k * step)] for k in range(FIRST.trials)]
    frequency, pressure = FIRST.fallback_frequency_hz, FIRST.fallback_pressure_kpa
    lag = np.pi / 2
    if own:
        frequency, pressure = float(np.median([g[0] for g in own])), max(g[1] for g in own)
        lag = own[0][3]
    return [
        (
            frequency * FIRST.frequency_shares[i],
            pressure * FIRST.pressure_shares[(i + j) % 3],
            FIRST.offsets[j],
            lag,
        )
        for i in range(3)
        for j in range(3)
    ]
