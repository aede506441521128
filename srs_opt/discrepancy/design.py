"""Step 10: the experiment that would tell the rivals apart, with the power to expect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.gram import bounded_solve
from srs_opt.calibrate.instruments import check_expectations
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.select import Selection
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Schedule, Trial

LEVEL = 10.0  # deviance that tells two hypotheses apart
SURE = 0.95  # power from which on an effect's own instrument is asked before further trials
_SECONDS, _RATE_HZ = 4.0, 60.0


@dataclass(frozen=True)
class NextExperiment:
    """What to do next.

    Attributes
    ----------
    what : str
    separates : tuple of str
        The rivals.
    expected_power : float
        Probability that it decides between them, if one of them is right.
    """

    what: str
    separates: tuple[str, ...]
    expected_power: float


# what a further instrument shows (a quantity of bench/checks.csv) and its standard deviation
INSTRUMENTS = {
    "valve_light_delay_s": ("a light on the valve's command", 0.002),
    "ruler_scale": ("a ruler in the picture", 0.002),
    "ruler_scale_at_1m": ("a ruler in the picture at x = 1 m", 0.002),
    "tail_load_n": ("a scale under the tail's wheels", 0.005),
    "head_load_n": ("a scale under the head's wheels", 0.005),
    "floor_angle_rad": ("a level on the floor", 0.001),
    # four pairs of steps know 1/EI to 3 to 5 % at 0.002 to 0.02 N m^2
    "bending_flexibility_1_n_m2": (
        "steps of single segments, lifted and on the ground, bench/steps.csv",
        8.0,
    ),
}


def rivals_of(selection: Selection, fitted: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return what an experiment should tell apart: the rivals, or, where nothing fits, the two best stories.

    The stories are the best fits that put the fault into different stages of the model, so that the answer
    says where to look.
    """
    from srs_opt.model.effects import known_effects

    found = [selection.best, *selection.rivals]
    if len(found) > 1 or not selection.best.candidates:
        return tuple(found)

    def stages(h: Hypothesis) -> set[str]:
        return {known_effects()[c.effect].kind for c in h.candidates}

    own = stages(selection.best)
    others = [h for h in fitted if h.candidates and stages(h) != own]
    return (selection.best, *sorted(others, key=lambda h: h.deviance)[:1])


def next_experiment(
    experiment: Experiment, rivals: Sequence[Hypothesis], trials: Sequence[Trial]
) -> NextExperiment | None:
    """Return the instrument or trial that best separates the two leading rivals."""
    if len(rivals) < 2 or not trials:
        return None
    first, second = rivals[0], rivals[1]
    expected = check_expectations(experiment.model)
    options = {
        f"{what} ({quantity})": _instrument_gain(expected[quantity], sd, first, second)
        for quantity, (what, sd) in INSTRUMENTS.items()
    }
    new = proposals(experiment, trials)
    both = [_trial_gains(experiment, a, b, new) for a, b in ((first, second), (second, first))]
    options |= {what: min(gains[what] for gains in both) for what in new}
    direct = [f"{INSTRUMENTS[q][0]} ({q})" for q in _own_instruments(first, second)]
    sure = {what: options[what] for what in direct if power(options[what]) > SURE}
    what, gain = max((sure or options).items(), key=lambda item: item[1])
    names = tuple(" + ".join(h.names) for h in rivals)
    return NextExperiment(what, names, round(power(gain), 3))


def _own_instruments(a: Hypothesis, b: Hypothesis) -> list[str]:
    """Return the quantities that measure directly an effect that one of two hypotheses holds."""
    from srs_opt.model.effects import known_effects

    asked = (known_effects()[name].instrument for name in {*a.names} ^ {*b.names})
    return sorted({q for q in asked if q in INSTRUMENTS})


def power(gain: float) -> float:
    """Return the probability that a separation of expected deviance `gain` exceeds the level that decides."""
    from scipy.special import chndtr

    return float(1 - chndtr(LEVEL, 1, max(gain, 1e-9)))


