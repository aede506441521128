"""srs-opt: models, gaits, drive, planning, calibration and model diagnosis for soft snake robots.

Ten lines from a robot to a driven maze::

    import srs_opt as srs

    robot = srs.wpi_srs()
    best = srs.optimize_gait(robot)          # a certified gait
    best.plot()
    speeds = srs.gait_map(robot, frequencies_hz=[1, 1.5, 2], pressures_kpa=[41, 55], offsets=[0, 0.4, 0.8])
    drive = srs.drive_from_map(robot, speeds)
    print(drive.gait_for_radius(0.15, 0.4))  # the gait for a speed and a radius
    route = srs.plan("mazes/first.yaml", robot)
    print(srs.drive_plan(route))
    route.save("plan.json")

Results print as one line, show their picture in a notebook, and have `to_dict`, `save` and `plot`. Every name
is imported when it is first used, so that ``import srs_opt`` and every ``--help`` stay fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Where every public name lives. This module alone may name `planners`, which is built upon the library.
_PUBLIC = {
    "Robot": "srs_opt.robot",
    "load_robot": "srs_opt.robot",
    "save_robot": "srs_opt.robot",
    "wpi_srs": "srs_opt.robot",
    "Gait": "srs_opt.gait",
    "Wave": "srs_opt.gait",
    "published_wave": "srs_opt.gait",
    "load_gait": "srs_opt.gait_file",
    "steady_gait": "srs_opt.orbit.steady",
    "optimize_gait": "srs_opt.gait_opt.optimize",
    "Limits": "srs_opt.gait_opt.goal",
    "Drive": "srs_opt.drive.drive",
    "drive_from_map": "srs_opt.drive.drive",
    "calibrate_drive": "srs_opt.drive.fit",
    "GaitTable": "srs_opt.gait_opt.table",
    "default_table": "srs_opt.gait_opt.catalogue",
    "load_table": "srs_opt.gait_opt.table",
    "load_dataset": "srs_opt.measurement.dataset",
    "diagnose": "srs_opt.discrepancy.pipeline",
    "register_effect": "srs_opt.effects.__init__",
    "Maze": "planners.maze.maze",
    "load_maze": "planners.maze.load",
    "plan": "planners.apps.route",
    "drive_plan": "planners.apps.route",
}
_CALLABLE = ("simulate", "gait_map", "calibrate", "judge")  # packages that are called like functions
__all__ = sorted([*_PUBLIC, *_CALLABLE])


def __getattr__(name: str) -> Any:
    if name in _CALLABLE:
        return import_module(f"{__name__}.{name}")
    if name not in _PUBLIC:
        raise AttributeError(f"module 'srs_opt' has no attribute '{name}'; it has {', '.join(__all__)}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
