"""How long a person waits for ``--help`` and for ``import srs_opt``."""

from __future__ import annotations

import os
import pkgutil
import subprocess
import sys
import time
from pathlib import Path

import planners
import srs_opt
from benchmarks.section import Section

HELP_S, IMPORT_S = 0.3, 0.2


def commands() -> list[str]:
    """Return every module that runs as a command."""
    found = []
    for package in (srs_opt, planners):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if module.ispkg or module.name.endswith(".__main__"):
                continue
            file = Path(str(module.module_finder.path)) / f"{module.name.rsplit('.', 1)[1]}.py"  # type: ignore[union-attr]
            if 'if __name__ == "__main__"' in file.read_text(encoding="utf-8"):
                found.append(module.name)
        root = Path(package.__path__[0])
        found += [".".join((package.__name__, *main.parent.relative_to(root).parts))
                  for main in sorted(root.rglob("__main__.py"))]  # fmt: skip
    return sorted(found)


def help_seconds(command: str, enough_s: float = 0.0, tries: int = 5) -> float:
    """Return the shortest processor time of ``python -m command --help``; one below `enough_s` will do."""
    return _shortest([sys.executable, "-m", command, "--help"], enough_s, tries)


def import_seconds(enough_s: float = 0.0, tries: int = 5) -> float:
    """Return the shortest processor time of a Python that imports srs_opt and ends."""
    return _shortest([sys.executable, "-c", "import srs_opt"], enough_s, tries)


def _shortest(arguments: list[str], enough_s: float, tries: int) -> float:
    best = float("inf")
    for _ in range(tries):
        before, started = os.times(), time.perf_counter()
        subprocess.run(arguments, check=True, capture_output=True)
        after, wall = os.times(), time.perf_counter() - started
        used = after.children_user + after.children_system - before.children_user - before.children_system
        # the clock of processor time is coarse and waiting for files counts too, a busy machine does not
        best = min(best, wall, max(used, 0.01) + 0.02)
        if best < enough_s:
            break
    return best


def run(quick: bool) -> Section:
    bare = _shortest([sys.executable, "-c", "pass"], 0.0, 5)
    asked = commands()[:: 4 if quick else 1]
    times = {command: help_seconds(command, tries=3) for command in asked}
    imported = import_seconds()
    rows = [["import srs_opt", f"{imported:.2f}", f"{imported / bare:.1f}"]]
    rows += [[f"{name} --help", f"{s:.2f}", f"{s / bare:.1f}"] for name, s in times.items()]
    ratios = {
        "slowest --help over bare Python": max(times.values()) / bare,
        "import over bare Python": imported / bare,
    }
    notes = [
        f"Wanted: every --help under {HELP_S} s, the import under {IMPORT_S} s (bare Python: {bare:.2f} s)."
    ]
    return Section("Start-up", ["what", "s", "over bare Python"], rows, notes, ratios)
