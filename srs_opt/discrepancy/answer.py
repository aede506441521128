"""The answer as the JSON object that scripts read, and the corrected robot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from srs_opt.calibrate.coordinates import Candidate, effect_spec
from srs_opt.calibrate.result import calibrated_robot
from srs_opt.discrepancy.examined import needed_gain
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.pipeline import Discrepancy
from srs_opt.discrepancy.screen import Score
from srs_opt.discrepancy.verdict import NAMED, ONE_OF
from srs_opt.robot import Robot


def answer(found: Discrepancy, robot_file: Path | None) -> dict[str, Any]:
    """Return the command's JSON object."""
    speaks = found.verdict.word in (NAMED, ONE_OF)
    best = found.selection.best if found.selection and speaks else None
    rivals = found.selection.rivals if found.selection and speaks else ()
    return {
        "verdict": found.verdict.word,
        "why": found.verdict.why,
        "effects": _effects(best) if best else [],
        "alternatives": [list(h.names) for h in rivals],
        "located": [
            {"where": p.where, "against": p.against, "score": round(p.score, 2)} for p in found.located
        ],
        "gap": _gap(found, speaks),
        "next_experiment": _next(found),
        "candidates": candidate_rows(found),
        "corrected_robot": str(robot_file) if robot_file else None,
        "seconds": round(found.seconds, 2),
    }


def _effects(best: Hypothesis) -> list[dict[str, Any]]:
    found = []
    for candidate in best.candidates:
        spec = effect_spec(candidate, best.fit.point.values)
        sd = parameter_sd(best, candidate)
        parameters = {k: v for k, v in spec.items() if k != "name"}
        found.append({"name": spec["name"], "parameters": parameters, "sd": sd})
    return found


def parameter_sd(best: Hypothesis, candidate: Candidate) -> dict[str, float]:
    """Return the standard deviations of an effect's parameters (first order; places have none)."""
    names = [c.name for c in best.fit.coordinates]
    own = [names.index(c.name) for c in candidate.coordinates]
    covariance = best.fit.covariance[np.ix_(own, own)]
    values = best.fit.point.values
    here = effect_spec(candidate, values)
    keys = [k for k, v in here.items() if isinstance(v, float)]
    slopes = np.zeros((len(keys), len(own)))
    for j, c in enumerate(candidate.coordinates):
        h = 1e-4 * c.typical
        ends = [effect_spec(candidate, {**values, c.name: values[c.name] + s * h}) for s in (1, -1)]
        for i, key in enumerate(keys):
            change = ends[0][key] - ends[1][key]
            if key == "direction":
                change = math.remainder(change, 2 * math.pi)
            slopes[i, j] = change / (2 * h)
    variances = np.diag(slopes @ covariance @ slopes.T)
    return {k: float(math.sqrt(max(v, 0.0))) for k, v in zip(keys, variances)}


def _gap(found: Discrepancy, speaks: bool) -> dict[str, Any] | None:
    gap = found.gap
    if gap is None:
        return None
    return {
        "unit": "m",
        "calibrated": gap.calibrated,
        "with_effect": gap.with_effect if speaks else None,
        "noise_floor": gap.noise_floor,
        "ratio": gap.ratio if speaks else None,
        "interval": list(gap.interval) if speaks and gap.interval else None,
        "trials": gap.trials,
    }


def _next(found: Discrepancy) -> dict[str, Any] | None:
    following = found.next_experiment
    if following is None:
        return None
    return {
        "what": following.what,
        "separates": list(following.separates),
        "expected_power": following.expected_power,
    }


def candidate_rows(found: Discrepancy) -> list[dict[str, Any]]:
    """Return one row per effect (its best place): expected gain, share absorbed, what became of it."""
    best: dict[str, Score] = {}
    for score in found.scores:
        best.setdefault(score.candidate.effect, score)
    temper = found.null.linearisation.temper if found.null else 1.0
    return [
        {
            "name": name,
            "improvement": round(score.improvement * temper, 2),
            "absorbed_by_calibration": round(score.absorbed, 4),
            "verdict": _fate(found, score, temper),
        }
        for name, score in best.items()
    ]


def _fate(found: Discrepancy, score: Score, temper: float) -> str:
    effect = score.candidate.effect
    selection = found.selection
    speaks = found.verdict.word in (NAMED, ONE_OF)
    if selection and speaks and effect in selection.best.names:
        return "chosen"
    if selection and speaks and any(effect in h.names for h in selection.rivals):
        return "cannot be told from the chosen"
    if any(label.split("[")[0] == effect for label in found.tried):
        return "refitted: explains less"
    if score.improvement < needed_gain(score.candidate, len(found.scores)) and temper == 1.0:
        return "no evidence"
    return "well behind in the screen"


def corrected_robot(found: Discrepancy) -> Robot | None:
    """Return the calibrated robot with the named effects in; None where nothing was calibrated."""
    if found.selection is None or found.null is None:
        return None
    speaks = found.verdict.word in (NAMED, ONE_OF)
    hypothesis = found.selection.best if speaks else found.null.hypothesis
    robot = calibrated_robot(found.dataset.robot, hypothesis.fit)
    effects = [*(dict(e) for e in robot.effects), *(hypothesis.specs() if speaks else [])]
    return robot.with_values(effects=effects)
