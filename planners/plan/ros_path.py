"""A plan as ROS's nav_msgs/Path in YAML, as ``ros2 topic pub --yaml-file`` takes it."""

from __future__ import annotations

import math
from pathlib import Path

from planners.plan.answer import Plan
from srs_opt.files import write_text

FRAME = "map"


def ros_path(plan: Plan) -> dict[str, object]:
    """Return the message: frame ``map``, metres, x right and y up as in the maze, headings as quaternions.

    The pose is the robot's: centre of mass of the links, mean heading; stamps count from the start.
    """
    poses = []
    for row in plan.path():
        sec, fraction = divmod(row["t_s"], 1.0)
        half = row["heading_rad"] / 2
        poses.append(
            {
                "header": {"stamp": {"sec": int(sec), "nanosec": round(1e9 * fraction)}, "frame_id": FRAME},
                "pose": {
                    "position": {"x": row["x_m"], "y": row["y_m"], "z": 0.0},
                    "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
                },
            }
        )
    return {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": FRAME}, "poses": poses}


def save_ros_path(plan: Plan, path: Path) -> Path:
    """Write the message."""
    import yaml

    return write_text(path, yaml.safe_dump(ros_path(plan), sort_keys=False))
