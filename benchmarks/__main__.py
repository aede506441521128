"""``python -m benchmarks``: run all benchmarks, or those named, and write benchmarks/results.md."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the work is many small matrices

from benchmarks.section import Section, machine

HERE = Path(__file__).parent
REFERENCE = HERE / "reference.json"


def names() -> list[str]:
    """Return the modules that define ``run``."""
    found = []
    for module in pkgutil.iter_modules([str(HERE)]):
        if not module.name.startswith("_") and module.name != "section":
            source = (HERE / f"{module.name}.py").read_text(encoding="utf-8")
            if "\ndef run(quick: bool)" in source:
                found.append(module.name)
    return found


def measure(chosen: list[str], quick: bool) -> tuple[dict[str, Section], list[str]]:
    """Run benchmarks; return their sections and the names of those that failed."""
    sections, failed = {}, []
    for name in chosen:
        started = time.perf_counter()
        try:
            sections[name] = importlib.import_module(f"benchmarks.{name}").run(quick)
        except Exception as error:  # the others still count
            failed.append(name)
            print(f"{name}: failed: {type(error).__name__}: {error}", file=sys.stderr)
            continue
        print(f"{name}: {time.perf_counter() - started:.0f} s", file=sys.stderr)
        print(sections[name].markdown(), flush=True)
    return sections, failed


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"of {', '.join(names())} (default: all; only then is results.md written)",
    )
    parser.add_argument("--quick", action="store_true", help="small cases; nothing is written")
    parser.add_argument("--update", action="store_true", help="with --quick: write reference.json anew")
    options = parser.parse_args(argv)
    unknown = set(options.names) - set(names())
    if unknown:
        parser.error(f"no benchmark called {', '.join(sorted(unknown))}; there are {', '.join(names())}")
    chosen = options.names or names()
    sections, failed = measure(chosen, options.quick)
    ratios = {f"{n}: {k}": v for n, s in sections.items() for k, v in s.ratios.items()}
    if options.update and options.quick:
        known = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
        kept = {k: v for k, v in known.items() if k.split(":")[0] not in sections}
        REFERENCE.write_text(json.dumps({**kept, **ratios}, indent=2, sort_keys=True) + "\n")
    elif not options.quick and not options.names:
        text = f"# Measured\n\n{machine()}\n\nRatios within one run are what counts; see README.md.\n\n"
        (HERE / "results.md").write_text(text + "\n".join(s.markdown() for s in sections.values()))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
