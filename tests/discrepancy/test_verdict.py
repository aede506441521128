"""The rule of adequacy, on figures made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from srs_opt.discrepancy.design import proposals, repeat_of
from srs_opt.discrepancy.functions import Group
from srs_opt.discrepancy.seal import Gap, Remainder
from srs_opt.discrepancy.settings import ADEQUACY
from srs_opt.discrepancy.verdict import judge
from srs_opt.measurement.records import Trial


def diagnostics(p, misfit=1.0):
    fit = SimpleNamespace(misfit_ratio=misfit)
    shares = SimpleNamespace(improvement=90.0, dof=4), SimpleNamespace(improvement=40.0, dof=2)
    return SimpleNamespace(
        detection=SimpleNamespace(p_value=p, groups=shares, adjusted=(p, p)),
        groups=(Group("motion along", "gait phase", (0, 1, 2, 3)), Group("heading", "time", (4, 5))),
        adequate=p > 0.01,
        scores=(),
        hypothesis=SimpleNamespace(fit=fit),
    )


def chosen(*names, rivals=(), implausible="", change=0.0):
    best = SimpleNamespace(
        names=names, candidates=names, implausible=lambda: implausible, implausible_size=lambda: implausible
    )
    others = tuple(SimpleNamespace(names=r) for r in rivals)
    return SimpleNamespace(best=best, rivals=others, change=change)


def gap(before_m, after_m, speed=0.0, rival_m=None):
    floor = 1e-3
    sizes = [float(np.hypot(floor, m)) for m in (before_m, after_m)]
    ratio = (sizes[1] - floor) / (sizes[0] - floor)
    left = [Remainder(before_m, 5 * speed, None, {}), Remainder(after_m, speed, None, {})]
    return Gap(*sizes, floor, ratio, (ratio, ratio), 3, *left, 1e-4, rival_m)


def said(left_p, *arguments, misfit=1.05, **options):
    return judge(diagnostics(1e-9, 80.0), diagnostics(left_p, misfit), *arguments, **options)


def test_a_significant_but_small_remainder_does_not_cost_the_name_and_is_told_beside_it():
    verdict = said(1e-9, chosen("wheel_toe"), gap(9.5e-3, 0.12e-3))
    assert verdict.word == "named"
    assert "closes 98.7% of it, a further 0.12 mm" in verdict.why
    assert verdict.why.endswith("is something else, mostly in motion along, varying with gait phase")


@pytest.mark.parametrize(("after_m", "speed"), [(2e-3, 0.0), (5e-3, 0.0), (0.3e-3, 0.05)])
def test_millimetres_or_a_wrong_speed_cost_it(after_m, speed):
    verdict = said(1e-9, chosen("wheel_toe"), gap(40e-3, after_m, speed))
    assert verdict.word == "unknown"
    assert "wheel_toe" in verdict.why and "closes" in verdict.why


def test_lengths_are_those_of_the_body():
    """What costs a short robot's name does not cost that of one four times as long."""
    left = gap(40e-3, 2e-3)
    words = [
        judge(diagnostics(1e-9, 80.0), diagnostics(1e-9, 1.05), chosen("a"), left, ADEQUACY.of_body(m)).word
        for m in (0.236, 1.0)
    ]
    assert words == ["unknown", "named"]


def test_a_part_needs_a_lead_and_the_same_size_in_all_trials():
    sure = gap(9e-3, 2.5e-3, rival_m=8e-3)
    assert said(1e-9, chosen("a", change=0.05), sure).word == "named_in_part"
    assert said(1e-9, chosen("a", change=0.5), sure).word == "unknown"
    assert said(1e-9, chosen("a", change=0.05), gap(9e-3, 2.5e-3, rival_m=3e-3)).word == "unknown"
    assert said(1e-9, chosen("a", change=0.05), gap(9e-3, 2.5e-3)).word == "unknown"
    assert said(1e-9, chosen("a", "b", "c", change=0.05), sure).word == "unknown"


def test_a_gap_too_small_to_matter_is_none_and_says_how_small():
    verdict = said(1e-9, chosen("a"), gap(0.3e-3, 0.28e-3))
    assert verdict.word == "no_gap" and "0.3 mm" in verdict.why
    assert said(1e-9, chosen(), gap(0.3e-3, 0.3e-3)).word == "no_gap"
    assert said(1e-9, chosen(), gap(3e-3, 3e-3)).word == "unknown"


def test_sealed_trials_that_are_missed_are_a_gap_whatever_the_open_ones_say():
    verdict = judge(diagnostics(0.4), diagnostics(0.4), chosen(), gap(92e-3, 92e-3))
    assert verdict.word == "unknown" and "92 mm" in verdict.why
    assert judge(diagnostics(0.4), diagnostics(0.4), chosen(), gap(0.1e-3, 0.1e-3)).word == "no_gap"


def test_rivals_and_what_is_implausible_abstain():
    assert said(0.5, chosen("a", rivals=(("b",),)), gap(9e-3, 1e-5)).word == "one_of"
    assert said(0.5, chosen("a", implausible="too large"), gap(9e-3, 1e-5)).word == "unknown"
    assert ADEQUACY.small_m <= ADEQUACY.left_m


def test_proposed_gaits_are_within_what_a_slow_robot_did():
    time_s = np.arange(400) / 20
    slow = [Trial(f"t{k}", f, p, 0.0, 1.57, 0.0, 20.0, time_s, np.zeros((400, 5, 2)))
            for k, (f, p) in enumerate([(0.1, 20.0), (0.2, 30.0)])]  # fmt: skip
    new = proposals(SimpleNamespace(model=SimpleNamespace(links=5, segments=4)), slow)
    gaits = [t for t in new.values() if t.kind == "gait"]
    assert {t.frequency_hz for t in gaits} <= {0.1, 0.2} and {t.pressure_kpa for t in gaits} <= {20.0, 30.0}
    assert all(t.duration_s * t.frequency_hz >= 4 for t in gaits)
    assert all(t.schedule.period_s == 20.0 for t in new.values() if t.kind == "step")


def test_a_trial_with_a_large_misfit_is_worth_repeating():
    found = repeat_of("t1", 4000.0, "something else")
    assert found.expected_power == pytest.approx(1.0) and "t1" in found.what
