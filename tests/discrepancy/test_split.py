import numpy as np

from srs_opt.discrepancy.split import BRIEF_S, FEW, few_and_brief, split_trials
from srs_opt.measurement.records import Trial


def trials(count, frames=100):
    time_s = np.arange(frames) / 50
    return [
        Trial(
            f"t{k}",
            (1.0, 1.5, 2.0)[k % 3],
            (41.0, 55.0)[k % 2],
            0.0,
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


def test_the_same_seed_seals_the_same_trials():
    assert split_trials(trials(9), 3).sealed[0].name == split_trials(trials(9), 3).sealed[0].name


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
    assert len(some) == FEW
    assert all(t.time_s[-1] <= BRIEF_S and t.markers_m.shape[0] == t.time_s.size for t in some)
    assert not {t.name for t in some} & {t.name for t in many}
    assert few_and_brief(trials(5)) == ()  # would save nothing
