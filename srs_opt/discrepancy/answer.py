"""The answer as the JSON object that scripts read, and the corrected robot."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.calibrate.candidates import effect_spec, entry_sd, with_sd
from srs_opt.calibrate.result import bench_warnings, calibrated_robot
from srs_opt.discrepancy.diagnostics import needed_gain
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.locate import left_places
from srs_opt.discrepancy.screen import Score
from srs_opt.discrepancy.search_settings import SCREEN
from srs_opt.discrepancy.verdict import DESCRIBED, NO_GAP, ONE_OF
from srs_opt.robot import Robot

if TYPE_CHECKING:
    from srs_opt.discrepancy.pipeline import Discrepancy

VERSION = 1
DESCRIBED_FILE = "described_robot.yaml"


def answer(found: Discrepancy, robot_file: Path | None) -> dict[str, Any]:
    """Return the content of discrepancy.json; the best effects stand in it whether believed or not."""
    described = found.description if found.verdict.word == DESCRIBED else None
    shown = found.selection if found.verdict.word != NO_GAP else None
    best = found.answer if shown else None
    rivals = shown.rivals if shown and found.verdict.word == ONE_OF else ()
    file = str(robot_file) if robot_file else None
    return {
        "version": VERSION,
        "verdict": found.verdict.word,
        "why": found.verdict.why,
        "believed": found.believed,
        "effects": _effects(best) if best else [],
        "described": described.sentence if described else None,
        "lead": found.gap.lead if found.gap and shown else None,
        "remainder": _remainder(found),
        "would_have_seen": _would_have_seen(found),
        "noise": {**asdict(found.noise), "outlier_share": found.outlier_share},
        "set_aside": [{"trial": name, "reason": why} for name, why in found.set_aside],
        "alike": [{"effects": list(p.effects), "angle_rad": round(p.angle_rad, 4)} for p in found.alike],
        "alternatives": [list(h.names) for h in rivals],
        "located": [
            {"where": p.where, "against": p.against, "score": round(p.score, 2)} for p in found.located
        ],
        "gap": _gap(found),
        "next_experiment": _next(found),
        "warnings": _warnings(found),
        "candidates": candidate_rows(found),
        "corrected_robot": file if found.believed else None,
        "tentative_robot": None if found.believed else file,
        "described_robot": str(robot_file.with_name(DESCRIBED_FILE)) if robot_file and described else None,
        "seconds": round(found.seconds, 2),
    }


def _effects(best: Hypothesis) -> list[dict[str, Any]]:
    found = []
    for candidate in best.candidates:
        spec = effect_spec(candidate, best.fit.point.values)
        sd = entry_sd(candidate.form, best.fit)
        parameters = {k: v for k, v in spec.items() if k != "name"}
        effect = candidate.form.effect
        units = {p.name: p.unit for p in effect.parameters if p.unit}
        words = {"units": units, "what": effect.what, "look": effect.look}
        found.append({"name": spec["name"], "parameters": parameters, "sd": sd, **words})
    return found


def _gap(found: Discrepancy) -> dict[str, Any] | None:
    gap = found.gap
    if gap is None:
        return None
    filled = found.best is not None and bool(found.best.hypothesis.candidates)
    return {
        "unit": "m",
        "calibrated": gap.calibrated,
        "with_effect": gap.with_effect if filled else None,
        "noise_floor": gap.noise_floor,
        "ratio": gap.ratio if filled else None,
        "interval": list(gap.interval) if filled and gap.interval else None,
        "trials": gap.trials,
        "believed": found.believed,
    }


def _remainder(found: Discrepancy) -> dict[str, Any] | None:
    """Return what the answer's model leaves: calibration alone where it speaks of no effect."""
    gap = found.gap
    if gap is None:
        return None
    bare = found.verdict.word == NO_GAP
    left = gap.before if bare else gap.after
    return {
        "m": left.m,
        "share": None if bare else gap.share,
        "speed_share": left.speed_share,
        "radius_share": left.radius_share,
        "where": remainder_place(found),
    }


def remainder_place(found: Discrepancy) -> str | None:
    """Return where what is left shows most, in words; None where nothing significant is left."""
    diagnostics = found.null if found.verdict.word == NO_GAP else found.best
    if diagnostics is None or diagnostics.adequate:
        return None
    places = left_places(diagnostics)
    return f"mostly in {places[0].where}, varying with {places[0].against}" if places else None


def _would_have_seen(found: Discrepancy) -> dict[str, Any] | None:
    seen = found.would_have_seen
    if seen is None:
        return None
    return {"m": seen.m, "speed_share": seen.speed_share, "radius_share": seen.radius_share}


def _warnings(found: Discrepancy) -> list[str]:
    """Return which values lie far from the bench, in the model that is answered with."""
    chosen = found.null if found.verdict.word == NO_GAP else found.best
    return [] if chosen is None else list(bench_warnings(chosen.hypothesis.fit.off_bench))


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
    inflation = found.null.linearisation.variance_inflation if found.null else 1.0
    return [
        {
            "name": name,
            "improvement": round(score.improvement * inflation, 2),
            "absorbed_by_calibration": round(score.absorbed, 4),
            "verdict": _fate(found, score, inflation),
        }
        for name, score in best.items()
    ]


def _fate(found: Discrepancy, score: Score, inflation: float) -> str:
    effect = score.candidate.effect
    selection = found.selection
    if selection and effect in selection.best.names:
        sure = found.believed and found.verdict.word != DESCRIBED
        return "chosen" if sure or found.verdict.word == ONE_OF else "explains most, not believed"
    if selection and any(effect in h.names for h in selection.rivals):
        return "cannot be told from the chosen"
    if any(label.split("[")[0] == effect for label in found.tried):
        return "refitted: explains less"
    if score.improvement < needed_gain(score.candidate, len(found.scores)) and inflation == 1.0:
        return "no evidence"
    chosen = selection.best.names if selection else ()
    gains = [s.improvement for s in found.scores if s.candidate.effect in chosen]
    if gains and score.improvement > SCREEN.contender_share * max(gains):
        return "not refitted: acts otherwise than what explains more"
    return "well behind in the screen"


def robot_name(found: Discrepancy) -> str:
    """Return the name of the robot's file: corrected where the verdict is believed, else tentative."""
    return "corrected_robot.yaml" if found.believed else "tentative_robot.yaml"


def robot_header(found: Discrepancy) -> str:
    """Return the first line of a tentative robot's file; empty for a corrected one."""
    if found.believed:
        return ""
    word = found.verdict.word
    if word == NO_GAP:
        return "# tentative: calibrated, no effect added; discrepancy found no gap that matters"
    return f"# tentative: the effects below are the best explanation so far and not believed (verdict {word})"


def answered_robot(found: Discrepancy) -> Robot | None:
    """Return the calibrated robot with the best effects in, where the verdict speaks of any.

    Effects have deviations, so that a later fit that starts from this robot refits their sizes. None where
    nothing was calibrated.
    """
    best = found.answer
    if best is None or found.null is None:
        return None
    if found.verdict.word == NO_GAP:
        return calibrated_robot(found.dataset.robot, found.null.hypothesis.fit)
    robot = calibrated_robot(found.dataset.robot, best.fit)
    named = [
        with_sd(effect_spec(c, best.fit.point.values), entry_sd(c.form, best.fit)) for c in best.candidates
    ]
    return robot.with_values(effects=[*(dict(e) for e in robot.effects), *named])


def corrected_robot(found: Discrepancy) -> Robot | None:
    """Return the robot as corrected; None where the verdict is not believed."""
    return answered_robot(found) if found.believed else None
