"""What was found in plain sentences: for the terminal and the top of the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from srs_opt.discrepancy.verdict import DESCRIBED, NO_GAP

if TYPE_CHECKING:
    from srs_opt.discrepancy.pipeline import Discrepancy


def in_words(found: Discrepancy) -> list[str]:
    """Return what stands below the verdict, a sentence each."""
    lines = []
    gap = found.gap
    if gap is not None and found.verdict.word != NO_GAP and gap.ratio is not None:
        added = found.best is not None and found.best.hypothesis.candidates
        with_it = f", {gap.with_effect * 1e3:.3f} mm {with_what(found)}" if added else ""
        lines.append(
            f"sealed trials: {gap.calibrated * 1e3:.3f} mm calibrated{with_it}, "
            f"noise floor {gap.noise_floor * 1e3:.3f} mm"
        )
    if found.would_have_seen is not None:
        lines.append(found.would_have_seen.in_words)
    lines += [f"set aside: {name} ({why})" for name, why in found.set_aside]
    following = found.next_experiment
    if following is not None:
        power = "" if following.expected_power is None else f" (power {following.expected_power:.0%})"
        lines.append(f"next: {following.what}{power}")
    return lines


def with_what(found: Discrepancy) -> str:
    """Return what the best model is called beside calibration alone."""
    several = found.best is not None and len(found.best.hypothesis.candidates) > 1
    added = "the term" if found.verdict.word == DESCRIBED else "the effects" if several else "the effect"
    return f"with {added}" if found.believed else f"with {added} (not believed)"
