"""How a plan is driven: when it is left, when a cycle is not begun, how long another way is looked for."""

from __future__ import annotations

from dataclasses import dataclass

from planners.search.track import DEFAULT_TRACK, TrackSettings


@dataclass(frozen=True)
class DriveSettings:
    """What the driver decides by. Lengths in body lengths, speeds in body lengths per second.

    What half and double of a value do is said as it is to be expected; only the values were driven.

    Attributes
    ----------
    astray : float
        Farther from the plan than this it is planned anew. Half: detours of the tracker that would come back
        end in a new plan, which takes seconds; double: the robot may pass a branch before it is noticed.
    stop_clearance : float
        A cycle that runs deeper into a wall than this by the gait table is not begun. Below zero since the
        table errs: half stops drives that would pass, double begins cycles that touch.
    least_room : float
        Room foreseen by the friction ensemble below which a halt is the better choice; 1 mm of the built-in
        robot, the size of what its simulations leave out.
    on_track : tuple of float
        Off the plan's place (x, y), heading (rad) and speed up to which the plan's own gait is played on.
        Half: the tracker takes over where nothing is wrong; double: errors build up before it corrects them.
    most_tried : int
        Gaits that are simulated before a cycle is given up: each costs a simulation with every friction.
    most_idle : int
        Cycles without progress along the plan before it is planned anew.
    most_replans, most_halts : int
        New plans in motion, and halts from which the robot sets off again, before the drive ends.
    replan_cycles, rest_cycles : int
        Cycles that a search looks at: in motion, where the robot drives on meanwhile, and from rest.
    replan_s, rest_s : float
        The same as time.
    patience : float
        Times the plan's cycles after which the drive ends.
    beyond : float
        By how much the reference is drawn out past the goal, so that the goal is driven through. Shorter: the
        robot brakes before it; longer: the end of a narrow way is followed into a wall.
    slowest : float
        Speed with which the time for that is reckoned at least.
    engine_steps : int
        Steps of the other physics engine from one look at the body to the next; contacts are told by the
        engine at every step.
    track : TrackSettings
    """

    astray: float = 0.254
    stop_clearance: float = -0.0169
    least_room: float = 0.00424
    on_track: tuple[float, float, float, float] = (0.0169, 0.0169, 0.03, 0.169)
    most_tried: int = 8
    most_idle: int = 4
    most_replans: int = 8
    most_halts: int = 3
    replan_cycles: int = 4000
    rest_cycles: int = 40_000
    replan_s: float = 20.0
    rest_s: float = 60.0
    patience: float = 3.0
    beyond: float = 0.508
    slowest: float = 0.424
    engine_steps: int = 5
    track: TrackSettings = DEFAULT_TRACK


DEFAULT_DRIVE = DriveSettings()
