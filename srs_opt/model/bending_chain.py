"""Equations of motion of the compliant model in the tail's position and the links' headings.

With Y = (r_1, theta_1 ... theta_N) a segment's chord s_k depends on two neighbouring headings only, so one
recursion from the tail gives velocities and accelerations and one from the head the joint forces:

    g(Y, Y', Y'') = B^T (f - m r'') + (bending moments) - J theta'' = 0,    B = dr/dY.

Derivatives, for implicit integration, are in `srs_opt.model.chain_derivatives`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from srs_opt.model.compliant import CompliantModel
from srs_opt.model.kinematics import Chain, segment_chord, straight_gap_chord
from srs_opt.model.mechanics import Forces

Vector = tuple[ca.SX, ca.SX]


@dataclass(frozen=True)
class Drive:
    """What the actuators and the room do at one instant: no-load curvatures (N-1,), frame (3,) in the room.

    `frame` is (x, y, heading) of the axes in which Y stands.
    """

    no_load: ca.SX
    no_load_rate: ca.SX
    frame: ca.SX


@dataclass(frozen=True)
class Segment:
    """Chord, its derivatives by the segment's turn (up to the third), and the axes along and across it."""

    chord: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    along: Vector

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
        p = model.parameters
        self.turn_per_kappa = p["segment_length_m"] + model.gap_length * model.gap_ratio
        kappa = ca.SX.sym("kappa")
        l, gap = p["segment_length_m"], model.gap_length
        if ca.SX(model.gap_ratio).is_zero():
            jet, cos, sin = straight_gap_chord(kappa, l, gap)
        else:
            length, slope, cos, sin = segment_chord(kappa, l, gap, model.gap_ratio)
            second = ca.jacobian(slope, kappa)
            jet = length, slope, second, ca.jacobian(second, kappa)
        by_turn = 1 / self.turn_per_kappa
        jet = tuple(derivative * by_turn**order for order, derivative in enumerate(jet))
        self._chord = ca.Function("chord", [kappa, p.vector], [*jet, cos, sin], {"cse": True})

    def kappa(self, y: ca.SX) -> ca.SX:
        """Return the curvatures (or, of rates of Y, their rates), (N-1, 1)."""
        return (y[3:] - y[2:-1]) * (1 / self.turn_per_kappa)

    def residual(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, drive: Drive, h: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return h g (N+2, 1) and h times the friction power, with `ddy` = h Y''.

        h = 1 gives the inverse dynamics; with the step size the result stays regular where h is zero.
        """
        model, n = self.model, self.links
        m = self.motion(y, dy, ddy, h)
        f = self.forces(m.place, m.velocity, m.cos, m.sin, drive.frame)
        net_x, net_y = h * f.x - model.mass * m.acceleration[0], h * f.y - model.mass * m.acceleration[1]
        joint = self.joint_forces(net_x, net_y)
        q = self._moment(y, dy, drive) * h
        g = [-model.inertia[i] * ddy[2 + i] for i in range(n)]
        for k, segment in enumerate(m.segments):
            length, slope = segment.chord[:2]
            along, across = segment.own(*joint[k + 1])
            stretch, turn = slope * along, length / 2 * across
            g[k] += turn - stretch - q[k]
            g[k + 1] += turn + stretch + q[k]
        return ca.vertcat(*joint[0], *g), h * f.friction_power

    def moment_rate(self, rate: ca.SX, acceleration: ca.SX) -> ca.SX:
        """Return dg/dt at fixed Y for no-load curvatures that change at `rate` and `acceleration`."""
        zero = ca.SX.zeros(self.links - 1, 1)
        return ca.vertcat(0, 0, self._to_headings(self.model.moment(zero, zero, rate, acceleration)))

    def _moment(self, y: ca.SX, dy: ca.SX, drive: Drive) -> ca.SX:
        """Return the moments conjugate to the segments' turns."""
        q = self.model.moment(self.kappa(y), self.kappa(dy), drive.no_load, drive.no_load_rate)
        return q * self._share()

    def _share(self) -> ca.SX:
        """Return l kappa over the segment's whole turn: gaps that bend along take part in the turn."""
        return self.model.parameters["segment_length_m"] / self.turn_per_kappa

    def turning_stiffness(self) -> ca.SX:
        """Return the moment conjugate to a segment's turn over that turn, N m."""
        return self.model.stiffness() * self._share() / self.turn_per_kappa

    def _to_headings(self, moment: ca.SX) -> ca.SX:
        q = moment * self._share()
        return ca.vertcat(0, q) - ca.vertcat(q, 0)

    def motion(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, h: ca.SX) -> Motion:
        """Return the chain's motion; accelerations, like `ddy`, are h times the true ones."""
        kappa, p = self.kappa(y), self.model.parameters.vector
        c, s = ca.cos(y[2]), ca.sin(y[2])
        cosines, sines, segments = [c], [s], []
        rows = [[y[0]], [y[1]], [dy[0]], [dy[1]], [ddy[0]], [ddy[1]]]
        for k in range(self.links - 1):
            *jet, c_half, s_half = self._chord(kappa[k], p)
            c, s = c * c_half - s * s_half, s * c_half + c * s_half
            segment = Segment(tuple(jet), (c, s))
            c0, c1, c2, _ = jet
            turn1, turn2 = (v[3 + k] - v[2 + k] for v in (dy, ddy))
            lean1, lean2 = (dy[3 + k] + dy[2 + k]) / 2, (ddy[3 + k] + ddy[2 + k]) / 2
            steps = (
                *segment.room(c0, ca.SX(0)),
                *segment.room(c1 * turn1, c0 * lean1),
                *segment.room(
                    h * (c2 * turn1**2 - c0 * lean1**2) + c1 * turn2, 2 * h * c1 * turn1 * lean1 + c0 * lean2
                ),
            )
            for row, step in zip(rows, steps):
                row.append(row[-1] + step)
            segments.append(segment)
            c, s = c * c_half - s * s_half, s * c_half + c * s_half
            cosines.append(c)
            sines.append(s)
        x, y_, vx, vy, ax, ay = (ca.vertcat(*row) for row in rows)
        return Motion(segments, ca.vertcat(*cosines), ca.vertcat(*sines), (x, y_), (vx, vy), (ax, ay))

    def forces(self, place: Vector, velocity: Vector, cos: ca.SX, sin: ca.SX, frame: ca.SX) -> Forces:
        """Return the forces on the links at places and velocities in a frame (x, y, heading) of the room."""
        x, y, heading = frame[0], frame[1], frame[2]
        c, s = ca.cos(heading), ca.sin(heading)
        room_x, room_y = x + c * place[0] - s * place[1], y + s * place[0] + c * place[1]
        v = Chain(*velocity, ca.SX.zeros(self.links, 1))
        return self.model.forces_on_links(v, cos, sin, room_x, room_y, heading)

    def joint_forces(self, x: ca.SX, y: ca.SX) -> list[Vector]:
        """Return the sums of the links' rows from each link on to the head: entry k from link k + 1."""
        joint = [(x[-1, :], y[-1, :])]
        for i in reversed(range(self.links - 1)):
            joint.append((joint[-1][0] + x[i, :], joint[-1][1] + y[i, :]))
        return joint[::-1]
