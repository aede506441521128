"""Long statistics: swept over many sets, kept as rows in a file that says when and where they were found."""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import random
import shutil
import sys
import time
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
    add("--minutes", type=float, default=math.inf, metavar="M",
        help="stop after M minutes and store what is done: a random sample of the sets")  # fmt: skip
    return parser


def gather(
    name: str,
    work: Callable[..., Row],
    items: Sequence[tuple[Any, ...]],
    options: argparse.Namespace,
    depends: str = "",
) -> list[Row]:
    """Return ``work(*item)`` of all items and keep the rows; when interrupted, the next call goes on.

    The items are visited in random order, so that what is done when the time of `options.minutes` is over is
    a sample of all kinds of them; the first line of the rows then says how many there are. Rows found before
    an interruption count only if no source has changed since, nor `depends`, which stands for files that the
    work reads.
    """
    key = " ".join([name, depends, *(source_digest(HERE.parent / package) for package in PACKAGES)])
    unfinished = options.rows.with_suffix(".unfinished")
    each, kept = partial(_each, _importable(work)), Resume(unfinished, key)
    order = random.Random(options.seed).sample(range(len(items)), len(items))
    end, found = time.monotonic() + 60 * options.minutes, {}
    with executor(options.jobs, options.cluster) as where:
        swept = sweep(
            each, [items[k] for k in order], chunk=1, where=where, what=name, quiet=False, resume=kept
        )
        for k, row in zip(order, swept):
            found[k] = row
            if time.monotonic() > end:
                break
    rows = [found[k] for k in sorted(found)]
    short = "" if len(rows) == len(items) else f"; {len(rows)} of {len(items)} sets, drawn at random"
    lines = [{"measured": machine() + short, "seed": options.seed}, *rows]
    write_text(options.rows, "".join(json.dumps(line) + "\n" for line in lines))
    if not short:
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
