"""Chain geometry: links joined by arcs (pressure chambers) and gaps.

theta_{i+1} = theta_i + l kappa_i, and the chord of an arc is l S(l kappa/2) with
S(h) = sin(h)/h: the paper's (3) without its 0/0. Half of each straight gap stands
at either end of its arc, along that link (paper, Fig. 11); seen from the segment's
middle both halves lean alike, so link follows link along the mean of their headings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca

from srs_opt.geometry import turn_by

_SERIES_RADIUS = 0.3  # below it the Taylor series of sinc is exact to rounding


# Taylor coefficients in h^2 of sin(h)/h and of its derivative over h
_SINC = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(7))
_FIRST = tuple((-1) ** k * 2 * k / math.factorial(2 * k + 1) for k in range(1, 8))
# of (sin(h)/h)'' in h^2, and of (sin(h)/h)''' over h
_SECOND = tuple((-1) ** k * 2 * k * (2 * k - 1) / math.factorial(2 * k + 1) for k in range(1, 8))
_THIRD = tuple((-1) ** k * 2 * k * (2 * k - 1) * (2 * k - 2) / math.factorial(2 * k + 1) for k in range(2, 9))


def _polynomial(coefficients: tuple[float, ...], z: ca.SX) -> ca.SX:
    value = ca.SX(coefficients[-1])
    for c in reversed(coefficients[:-1]):
        value = value * z + c
    return value


def sinc(h: ca.SX) -> ca.SX:
    """Return sin(h)/h, smooth through zero (so are its derivatives)."""
    small = ca.fabs(h) < _SERIES_RADIUS
    # both branches are evaluated: the unused one must not divide by zero
    safe = ca.if_else(small, 1.0, h)
    return ca.if_else(small, _polynomial(_SINC, h * h), ca.sin(safe) / safe)


@dataclass(frozen=True)
class Chain:
    """A vector and an angle per link in the robot's own frame: shape, or its rates.

    Attributes
    ----------
    x, y : SX (N, 1)
        Link positions, m (origin at the centre of mass).
    angle : SX (N, 1)
        Link headings relative to the mean heading, rad.
    """

    x: ca.SX
    y: ca.SX
    angle: ca.SX


@dataclass(frozen=True)
class Shape(Chain):
    """The chain of given curvatures, with what its rates share with it.

    Attributes
    ----------
    cos, sin : SX (N, 1)
        Of the links' headings.
    rates : Chain
        Time derivatives for the given curvature rates, m/s and rad/s.
    """

    cos: ca.SX
    sin: ca.SX
    rates: Chain


def arc(length: ca.SX, curvature: ca.SX, heading: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the chord (dx, dy) of an arc that starts along `heading`, and the heading at its end."""
    turn = length * curvature
    chord = length * sinc(turn / 2)
    middle = heading + turn / 2
    return chord * ca.cos(middle), chord * ca.sin(middle), heading + turn


