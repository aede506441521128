"""report.html: verdict first, then the evidence, then the caveats; one file that needs nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from srs_opt.calibrate.result import bench_warnings
from srs_opt.discrepancy.diagnostics import Diagnostics
from srs_opt.discrepancy.pictures import gap_picture, pictures
from srs_opt.discrepancy.pipeline import Discrepancy
from srs_opt.discrepancy.verdict import (
    DESCRIBED,
    NAMED,
    NAMED_IN_PART,
    NO_GAP,
    NOT_TESTABLE,
    ONE_OF,
    UNKNOWN,
)
from srs_opt.discrepancy.words import in_words
from srs_opt.effects import known_effects
from srs_opt.figures import Picture
from srs_opt.files import write_text

HEADLINES = {
    NO_GAP: "No gap: the calibrated model explains these data",
    NAMED: "Named: {names}",
    NAMED_IN_PART: "Named in part: {names}",
    ONE_OF: "One of: {names}",
    DESCRIBED: "Described: {described}",
    UNKNOWN: "A gap that nothing known explains well enough",
    NOT_TESTABLE: "Not testable with these data",
}
COLOURS = {NO_GAP: "#2a7", NAMED: "#26c", NAMED_IN_PART: "#26c", DESCRIBED: "#26c", ONE_OF: "#b80"}


def write_report(
    found: Discrepancy, record: dict[str, Any], path: Path, further: Sequence[Picture] = ()
) -> Path:
    """Write the report.

    Parameters
    ----------
    found : Discrepancy
    record : dict
        The JSON answer, so that the report says nothing else.
    path : Path
    further : sequence of Picture
        Shown after those of the evidence.
    """
    from importlib import resources

    from jinja2 import Environment

    text = resources.files("srs_opt.discrepancy").joinpath("report.html.jinja").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(text)
    names = [" + ".join(e["name"] for e in record["effects"])] + [
        " + ".join(a) for a in record["alternatives"]
    ]
    page = template.render(
        headline=HEADLINES[record["verdict"]].format(
            names=" or ".join(n for n in names if n), described=record["described"]
        ),
        colour=COLOURS.get(record["verdict"], "#888"),
        sentences=in_words(found),
        closing=gap_picture(found),
        answer=record,
        words=known_effects(),
        dataset=found.dataset,
        split=found.split,
        calibrated=_parameters(found),
        tests=_tests(found),
        caveats=caveats(found),
        pictures=[*pictures(found), *further],
        noise_mm=1e3 * found.sd_m,
    )
    return write_text(path, page)


def _parameters(found: Discrepancy) -> list[dict[str, Any]]:
    """Return bench and calibrated values of the robot, with what the verdict's effects change."""
    if found.null is None or found.selection is None:
        return []
    rows = []
    fits = [found.null.hypothesis.fit, found.selection.best.fit]
    for coordinate in (c for c in fits[0].coordinates if not c.effect and not c.fixed):
        bench = getattr(found.dataset.robot, coordinate.name)
        values = [bench * math.exp(f.point.values[coordinate.name]) for f in fits]
        off = fits[1].point.values[coordinate.name] - coordinate.start
        rows.append(
            {
                "name": coordinate.name,
                "bench": bench,
                "alone": values[0],
                "with_effect": values[1],
                "sd": values[1] * fits[1].sd[coordinate.name],
                "off": off / coordinate.prior_sd,
            }
        )
    return rows


def _tests(found: Discrepancy) -> list[dict[str, Any]]:
    rows = []
    for what, diagnostics in (("calibration alone", found.null), ("best set of effects", found.best)):
        if diagnostics is not None:
            rows.append(
                {
                    "what": f"{what}: {diagnostics.hypothesis.label}",
                    "p": diagnostics.detection.p_value,
                    "misfit": diagnostics.hypothesis.fit.misfit_ratio,
                }
            )
    return rows


def how_much_is_left(diagnostics: Diagnostics) -> str:
    """Return in words how far a fit's misfit lies above the noise, and within what that is known."""
    fit = diagnostics.hypothesis.fit
    left = fit.misfit_ratio - 1
    within = math.sqrt(2 / sum(g.count for g in fit.equations.values()))  # standard deviation of a variance
    if left <= 0:
        return f"in size nothing beyond the noise, whose variance is known within {within:.1%}"
    return f"{left:.1%} (± {within:.1%}) of the noise's variance"


def caveats(found: Discrepancy) -> list[str]:
    """Return what a reader should know before acting."""
    notes = []
    stated = found.dataset.marker_sd_m
    if not 0.8 < found.sd_m / stated < 1.25:
        notes.append(
            f"The set states {stated * 1e3:.2f} mm of marker noise; the tracks show "
            f"{found.sd_m * 1e3:.2f} mm, which is what was used."
        )
    notes += [f"Trial {name} was set aside: {why}." for name, why in found.set_aside]
    if found.null is not None:
        notes += [f"Of calibration alone: {w}." for w in bench_warnings(found.null.hypothesis.fit.off_bench)]
    if found.best is not None and found.best.hypothesis.candidates:
        notes += [f"With the effects: {w}." for w in bench_warnings(found.best.hypothesis.fit.off_bench)]
    if found.gap is not None and found.gap.trials < 5:
        notes.append(f"Only {found.gap.trials} trials were sealed: the interval of the gap is wide.")
    if found.best is not None and found.verdict.word in (NAMED, ONE_OF) and not found.best.adequate:
        notes.append(
            f"Something is left (p = {found.best.detection.p_value:.2g}), {how_much_is_left(found.best)}: "
            "too little to count against the name."
        )
    if found.verdict.word == UNKNOWN and found.description is not None:
        said = found.description
        notes.append(
            f"Of the grammar's terms one would say best: {said.sentence}. Not believed: {said.why_not}."
        )
    if not found.split.new_gaits:
        notes.append(
            "The set holds too few gaits to seal one: the sealed trials repeat gaits that were fitted: "
            "a closed gap is no prediction of another gait."
        )
    if found.gap is not None and found.gap.ratio is None and found.verdict.word in (NAMED, ONE_OF):
        notes.append(
            "On the sealed trials the gap stands less than 2 % above the noise: too little to measure what "
            "share of it the effect closes. The name rests on the open trials."
        )
    if found.dataset.trials and found.dataset.trials[0].markers_m is None:
        notes.append(
            "Only the centre of mass was tracked: what bends the body and what moves it look much alike."
        )
    notes.append(
        "Friction and curvature per pressure are taken to scatter by 3 %, 3 % and 1 % from trial to trial; "
        "more than that would look like an effect."
    )
    notes.append(
        "The friction's smoothing speed is fitted as a nuisance; the corrected robot keeps the file's value."
    )
    return notes
