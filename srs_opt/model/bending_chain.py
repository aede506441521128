"""Equations of motion of the compliant model in the tail's position and the links' headings.

With Y = (r_1, theta_1 ... theta_N) a segment's chord s_k depends on two neighbouring headings only, so one
recursion from the tail gives velocities and accelerations and one from the head the joint forces:

    g(Y, Y', Y'') = B^T (f - m r'') + (bending moments) - J theta'' = 0,    B = dr/dY.

The mass matrix and the derivatives of g (for implicit integration) follow from dr/dY and its first two time
derivatives in N^2 operations: heading j moves link j by one vector and all links ahead of it by another.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from srs_opt.model.compliant import CompliantModel
from srs_opt.model.kinematics import Chain, segment_chord
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
class Derivatives:
    """The mass matrix -dg/dY'', derivatives of g (N+2, N+2) and of the friction power (1, N+2)."""

    mass: ca.SX
    by_rate: ca.SX
    by_place: ca.SX
    power_by_rate: ca.SX
    power_by_place: ca.SX


@dataclass(frozen=True)
class _Segment:
    """Chord, its derivatives by the segment's turn (up to the third), and the axes along and across it."""

    chord: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    along: Vector

    def room(self, along: ca.SX, across: ca.SX) -> Vector:
        e_x, e_y = self.along
        return along * e_x - across * e_y, along * e_y + across * e_x

    def own(self, x: ca.SX, y: ca.SX) -> Vector:
        e_x, e_y = self.along
        return x * e_x + y * e_y, y * e_x - x * e_y


