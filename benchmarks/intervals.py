"""Rates with Clopper-Pearson intervals."""

from __future__ import annotations


def interval(hits: int, total: int, level: float = 0.99) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a rate."""
    from scipy import stats

    found = stats.binomtest(hits, total).proportion_ci(level, method="exact")
    return float(found.low), float(found.high)


def rate(hits: int, total: int) -> str:
    """Return hits, total and their ratio as text."""
    return f"{hits:4d}/{total:<4d} = {hits / total:.3f}"
