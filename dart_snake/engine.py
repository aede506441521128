"""The snake in the engine: built once, then played in steps.

Contacts obey exact Coulomb friction (nonsmooth Gauss-Seidel sweeps on the cone). Every wheel is a sphere that
rolls on an axle with dry friction; every carrier has its own vertical slide, so that each wheel carries its
own link and nothing else. Hinges of a stiff body follow prescribed velocities, those of a soft one are
springs and dampers. The wall's height is where no wheel is: wheels touch the floor alone, the body touches
walls alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dart_snake.body import SPIN_SHARE, WHEEL_RADIUS_M, Body, Link, hinges_of
from dart_snake.walls import WallBox

Array = NDArray[np.float64]
# (time, x, y, v_x, v_y) of the tail link -> (f_x, f_y), N, and a torque about the vertical, N m
Pull = Callable[[float, float, float, float, float], tuple[float, float, float]]

STEP_S = 1e-3
MOST_SWEEPS, TOLERANCE = 20_000, 1e-7  # with 1e-5 the published gait is 2e-5 slower, in half the time
TINY_KG, TINY_KG_M2 = 1e-7, 1e-12  # of the pieces between hinges: the engine wants some mass in every body
WHEEL_SHARE = 1e-3  # of the link's mass that is its wheel's
AXLE_SHARE = 0.3  # of the link's mass that slides with a loose wheel; 0.05 takes 14 times the sweeps
WALL_HEIGHT_M, WALL_Z_M = 0.2, 1.0
WALL_FRICTION = 0.5


@dataclass(frozen=True)
class Motion:
    """What the engine did.

    Attributes
    ----------
    time_s : (T,) array
        Since the snake was built.
    x_m, y_m, theta_rad : (T, N) arrays
        Of the links, tail to head; headings unwrapped.
    bend_rad : (T, N-1) array
        By how much each segment has bent, soft gaps included.
    line_m : (T, corners, 2) array
        The chain's corners: links and the hinges between them.
    touched : (T,) array of bool
        Whether the body touched a wall since the row before.
    """

    time_s: Array
    x_m: Array
    y_m: Array
    theta_rad: Array
    bend_rad: Array
    line_m: Array
    touched: NDArray[np.bool_]


class Snake:
    """A snake in a world of its own.

    Parameters
    ----------
    body : Body
    start : (x, y, heading)
        Middle of the straight body, and where it points.
    step_s : float
    pairs : int
        Of hinges per chamber (see `hinges_of`).
    walls : sequence of WallBox
    slope : (angle, direction)
        Of the floor, rad; downhill is towards `direction`.
    pull : callable, optional
        Force and torque on the tail link.
    """

    def __init__(
        self,
        body: Body,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        step_s: float = STEP_S,
        pairs: int = 1,
        walls: Sequence[WallBox] = (),
        slope: tuple[float, float] = (0.0, 0.0),
        pull: Pull | None = None,
    ) -> None:
        import dartpy

        self._dart, self.body, self.time_s = dartpy, body, 0.0
        self._hinges, self._to_links = hinges_of(body, pairs)
        self._pull = pull
        self._world, self.solver = self._make_world(step_s, slope)
        self._world.addSkeleton(self._make_room(walls))
        self._carriers: list[Any] = []
        self._damped: list[tuple[Any, float]] = []
        self._joints: list[Any] = []
        self._snake = self._make_snake(bool(walls))
        self._world.addSkeleton(self._snake)
        x, y, heading = start
        root = self._snake.getRootJoint()
        back = body.half_length_m
        root.setPositions(np.array([x - back * math.cos(heading), y - back * math.sin(heading), heading]))
        self._dofs = [joint.getIndexInSkeleton(0) for joint in self._joints]
        self._driven = [k for k, hinge in enumerate(self._hinges) if hinge.stiffness_n_m is None]
        self._watched = bool(walls)
        self._loaded = [(c, link.load_n) for c, link in zip(self._carriers, body.links) if link.load_n]

    @property
    def step_s(self) -> float:
        """Length of a step."""
        return float(self._world.getTimeStep())

    @step_s.setter
    def step_s(self, seconds: float) -> None:
        self._world.setTimeStep(seconds)

    def play(self, curvature: Array, rate: Array, every: int = 1) -> Motion:
        """Move on by one step per row.

        Parameters
        ----------
        curvature, rate : (T, N-1) arrays
            Without load, at the end of each step; 1/m and 1/(m s).
        every : int
            Rows of the motion are that many steps apart (the last step has one too).
        """
        world, snake, step_s = self._world, self._snake, self.step_s
        commands = np.zeros(snake.getNumDofs())
        driven = [self._dofs[k] for k in self._driven]
        bends = self._bends(curvature)
        velocity = np.empty((len(bends), len(driven)))
        if driven:
            now = np.array([self._joints[k].getPosition(0) for k in self._driven])
            velocity = np.diff(bends[:, self._driven], axis=0, prepend=now[None]) / step_s
        springs = self._spring_rests(bends, self._bends(rate))
        # the engine's own dampers are implicit in the wheel's spin alone, which is next to nothing
        axles = [joint.getIndexInSkeleton(0) for joint, _ in self._damped]
        damping = -np.array([per_rad_s for _, per_rad_s in self._damped])
        links = len(self.body.links)
        rows, times, touches, touched = [], [], [], False
        for n in range(len(bends)):
            commands[driven] = velocity[n]
            if self._damped:
                commands[axles] = damping * snake.getVelocities()[axles]
            snake.setCommands(commands)
            for joint, rests in springs:
                joint.setRestPosition(0, rests[n])
            for carrier, load in self._loaded:
                carrier.addExtForce([0.0, 0.0, -load], [0.0, 0.0, 0.0], False, True)
            if self._pull is not None:
                self._apply_pull()
            world.step()
            self.time_s += step_s
            if self._watched and not touched:
                touched = self._count_contacts() > links
            if (n + 1) % every == 0 or n + 1 == len(bends):
                rows.append(snake.getPositions())
                times.append(self.time_s)
                touches.append(touched)
                touched = False
        return self._motion(np.array(rows), np.array(times), np.array(touches, dtype=bool))

    def look(self) -> Motion:
        """Return the one row that is now."""
        row = self._snake.getPositions()
        return self._motion(row[None], np.array([self.time_s]), np.zeros(1, dtype=bool))

    def link_velocities(self) -> Array:
        """Return the velocities of the links (N, 2), m/s."""
        return np.array([carrier.getLinearVelocity()[:2] for carrier in self._carriers])

    def turn_rates(self) -> Array:
        """Return the turn rates of the links (N,), rad/s."""
        return np.array([carrier.getAngularVelocity()[2] for carrier in self._carriers])

    def _bends(self, curvature: Array) -> Array:
        """Return the angle of every hinge (T, hinges) without load."""
        segment = [hinge.segment for hinge in self._hinges]
        length = np.array(self.body.segment_lengths_m)[segment]
        angles_rad: Array = curvature[:, segment] * (length * [hinge.share for hinge in self._hinges])
        return angles_rad

    def _spring_rests(self, bends: Array, rates: Array) -> list[tuple[Any, list[float]]]:
        """Return the soft hinges of chambers with their springs' rest angles at every step.

        The material's damper works against the no-load bend too, hence its rate.
        """
        soft = [k for k, h in enumerate(self._hinges) if h.stiffness_n_m is not None and h.share]
        rest = bends + self.body.relaxation_s * rates
        return [(self._joints[k], rest[:, k].tolist()) for k in soft]

    def _apply_pull(self) -> None:
        tail = self._carriers[0]
        place, speed = tail.getWorldTransform().translation(), tail.getLinearVelocity()
        assert self._pull is not None  # the caller has looked
        fx, fy, torque = self._pull(self.time_s, place[0], place[1], speed[0], speed[1])
        tail.addExtForce([fx, fy, 0.0], [0.0, 0.0, 0.0], False, True)
        if torque:
            tail.addExtTorque([0.0, 0.0, torque], False)

    def _count_contacts(self) -> int:
        return int(self._world.getLastCollisionResult().getNumContacts())

    def _motion(self, rows: Array, times: Array, touched: NDArray[np.bool_]) -> Motion:
        """Return places and headings of the links, and the chain's corners, from its angles."""
        angles = rows[:, self._dofs]
        heading = rows[:, 2:3] + np.concatenate([np.zeros((len(rows), 1)), np.cumsum(angles, axis=1)], axis=1)
        ahead, piece, is_link = self._corners
        steps = np.stack([np.cos(heading[:, piece]), np.sin(heading[:, piece])], axis=2) * ahead[:, None]
        line = np.concatenate([rows[:, None, :2], rows[:, None, :2] + np.cumsum(steps, axis=1)], axis=1)
        links = np.flatnonzero([True, *is_link])
        theta = heading[:, np.concatenate([[0], piece])[links]]
        bend = np.diff(theta, axis=1)
        return Motion(times, line[:, links, 0], line[:, links, 1], theta, bend, line, touched)

    @cached_property
    def _corners(self) -> tuple[Array, NDArray[np.int64], list[bool]]:
        """Return of every corner behind the tail: step from the last one, its piece, whether a link."""
        ahead: list[float] = []
        piece: list[int] = []
        is_link: list[bool] = []
        for k, hinge in enumerate(self._hinges):
            first = k > 0 and self._hinges[k - 1].segment != hinge.segment
            ahead.append(hinge.ahead_m - (self._to_links[hinge.segment - 1] if first else 0.0))
            piece.append(k)
            is_link.append(False)
            if k + 1 == len(self._hinges) or self._hinges[k + 1].segment != hinge.segment:
                ahead.append(self._to_links[hinge.segment])
                piece.append(k + 1)
                is_link.append(True)
        return np.array(ahead), np.array(piece), is_link

    def _make_world(self, step_s: float, slope: tuple[float, float]) -> tuple[Any, Any]:
        dart, (angle, direction) = self._dart, slope
        world = dart.simulation.World()
        world.setTimeStep(step_s)
        down, along = -math.cos(angle), math.sin(angle)
        towards = [along * math.cos(direction), along * math.sin(direction), down]
        world.setGravity([self.body.gravity_m_s2 * g for g in towards])
        options = dart.constraint.NsgsFrictionSolver.Options()
        options.law = dart.constraint.NsgsFrictionSolver.Law.Coulomb
        options.maxSweeps, options.tolerance = MOST_SWEEPS, TOLERANCE
        solver = dart.constraint.NsgsFrictionSolver(options)
        constraints = world.getConstraintSolver()
        constraints.setBoxedLcpSolver(solver)
        constraints.setSecondaryBoxedLcpSolver(None)  # no other law may step in
        constraints.setCollisionDetector(dart.collision.OdeCollisionDetector())
        return world, solver

    def _make_room(self, walls: Sequence[WallBox]) -> Any:
        """Return floor and walls."""
        dart = self._dart
        room = dart.dynamics.Skeleton("room")
        _, floor = room.createWeldJointAndBodyNodePair()
        self._solid(floor.createShapeNode(dart.dynamics.PlaneShape([0.0, 0.0, 1.0], 0.0)), 1e3)
        for wall in walls:
            node = floor.createShapeNode(dart.dynamics.BoxShape([wall.length_m, wall.width_m, WALL_HEIGHT_M]))
            node.setRelativeTransform(self._placed(wall.x_m, wall.y_m, WALL_Z_M, wall.heading_rad))
            self._solid(node, 1e3)
        room.setMobile(False)
        return room

    @staticmethod
    def _solid(node: Any, friction: float) -> None:
        """Let a shape touch others; of two in contact the smaller friction counts."""
        node.createCollisionAspect()
        node.createDynamicsAspect()
        node.getDynamicsAspect().setFrictionCoeff(friction)

    def _placed(self, x: float, y: float, z: float, heading: float = 0.0) -> Any:
        transform = self._dart.math.Isometry3()
        transform.set_translation([x, y, z])
        c, s = math.cos(heading), math.sin(heading)
        transform.set_rotation(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
        return transform

    def _inertia(self, mass: float, about: tuple[float, float, float]) -> Any:
        return self._dart.dynamics.Inertia(mass, np.zeros(3), np.diag(about))

    def _make_snake(self, capsules: bool) -> Any:
        dart = self._dart
        snake = dart.dynamics.Skeleton("snake")
        joint, piece = snake.createPlanarJointAndBodyNodePair()
        joint.setXYPlane()
        piece.setInertia(self._inertia(TINY_KG, (TINY_KG_M2,) * 3))
        self._add_link(snake, piece, 0.0, self.body.links[0])
        spans = [hinge.ahead_m for hinge in self._hinges]
        for k, hinge in enumerate(self._hinges):
            if capsules:
                self._add_capsule(piece, spans[k])
            joint, piece = snake.createRevoluteJointAndBodyNodePair(piece)
            joint.setAxis([0.0, 0.0, 1.0])
            joint.setTransformFromParentBodyNode(self._placed(spans[k], 0.0, 0.0))
            piece.setInertia(self._inertia(TINY_KG, (TINY_KG_M2,) * 3))
            if hinge.stiffness_n_m is None:
                joint.setActuatorType(dart.dynamics.ActuatorType.VELOCITY)
            else:
                joint.setSpringStiffness(0, hinge.stiffness_n_m)
                joint.setDampingCoefficient(0, hinge.stiffness_n_m * self.body.relaxation_s)
            self._joints.append(joint)
            ends = k + 1 == len(self._hinges) or self._hinges[k + 1].segment != hinge.segment
            if ends:
                ahead = self._to_links[hinge.segment]
                self._add_link(snake, piece, ahead, self.body.links[hinge.segment + 1])
        if capsules:
            self._add_capsule(piece, self._to_links[-1])
        return snake

    def _add_capsule(self, piece: Any, length: float) -> None:
        node = piece.createShapeNode(self._dart.dynamics.CapsuleShape(self.body.width_m / 2, length))
        lying = self._placed(length / 2, 0.0, WALL_Z_M)
        lying.set_rotation(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]))
        node.setRelativeTransform(lying)
        self._solid(node, WALL_FRICTION)

    def _add_link(self, snake: Any, piece: Any, ahead_m: float, link: Link) -> None:
        """Hang a carrier into its vertical slide, and its wheel onto the carrier."""
        radius, share = WHEEL_RADIUS_M, WHEEL_SHARE
        loose = AXLE_SHARE if link.play_m else 0.0
        slide, carrier = snake.createPrismaticJointAndBodyNodePair(piece)
        slide.setAxis([0.0, 0.0, 1.0])
        slide.setTransformFromParentBodyNode(self._placed(ahead_m, 0.0, radius))
        upright = link.inertia_kg_m2
        carrier.setInertia(self._inertia(link.mass_kg * (1 - share - loose), (upright, upright, upright)))
        self._carriers.append(carrier)
        holder, where = carrier, self._placed(0.0, 0.0, 0.0, link.toe_rad)
        spin = SPIN_SHARE * link.mass_kg * radius**2
        if link.play_m:
            axle, holder = snake.createPrismaticJointAndBodyNodePair(carrier)
            axle.setAxis([0.0, 1.0, 0.0])
            axle.setTransformFromParentBodyNode(where)
            axle.setPositionLowerLimit(0, -link.play_m)
            axle.setPositionUpperLimit(0, link.play_m)
            axle.setLimitEnforcement(True)
            holder.setInertia(self._inertia(link.mass_kg * loose, (spin, spin, spin)))
            where = self._placed(0.0, 0.0, 0.0)
        if link.seized:
            joint, wheel = snake.createWeldJointAndBodyNodePair(holder)
        else:
            joint, wheel = snake.createRevoluteJointAndBodyNodePair(holder)
            joint.setAxis([0.0, 1.0, 0.0])
            weight = link.mass_kg * self.body.gravity_m_s2 + link.load_n
            joint.setCoulombFriction(0, link.axle_friction * weight * radius)
            if link.axle_damping_n_s_m:
                self._damped.append((joint, link.axle_damping_n_s_m * radius**2))
        joint.setTransformFromParentBodyNode(where)
        wheel.setInertia(self._inertia(link.mass_kg * share, (spin / 2, spin, spin / 2)))
        self._solid(wheel.createShapeNode(self._dart.dynamics.SphereShape(radius)), link.tyre_friction)