@dataclass(frozen=True)
class _Motion:
    """The chain on its way: segments, cosines and sines of the headings, rows (x, y) per link."""

    segments: list[_Segment]
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
        length, slope, cos, sin = segment_chord(
            kappa, p["segment_length_m"], model.gap_length, model.gap_ratio
        )
        by_turn = 1 / self.turn_per_kappa
        jet = [length, slope * by_turn]
        for _ in range(2):
            jet.append(ca.jacobian(jet[-1], kappa) * by_turn)
        self._chord = ca.Function("chord", [kappa, p.vector], [*jet, cos, sin], {"cse": True})

    def kappa(self, y: ca.SX) -> ca.SX:
        """Return the curvatures (or, of rates of Y, their rates), (N-1, 1)."""
        return (y[3:] - y[2:-1]) * (1 / self.turn_per_kappa)

    def residual(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, drive: Drive, h: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return h g (N+2, 1) and h times the friction power, with `ddy` = h Y''.

        h = 1 gives the inverse dynamics; with the step size the result stays regular where h is zero.
        """
        model, n = self.model, self.links
        m = self._motion(y, dy, ddy, h)
        f = self._forces(m.place, m.velocity, m.cos, m.sin, drive.frame)
        net_x, net_y = h * f.x - model.mass * m.acceleration[0], h * f.y - model.mass * m.acceleration[1]
        joint = self._joint_forces(net_x, net_y)
        q = self._moment(y, dy, drive) * h
        g = [-model.inertia[i] * ddy[2 + i] for i in range(n)]
        for k, segment in enumerate(m.segments):
            length, slope = segment.chord[:2]
            along, across = segment.own(*joint[k + 1])
            stretch, turn = slope * along, length / 2 * across
            g[k] += turn - stretch - q[k]
            g[k + 1] += turn + stretch + q[k]
        return ca.vertcat(*joint[0], *g), h * f.friction_power

    def derivatives(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, drive: Drive) -> Derivatives:
        """Return the mass matrix and the derivatives of g at (Y, Y', Y'')."""
        model, n = self.model, self.links
        m = self._motion(y, dy, ddy, ca.SX(1))
        slopes = self._force_slopes(m, y[2:], drive)
        f_v, f_r, f_theta, power_v, power_r, power_theta, f_x, f_y = slopes
        levers = [_lever(s, *_rates(dy, ddy, k)) for k, s in enumerate(m.segments)]
        b, b1, b2 = (self._by_headings([lever[order] for lever in levers]) for order in range(3))
        b += self._by_tail()
        mass = ca.vertcat(model.mass, model.mass)
        heading = ca.horzcat(ca.SX(n, 2), ca.SX.eye(n))
        joint = self._joint_forces(f_x - model.mass * m.acceleration[0], f_y - model.mass * m.acceleration[1])
        pull = [lever[0] for lever in levers]
        by_rate = self._rows(pull, f_v @ b - 2 * _scaled(b1, mass))
        by_place = self._rows(pull, f_v @ b1 + f_r @ b + f_theta @ heading - _scaled(b2, mass))
        by_place += self._turning_levers(m.segments, joint)
        spring, damper = self._spring()
        return Derivatives(
            self._mass(pull, b),
            by_rate - damper,
            by_place - spring,
            power_v @ b,
            power_v @ b1 + power_r @ b + power_theta @ heading,
        )

    def mass_matrix(self, y: ca.SX) -> ca.SX:
        """Return -dg/dY'' alone, (N+2, N+2)."""
        still, zero = ca.SX.zeros(self.size, 1), ca.SX(0)
        segments = self._motion(y, still, still, zero).segments
        pull = [_lever(segment, zero, zero, zero, zero)[0] for segment in segments]
        return self._mass(pull, self._by_headings(pull) + self._by_tail())

    def _mass(self, pull: list[tuple[Vector, Vector]], b: ca.SX) -> ca.SX:
        mass = ca.vertcat(self.model.mass, self.model.mass)
        return self._rows(pull, _scaled(b, mass)) + ca.diag(ca.vertcat(0, 0, self.model.inertia))

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

    def _to_headings(self, moment: ca.SX) -> ca.SX:
        q = moment * self._share()
        return ca.vertcat(0, q) - ca.vertcat(q, 0)

    def _spring(self) -> tuple[ca.SX, ca.SX]:
        """Return stiffness and damping matrices of the segments, (N+2, N+2)."""
        n = self.links
        difference = ca.horzcat(ca.SX(n - 1, 2), _bidiagonal(n))
        ei = self.model.stiffness() * self._share() / self.turn_per_kappa
        spring = ei * (difference.T @ difference)
        return spring, self.model.parameters["bending_relaxation_s"] * spring

    def _motion(self, y: ca.SX, dy: ca.SX, ddy: ca.SX, h: ca.SX) -> _Motion:
        """Return the chain's motion; accelerations, like `ddy`, are h times the true ones."""
        kappa, p = self.kappa(y), self.model.parameters.vector
        c, s = ca.cos(y[2]), ca.sin(y[2])
        cosines, sines, segments = [c], [s], []
        rows = [[y[0]], [y[1]], [dy[0]], [dy[1]], [ddy[0]], [ddy[1]]]
        for k in range(self.links - 1):
            *jet, c_half, s_half = self._chord(kappa[k], p)
            c, s = c * c_half - s * s_half, s * c_half + c * s_half
            segment = _Segment(tuple(jet), (c, s))
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
        return _Motion(segments, ca.vertcat(*cosines), ca.vertcat(*sines), (x, y_), (vx, vy), (ax, ay))

    def _forces(self, place: Vector, velocity: Vector, cos: ca.SX, sin: ca.SX, frame: ca.SX) -> Forces:
        x, y, heading = frame[0], frame[1], frame[2]
        c, s = ca.cos(heading), ca.sin(heading)
        room_x, room_y = x + c * place[0] - s * place[1], y + s * place[0] + c * place[1]
        v = Chain(*velocity, ca.SX.zeros(self.links, 1))
        return self.model.forces_on_links(v, cos, sin, room_x, room_y, heading)

    def _force_slopes(self, m: _Motion, theta: ca.SX, drive: Drive) -> list[ca.SX]:
        """Return derivatives of the forces (x of all links, then y) and of the friction power, and forces."""
        n = self.links
        r, v, th = ca.SX.sym("r", 2 * n), ca.SX.sym("v", 2 * n), ca.SX.sym("theta", n)
        frame, p = ca.SX.sym("frame", 3), self.model.parameters.vector
        f = self._forces((r[:n], r[n:]), (v[:n], v[n:]), ca.cos(th), ca.sin(th), frame)
        force = ca.vertcat(f.x, f.y)
        outputs = [ca.jacobian(force, of) for of in (v, r, th)]
        outputs += [ca.jacobian(f.friction_power, of) for of in (v, r, th)]
        slopes = ca.Function("slopes", [r, v, th, frame, p], [*outputs, f.x, f.y], {"cse": True})
        found = slopes(ca.vertcat(*m.place), ca.vertcat(*m.velocity), theta, drive.frame, p)
        return list(found)

    def _joint_forces(self, x: ca.SX, y: ca.SX) -> list[Vector]:
        """Return the sums of the links' rows from each link on to the head: entry k from link k + 1."""
        joint = [(x[-1, :], y[-1, :])]
        for i in reversed(range(self.links - 1)):
            joint.append((joint[-1][0] + x[i, :], joint[-1][1] + y[i, :]))
        return joint[::-1]

    def _by_headings(self, levers: list[tuple[Vector, Vector]]) -> ca.SX:
        """Return d(place)/dY from the segments' d(chord)/d(heading behind, ahead): x rows, then y rows."""
        whole = []
        for axis in (0, 1):
            row = ca.SX(1, self.size)
            rows = [row]
            for k, (behind, ahead) in enumerate(levers):
                step = ca.SX(1, self.size)
                step[2 + k], step[3 + k] = behind[axis], ahead[axis]
                row = row + step
                rows.append(row)
            whole.append(ca.vertcat(*rows))
        return ca.vertcat(*whole)

    def _by_tail(self) -> ca.SX:
        """Return d(place)/dY of the tail's own place: it moves all links alike."""
        one, zero = ca.SX.ones(self.links, 1), ca.SX(self.links, 1)
        columns = ca.vertcat(ca.horzcat(one, zero), ca.horzcat(zero, one))
        return ca.horzcat(columns, ca.SX(2 * self.links, self.links))

    def _rows(self, levers: list[tuple[Vector, Vector]], net: ca.SX) -> ca.SX:
        """Return B^T applied to columns of link forces `net` (x rows, then y rows)."""
        n = self.links
        joint = self._joint_forces(net[:n, :], net[n:, :])
        rows = [ca.SX(1, net.shape[1]) for _ in range(n)]
        for k, (behind, ahead) in enumerate(levers):
            x, y = joint[k + 1]
            rows[k] += behind[0] * x + behind[1] * y
            rows[k + 1] += ahead[0] * x + ahead[1] * y
        return ca.vertcat(*joint[0], *rows)

    def _turning_levers(self, segments: list[_Segment], joint: list[Vector]) -> ca.SX:
        """Return the part of dg/dY in which given joint forces act on turning levers d(chord)/d(heading)."""
        matrix = ca.SX(self.size, self.size)
        half = ca.SX(0.5)
        for k, segment in enumerate(segments):
            x, y = joint[k + 1]
            for column, turn in ((2 + k, -1), (3 + k, 1)):
                _, (behind, ahead), _ = _lever(segment, ca.SX(turn), half, ca.SX(0), ca.SX(0))
                for row, (lever_x, lever_y) in ((2 + k, behind), (3 + k, ahead)):
                    matrix[row, column] += lever_x * x + lever_y * y
        return matrix


def _rates(dy: ca.SX, ddy: ca.SX, k: int) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return rates and accelerations of segment k's turn and of its chord's direction."""
    return (
        dy[3 + k] - dy[2 + k],
        (dy[3 + k] + dy[2 + k]) / 2,
        ddy[3 + k] - ddy[2 + k],
        (ddy[3 + k] + ddy[2 + k]) / 2,
    )


def _lever(
    segment: _Segment, turn1: ca.SX, lean1: ca.SX, turn2: ca.SX, lean2: ca.SX
) -> list[tuple[Vector, Vector]]:
    """Return d(chord)/d(heading behind, heading ahead) and its first and second time derivatives."""
    c0, c1, c2, c3 = segment.chord
    b_n, b_n1, b_n2 = c0 / 2, c1 * turn1 / 2, (c2 * turn1**2 + c1 * turn2) / 2
    found: list[list[Vector]] = [[], [], []]
    for sign in (-1, 1):
        b_e, b_e1, b_e2 = sign * c1, sign * c2 * turn1, sign * (c3 * turn1**2 + c2 * turn2)
        # components in axes that turn with lean1
        d_e, d_n = b_e1 - b_n * lean1, b_n1 + b_e * lean1
        dd_e = b_e2 - b_n1 * lean1 - b_n * lean2 - d_n * lean1
        dd_n = b_n2 + b_e1 * lean1 + b_e * lean2 + d_e * lean1
        for order, pair in enumerate(((b_e, b_n), (d_e, d_n), (dd_e, dd_n))):
            found[order].append(segment.room(*pair))
    return [(behind, ahead) for behind, ahead in found]


def _scaled(matrix: ca.SX, factors: ca.SX) -> ca.SX:
    """Return the matrix with every row times its factor."""
    return ca.diag(factors) @ matrix


def _bidiagonal(n: int) -> ca.SX:
    """Return the matrix (n-1, n) of differences between neighbours."""
    matrix = ca.SX(n - 1, n)
    for k in range(n - 1):
        matrix[k, k], matrix[k, k + 1] = -1, 1
    return matrix
