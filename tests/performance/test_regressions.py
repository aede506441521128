"""Quick ratios against what they were: more than twice as much is a regression."""

import importlib
import json

import pytest

from benchmarks.__main__ import REFERENCE, names
from benchmarks.memory import LIMIT_MB, peak_mb

FACTOR = 2.0
MEASURED = ("simulation", "maps")
TRIES = 6  # a busy machine is no regression; a slow program is slow every time


@pytest.mark.parametrize("name", MEASURED)
def test_no_ratio_has_doubled(name):
    reference = json.loads(REFERENCE.read_text())
    for attempt in range(TRIES):
        ratios = importlib.import_module(f"benchmarks.{name}").run(quick=True).ratios
        slow = {k: v for k, v in ratios.items() if v > FACTOR * reference[f"{name}: {k}"]}
        if not slow:
            break
        assert attempt < TRIES - 1, slow


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # clusters close noisily on a busy machine
@pytest.mark.parametrize("name", sorted(set(names()) - set(MEASURED)))
def test_every_other_section_can_be_made(name):
    section = importlib.import_module(f"benchmarks.{name}").run(quick=True)
    assert section.columns
    assert all(len(row) == len(section.columns) for row in section.rows)
    assert section.markdown().startswith("## ")


def test_large_maps_fit_into_memory():
    """100,000 rows pass through the sweep, its kept chunks and the file; the solver is a stand-in."""
    # building a model that is not in the cache takes several hundred MB once, whatever the map's size
    assert peak_mb(100_000, solved=False) + peak_mb(300) < LIMIT_MB
