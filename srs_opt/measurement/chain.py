"""The chain's geometry in numpy, many frames at once: links' positions from pose and curvatures.

Same geometry as `srs_opt.model.kinematics` (a test holds the two together), vectorised over
frames and with its Jacobian in closed form. A configuration is ``q = (p_x, p_y, theta, kappa_1,
..., kappa_{N-1})``: centre of mass, mean heading, curvatures from tail to head.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from srs_opt.geometry import quarter_turn, unit_vectors
from srs_opt.measurement.records import Array
from srs_opt.measurement.spots import Spots, one_per_link
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Chain:
    """What the geometry needs of a robot: links N, chamber length l, gap L_o; and where its M markers sit.

    Without `spots` one marker sits on every link's centre, tail to head.
    """

    links: int
    segment_length_m: float
    gap_length_m: float
    spots: Spots | None = None

    @property
    def markers(self) -> int:
        """Number M of markers."""
        return self.links if self.spots is None else len(self.spots)

    @property
    def unknowns(self) -> int:
        """Size N + 2 of a configuration."""
        return self.links + 2

    @property
    def pitch_m(self) -> float:
        """Distance of neighbouring links when straight."""
        return self.segment_length_m + self.gap_length_m

    @cached_property
    def straight_m(self) -> Array:
        """Markers of the straight robot, (M, 2): tail link at the origin, heading along x."""
        q = np.zeros(self.unknowns)
        q[0] = self.pitch_m * (self.links - 1) / 2
        return marker_positions(self, q)

    @cached_property
    def spacing_m(self) -> Array:
        """Distances of markers that follow each other when straight, (M - 1,)."""
        lengths_m: Array = np.linalg.norm(np.diff(self.straight_m, axis=0), axis=1)
        return lengths_m


def chain_of(robot: Robot, spots: Spots | None = None) -> Chain:
    """Return the geometry of `robot`, with markers at `spots` (none: one on every link's centre)."""
    if spots == one_per_link(robot.links):
        spots = None
    return Chain(robot.links, robot.segment_length_m, robot.gap_length_m, spots)


def _sinc(h: Array) -> tuple[Array, Array]:
    """Return S(h) = sin(h)/h and S'(h), by their series near 0, where the next terms are below 1e-10."""
    small = np.abs(h) < 1e-3
    safe = np.where(small, 1.0, h)
    value = np.where(small, 1 - h**2 / 6, np.sin(safe) / safe)
    derivative = np.where(small, -h / 3, (np.cos(safe) - value) / safe)
    return value, derivative


def headings(chain: Chain, q: Array) -> Array:
    """Return the links' headings theta_i, shape (..., N): theta_{i+1} = theta_i + l kappa_i."""
    steps = chain.segment_length_m * q[..., 3:]
    relative = np.concatenate([np.zeros((*steps.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)
    angles_rad: Array = q[..., 2:3] + relative - relative.mean(axis=-1, keepdims=True)
    return angles_rad


def link_positions(chain: Chain, q: Array) -> Array:
    """Return the links' positions, shape (..., N, 2), of configurations `q`, shape (..., N + 2)."""
    theta = headings(chain, q)
    middle = (theta[..., :-1] + theta[..., 1:]) / 2
    # (3): the chord of an arc of length l, l S(l kappa / 2), along the mean heading of its ends
    length, _ = _sinc(chain.segment_length_m * q[..., 3:] / 2)
    gaps = chain.gap_length_m / 2 * (unit_vectors(theta[..., :-1]) + unit_vectors(theta[..., 1:]))
    steps = gaps + chain.segment_length_m * length[..., None] * unit_vectors(middle)
    relative = np.concatenate([np.zeros((*steps.shape[:-2], 1, 2)), np.cumsum(steps, axis=-2)], axis=-2)
    # links of equal mass: their mean place is the centre of mass
    points_m: Array = q[..., None, :2] + relative - relative.mean(axis=-2, keepdims=True)
    return points_m


def position_jacobian(chain: Chain, q: Array) -> Array:
    """Return the derivative of `link_positions`, shape (..., N, 2, N + 2)."""
    n, l = chain.links, chain.segment_length_m
    theta = headings(chain, q)
    heading_derivatives = _heading_derivatives(chain)  # (N, N - 1): d theta_i / d kappa_j
    middle = (theta[..., :-1] + theta[..., 1:]) / 2
    length, derivative = _sinc(l * q[..., 3:] / 2)
    turned = quarter_turn(unit_vectors(theta)) * chain.gap_length_m / 2
    arc = l * length[..., None] * quarter_turn(unit_vectors(middle))
    steps = (
        turned[..., :-1, :, None] * heading_derivatives[:-1, None, :]
        + turned[..., 1:, :, None] * heading_derivatives[1:, None, :]
        + arc[..., None] * ((heading_derivatives[:-1] + heading_derivatives[1:]) / 2)[:, None, :]
    )  # (..., N - 1, 2, N - 1): d step_i / d kappa_j
    own = np.arange(n - 1)
    # its own curvature also shortens the chord: d(l S(l kappa/2))/d kappa = l^2/2 S'
    steps[..., own, :, own] += np.moveaxis((l * l / 2 * derivative)[..., None] * unit_vectors(middle), -2, 0)
    tail = np.zeros((*steps.shape[:-3], 1, 2, n - 1))
    relative = np.concatenate([tail, np.cumsum(steps, axis=-3)], axis=-3)
    out = np.empty((*q.shape[:-1], n, 2, n + 2))
    out[..., :2] = np.eye(2)
    # turning about the centre of mass
    out[..., 2] = quarter_turn(link_positions(chain, q) - q[..., None, :2])
    out[..., 3:] = relative - relative.mean(axis=-3, keepdims=True)
    return out


def _heading_derivatives(chain: Chain) -> Array:
    below = np.tril(np.ones((chain.links, chain.links - 1)), -1) * chain.segment_length_m
    return np.asarray(below - below.mean(axis=0))


def _along(chain: Chain) -> tuple[np.ndarray, Array, Array, Array]:
    """Return per marker: carrying link, straight way along it, way along the chamber, offset to the left."""
    spots = chain.spots or ()
    gap, l = chain.gap_length_m, chain.segment_length_m
    straight = [s.dx_m if s.link is not None else gap / 2 for s in spots]
    return (
        np.array([s.carrier for s in spots]),
        np.array(straight),
        np.array([s.at * l for s in spots]),
        np.array([s.dy_m for s in spots]),
    )


def _carried(chain: Chain, q: Array) -> tuple[Array, Array]:
    """Return heading and curvature at the link that carries each marker, (..., M); zero beyond the head."""
    carrier = _along(chain)[0]
    kappa = np.concatenate([q[..., 3:], np.zeros((*q.shape[:-1], 1))], axis=-1)
    return headings(chain, q)[..., carrier], kappa[..., carrier]


def marker_positions(chain: Chain, q: Array) -> Array:
    """Return the markers' positions, shape (..., M, 2).

    From the carrying link's centre straight on, then along the chamber's arc (the paper's (3) for a part of
    it), then to the left.
    """
    links = link_positions(chain, q)
    if chain.spots is None:
        return links
    carrier, straight, way, left = _along(chain)
    theta, kappa = _carried(chain, q)
    chord, _ = _sinc(way * kappa / 2)
    arc = (way * chord)[..., None] * unit_vectors(theta + way * kappa / 2)
    side = left[:, None] * quarter_turn(unit_vectors(theta + way * kappa))
    return np.asarray(links[..., carrier, :] + straight[:, None] * unit_vectors(theta) + arc + side)


def marker_jacobian(chain: Chain, q: Array) -> Array:
    """Return the derivative of `marker_positions`, shape (..., M, 2, N + 2)."""
    links = position_jacobian(chain, q)
    if chain.spots is None:
        return links
    carrier, straight, way, left = _along(chain)
    theta, kappa = _carried(chain, q)
    chord, derivative = _sinc(way * kappa / 2)
    turn = np.zeros((chain.markers, chain.unknowns))  # d theta of the carrier
    turn[:, 2], turn[:, 3:] = 1.0, _heading_derivatives(chain)[carrier]
    turn_along = np.zeros_like(turn)  # d (way * kappa): the turn along the chamber
    inside = carrier < chain.links - 1
    turn_along[inside, 3 + carrier[inside]] = way[inside]
    out = links[..., carrier, :, :].copy()
    out += (straight[:, None] * quarter_turn(unit_vectors(theta)))[..., None] * turn[:, None, :]
    middle = unit_vectors(theta + way * kappa / 2)
    out += ((way * chord)[..., None] * quarter_turn(middle))[..., None] * (turn + turn_along / 2)[:, None, :]
    out += ((way * derivative / 2)[..., None] * middle)[..., None] * turn_along[:, None, :]
    out -= (left[:, None] * unit_vectors(theta + way * kappa))[..., None] * (turn + turn_along)[:, None, :]
    return np.asarray(out)
