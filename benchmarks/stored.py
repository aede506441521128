"""Long statistics: swept over many sets, kept as rows in a file that says when and where they were found."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, cast

from benchmarks.section import machine
from srs_opt.command import positive_int
from srs_opt.files import write_text
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, source_digest, sweep

HERE = Path(__file__).resolve().parent
STORED = HERE / "stored"
PACKAGES = ("benchmarks", "planners", "virtual_lab")  # what rows depend on, besides srs_opt
Row = Any  # what JSON holds


def study_parser(name: str, description: str | None, sets: int) -> argparse.ArgumentParser:
    """Return a parser with the options of all long studies."""
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks.{name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--sets", type=positive_int, default=sets, help=f"how many sets (default {sets})")
    add("--seed", type=int, default=1)
    add("--jobs", type=positive_int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    add("--cluster", metavar="ADDRESS", help="Dask scheduler to send the work to, host:port")
    add("--rows", type=Path, default=STORED / f"{name}.jsonl", metavar="FILE",
        help="the rows, one JSON each; the default is what the report shows")  # fmt: skip
    return parser


def gather(
    name: str,
    work: Callable[..., Row],
    items: Sequence[tuple[Any, ...]],
    options: argparse.Namespace,
    depends: str = "",
) -> list[Row]:
    """Return ``work(*item)`` of all items and keep the rows; when interrupted, the next call goes on.

    Rows found before the interruption count only if no source has changed since, nor `depends`, which
    stands for files that the work reads.
    """
    key = " ".join([name, depends, *(source_digest(HERE.parent / package) for package in PACKAGES)])
    unfinished = options.rows.with_suffix(".unfinished")
    each, kept = partial(_each, _importable(work)), Resume(unfinished, key)
    with executor(options.jobs, options.cluster) as where:
        rows = list(sweep(each, items, chunk=1, where=where, what=name, quiet=False, resume=kept))
    lines = [{"measured": machine(), "seed": options.seed}, *rows]
    write_text(options.rows, "".join(json.dumps(line) + "\n" for line in lines))
    shutil.rmtree(unfinished, ignore_errors=True)
    return rows


def _importable(work: Callable[..., Row]) -> Callable[..., Row]:
    """Return `work` under its module's own name: no other process has the `__main__` that a study runs as."""
    if getattr(work, "__module__", None) != "__main__":
        return work
    module = importlib.import_module(sys.modules["__main__"].__spec__.name)
    return cast("Callable[..., Row]", getattr(module, work.__name__))


def _each(work: Callable[..., Row], items: Sequence[tuple[Any, ...]]) -> list[Row]:
    return [work(*item) for item in items]


def stored_rows(name: str) -> tuple[str, list[Row]] | None:
    """Return when and where a study was last made, and its rows; None if it never was."""
    path = STORED / f"{name}.jsonl"
    if not path.exists():
        return None
    first, *rows = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    return str(first["measured"]), rows
