"""Equations of motion of the compliant model in the tail's position and the links' headings.

With Y = (r_1, theta_1 ... theta_N) a segment's chord s_k depends on two neighbouring headings only, so one
recursion from the tail gives velocities and accelerations and one from the head the joint forces:

    g(Y, Y', Y'') = B^T (f - m r'') + (bending moments) - J theta'' = 0,    B = dr/dY.

Chambers that lengthen do so in time: `srs_opt.model.chambers`.

Derivatives, for implicit integration, are in `srs_opt.model.chain_derivatives`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from srs_opt.geometry import turn_by
from srs_opt.model.chambers import NO_GROWTH, Chambers, Drive, Growth, chord_function
from srs_opt.model.compliant import CompliantModel
from srs_opt.model.kinematics import Chain
from srs_opt.model.mechanics import Forces

Vector = tuple[ca.SX, ca.SX]


@dataclass(frozen=True)
class Segment:
    """Chord, its derivatives by the segment's turn (up to the third), and the axes along and across it."""

    chord: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    along: Vector
    growth: Growth = NO_GROWTH

    def room(self, along: ca.SX, across: ca.SX) -> Vector:
        """Return a vector given along and across the chord."""
        e_x, e_y = self.along
        return along * e_x - across * e_y, along * e_y + across * e_x

    def own(self, x: ca.SX, y: ca.SX) -> Vector:
        """Return a vector's components along and across the chord."""
        e_x, e_y = self.along
        return x * e_x + y * e_y, y * e_x - x * e_y


@dataclass(frozen=True)
class Motion:
    """The chain on its way: segments, cosines and sines of the headings, rows (x, y) per link."""

    segments: list[Segment]
    cos: ca.SX
    sin: ca.SX
    place: Vector
    velocity: Vector
    acceleration: Vector


