"""Make the pictures of the documentation: those of the examples, and a maze that is planned and driven."""

from __future__ import annotations

import importlib
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs" / "pictures"
EXAMPLES = (
    "fig6_step_responses",
    "fig8_speed_map",
    "fig9_turning",
    "fig10_circle",
    "undulation_cost",
    "drive_factor",
    "best_lag",
    "fastest_gait",
    "soft_strobes",
    "tightest_turn",
    "slim_gait_gap",
    "ros_map",
)


def main() -> int:
    """Write docs/pictures."""
    sys.path.insert(0, str(ROOT))
    from planners.plan.__main__ import main as plan

    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        for name in EXAMPLES:
            importlib.import_module(f"examples.{name}").main(work)
            for picture in work.glob(f"{name}.png"):
                shutil.copy(picture, PICTURES)
            if (work / name / "plan.png").exists():
                shutil.copy(work / name / "plan.png", PICTURES / f"{name}.png")
        for maze, name in (("first", "maze"), ("no_way", "why_not")):
            out = work / maze
            plan([str(ROOT / "mazes" / f"{maze}.yaml"), "--execute", "--quiet", "--out", str(out)])
            made = out / ("plan.png" if (out / "plan.png").exists() else "why_not.png")
            shutil.copy(made, PICTURES / f"{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
