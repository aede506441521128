"""``python -m planners.view DIR``: a page that replays a plan and its execution in any browser."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from srs_opt.command import Answer, Parser, make_parser, run_command


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m planners.view",
        "Write one self-contained HTML page: maze, body, play and scrub, gaits and valves, clearance.\n"
        "It needs no network. Lengths in m, times in s, clearance in mm.",
        "plan mazes/first.yaml --execute --out out/plan && python -m planners.view out/plan",
        robot=False,
    )
    parser.add_argument(
        "motion", type=Path, metavar="DIR", help="folder that plan has written, or its motion.json"
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Read the motion, write the page."""
    from planners.view.page import find_motion, read_motion, save_page

    motion = read_motion(find_motion(options.motion))
    page = save_page(motion, options.out / "view.html")
    runs = [
        {"name": r["name"], "duration_s": r["duration_s"], "clearance_mm": min(r["clearance_mm"])}
        for r in motion["runs"]
    ]
    record = {"page": str(page), "bytes": page.stat().st_size, "runs": runs}
    words = ", ".join(f"{r['name']} {r['duration_s']:.1f} s" for r in runs)
    return Answer(record, f"{words}; open {page} in a browser", files=(page,))


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())
