"""The sealed trials' gap: noise floor, ratio and interval, against residuals made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from srs_opt.calibrate.noise import Noise
from srs_opt.discrepancy import seal
from srs_opt.discrepancy.motions import motion_errors
from srs_opt.discrepancy.pictures import middle
from srs_opt.discrepancy.verdict import negligible
from srs_opt.measurement.records import Trial

SD = 0.001


def steady(time_s, speed_m_s=0.1, turn_rad_s=0.4):
    """Return five markers in a row that drive on a circle."""
    heading = turn_rad_s * time_s
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    centre = speed_m_s / turn_rad_s * np.stack([np.sin(heading), 1 - np.cos(heading)], axis=1)
    return centre[:, None] + along[:, None] * np.linspace(-0.1, 0.1, 5)[:, None]


def opened(monkeypatch, before_m, after_m, trials=3, seed=0):
    """Open the seal on white noise plus slow waves of the given sizes before and after."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(480) / 120
    named = [Trial(f"t{k}", 1.5, 41.0, 0.0, 1.57, 0.0, 4.0, time_s, steady(time_s)) for k in range(trials)]
    wave = np.sqrt(2) * np.sin(2 * np.pi * 1.5 * time_s)[:, None] * np.ones(10)
    noise = [SD * rng.standard_normal((480, 10)) for _ in named]
    sizes = {"before": before_m, "after": after_m}
    monkeypatch.setattr(seal, "sealed_residuals", lambda e, fit, ts: [n + sizes[fit] * wave for n in noise])
    experiment = SimpleNamespace(
        noise=Noise(SD), model=SimpleNamespace(robot=SimpleNamespace(length_m=0.236))
    )
    return seal.open_seal(experiment, "before", "after", named)


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
    assert closed.share < 0.1 and half.share == pytest.approx(0.5, abs=0.05)
    for gap in (closed, half, open_):
        assert gap.interval[0] <= gap.ratio <= gap.interval[1]


def test_intervals_hold_the_ratio_at_their_rate(monkeypatch):
    """The closed gap's true ratio is 0; 90 % intervals miss it in about one of ten sets."""
    gaps = [opened(monkeypatch, 0.0006, 0.0, seed=seed) for seed in range(60)]
    held = sum(g.interval[0] <= 0 <= g.interval[1] for g in gaps)
    assert held >= 46  # 90 % of 60 is 54; fewer than 46 happens once in 500


def test_without_a_gap_there_is_no_ratio(monkeypatch):
    gap = opened(monkeypatch, 0.0, 0.0)
    assert gap.ratio is None and gap.interval is None and gap.share is None


def test_what_is_left_is_told_in_millimetres_and_the_gap_is_nothing_below_them(monkeypatch):
    gap = opened(monkeypatch, 0.0003, 0.0)
    assert gap.before.m == pytest.approx(0.0003, rel=0.3) and negligible(gap)
    gap = opened(monkeypatch, 0.002, 0.001)
    assert gap.before.m == pytest.approx(0.002, rel=0.05) and not negligible(gap)
    assert gap.after.m == pytest.approx(0.001, rel=0.1)


def test_errors_of_speed_and_radius_are_those_of_a_circle():
    time_s = np.arange(480) / 120
    trial = Trial("t", 1.5, 41.0, 0.0, 1.57, 0.0, 4.0, time_s, steady(time_s))
    slower = (trial.markers_m - steady(time_s, 0.098, 0.4)).reshape(480, -1)
    speed, radius = motion_errors([trial], [slower], 0.236)
    assert speed == pytest.approx(0.02, rel=1e-3) and radius == pytest.approx(0.02, rel=1e-3)
    straighter = (trial.markers_m - steady(time_s, 0.1, 0.38)).reshape(480, -1)
    speed, radius = motion_errors([trial], [straighter], 0.236)
    assert speed < 0.002 and radius == pytest.approx(0.4 / 0.38 - 1, rel=0.05)


def test_one_sealed_trial_far_off_is_set_aside_and_three_are_not():
    def gap(**left):
        found = seal.Remainder(0.0, None, None, left)
        return seal.Gap(1e-3, 1e-3, 1e-3, None, None, len(left), found, found, 1e-4)

    (name,) = seal.odd_sealed(gap(a=1e-4, b=0.092, c=2e-4))
    assert name == "b"
    assert not seal.odd_sealed(gap(a=0.09, b=0.08, c=2e-4))
    assert not seal.odd_sealed(gap(a=1e-4, b=5e-4, c=2e-4))


def test_the_way_drawn_is_one_marker_s_and_does_not_jump_when_another_is_lost():
    points = steady(np.arange(3) / 10)
    points[1] = np.nan
    points[2, 0] = np.nan
    found = middle(points)
    assert np.isnan(found[1]).all()
    np.testing.assert_allclose(found[[0, 2]], points[[0, 2], 2])
    points[0, 2] = np.nan  # now others were seen more often
    np.testing.assert_allclose(middle(points)[2], points[2, 1])
