"""Who simulates which trials."""

import numpy as np
import pytest

from srs_opt.calibrate.crew import fair_shares
from srs_opt.measurement.records import Trial


def trials(count, seconds, first=0):
    rng = np.random.default_rng(count)
    time_s = np.linspace(0, seconds, 5)
    return [
        Trial(f"t{first + k}", float(rng.uniform(0.5, 2)), 48.0, 0.4, np.pi / 2, 0.0, seconds, time_s)
        for k in range(count)
    ]


@pytest.mark.parametrize("jobs", [1, 2, 3, 8])
def test_of_what_is_asked_for_together_all_have_as_many(jobs):
    groups = trials(9, 4.0), trials(5, 3.0, 20), trials(3, 4.0, 40)
    shares = fair_shares(groups, jobs)
    assert sorted(t.name for s in shares for t in s) == sorted(t.name for g in groups for t in g)
    for group in groups:
        counts = [sum(t in group for t in share) for share in shares]
        assert max(counts) - min(counts) <= 1
    totals = [len(share) for share in shares]
    assert max(totals) - min(totals) <= 1
