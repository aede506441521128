"""The study of tuned values: a change is in force while it is tried, and only then; reads are seen."""

import pytest

from benchmarks.half_and_double import section
from benchmarks.tuned import Tuned, changed, reads, times, tuned_values

STEP = Tuned("srs_opt.simulate.settings", "INTEGRATION", "first_step_s")


@pytest.mark.parametrize(
    ("value", "half", "double"), [(3.0, 1.5, 6.0), (5, 2, 10), (1, 1, 2), ((4, 0.2), (2, 0.1), (8, 0.4))]
)
def test_half_and_double(value, half, double):
    assert times(value, 0.5) == half
    assert times(value, 2.0) == double


def test_a_change_ends_with_the_trial():
    before = STEP.value
    with changed(STEP, 2 * before):
        assert STEP.value == 2 * before
    assert STEP.value == before
    with pytest.raises(ZeroDivisionError), changed(STEP, 3 * before):
        _ = 1 / 0
    assert STEP.value == before


def test_values_are_found_once_each_and_their_reads_are_seen():
    found = tuned_values()
    places = {(id(t.settings), t.field) for t in found}
    assert len(places) == len(found) > 300
    assert STEP in found
    with reads(found) as seen:
        _ = STEP.settings.first_step_s
    assert seen == {STEP}
    _ = STEP.settings.tolerance_m_s
    assert seen == {STEP}


def test_a_row_is_told_where_an_answer_or_the_time_changes():
    row = {"setting": "MESH.accepted", "module": "m", "probe": "p", "value": 8.0, "cpu_s": 1.0}
    row |= {"answers": {"error (mm)": 1.0, "verdict": "named"}, "tried_cpu_s": 1.0}
    rows = [
        row | {"factor": 0.5, "found": {"error (mm)": 1.5, "verdict": "named"}},
        row | {"factor": 2.0, "found": {"error (mm)": 1.0, "verdict": "unknown"}, "tried_cpu_s": 3.0},
        row | {"setting": "MESH.other", "factor": 0.5, "found": row["answers"]},
        row | {"setting": "MESH.third", "factor": 2.0, "failed": "InputError: too small"},
    ]
    told = section(rows, "today")
    assert told.rows == [
        ["MESH.accepted", "8", "p", "error (mm) 1 → 1.5", "verdict named → unknown; processor time x 3"],
        ["MESH.third", "8", "p", "not run", "InputError: too small"],
    ]
    assert "3 values tried, 1 of them without" in told.notes[0]
