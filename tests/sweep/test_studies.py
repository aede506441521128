"""Long studies keep their rows, go on after an interruption, and drop rows that other sources made."""

import json
import sys
from functools import partial
from pathlib import Path
from types import FunctionType, SimpleNamespace

import pytest

from benchmarks import stored


def squared(log, k):
    """One row; the log counts how often it was worked out. The fourth is interrupted while `stop` exists."""
    log = Path(log)
    if (log.parent / "stop").exists() and log.exists() and len(log.read_text()) == 3:
        raise KeyboardInterrupt
    with log.open("a") as stream:
        stream.write("x")
    return {"k": k, "square": k * k}


@pytest.fixture
def options(tmp_path):
    given = ["--rows", str(tmp_path / "study.jsonl"), "--jobs", "1", "--seed", "7"]
    return stored.study_parser("study", "", 5).parse_args(given)


def interrupted(tmp_path, options, depends):
    (tmp_path / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        stored.gather("study", partial(squared, tmp_path / "log"), [(k,) for k in range(5)], options, depends)
    (tmp_path / "stop").unlink()
    assert not options.rows.exists()
    assert len((tmp_path / "log").read_text()) == 3


@pytest.mark.parametrize(("depends", "worked"), [("same table", 5), ("another table", 8)])
def test_a_study_goes_on_where_it_was(tmp_path, options, depends, worked):
    interrupted(tmp_path, options, "same table")
    rows = stored.gather(
        "study", partial(squared, tmp_path / "log"), [(k,) for k in range(5)], options, depends
    )
    assert [row["square"] for row in rows] == [0, 1, 4, 9, 16]
    assert len((tmp_path / "log").read_text()) == worked
    first, *kept = map(json.loads, options.rows.read_text().splitlines())
    assert kept == rows
    assert first["seed"] == 7
    assert sorted(file.name for file in tmp_path.iterdir()) == ["log", "study.jsonl"]


def test_a_study_cut_short_stores_a_sample_and_says_so(tmp_path, options):
    options.minutes = 0.0
    work, items = partial(squared, tmp_path / "log"), [(k,) for k in range(50)]
    rows = stored.gather("study", work, items, options)
    first, *kept = map(json.loads, options.rows.read_text().splitlines())
    assert len(rows) == 1
    assert kept == rows
    assert "1 of 50 sets, drawn at random" in first["measured"]
    options.minutes = 10.0  # the next call goes on
    assert [row["k"] for row in stored.gather("study", work, items, options)] == list(range(50))
    assert len((tmp_path / "log").read_text()) == 50


def test_rows_of_an_older_planner_are_not_mixed_in(tmp_path, options, monkeypatch):
    interrupted(tmp_path, options, "")
    digest = stored.source_digest
    monkeypatch.setattr(stored, "source_digest", lambda package: digest(package) + "changed")
    stored.gather("study", partial(squared, tmp_path / "log"), [(k,) for k in range(5)], options)
    assert len((tmp_path / "log").read_text()) == 8


def test_a_study_run_as_a_program_finds_its_work_by_name(monkeypatch):
    """What keeps something per process (``lru_cache``) cannot be sent to another one from ``__main__``."""
    from benchmarks import planner_narrow

    program = SimpleNamespace(__spec__=SimpleNamespace(name="benchmarks.planner_narrow"))
    monkeypatch.setitem(sys.modules, "__main__", program)
    work = FunctionType(planner_narrow.attempt.__code__, {"__name__": "__main__"}, "attempt")
    assert work.__module__ == "__main__"
    assert stored._importable(work) is planner_narrow.attempt
