"""What the benchmark counts as right."""

from benchmarks import stored
from benchmarks.discrepancy import (
    bad_found,
    confusion,
    covered,
    in_words,
    interval,
    plan,
    rates,
    right_class,
    right_name,
    wrong_name,
)
from benchmarks.discrepancy_described import KINDS as TRUE_KINDS
from benchmarks.discrepancy_described import right_description
from virtual_lab.catalogue import UNLISTED


def row(hidden, verdict, named=(), alternatives=()):
    return {
        "hidden": list(hidden),
        "verdict": verdict,
        "named": list(named),
        "alternatives": list(alternatives),
        "truth": [{"name": name, "size": 2.0} for name in hidden],
        "effects": [{"name": name, "parameters": {"size": 2.3}, "sd": {"size": 0.2}} for name in named],
    }


def test_a_name_must_be_the_whole_set():
    assert right_name(row(["a", "b"], "named", ["a", "b"]))
    assert not right_name(row(["a", "b"], "named", ["a"]))


def test_an_exact_tie_counts_when_both_are_said():
    assert right_name(row(["dead_time"], "one_of", ["clock_offset"], [["dead_time"]]))
    assert not right_name(row(["camera_scale"], "one_of", ["gap_length"], [["camera_scale"]]))


def test_look_alikes_are_the_right_class():
    alike = {"alike": [{"effects": ["single_wheel_toe", "segment_bias"], "angle_rad": 0.05}]}
    assert right_class({**row(["segment_bias"], "named", ["single_wheel_toe"]), **alike})
    assert not right_class(row(["segment_bias"], "named", ["single_wheel_toe"]))
    assert not right_class(row(["segment_bias"], "named", ["head_mass"]))
    assert not right_class(row(["segment_bias"], "unknown"))


def test_a_part_that_is_hidden_is_no_wrong_name_and_one_that_is_not_is():
    assert not wrong_name(row(["a", "b"], "named_in_part", ["a"]))
    assert wrong_name(row(["a"], "named_in_part", ["b"]))
    assert wrong_name(row([], "named", ["b"]))
    assert not wrong_name(row([], "unknown", ["b"]))


def test_a_bad_trial_is_found_where_it_is_set_aside_or_contradicts():
    bad = {**row([], "no_gap"), "wrong_trial": "t1"}
    assert bad_found({**bad, "set_aside": [{"trial": "t1", "reason": "x"}]})
    assert bad_found({**bad, "why": "trial t1 contradicts the others"})
    assert not bad_found({**bad, "set_aside": [{"trial": "t11", "reason": "x"}]})


def test_intervals_of_named_sizes_hold_the_truth_or_not():
    near, far = row(["a"], "named", ["a"]), row(["a"], "named", ["a"])
    far["effects"][0]["sd"]["size"] = 0.1
    assert (covered(near), covered(far)) == ([True], [False])


def test_the_plan_is_seeded_and_holds_every_kind():
    assert plan(40, 3, ("null", "typical", "unlisted")) == plan(40, 3, ("null", "typical", "unlisted"))
    assert {kind for kind, _, _ in plan(40, 3, ("null", "typical"))} == {"null", "typical"}


def test_intervals_are_exact():
    low, high = interval(0, 300)
    assert low == 0.0
    assert abs(high - (1 - 0.005 ** (1 / 300))) < 1e-9


def test_rates_and_confusion_of_rows():
    rows = [
        {
            **row(["a"], "named", ["a"]),
            "kind": "typical",
            "ratio": 0.1,
            "cpu_s": 2.0,
            "baselines": {"forward_aic": ["b"]},
        },
        {**row(["a"], "unknown"), "kind": "typical", "ratio": None, "baselines": {"forward_aic": ["a"]}},
        {**row([], "no_gap"), "kind": "null", "baselines": {"forward_aic": ["b"]}},
    ]
    found = {what: hits for what, hits, *_ in rates(rows)}
    assert found["typical: right name"].startswith("1/2")
    assert found["null: false alarm"].startswith("0/1")
    assert found["typical: right name, by forward aic"].startswith("1/2")
    assert found["null: false name, by forward aic"].startswith("1/1")
    assert "0.100" in in_words(rows)[1]
    assert len(confusion(rows).splitlines()) == 3


def multiplied(x, y):
    return {"product": x * y}


def test_a_study_keeps_its_rows_and_says_when(tmp_path, monkeypatch):
    monkeypatch.setattr(stored, "STORED", tmp_path)
    options = stored.study_parser("study", "", 3).parse_args(["--jobs", "1"])
    assert stored.stored_rows("study") is None
    rows = stored.gather("study", multiplied, [(2, 3), (4, 5)], options)
    measured, kept = stored.stored_rows("study")
    assert rows == kept == [{"product": 6}, {"product": 20}]
    assert "Python" in measured
    assert [p.name for p in tmp_path.iterdir()] == ["study.jsonl"]


def test_a_description_must_tell_the_kind_and_the_place():
    truth = [{"name": "stiff_wheel", "excess": 5.0, "link": 2}]

    def said(name, **parameters):
        return right_description(truth, [{"name": f"generic_{name}", "parameters": parameters}])

    assert said("along_link", excess=4.9, link=2) == (True, True)
    assert said("along_link", excess=4.9, link=3) == (True, False)
    assert said("across_link", excess=4.9, link=2) == (False, True)
    assert right_description(truth, []) == (False, False)
    assert set(TRUE_KINDS) == set(UNLISTED)
