"""Which way through? A passage that only slim gaits fit: the planner changes gait for it."""

import json
from pathlib import Path

from planners.plan.__main__ import main as plan
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.robot import wpi_srs

PASSAGE_M = 0.086
MARGIN_M = 0.004
MAZE = f"""
name: a slim passage
bounds: [0, 0, 2.2, 0.6]
walls:
  - {{box: [0.9, 0, 1.3, {0.3 - PASSAGE_M / 2:.4f}]}}
  - {{box: [0.9, {0.3 + PASSAGE_M / 2:.4f}, 1.3, 0.6]}}
start: {{x: 0.2, y: 0.3, heading: 0.0}}
goal: {{x: 2.0, y: 0.3, radius: 0.06}}
"""


def main(out: Path = Path("out/examples")) -> float:
    """Return the swept width (m) of the gait that threads the passage: the one played longest."""
    folder = out / "slim_gait_gap"
    folder.mkdir(parents=True, exist_ok=True)
    maze = folder / "passage.yaml"
    maze.write_text(MAZE, encoding="utf-8")
    status = plan([str(maze), "--margin", str(MARGIN_M), "--execute", "--quiet", "--out", str(folder)])
    record = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    assert status == 0, record["reason"]
    table = default_table(wpi_srs())
    widths = {}
    for step in record["steps"]:
        width = widths[step["gait"]] = sum(table[step["gait"]].envelope_m)
        fits = "fits the passage" if width + 2 * MARGIN_M < PASSAGE_M else "too wide for it"
        print(f"{step['cycles']:3d} x {step['gait']:26s} sweeps {1e3 * width:.0f} mm: {fits}")
    spare = 1e3 * record["execution"]["smallest_clearance_m"]
    print(f"driven: {record['execution']['reason']}, {spare:.1f} mm to spare")
    assert max(widths.values()) + 2 * MARGIN_M > PASSAGE_M, "a wide gait where there is room"
    longest = max(record["steps"], key=lambda step: step["cycles"])
    return widths[longest["gait"]]


if __name__ == "__main__":
    main()