class BendingChain:
    """Builds expressions of one compliant model; N + 2 coordinates Y (see the module)."""

    def __init__(self, model: CompliantModel) -> None:
        self.model = model
        self.links = model.links
        self.size = model.links + 2
        self._chord = chord_function(model)

    def chambers(self, drive: Drive) -> Chambers:
        """Return the chambers' lengths at one instant."""
        return Chambers.of(self.model, drive)

    def residual(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, drive: Drive, h: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return h g (N+2, 1) and h times the friction power, with `ddy` = h Y''.

        h = 1 gives the inverse dynamics; with the step size the result stays regular where h is zero.
        """
        model, n = self.model, self.links
        m = self.motion(y, dy, ddy, h, drive)
        f = self.forces(
            m.place, m.velocity, m.cos, m.sin, drive.where_and_when, self.chambers(drive).kappa(y)
        )
        net_x, net_y = h * f.x - model.mass * m.acceleration[0], h * f.y - model.mass * m.acceleration[1]
        # what a joint carries is all that acts on the links in front of it, inertia included
        joint = self.joint_forces(net_x, net_y)
        q = self._moment(y, dy, drive) * h
        g = [-model.inertia[i] * ddy[2 + i] for i in range(n)]
        for k, segment in enumerate(m.segments):
            length, length_by_turn = segment.chord[:2]
            along, across = segment.own(*joint[k + 1])
            # d(chord)/d(theta behind, ahead) = (-c', c') along it and (c/2, c/2) across it
            stretch, turn = length_by_turn * along, length / 2 * across
            g[k] += turn - stretch - q[k]
            g[k + 1] += turn + stretch + q[k]
        return ca.vertcat(*joint[0], *g), h * f.friction_power

    def rate_in_time(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, drive: Drive, jerk: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the derivatives of g and the friction power by time at fixed Y, Y', Y''."""
        rate, acceleration = drive.no_load_rate, drive.no_load_acceleration
        if not (self.model.stretches or self.model.ages):
            zero = ca.SX.zeros(self.links - 1, 1)
            q = self.model.moment(zero, zero, rate, acceleration) * self._share(self.chambers(drive))
            return ca.vertcat(0, 0, ca.vertcat(0, q) - ca.vertcat(q, 0)), ca.SX(0)
        state = [ca.SX.sym(name, self.size) for name in ("y", "dy", "ddy")]
        free = [ca.SX.sym(name, self.links - 1) for name in ("free", "rate", "acceleration", "jerk")]
        frame, time, p = ca.SX.sym("frame", 3), ca.SX.sym("time"), self.model.parameters.vector
        y0, dy0, ddy0 = state
        at = Drive(free[0], free[1], frame, free[2], time)
        both = ca.vertcat(*self.residual(y0, dy0, ddy0, at, ca.SX(1)))
        in_time = ca.jtimes(both, ca.vertcat(*free[:3], time), ca.vertcat(*free[1:], 1))
        function = ca.Function("rate_in_time", [*state, *free, frame, time, p], [in_time], {"cse": True})
        found = function(y, dy, ddy, drive.no_load, rate, acceleration, jerk, drive.frame, drive.time_s, p)
        return found[:-1], found[-1]

    def _moment(self, y: ca.SX, dy: ca.SX, drive: Drive) -> ca.SX:
        """Return the moments conjugate to the segments' turns."""
        chambers = self.chambers(drive)
        bend = chambers.kappa(y), chambers.dkappa(y, dy)
        return self.model.moment(*bend, drive.no_load, drive.no_load_rate) * self._share(chambers)

    def _share(self, chambers: Chambers) -> ca.SX:
        """Return l kappa over the segments' whole turn: gaps that bend along take part in the turn."""
        # Q is conjugate to l kappa; by the chain rule the turn's moment is Q d(l kappa)/d(turn)
        return self.model.parameters["segment_length_m"] / chambers.turn_per_kappa

    def turning_stiffness(self, drive: Drive) -> tuple[ca.SX, ca.SX]:
        """Return what a segment's turn and its rate take off the moment conjugate to it, N m and N m s."""
        chambers, relaxation = self.chambers(drive), self.model.relaxation()
        stiffness = self.model.stiffness() * self._share(chambers) / chambers.turn_per_kappa
        # a turn on a chamber that lengthens loses curvature by itself
        return stiffness * (
            1 - relaxation * chambers.growth / chambers.turn_per_kappa
        ), stiffness * relaxation

    def motion(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, h: ca.SX, drive: Drive) -> Motion:
        """Return the chain's motion; accelerations, like `ddy`, are h times the true ones."""
        chambers, p = self.chambers(drive), self.model.parameters.vector
        kappa = chambers.kappa(y)
        c, s = ca.cos(y[2]), ca.sin(y[2])
        cosines, sines, segments = [c], [s], []
        rows = [[y[0]], [y[1]], [dy[0]], [dy[1]], [ddy[0]], [ddy[1]]]
        for k in range(self.links - 1):
            c0, c1, c2, c3, *mixed, c_half, s_half = self._chord(kappa[k], chambers.length[k], p)
            c, s = turn_by(c_half, s_half, c, s)
            turn1, turn2 = (v[3 + k] - v[2 + k] for v in (dy, ddy))
            growth = chambers.of_chord(k, mixed, turn1) if mixed else NO_GROWTH
            segment = Segment((c0, c1, c2, c3), (c, s), growth)
            # a chord turns with the mean of its headings: steps of place, velocity, and h times acceleration
            lean1, lean2 = (dy[3 + k] + dy[2 + k]) / 2, (ddy[3 + k] + ddy[2 + k]) / 2
            steps = (
                *segment.room(c0, ca.SX(0)),
                *segment.room(c1 * turn1 + growth.rate, c0 * lean1),
                *segment.room(
                    h * (c2 * turn1**2 - c0 * lean1**2 + growth.acceleration) + c1 * turn2,
                    2 * h * (c1 * turn1 + growth.rate) * lean1 + c0 * lean2,
                ),
            )
            for row, step in zip(rows, steps):
                row.append(row[-1] + step)
            segments.append(segment)
            c, s = turn_by(c_half, s_half, c, s)
            cosines.append(c)
            sines.append(s)
        x, y_, vx, vy, ax, ay = (ca.vertcat(*row) for row in rows)
        return Motion(segments, ca.vertcat(*cosines), ca.vertcat(*sines), (x, y_), (vx, vy), (ax, ay))

    def forces(
        self, place: Vector, velocity: Vector, cos: ca.SX, sin: ca.SX, frame: ca.SX, kappa: ca.SX
    ) -> Forces:
        """Return the forces on the links at places and velocities in a frame (x, y, heading, time)."""
        x, y, heading = frame[0], frame[1], frame[2]
        c, s = ca.cos(heading), ca.sin(heading)
        dx, dy = turn_by(c, s, *place)
        room_x, room_y = x + dx, y + dy
        v = Chain(*velocity, ca.SX.zeros(self.links, 1))
        return self.model.forces_on_links(v, cos, sin, room_x, room_y, (heading, frame[3]), kappa)

    def joint_forces(self, x: ca.SX, y: ca.SX) -> list[Vector]:
        """Return the sums of the links' rows from each link on to the head: entry k from link k + 1."""
        # from the head, where nothing is in front
        joint = [(x[-1, :], y[-1, :])]
        for i in reversed(range(self.links - 1)):
            joint.append((joint[-1][0] + x[i, :], joint[-1][1] + y[i, :]))
        return joint[::-1]
