"""Mass matrix and derivatives of the compliant model's equations of motion, in time linear in the links.

Heading j moves link j by one vector (`ahead`: the end of the segment behind it) and all links in front of it
by another (`total`: the beginning of the segment in front as well). What a moving link then feels, K_m times
its motion (K the mass, or a derivative of its forces), reaches the rows through the joint forces, which are
sums over the links from a joint to the head. Hence the form of `ChainMatrix`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca

from srs_opt.errors import UnsupportedEffectError
from srs_opt.model.bending_chain import BendingChain, Motion, Segment
from srs_opt.model.chain_matrix import ChainMatrix, Rows
from srs_opt.model.chambers import NO_GROWTH, Drive

Pair = tuple[ca.SX, ca.SX]  # d(chord)/d(heading behind it, heading ahead of it), (2, 1) each
MASS, VELOCITY, PLACE = range(3)  # what a link's load may be proportional to


@dataclass(frozen=True)
class Derivatives:
    """The mass matrix -dg/dY'', derivatives of g, and those of the friction power (1, N+2)."""

    mass: ChainMatrix
    by_rate: ChainMatrix
    by_place: ChainMatrix
    power_by_rate: ca.SX
    power_by_place: ca.SX


@dataclass(frozen=True)
class _Move:
    """What one coordinate moves, from link `link` on: that link by `ahead`, those in front by `total`."""

    link: int
    ahead: ca.SX
    behind: ca.SX

    @property
    def total(self) -> ca.SX:
        return self.ahead + self.behind


@dataclass(frozen=True)
class _Loads:
    """Loads per motion of each link (2, 2) and their sums from each link to the head, one more than links."""

    own: list[ca.SX]
    sums: list[ca.SX]

    @staticmethod
    def of(own: list[ca.SX]) -> _Loads:
        sums = [ca.SX(*own[0].shape)]
        for load in reversed(own):
            sums.append(sums[-1] + load)
        return _Loads(own, sums[::-1])

    def beyond(self, move: _Move) -> ca.SX:
        return self.sums[move.link + 1] @ move.total

    def all(self, move: _Move) -> ca.SX:
        return self.beyond(move) + self.own[move.link] @ move.ahead


def mass_matrix(chain: BendingChain, y: ca.SX, drive: Drive) -> ChainMatrix:
    """Return -dg/dY'' at Y."""
    still = ca.SX.zeros(chain.size, 1)
    moves = _moves(chain, chain.motion(y, still, still, ca.SX(0), drive).segments, still, still)[0]
    nothing = [ca.SX(2, 2)] * chain.links
    assembly = _Assembly(moves, [_mass(chain), _Loads.of(nothing), _Loads.of(nothing)])
    return assembly.matrix({MASS: (moves, 1.0)}, _inertia(chain))


def derivatives(chain: BendingChain, y: ca.SX, dy: ca.SX, ddy: ca.SX, drive: Drive) -> Derivatives:
    """Return the mass matrix and the derivatives of g at (Y, Y', Y'').

    Raises
    ------
    UnsupportedEffectError
        If an effect makes the force on one link depend on another link's motion.
    """
    motion = chain.motion(y, dy, ddy, ca.SX(1), drive)
    force = _force_derivatives(chain, motion, y, drive)
    moves, moves1, moves2 = _moves(chain, motion.segments, dy, ddy)
    loads = [_mass(chain), _Loads.of(force.by_velocity), _Loads.of(force.by_place)]
    assembly = _Assembly(moves, loads)
    mass = chain.model.mass
    net = [force.value[0] - mass * motion.acceleration[0], force.value[1] - mass * motion.acceleration[1]]
    spring, damper = (_springs(chain, stiffness) for stiffness in chain.turning_stiffness(drive))
    turning = _turning_levers(motion.segments, chain.joint_forces(*net))
    power_v = _Loads.of(force.power_by_velocity)
    power_r = _Loads.of(force.power_by_place)
    return Derivatives(
        # r' = B Y', so dr''/dY' = 2 B', dr''/dY = B'', dr'/dY = B'; forces enter g with plus, inertia with
        # minus
        mass=assembly.matrix({MASS: (moves, 1.0)}, _inertia(chain)),
        by_rate=assembly.matrix({MASS: (moves1, -2.0), VELOCITY: (moves, 1.0)}, damper),
        by_place=assembly.matrix(
            {MASS: (moves2, -1.0), VELOCITY: (moves1, 1.0), PLACE: (moves, 1.0)},
            spring.plus(turning),
            force.by_heading,
        ),
        power_by_rate=ca.horzcat(*[power_v.all(move) for move in moves]),
        power_by_place=ca.horzcat(*[power_v.all(m1) + power_r.all(m) for m1, m in zip(moves1, moves)])
        + ca.horzcat(0, 0, force.power_by_heading),
    )


@dataclass(frozen=True)
class _Local:
    """Terms of neighbours only: the diagonal (N+2) and those beside it (N+1)."""

    diagonal: list[ca.SX]
    below: list[ca.SX]
    above: list[ca.SX]

    def plus(self, other: _Local) -> _Local:
        pairs = (
            (self.diagonal, other.diagonal),
            (self.below, other.below),
            (self.above, other.above),
        )
        return _Local(*([a + b for a, b in zip(*pair)] for pair in pairs))


@dataclass(frozen=True)
class _Assembly:
    """Makes matrices that share their rows: those of the coordinates' moves under three kinds of load."""

    moves: list[_Move]
    loads: list[_Loads]

    def matrix(
        self,
        terms: dict[int, tuple[list[_Move], float]],
        local: _Local,
        by_heading: list[ca.SX] | None = None,
    ) -> ChainMatrix:
        """Return sum over kinds of factor B^T K (moves), local terms and loads that headings alone make."""
        rows = Rows(
            [
                ca.horzcat(
                    *[
                        move.ahead.T @ load.sums[move.link] + move.behind.T @ load.sums[move.link + 1]
                        for load in self.loads
                    ]
                )
                for move in self.moves
            ],
            [move.total.T for move in self.moves],
        )
        lower, upper, diagonal = [], [], []
        for j, move in enumerate(self.moves):
            columns, beyond, load = [], ca.SX(2, 1), ca.SX(2, 1)
            for kind, loads in enumerate(self.loads):
                moved, factor = terms.get(kind, (None, 0.0))
                if moved is None:
                    columns.append(ca.SX(2, 1))
                    continue
                columns.append(factor * moved[j].total)
                beyond += factor * loads.beyond(moved[j])
                load += factor * loads.all(moved[j])
            if by_heading is not None and j >= 2:
                load += by_heading[j - 2]
            lower.append(ca.vertcat(*columns))
            upper.append(load)
            diagonal.append(move.ahead.T @ load + move.behind.T @ beyond + local.diagonal[j])
        return ChainMatrix(rows, lower, upper, diagonal, local.below, local.above)


def _moves(chain: BendingChain, segments: Sequence[Segment], dy: ca.SX, ddy: ca.SX) -> list[list[_Move]]:
    """Return the coordinates' moves and their first and second time derivatives."""
    levers = []
    for k, segment in enumerate(segments):
        turn1, turn2 = (v[3 + k] - v[2 + k] for v in (dy, ddy))
        lean1, lean2 = ((v[3 + k] + v[2 + k]) / 2 for v in (dy, ddy))
        levers.append(lever(segment, turn1, lean1, turn2, lean2))
    nothing, found = ca.SX(2, 1), []
    for order in range(3):
        along = [ca.SX(ca.DM.eye(2))[:, i] if order == 0 else nothing for i in range(2)]
        moves = [_Move(0, vector, nothing) for vector in along]
        for i in range(chain.links):
            ahead = levers[i - 1][order][1] if i else nothing
            behind = levers[i][order][0] if i < chain.links - 1 else nothing
            moves.append(_Move(i, ahead, behind))
        found.append(moves)
    return found


def lever(segment: Segment, turn1: ca.SX, lean1: ca.SX, turn2: ca.SX, lean2: ca.SX) -> list[Pair]:
    """Return d(chord)/d(heading behind, heading ahead) and its first and second time derivatives."""
    c0, c1, c2, c3 = segment.chord
    grown = segment.growth
    b_n, b_n1 = c0 / 2, (c1 * turn1 + grown.rate) / 2
    b_n2 = (c2 * turn1**2 + c1 * turn2 + grown.acceleration) / 2
    found: list[list[ca.SX]] = [[], [], []]
    for sign in (-1, 1):
        b_e, b_e1 = sign * c1, sign * (c2 * turn1 + grown.derivative_rate)
        b_e2 = sign * (c3 * turn1**2 + c2 * turn2 + grown.derivative_acceleration)
        # components in axes that turn with lean1
        # (a e + b n)' = (a' - b lean') e + (b' + a lean') n, applied twice
        d_e, d_n = b_e1 - b_n * lean1, b_n1 + b_e * lean1
        dd_e = b_e2 - b_n1 * lean1 - b_n * lean2 - d_n * lean1
        dd_n = b_n2 + b_e1 * lean1 + b_e * lean2 + d_e * lean1
        for order, pair in enumerate(((b_e, b_n), (d_e, d_n), (dd_e, dd_n))):
            found[order].append(ca.vertcat(*segment.room(*pair)))
    return [(behind, ahead) for behind, ahead in found]


def _mass(chain: BendingChain) -> _Loads:
    unit = ca.SX(ca.DM.eye(2))
    return _Loads.of([chain.model.mass[i] * unit for i in range(chain.links)])


def _inertia(chain: BendingChain) -> _Local:
    none = [ca.SX(0)] * (chain.size - 1)
    return _Local([ca.SX(0), ca.SX(0), *ca.vertsplit(chain.model.inertia)], none, none)


def _springs(chain: BendingChain, stiffness: ca.SX) -> _Local:
    """Return the derivatives of moments on the headings of springs (N-1, 1) between neighbours."""
    none = ca.SX(1, 1)
    beside = [none, *ca.vertsplit(stiffness), none]
    diagonal = [none, none, *(-behind - ahead for behind, ahead in pairwise(beside))]
    return _Local(diagonal, [none, *beside[:-1]], [none, *beside[:-1]])


def _turning_levers(segments: Sequence[Segment], joint: Sequence[Pair]) -> _Local:
    """Return the part of dg/dY in which given joint forces act on turning levers d(chord)/d(heading)."""
    n, half, zero = len(segments) + 1, ca.SX(0.5), ca.SX(0)
    diagonal = [zero] * (n + 2)
    below, above = [zero] * (n + 1), [zero] * (n + 1)
    for k, segment in enumerate(replace(s, growth=NO_GROWTH) for s in segments):
        # a lever's derivative by a heading is its rate when that heading alone turns at 1 rad/s
        force = ca.vertcat(*joint[k + 1]).T
        by_behind, by_ahead = (lever(segment, ca.SX(turn), half, zero, zero)[1] for turn in (-1, 1))
        diagonal[2 + k] += force @ by_behind[0]
        below[2 + k] = force @ by_behind[1]
        above[2 + k] = force @ by_ahead[0]
        diagonal[3 + k] += force @ by_ahead[1]
    return _Local(diagonal, below, above)


@dataclass(frozen=True)
class _ForceDerivatives:
    """Derivatives of each link's force (2, 2) or (2, 1) and of the friction power by its motion; forces."""

    by_velocity: list[ca.SX]
    by_place: list[ca.SX]
    by_heading: list[ca.SX]
    power_by_velocity: list[ca.SX]
    power_by_place: list[ca.SX]
    power_by_heading: ca.SX
    value: Pair


def _force_derivatives(chain: BendingChain, m: Motion, y: ca.SX, drive: Drive) -> _ForceDerivatives:
    n, theta = chain.links, y[2:]
    r, v, th = ca.SX.sym("r", 2 * n), ca.SX.sym("v", 2 * n), ca.SX.sym("theta", n)
    frame, p = ca.SX.sym("frame", 4), chain.model.parameters.vector
    # how friction depends on the curvature is left out: it is small beside the bending stiffness, and only
    # the steps' matrix asks for these derivatives, not the motion
    kappa = ca.SX.sym("kappa", n - 1)
    f = chain.forces((r[:n], r[n:]), (v[:n], v[n:]), ca.cos(th), ca.sin(th), frame, kappa)
    jacobians = [ca.jacobian(ca.vertcat(f.x, f.y), of) for of in (v, r, th)]
    jacobians += [ca.jacobian(f.friction_power, of) for of in (v, r, th)]
    _check_local(jacobians[:3], n)
    function = ca.Function(
        "force_derivatives", [r, v, th, frame, kappa, p], [*jacobians, f.x, f.y], {"cse": True}
    )
    place, velocity = ca.vertcat(*m.place), ca.vertcat(*m.velocity)
    f_v, f_r, f_th, p_v, p_r, p_th, f_x, f_y = function(
        place, velocity, theta, drive.where_and_when, chain.chambers(drive).kappa(y), p
    )

    def block(matrix: ca.SX, i: int) -> ca.SX:
        return matrix[[i, n + i], [i, n + i]]

    return _ForceDerivatives(
        by_velocity=[block(f_v, i) for i in range(n)],
        by_place=[block(f_r, i) for i in range(n)],
        by_heading=[f_th[[i, n + i], i] for i in range(n)],
        power_by_velocity=[p_v[0, [i, n + i]] for i in range(n)],
        power_by_place=[p_r[0, [i, n + i]] for i in range(n)],
        power_by_heading=p_th,
        value=(f_x, f_y),
    )


def _check_local(jacobians: Sequence[ca.SX], n: int) -> None:
    for matrix in jacobians:
        rows, columns = matrix.sparsity().get_triplet()
        if any(row % n != column % n for row, column in zip(rows, columns)):
            raise UnsupportedEffectError(
                "an effect makes the force on one link depend on another link; the compliant model takes none"
            )