def _sinc_and_derivative(h: ca.SX, cos: ca.SX, sin: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return sin(h)/h and its derivative, smooth through zero, given cos(h) and sin(h)."""
    small = ca.fabs(h) < _SERIES_RADIUS
    inverse = 1 / ca.if_else(small, 1.0, h)
    value = ca.if_else(small, _polynomial(_SINC, h * h), sin * inverse)
    return value, ca.if_else(small, h * _polynomial(_FIRST, h * h), (cos - value) * inverse)


def segment_chord(
    kappa: ca.SX, segment_length: ca.SX, gap_length: ca.SX, gap_ratio: ca.SX | float
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return a segment's chord from link to link, its derivative by kappa, and cos, sin of half its turn.

    Half gap, arc and half gap are symmetric, so the chord lies along the mean of the two links' headings.
    """
    h = segment_length * kappa / 2
    cos, sin = ca.cos(h), ca.sin(h)
    arc_chord, arc_derivative = _sinc_and_derivative(h, cos, sin)
    # a bent half gap is an arc of L_o/2 whose half turn is bend kappa
    bend, gap_chord, gap_derivative = gap_length * gap_ratio / 4, ca.SX(1), ca.SX(0)
    if not ca.SX(gap_ratio).is_zero():
        gap_cos, gap_sin = ca.cos(bend * kappa), ca.sin(bend * kappa)
        gap_chord, gap_derivative = _sinc_and_derivative(bend * kappa, gap_cos, gap_sin)
        middle_cos, middle_sin = turn_by(gap_cos, gap_sin, cos, sin)
        cos, sin = turn_by(gap_cos, gap_sin, middle_cos, middle_sin)
    else:
        middle_cos, middle_sin = cos, sin
    half = segment_length / 2
    # the arc's chord lies along the mean heading, the half gaps' chords lean from it to either side
    chord = segment_length * arc_chord + gap_length * gap_chord * middle_cos
    derivative = segment_length * half * arc_derivative + gap_length * (
        bend * gap_derivative * middle_cos - (half + bend) * gap_chord * middle_sin
    )
    return chord, derivative, cos, sin


def segment_sagitta(
    kappa: ca.SX, segment_length: ca.SX, gap_length: ca.SX, gap_ratio: ca.SX | float
) -> ca.SX:
    """Return how far a segment's middle lies from its chord, m; to the right for kappa > 0.

    Seen from the middle, half the arc ends at h = l kappa/2, then half a gap of turn g follows: their chords
    stand at h/2 and h + g/2.
    """
    h, g = segment_length * kappa / 2, gap_length * gap_ratio * kappa / 2
    arc_part = segment_length / 2 * sinc(h / 2) * ca.sin(h / 2)
    return arc_part + gap_length / 2 * sinc(g / 2) * ca.sin(h + g / 2)


def chord_by_length(
    kappa: ca.SX, segment_length: ca.SX, gap_length: ca.SX, gap_ratio: ca.SX | float
) -> ca.SX:
    """Return the derivative of `segment_chord` by the chamber's length at fixed kappa.

    The arc's chord is 2 sin(l kappa/2)/kappa, and half the chamber's turn leans the gaps.
    """
    h, bend = segment_length * kappa / 2, gap_length * gap_ratio / 4 * kappa
    return ca.cos(h) - gap_length * sinc(bend) * kappa / 2 * ca.sin(h + bend)


def straight_gap_chord(
    kappa: ca.SX, segment_length: ca.SX, gap_length: ca.SX
) -> tuple[tuple[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX, ca.SX]:
    """Return a segment's chord with its first three derivatives by kappa, and cos, sin of half its turn.

    As `segment_chord` for straight gaps, chord = l S(h) + L cos(h) with h = l kappa/2; the derivatives of
    S(h) = sin(h)/h follow from h S'' + 2 S' + h S = 0, which costs a quarter of automatic ones.
    """
    half = segment_length / 2
    h = half * kappa
    cos, sin = ca.cos(h), ca.sin(h)
    value, derivative = _sinc_and_derivative(h, cos, sin)
    small = ca.fabs(h) < _SERIES_RADIUS
    inverse, z = 1 / ca.if_else(small, 1.0, h), h * h
    # h S'' = -2 S' - h S, and its derivative h S''' = -3 S'' - h S' - S
    second = ca.if_else(small, _polynomial(_SECOND, z), -value - 2 * derivative * inverse)
    third = ca.if_else(
        small, h * _polynomial(_THIRD, z), -derivative + 2 * (derivative * inverse - second) * inverse
    )
    jet = (
        segment_length * value + gap_length * cos,
        half * (segment_length * derivative - gap_length * sin),
        half**2 * (segment_length * second - gap_length * cos),
        half**3 * (segment_length * third + gap_length * sin),
    )
    return jet, cos, sin


def body_frame_chain(
    kappa: ca.SX,
    mass: ca.SX,
    segment_length: ca.SX,
    gap_length: ca.SX,
    gap_ratio: ca.SX | float = 0.0,
    dkappa: ca.SX | None = None,
    length_rate: ca.SX | None = None,
) -> Shape:
    """Return the chain in the robot's frame: origin at the centre of mass, x along the mean heading.

    Parameters
    ----------
    kappa : SX (N-1, 1)
        Segment curvatures, 1/m.
    mass : SX (N, 1)
        Link masses, kg (they weigh the centre of mass).
    segment_length, gap_length : SX
        Chamber l (of all, or one each (N-1, 1)) and gap L_o, m.
    gap_ratio : SX
        Curvature of the gaps over that of their chamber (0: straight gaps).
    dkappa : SX (N-1, 1), optional
        Rates of the curvatures, 1/(m s); without, the shape is at rest.
    length_rate : SX (N-1, 1), optional
        Rates at which the chambers lengthen, m/s; without, they do not.
    """
    dkappa = ca.SX.zeros(kappa.shape) if dkappa is None else dkappa
    length = segment_length * ca.SX.ones(kappa.shape)
    growth = ca.SX(*kappa.shape) if length_rate is None else length_rate
    # theta_{i+1} - theta_i: the chamber's turn and that of gaps that bend along
    turn_per_kappa = length + gap_length * gap_ratio
    angle = _headings(turn_per_kappa * kappa)
    angle_rate = _headings(turn_per_kappa * dkappa + growth * kappa)
    c, s = ca.cos(angle[0]), ca.sin(angle[0])
    x, y, x_rate, y_rate = ([ca.SX(0)] for _ in range(4))
    cosines, sines = [c], [s]
    for i in range(kappa.shape[0]):
        chord, derivative, c_half, s_half = segment_chord(kappa[i], length[i], gap_length, gap_ratio)
        # two half turns by complex products: no further cosine along the chain
        c, s = turn_by(c_half, s_half, c, s)
        middle_rate = (angle_rate[i] + angle_rate[i + 1]) / 2
        # the chord lengthens along itself and turns with the mean of the two headings' rates
        along, across = derivative * dkappa[i], chord * middle_rate
        if not growth[i].is_zero():
            along += growth[i] * chord_by_length(kappa[i], length[i], gap_length, gap_ratio)
        x.append(x[-1] + chord * c)
        y.append(y[-1] + chord * s)
        step_x, step_y = turn_by(c, s, along, across)
        x_rate.append(x_rate[-1] + step_x)
        y_rate.append(y_rate[-1] + step_y)
        c, s = turn_by(c_half, s_half, c, s)
        cosines.append(c)
        sines.append(s)
    # origin at the centre of mass: moments about it need no further terms
    weight = mass * (1 / ca.sum1(mass))
    centred = [v - ca.dot(weight, v) for v in (ca.vertcat(*p) for p in (x, y, x_rate, y_rate))]
    rates = Chain(centred[2], centred[3], angle_rate)
    return Shape(centred[0], centred[1], angle, ca.vertcat(*cosines), ca.vertcat(*sines), rates)


def _headings(turns: ca.SX) -> ca.SX:
    """Return the links' headings, mean zero, for the turns (N-1, 1) from each link to the next."""
    # mean zero, so that the pose's heading is the mean of the theta_i
    from_tail = ca.vertcat(0, ca.cumsum(turns))
    return from_tail - ca.sum1(from_tail) / from_tail.shape[0]


def chord_length(kappa: ca.SX, segment_length: ca.SX) -> ca.SX:
    """Return the moment arms l_i of the paper's (3): chords of the arcs, gaps not included."""
    # without the absolute value of (3): the sign only changes beyond a full turn of a segment
    return segment_length * sinc(segment_length * kappa / 2)
