"""Plan in a ROS map_server map: an occupancy image and a YAML file, as SLAM leaves them."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from planners.plan.__main__ import main as plan

CELL_M = 0.02


def write_map(folder: Path) -> Path:
    """Draw two rooms and a door as SLAM would: 254 free, 0 occupied, 205 unknown."""
    pixels = np.full((60, 110), 254, dtype=np.uint8)
    pixels[[0, -1], :] = pixels[:, [0, -1]] = 0
    pixels[:, 54:56] = 0
    pixels[22:40, 54:56] = 254  # the door
    pixels[5:12, 80:95] = 205  # behind a shelf: never seen
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(folder / "rooms.pgm")
    lines = ("image: rooms.pgm", f"resolution: {CELL_M}", "origin: [-1.1, -0.6, 0.0]", "negate: 0")
    text = "\n".join([*lines, "occupied_thresh: 0.65", "free_thresh: 0.196", ""])
    (folder / "rooms.yaml").write_text(text, encoding="utf-8")
    return folder / "rooms.yaml"


def main(out: Path = Path("out/examples")) -> float:
    """Return the length (m) of the way from one room to the other."""
    rooms = write_map(out / "ros_map")
    places = ["--start=-0.7,0.2,0", "--goal=0.8,-0.2,0.08"]
    status = plan([str(rooms), *places, "--execute", "--quiet", "--out", str(out / "ros_map")])
    record = json.loads((out / "ros_map" / "plan.json").read_text(encoding="utf-8"))
    assert status == 0, record["reason"]
    print(
        f"{record['planner']}: {record['length_m']:.2f} m in {record['duration_s']:.1f} s, "
        f"{1e3 * record['clearance_m']:.0f} mm from the walls; {record['execution']['reason']}"
    )
    return record["length_m"]


if __name__ == "__main__":
    main()
