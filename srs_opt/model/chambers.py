"""Chambers of the compliant model: how long they are at one instant, and what lengthening does to chords.

They lengthen with the curvature without load, a known function of time. So a chord changes by itself too, and
the curvature is a segment's turn over a length that changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from srs_opt.model.compliant import CompliantModel
from srs_opt.model.kinematics import segment_chord, straight_gap_chord


@dataclass(frozen=True)
class Drive:
    """What the actuators and the room do at one instant: no-load curvatures (N-1,), frame (3,) in the room.

    `frame` is (x, y, heading) of the axes in which Y stands. Only chambers that lengthen feel
    the acceleration.
    """

    no_load: ca.SX
    no_load_rate: ca.SX
    frame: ca.SX
    no_load_acceleration: ca.SX
    time_s: ca.SX = field(default_factory=lambda: ca.SX(0))

    @property
    def where_and_when(self) -> ca.SX:
        """The frame and the time since the start of the motion, (4,)."""
        return ca.vertcat(self.frame, self.time_s)


@dataclass(frozen=True)
class Growth:
    """What chambers' lengthening adds to rate and acceleration of a chord and its derivative by the turn."""

    rate: ca.SX
    acceleration: ca.SX
    derivative_rate: ca.SX
    derivative_acceleration: ca.SX


NO_GROWTH = Growth(*[ca.SX(1, 1)] * 4)


@dataclass(frozen=True)
class Chambers:
    """The chambers' lengths (N-1, 1) at one instant, their rates, and the segments' turn per kappa.

    Rates are structural zeros where nothing lengthens.
    """

    length: ca.SX
    growth: ca.SX
    growth_rate: ca.SX
    turn_per_kappa: ca.SX

    @staticmethod
    def of(model: CompliantModel, drive: Drive) -> Chambers:
        """Return them for the model's no-load curvatures at one instant."""
        free, rate = ca.SX.sym("free", model.links - 1), ca.SX.sym("rate", model.links - 1)
        acceleration = ca.SX.sym("acceleration", model.links - 1)
        length = model.chamber_lengths(free)
        growth = ca.jtimes(length, free, rate)
        # the second time derivative by the chain rule once more
        second = ca.jtimes(growth, ca.vertcat(free, rate), ca.vertcat(rate, acceleration))
        found = ca.substitute(
            ca.horzcat(length, growth, second),
            ca.vertcat(free, rate, acceleration),
            ca.vertcat(drive.no_load, drive.no_load_rate, drive.no_load_acceleration),
        )
        length, growth, second = ca.horzsplit(found)
        return Chambers(length, growth, second, length + model.gap_length * model.gap_ratio)

    def kappa(self, y: ca.SX) -> ca.SX:
        """Return the curvatures, (N-1, 1)."""
        return (y[3:] - y[2:-1]) * (1 / self.turn_per_kappa)

    def dkappa(self, y: ca.SX, dy: ca.SX) -> ca.SX:
        """Return the curvatures' rates."""
        return (dy[3:] - dy[2:-1] - self.kappa(y) * self.growth) * (1 / self.turn_per_kappa)

    def ddkappa(self, y: ca.SX, dy: ca.SX, ddy: ca.SX) -> ca.SX:
        """Return the curvatures' accelerations."""
        # turn = T kappa, so turn'' = T kappa'' + 2 T' kappa' + T'' kappa
        turn = ddy[3:] - ddy[2:-1] - 2 * self.growth * self.dkappa(y, dy) - self.growth_rate * self.kappa(y)
        return turn * (1 / self.turn_per_kappa)

    def of_chord(self, k: int, mixed: list[ca.SX], turn1: ca.SX) -> Growth:
        """Return what lengthening adds to a chord's rates; `mixed` as `chord_function` gives it."""
        c_l, c_ll, c1_l, c1_ll, c2_l = mixed
        rate, second = self.growth[k], self.growth_rate[k]
        return Growth(
            c_l * rate,
            2 * c1_l * turn1 * rate + c_ll * rate**2 + c_l * second,
            c1_l * rate,
            2 * c2_l * turn1 * rate + c1_ll * rate**2 + c1_l * second,
        )


def chord_function(model: CompliantModel) -> ca.Function:
    """Return ``(kappa, length, p) -> (chord c, its first three derivatives by the turn, ..., cos, sin)``.

    cos and sin are of half the turn. Where chambers lengthen, derivatives that involve the length l at a
    fixed turn stand between: c_l, c_ll, c'_l, c'_ll, c''_l.
    """
    kappa, length, gap, ratio = ca.SX.sym("kappa"), ca.SX.sym("length"), model.gap_length, model.gap_ratio
    straight, mixed = ca.SX(ratio).is_zero(), []
    per_kappa = length + gap * ratio
    if straight and not model.stretches:
        jet, cos, sin = straight_gap_chord(kappa, length, gap)
        # d/d(turn) = (1 / per_kappa) d/d(kappa), once per order
        jet = tuple(derivative * (1 / per_kappa) ** order for order, derivative in enumerate(jet))
    else:
        turn = ca.SX.sym("turn")
        chord, _, cos, sin = segment_chord(turn / per_kappa, length, gap, ratio)
        first = ca.jacobian(chord, turn)
        second = ca.jacobian(first, turn)
        jet = (chord, first, second, ca.jacobian(second, turn))
        if model.stretches:
            c_l, c1_l = ca.jacobian(chord, length), ca.jacobian(first, length)
            mixed = [c_l, ca.jacobian(c_l, length), c1_l, ca.jacobian(c1_l, length)]
            mixed.append(ca.jacobian(second, length))
        # differentiated at a fixed turn, then evaluated at the curvature
        found = ca.substitute(ca.vertcat(*jet, *mixed, cos, sin), turn, per_kappa * kappa)
        *jet, cos, sin = ca.vertsplit(found)
        jet, mixed = jet[:4], jet[4:]
    p = model.parameters.vector
    return ca.Function("chord", [kappa, length, p], [*jet, *mixed, cos, sin], {"cse": True})
