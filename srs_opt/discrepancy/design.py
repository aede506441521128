"""Step 10: the experiment that would tell the rivals apart, with the power to expect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit_settings import DERIVATIVE
from srs_opt.calibrate.instruments import check_expectations
from srs_opt.calibrate.normal_equations import bounded_solve
from srs_opt.discrepancy.gap_settings import DESIGN
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.select import Selection
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.instruments import INSTRUMENTS
from srs_opt.measurement.records import Schedule, Trial

NOTHING = "no effect"


@dataclass(frozen=True)
class NextExperiment:
    """What to do next.

    Attributes
    ----------
    what : str
    separates : tuple of str
        The explanations that it tells apart.
    expected_power : float
        Probability that it decides between them, if one of them is right.
    """

    what: str
    separates: tuple[str, ...]
    expected_power: float


def rivals_of(selection: Selection, fitted: Sequence[Hypothesis], null: Hypothesis) -> tuple[Hypothesis, ...]:
    """Return what an experiment should tell apart: the rivals, or without any the two best explanations.

    These are the best fits that put the fault into different stages of the model, so that the answer
    says where to look; where there is one only, that nothing is missing is the other.
    """
    from srs_opt.effects import known_effects

    found = [selection.best, *selection.rivals]
    if len(found) > 1:
        return tuple(found)

    def stages(h: Hypothesis) -> set[str]:
        return {known_effects()[c.effect].kind for c in h.candidates}

    own = stages(selection.best)
    mine = set(selection.best.names)
    apart = (h for h in fitted if h.candidates and not mine <= set(h.names))  # more of the same is no other
    others = sorted((h for h in apart if stages(h) != own), key=lambda h: h.deviance)
    if others:
        return selection.best, others[0]
    return (selection.best, null) if selection.best.candidates else (null,)


def next_experiment(
    experiment: Experiment, rivals: Sequence[Hypothesis], trials: Sequence[Trial]
) -> NextExperiment | None:
    """Return the instrument or trial that best separates the two leading rivals."""
    if len(rivals) < 2 or not trials:
        return None
    first, second = rivals[0], rivals[1]
    expected, tools = check_expectations(experiment.model), INSTRUMENTS.all()
    options = {
        f"{tool.what} ({name})": _instrument_gain(expected[name], tool.sd, first, second)
        for name, tool in tools.items()
    }
    direct = [f"{tools[q].what} ({q})" for q in _own_instruments(first, second)]
    sure = {what: options[what] for what in direct if power(options[what]) > DESIGN.sure_power}
    if not sure:  # trials cost a simulation each
        new = proposals(experiment, trials)
        both = [_trial_gains(experiment, a, b, new) for a, b in ((first, second), (second, first))]
        # whichever hypothesis is true: the less of both
        options |= {what: min(gains[what] for gains in both) for what in new}
    what, gain = max((sure or options).items(), key=lambda item: item[1])
    names = tuple(" + ".join(h.names) or NOTHING for h in rivals)
    return NextExperiment(what, names, round(power(gain), 3))


def repeat_of(trial: str, gain: float, other: str) -> NextExperiment:
    """Return that a trial be repeated: a wrong entry does not come twice.

    Its power is that of the misfit to come again, of which `gain` is the deviance.
    """
    what = f"repeat trial {trial}, and check its entry in the notebook"
    return NextExperiment(what, (f"a wrong entry of {trial}", other), round(power(gain), 3))


def _own_instruments(a: Hypothesis, b: Hypothesis) -> list[str]:
    """Return the quantities that measure directly an effect that one of two hypotheses holds."""
    from srs_opt.effects import known_effects

    asked = (known_effects()[name].instrument for name in {*a.names} ^ {*b.names})
    return sorted({q for q in asked if q is not None and q in INSTRUMENTS.all()})


def power(gain: float) -> float:
    """Return the probability that a separation of expected deviance `gain` exceeds the level that decides."""
    from scipy.special import chndtr

    # the deviance between two hypotheses is chi squared, one degree of freedom, noncentral by its expectation
    return float(1 - chndtr(DESIGN.decisive_deviance, 1, max(gain, 1e-9)))


def _instrument_gain(
    expected: Callable[[Mapping[str, float]], float], sd: float, a: Hypothesis, b: Hypothesis
) -> float:
    """Return the deviance by which a reading would tell two hypotheses apart."""
    readings = [expected(h.fit.point.values) for h in (a, b)]
    # the prediction is uncertain, too, of which the less certain hypothesis counts
    variance = max(_reading_variance(expected, h) for h in (a, b))
    return float((readings[0] - readings[1]) ** 2 / (sd**2 + variance))


def _reading_variance(expected: Callable[[Mapping[str, float]], float], h: Hypothesis) -> float:
    """Return how well a hypothesis knows what the instrument will show, as a variance, to first order."""
    values = h.fit.point.values
    jacobian = np.zeros(len(h.fit.coordinates))
    for k, c in enumerate(h.fit.coordinates):
        step = DERIVATIVE.central_step * c.typical
        ends = [expected({**values, c.name: values[c.name] + s * step}) for s in (1, -1)]
        jacobian[k] = (ends[0] - ends[1]) / (2 * step)
    return float(jacobian @ h.fit.covariance @ jacobian)


def proposals(experiment: Experiment, trials: Sequence[Trial]) -> Mapping[str, Trial]:
    """Return trials worth considering, beside repeats of what was done.

    Frequencies and pressures are those of the set's own gaits, so that the robot can do what is proposed.
    """
    gaits = [t for t in trials if t.kind == "gait" and t.frequency_hz > 0] or list(trials)
    model = max(gaits, key=lambda t: (t.pressure_kpa, t.frequency_hz))
    slow, fast = (
        end(t.frequency_hz for t in gaits if t.frequency_hz > 0 or t is model) for end in (min, max)
    )
    weak, strong = (end(t.pressure_kpa for t in gaits) for end in (min, max))
    slow, fast = max(slow, DESIGN.least_frequency_hz), max(fast, DESIGN.least_frequency_hz)
    long_lag = DESIGN.long_wave_share * model.phase_lag_rad
    duration_s = max(DESIGN.duration_s, DESIGN.cycles / slow)
    plain = replace(
        _blank(experiment, model, duration_s),
        duration_s=duration_s,
        schedule=None,
        applied=None,
        moving=False,
    )
    period_s = 2 / slow
    found = {
        _gait("a slow, strong gait", slow, strong): replace(plain, frequency_hz=slow, pressure_kpa=strong),
        _gait("a fast, weak gait", fast, weak): replace(plain, frequency_hz=fast, pressure_kpa=weak),
        f"{_gait('a fast, long wave', fast, strong)[:-1]}, lag {long_lag:.2g} rad)": replace(
            plain, frequency_hz=fast, pressure_kpa=strong, phase_lag_rad=long_lag
        ),
        f"{_gait('the same gait', plain.frequency_hz, plain.pressure_kpa)} in the opposite heading": replace(
            plain, heading_rad=plain.heading_rad + np.pi
        ),
    }
    if any(t.tether for t in trials):
        found["a trial with the tether taken off"] = replace(plain, tether=False)
    for segment in range(1, experiment.model.segments + 1):
        one = Schedule("step", period_s, ((segment, 0.0, period_s / 2),))
        step = replace(plain, schedule=one, frequency_hz=1 / period_s, pressure_kpa=strong, kind="step")
        found[f"a step of segment {segment} alone ({strong:.3g} kPa, {period_s / 2:.2g} s each way)"] = step
    if plain.markers_m is None:
        tracked = replace(
            plain, markers_m=np.zeros((plain.time_s.size, experiment.model.links, 2)), centre_m=None
        )
        found[f"{_gait('the same gait', plain.frequency_hz, plain.pressure_kpa)}, every link tracked"] = (
            tracked
        )
    return {what: replace(trial, name=what) for what, trial in found.items()}


def _gait(what: str, frequency_hz: float, pressure_kpa: float) -> str:
    return f"{what} ({frequency_hz:.3g} Hz, {pressure_kpa:.3g} kPa)"


def _blank(experiment: Experiment, like: Trial, duration_s: float) -> Trial:
    """Return a trial in which everything is seen, at zero, where `like` sees it."""
    time_s = np.arange(int(duration_s * DESIGN.rate_hz)) / DESIGN.rate_hz
    if like.markers_m is None:
        return replace(like, time_s=time_s, centre_m=np.zeros((time_s.size, 2)))
    seen = experiment.model.links if like.spots is None else len(like.spots)
    return replace(like, time_s=time_s, markers_m=np.zeros((time_s.size, seen, 2)), centre_m=None)


def _seen(trial: Trial, points: np.ndarray) -> Trial:
    """Return the trial with what was seen (T, 2 M)."""
    if trial.markers_m is None:
        return replace(trial, centre_m=points)
    return replace(trial, markers_m=points.reshape(len(points), -1, 2))


def _trial_gains(
    experiment: Experiment, truth: Hypothesis, other: Hypothesis, new: Mapping[str, Trial]
) -> dict[str, float]:
    """Return the deviance by which `other`, refitted to all data, would miss what `truth` predicts."""
    trials = tuple(new.values())
    # what all data so far tell enters as a prior: the new trial is judged after a refit to everything
    known = np.linalg.pinv(other.fit.covariance, hermitian=True)
    free = [k for k in range(len(other.fit.coordinates)) if other.fit.covariance[k, k] > 0]
    none = np.zeros(len(other.fit.coordinates))
    try:
        blank = Experiment(experiment.model, trials, experiment.noise)  # its markers stand at zero
        against = blank.residuals(trials, Point(truth.fit.point.values))
        seen = [_seen(t, -r) for t, r in zip(trials, against)]
        equations = Experiment(experiment.model, seen, experiment.noise).normal_equations(
            Point(other.fit.point.values), other.fit.coordinates
        )
    except NoAnswerError:
        return dict.fromkeys(new, 0.0)
    found = {}
    for what, trial in new.items():
        total = equations[trial.name].eliminated().matrix.copy()
        total[:-1, :-1] += known
        found[what] = bounded_solve(total, free, none, none, none - np.inf).deviance
    return found
