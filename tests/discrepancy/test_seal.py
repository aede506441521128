"""The sealed trials' gap: noise floor, ratio and interval, against residuals made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from srs_opt.discrepancy import seal

SD = 0.001


def opened(monkeypatch, before_m, after_m, trials=3, seed=0):
    """Open the seal on white noise plus slow waves of the given sizes before and after."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(480) / 120
    named = [SimpleNamespace(name=f"t{k}", time_s=time_s) for k in range(trials)]
    wave = np.sqrt(2) * np.sin(2 * np.pi * 1.5 * time_s)[:, None] * np.ones(10)
    noise = [SD * rng.standard_normal((480, 10)) for _ in named]
    sizes = {"before": before_m, "after": after_m}
    monkeypatch.setattr(seal, "sealed_residuals", lambda e, fit, ts: [n + sizes[fit] * wave for n in noise])
    return seal.open_seal(None, "before", "after", named)


def test_the_floor_is_the_noise_whatever_misfit_is_left(monkeypatch):
    for after in (0.0, 0.0005, 0.002):
        gap = opened(monkeypatch, 0.004, after)
        assert gap.noise_floor == pytest.approx(SD, rel=0.03)
        assert gap.with_effect == pytest.approx(np.hypot(SD, after), rel=0.03)
        assert gap.calibrated == pytest.approx(np.hypot(SD, 0.004), rel=0.03)


def test_the_ratio_is_the_share_of_the_gap_that_is_left(monkeypatch):
    closed, half, open_ = (opened(monkeypatch, 0.004, left) for left in (0.0, 0.002, 0.004))
    assert closed.ratio == pytest.approx(0.0, abs=0.01)
    assert half.ratio == pytest.approx((np.sqrt(5) - 1) / (np.sqrt(17) - 1), rel=0.05)
    assert open_.ratio == pytest.approx(1.0, abs=0.01)
    assert closed.passed and not half.passed and not open_.passed
    for gap in (closed, half, open_):
        assert gap.interval[0] <= gap.ratio <= gap.interval[1]


def test_intervals_hold_the_ratio_at_their_rate(monkeypatch):
    """The closed gap's true ratio is 0; 90 % intervals miss it in about one of ten sets."""
    gaps = [opened(monkeypatch, 0.0006, 0.0, seed=seed) for seed in range(60)]
    held = sum(g.interval[0] <= 0 <= g.interval[1] for g in gaps)
    assert held >= 46  # 90 % of 60 is 54; fewer than 46 happens once in 500


def test_without_a_gap_there_is_no_ratio(monkeypatch):
    gap = opened(monkeypatch, 0.0, 0.0)
    assert gap.ratio is None and gap.interval is None and not gap.passed
