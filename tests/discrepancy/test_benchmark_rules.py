"""What the benchmark counts as right."""

from benchmarks import stored
from benchmarks.discrepancy import confusion, in_words, interval, plan, rates, right_class, right_name


def row(hidden, verdict, named=(), alternatives=()):
    return {
        "hidden": list(hidden),
        "verdict": verdict,
        "named": list(named),
        "alternatives": list(alternatives),
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
