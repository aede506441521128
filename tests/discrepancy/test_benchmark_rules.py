"""What the benchmark counts as right."""

from benchmarks.discrepancy import interval, plan, right_class, right_name


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
    assert right_class(row(["segment_bias"], "named", ["single_wheel_toe"]))
    assert not right_class(row(["segment_bias"], "named", ["head_mass"]))
    assert not right_class(row(["segment_bias"], "unknown"))


def test_the_plan_is_seeded_and_holds_every_kind():
    assert plan(40, 3, ("null", "typical", "unlisted")) == plan(40, 3, ("null", "typical", "unlisted"))
    assert {kind for kind, _, _ in plan(40, 3, ("null", "typical"))} == {"null", "typical"}


def test_intervals_are_exact():
    low, high = interval(0, 300)
    assert low == 0.0
    assert abs(high - (1 - 0.005 ** (1 / 300))) < 1e-9
