"""The state vector: which entries are the pose, the body's velocity, the bends and the actuators.

Every model starts with the body: pose (x, y of the centre of mass, mean heading), velocity (u_x, u_y in
the robot's frame, yaw momentum) and friction work. Where the curvature is given by the actuators their
states follow; where the bends are coordinates of their own, the bends' curvatures and rates come first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

X, Y, HEADING, FORWARD, SIDEWAYS, YAW_MOMENTUM, WORK = range(7)
PLACE, POSE, VELOCITY, BODY = slice(0, 2), slice(0, 3), slice(3, 6), slice(0, 6)
POSE_AND_SPEED = slice(0, 4)  # what tells where the robot is going: pose and forward speed
BODY_STATES = 7


@dataclass(frozen=True)
class StateLayout:
    """Where things stand in the state of one structure.

    Attributes
    ----------
    segments : int
    compliant : bool
        Whether the bends are coordinates of their own (the compliant model).
    actuator_states : int
        Curvatures, their rates and memories, of all actuators together.
    stretches : bool
        Whether chambers lengthen as they are pressed.
    """

    segments: int
    compliant: bool
    actuator_states: int
    stretches: bool = False

    @property
    def kappa(self) -> slice:
        """Curvatures of the body, (N-1,)."""
        return slice(BODY_STATES, BODY_STATES + self.segments)

    @property
    def dkappa(self) -> slice:
        """Rates of the body's curvatures, (N-1,)."""
        return slice(self.kappa.stop, self.kappa.stop + self.segments)

    @property
    def actuator(self) -> slice:
        """The actuators' states: the no-load curvatures, their rates, and memories."""
        start = self.dkappa.stop if self.compliant else BODY_STATES
        return slice(start, start + self.actuator_states)

    @property
    def shape(self) -> list[int]:
        """Entries that tell where the body's points are in its frame: the curvatures.

        Where bends are free and chambers lengthen with the curvature without load, that follows.
        """
        free = range(self.actuator.start, self.actuator.start + self.segments)
        kappa = range(self.kappa.start, self.kappa.stop)
        return [*kappa, *free] if self.compliant and self.stretches else [*kappa]

    @property
    def shape_rate(self) -> list[int]:
        """Entries of the shape's rates."""
        return [i + self.segments for i in self.shape]

    @property
    def size(self) -> int:
        """Number of states."""
        size: int = self.actuator.stop
        return size

    @property
    def dynamic(self) -> list[int]:
        """Entries that obey the equations of motion and that a gait repeats: velocity, and bends if free."""
        bends = [*range(self.kappa.start, self.dkappa.stop)] if self.compliant else []
        return [*range(VELOCITY.start, VELOCITY.stop), *bends]

    def adopt(self, state: np.ndarray, source: StateLayout) -> np.ndarray:
        """Return the state (size,) of this layout that another model of the same snake stands for.

        Place, velocity, bends and the actuators' curvatures are taken over; memories of effects start anew,
        and work is counted from here. Where this model prescribes the curvature, it is that of the actuators.
        The yaw momentum stays, which is right between the complex and the compliant model alone, with bends
        alike: `Integrator.adopt` keeps the yaw rate.
        """
        adopted, known = np.zeros(self.size), 2 * self.segments
        adopted[:WORK] = state[:WORK]
        adopted[self.kappa.start : self.dkappa.stop] = state[source.kappa.start : source.dkappa.stop]
        first, origin = self.actuator.start, source.actuator.start
        adopted[first : first + known] = state[origin : origin + known]
        return adopted

    @property
    def periodic(self) -> list[int]:
        """Entries that a steady gait repeats: all but pose and work."""
        return [*range(VELOCITY.start, VELOCITY.stop), *range(BODY_STATES, self.size)]
