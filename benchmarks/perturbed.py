"""Documented commands with other rounding: an answer that hangs on rounding shows here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.section import Section

# Ways to round otherwise. By the processor the C library chooses sin, exp and so on, OpenBLAS its kernels.
VARIANTS = ("another processor", "fused multiply-add", "interpreted")
OLD_PROCESSOR = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4", "OPENBLAS_CORETYPE": "Prescott"}
FUSED = "-O2 -march=native -ffp-contract=fast"
QUICK = ("srs_opt.simulate --duration 2",)
LONG = (
    "srs_opt.simulate --duration 10",
    "srs_opt.gait_map --frequency 1 2 3 --pressure 41 55 2 --offset 0 0.4 --jobs 1",
    "srs_opt.gait_opt --objective speed --jobs 1",
    "srs_opt.gait_opt --objective turn --jobs 1",
    "planners.plan mazes/first.yaml --execute",
)
# what pages print; a flat optimum may be reached by slightly other switch times
ANSWERS = (
    *("speed_m_s", "turn_rate_rad_s", "radius_m", "duration_s", "length_m", "clearance_m"),
    *("speed_max_m_s", "radius_min_m", "status", "passed", "reached", "collisions"),
)
WORTH_TELLING = 5e-3  # relative: what the documentation's digits show
ROOT = Path(__file__).parent.parent


def run(quick: bool) -> Section:
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for command in QUICK if quick else LONG:
            plain = _answer(command, folder, {})
            for name in VARIANTS[:1] if quick else VARIANTS:
                other = _answer(command, folder, _environment(folder, name))
                where, difference = _largest_difference(plain, other)
                told = "no" if difference > WORTH_TELLING else "yes"
                rows.append([command, name, f"{difference:.1e}", where, told])
    return Section(
        "Other rounding",
        ["command", "variant", "largest relative difference", "of", "same digits"],
        rows,
        notes=[
            "Against the usual run. A difference is relative to the value or, near zero, to 1e-3; "
            "infinite where the answers have another form."
        ],
    )


def _environment(folder: Path, name: str) -> dict[str, str]:
    """Return what a variant changes in the environment."""
    if name == "another processor":
        return OLD_PROCESSOR
    if name == "interpreted":
        return {"SRS_OPT_CC": "none"}
    script = folder / "cc"
    script.write_text(f'#!/bin/sh\nexec cc "$@" {FUSED}\n', encoding="utf-8")  # the last flag counts
    script.chmod(0o755)
    return {"SRS_OPT_CC": str(script), "SRS_OPT_CACHE": str(folder / "cache")}


def _answer(command: str, folder: Path, changes: dict[str, str]) -> Any:
    given = [sys.executable, "-m", *command.split(), "--json", "--quiet", "--out", str(folder / "out")]
    environment = {**os.environ, **changes}
    done = subprocess.run(given, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    return json.loads(done.stdout)


def _largest_difference(one: Any, other: Any) -> tuple[str, float]:
    """Return where two answers differ most, and by how much."""
    a, b = dict(_values(one)), dict(_values(other))
    if a.keys() != b.keys():
        return "keys", float("inf")
    found = {key: _difference(a[key], b[key]) for key in a}
    key = max(found, key=lambda k: found[k])
    return key, found[key]


def _difference(a: Any, b: Any) -> float:
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) / max(abs(a), 1e-3)
    return 0.0 if a == b else float("inf")


def _values(record: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (key, number or word) of the answers in a JSON record."""
    if isinstance(record, dict):
        for name, value in record.items():
            yield from _values(value, f"{key}.{name}" if key else name)
    elif isinstance(record, list):
        for k, value in enumerate(record):
            yield from _values(value, f"{key}[{k}]")
    elif key.rsplit(".", 1)[-1].split("[")[0] not in ANSWERS:
        return
    elif isinstance(record, (int, float)) and not isinstance(record, bool):
        yield key, float(record)
    else:
        yield key, record
