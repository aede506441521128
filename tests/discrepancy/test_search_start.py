"""Where refits begin."""

from types import SimpleNamespace

import pytest

from srs_opt.calibrate.candidates import all_candidates
from srs_opt.calibrate.trials import Point
from srs_opt.discrepancy.answer import _fate
from srs_opt.discrepancy.screen import Score
from srs_opt.discrepancy.search import Search
from srs_opt.discrepancy.search_settings import SEARCH


@pytest.mark.parametrize(
    ("deviance", "starts", "best"), [(900.0, [1.0], 900.0), (2000.0, [1.0, SEARCH.restart_share], 500.0)]
)
def test_a_refit_that_ends_worse_than_without_its_effect_begins_again_nearer(deviance, starts, best):
    """The model without the effect is the one with size zero, so no converged fit can be worse."""
    candidate = next(c for c in all_candidates(5) if c.label == "stribeck")
    step = [0.5 * c.typical for c in candidate.sizes]
    lin = SimpleNamespace(point=Point({}), column=lambda name: 0)
    current = SimpleNamespace(hypothesis=SimpleNamespace(candidates=()), linearisation=lin)
    begun = []

    def try_out(candidates, start, beat):
        size = candidate.sizes[0]
        begun.append(start.values[size.name] / (0.5 * size.typical))
        worse = deviance if len(begun) == 1 else 500.0
        return SimpleNamespace(deviance=worse, parameters=6, candidates=candidates, fit=SimpleNamespace(
            variance_inflation=1, point=start))  # fmt: skip

    search = object.__new__(Search)
    search.quick = search.trials = ()
    search._fits = {(frozenset(), False): SimpleNamespace(deviance=1000.0)}
    search.try_out = try_out
    search._best_of_whole = lambda found: found[0]
    found = search._refit(current, [Score(candidate, 100.0, 0.0, step)], 5)
    assert begun == pytest.approx(starts)
    assert found.deviance == best


@pytest.mark.parametrize(("gain", "said"), [(90.0, "acts otherwise"), (10.0, "well behind")])
def test_a_candidate_that_was_not_refitted_is_said_to_be_behind_only_where_it_is(gain, said):
    drag, pull = (next(c for c in all_candidates(5) if c.label == n) for n in ("tether_drag", "tether_pull"))
    scores = Score(drag, 100.0, 0.0, [0.03]), Score(pull, gain, 0.0, [0.03])
    best = SimpleNamespace(names=("tether_drag",))
    found = SimpleNamespace(
        selection=SimpleNamespace(best=best, rivals=()), tried={"tether_drag"}, scores=scores
    )
    assert said in _fate(found, scores[1], 100.0)