def _instrument_gain(
    expected: Callable[[Mapping[str, float]], float], sd: float, a: Hypothesis, b: Hypothesis
) -> float:
    """Return the deviance by which a reading would tell two hypotheses apart."""
    readings = [expected(h.fit.point.values) for h in (a, b)]
    variance = max(_reading_variance(expected, h) for h in (a, b))
    return float((readings[0] - readings[1]) ** 2 / (sd**2 + variance))


def _reading_variance(expected: Callable[[Mapping[str, float]], float], h: Hypothesis) -> float:
    """Return how well a hypothesis knows what the instrument will show, as a variance, to first order."""
    values = h.fit.point.values
    slopes = np.zeros(len(h.fit.coordinates))
    for k, c in enumerate(h.fit.coordinates):
        step = 1e-4 * c.typical
        ends = [expected({**values, c.name: values[c.name] + s * step}) for s in (1, -1)]
        slopes[k] = (ends[0] - ends[1]) / (2 * step)
    return float(slopes @ h.fit.covariance @ slopes)


def proposals(experiment: Experiment, trials: Sequence[Trial]) -> Mapping[str, Trial]:
    """Return trials worth considering, beside repeats of what was done."""
    model = max(trials, key=lambda t: (t.pressure_kpa, t.frequency_hz))
    time_s = np.arange(int(_SECONDS * _RATE_HZ)) / _RATE_HZ
    seen = experiment.model.links if model.spots is None else len(model.spots)
    blank = np.zeros((time_s.size, seen, 2))
    plain = replace(
        model,
        time_s=time_s,
        markers_m=blank,
        centre_m=None,
        duration_s=_SECONDS,
        schedule=None,
        moving=False,
    )
    segments = experiment.model.segments
    steps = Schedule("step", 2.0, ((1, 0.0, 1.0),))
    found = {
        "a trial with the tether taken off": replace(plain, tether=False),
        "a slow, strong gait (0.5 Hz, 55 kPa)": replace(plain, frequency_hz=0.5, pressure_kpa=55.0),
        "a fast, weak gait (2.5 Hz, 35 kPa)": replace(plain, frequency_hz=2.5, pressure_kpa=35.0),
        "a fast, long wave (2 Hz, lag 0.9 rad)": replace(plain, frequency_hz=2.0, phase_lag_rad=0.9),
        "the same gait in the opposite heading": replace(plain, heading_rad=plain.heading_rad + np.pi),
    }
    for segment in range(1, segments + 1):
        one = replace(steps, intervals=((segment, 0.0, 1.0),))
        step = replace(plain, schedule=one, frequency_hz=0.5, kind="step")
        found[f"a step of segment {segment} alone"] = step
    return {what: replace(trial, name=what) for what, trial in found.items()}


def _trial_gains(
    experiment: Experiment, truth: Hypothesis, other: Hypothesis, new: Mapping[str, Trial]
) -> dict[str, float]:
    """Return the deviance by which `other`, refitted to all data, would miss what `truth` predicts."""
    trials = tuple(new.values())
    known = np.linalg.pinv(other.fit.covariance, hermitian=True)
    free = [k for k in range(len(other.fit.coordinates)) if other.fit.covariance[k, k] > 0]
    none = np.zeros(len(other.fit.coordinates))
    try:
        blank = Experiment(experiment.model, trials, experiment.noise)  # its markers stand at zero
        against = blank.residuals(trials, Point(truth.fit.point.values))
        seen = [replace(t, markers_m=-r.reshape(r.shape[0], -1, 2)) for t, r in zip(trials, against)]
        grams = Experiment(experiment.model, seen, experiment.noise).grams(
            Point(other.fit.point.values), other.fit.coordinates
        )
    except NoAnswerError:
        return dict.fromkeys(new, 0.0)
    found = {}
    for what, trial in new.items():
        total = grams[trial.name].eliminated().matrix.copy()
        total[:-1, :-1] += known
        found[what] = bounded_solve(total, free, none, none, none - np.inf).deviance
    return found
