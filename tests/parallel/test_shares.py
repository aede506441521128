"""Who gets which items."""

import pytest

from srs_opt.parallel.processes import fair_shares


def items(count, cost, first=0):
    return {f"t{first + k}": cost for k in range(count)}


@pytest.mark.parametrize("jobs", [1, 2, 3, 8])
def test_of_what_is_asked_for_together_all_have_as_many(jobs):
    groups = items(9, 4.0), items(5, 3.0, 20), items(3, 4.0, 40)
    shares = fair_shares(groups, jobs)
    assert sorted(n for s in shares for n in s) == sorted(n for g in groups for n in g)
    for group in groups:
        counts = [sum(n in group for n in share) for share in shares]
        assert max(counts) - min(counts) <= 1
    totals = [len(share) for share in shares]
    assert max(totals) - min(totals) <= 1
