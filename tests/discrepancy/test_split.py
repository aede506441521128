from dataclasses import replace

import numpy as np

from srs_opt.discrepancy.search_settings import SPLIT
from srs_opt.discrepancy.split import few_and_brief, gait_of, split_trials
from srs_opt.measurement.records import Trial
from virtual_lab.trials import small_design

SAME = ("name", "frequency_hz", "pressure_kpa", "offset", "heading_rad")


def trials(count, frames=100):
    time_s = np.arange(frames) / 50
    return [
        Trial(
            f"t{k}",
            (1.0, 1.5, 2.0)[k % 3],
            (41.0, 55.0)[k % 2],
            0.4 * (k // 6),
            1.57,
            0.0,
            frames / 50,
            time_s,
            np.zeros((frames, 5, 2)),
        )
        for k in range(count)
    ]


def test_every_trial_is_used_once():
    split = split_trials(trials(12))
    names = [t.name for t in (*split.open, *split.sealed)]
    assert sorted(names) == sorted(t.name for t in trials(12))
    assert len(split.sealed) == 3
    assert sorted(n for fold in split.folds for n in fold) == sorted(t.name for t in split.open)


def test_sealed_trials_spread_over_conditions():
    split = split_trials(trials(12))
    assert len({t.frequency_hz for t in split.sealed}) == 3


def test_the_split_follows_from_the_gaits_not_from_order_or_names():
    design = small_design(np.random.default_rng(0))
    made = [replace(trials(1)[0], **{k: getattr(t, k) for k in SAME}) for t in design]
    sealed = {gait_of(t) for t in split_trials(made).sealed}
    turned = [replace(t, name=f"x{k}") for k, t in enumerate(reversed(made))]
    assert {gait_of(t) for t in split_trials(turned).sealed} == sealed


def test_replicates_are_sealed_with_their_gait():
    design = small_design(np.random.default_rng(1))
    made = [replace(trials(1)[0], **{k: getattr(t, k) for k in SAME}) for t in design]
    split = split_trials(made)
    assert split.new_gaits and len(split.sealed) == 3
    assert not {gait_of(t) for t in split.sealed} & {gait_of(t) for t in split.open}
    assert len(split.folds) == 3


def test_one_gait_alone_is_split_by_direction_and_says_so():
    one = [
        replace(t, frequency_hz=1.0, pressure_kpa=41.0, offset=0.0, heading_rad=0.5 * k)
        for k, t in enumerate(trials(8))
    ]
    split = split_trials(one)
    assert split.enough and not split.new_gaits


def test_a_trial_of_holes_is_left_out_with_a_reason():
    bad = trials(5)
    holes = np.full((100, 5, 2), np.nan)
    bad[2] = Trial("hole", 1.0, 41.0, 0.0, 1.57, 0.0, 2.0, bad[2].time_s, holes)
    split = split_trials(bad)
    assert split.left_out[0][0] == "hole"
    assert split.enough


def test_too_few_trials_are_not_enough():
    assert not split_trials(trials(3)).enough
    assert not split_trials([]).enough


def test_the_first_seconds_of_a_few_trials_have_names_of_their_own():
    many = trials(12, 400)
    some = few_and_brief(many)
    assert len(some) == SPLIT.brief_trials
    assert all(t.time_s[-1] <= SPLIT.brief_s and t.markers_m.shape[0] == t.time_s.size for t in some)
    assert not {t.name for t in some} & {t.name for t in many}
    assert few_and_brief(trials(5)) == ()  # would save nothing
