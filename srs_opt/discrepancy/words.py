"""What was found in plain sentences: for the terminal and the top of the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from srs_opt.discrepancy.verdict import NO_GAP

if TYPE_CHECKING:
    from srs_opt.discrepancy.pipeline import Discrepancy


def in_words(found: Discrepancy) -> list[str]:
    """Return what stands below the verdict, a sentence each."""
    lines = []
    gap = found.gap
    if gap is not None and found.verdict.word != NO_GAP and gap.ratio is not None:
        lines.append(
            f"sealed trials: {gap.calibrated * 1e3:.3f} mm calibrated, {gap.with_effect * 1e3:.3f} mm with "
            f"the effect, noise floor {gap.noise_floor * 1e3:.3f} mm"
        )
    if found.would_have_seen is not None:
        lines.append(found.would_have_seen.in_words)
    lines += [f"set aside: {name} ({why})" for name, why in found.set_aside]
    following = found.next_experiment
    if following is not None:
        power = "" if following.expected_power is None else f" (power {following.expected_power:.0%})"
        lines.append(f"next: {following.what}{power}")
    return lines
