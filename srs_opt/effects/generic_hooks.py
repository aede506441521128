"""Hooks of the grammar's terms: what each does to wheels, links, valves and camera."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from srs_opt.effects.effect import Actuation, LinkState, Symbols, to_body_frame
from srs_opt.effects.settings import SMOOTHING, TERM

Factor = Callable[[Symbols, LinkState], ca.SX]


def along(factor: Factor) -> dict[str, Any]:
    """Return the hook of a factor on the friction along the wheels."""
    # the floor keeps friction from turning into a drive where a fit goes far
    return {"wheel_factors": lambda e, s: (ca.fmax(factor(e, s), TERM.least_factor), 1.0)}


def across(factor: Factor) -> dict[str, Any]:
    """Return the hook of a factor on the friction across the wheels."""
    return {"wheel_factors": lambda e, s: (1.0, ca.fmax(factor(e, s), TERM.least_factor))}


def on_both(factor: Factor) -> dict[str, Any]:
    """Return the hook of a factor on both frictions, as of the load."""

    def both(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
        f = ca.fmax(factor(e, s), TERM.least_factor)
        return f, f

    return {"wheel_factors": both}


def sign(v: ca.SX) -> ca.SX:
    """Return the direction of a speed, -1 to 1."""
    return ca.tanh(v / SMOOTHING.reversal_m_s)


def place_on_body(count: int) -> ca.DM:
    """Return where the links stand on the body, -1/2 at the tail to 1/2 at the head."""
    return ca.DM([k / (count - 1) - 0.5 for k in range(count)])


def towards(e: Symbols, s: LinkState) -> ca.SX:
    """Return how far the links have gone in the effect's direction in the room, m."""
    return ca.cos(e["direction"]) * s.room_x + ca.sin(e["direction"]) * s.room_y


def with_grain(e: Symbols, s: LinkState) -> ca.SX:
    """Return the cosine between a link's rolling and the effect's direction in the room."""
    # cos(link's heading in the room less the direction), by the sum of angles
    turned = s.heading - e["direction"]
    return (s.cos * ca.cos(turned) - s.sin * ca.sin(turned)) * sign(s.along)


def beyond_edge(e: Symbols, s: LinkState) -> ca.SX:
    """Return 1 beyond a line on the floor, 0 before it."""
    return (1 + ca.tanh((towards(e, s) - e["edge_m"]) / (2 * SMOOTHING.edge_m))) / 2


def drag(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    """Return a drag with the square of the speed."""
    # the friction's smoothing speed keeps the root differentiable at rest
    speed = ca.sqrt(s.v_x**2 + s.v_y**2 + s.friction_speed**2)
    return -e["drag"] * speed * s.v_x, -e["drag"] * speed * s.v_y


def own_force(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    """Return a force that stands in the link's axes."""
    along, across = e["along_n"], e["across_n"]
    return s.cos * along - s.sin * across, s.sin * along + s.cos * across


def spring(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    """Return the force of something elastic that is fixed in the room."""
    fx = e["pull_x_n"] - e["stiffness"] * s.room_x
    fy = e["pull_y_n"] - e["stiffness"] * s.room_y
    return to_body_frame(fx, fy, s.heading)


def couple(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    """Return a moment as opposite forces on tail and head, across the line between them."""
    c, h = ca.cos(s.heading), ca.sin(s.heading)
    dx, dy = s.room_x[-1] - s.room_x[0], s.room_y[-1] - s.room_y[0]
    ahead, left = c * dx + h * dy, c * dy - h * dx
    # a couple F at the distance d, F = moment / d, along (left, -ahead) / d
    per_m = e["moment"] / (ahead**2 + left**2)
    fx, fy = ca.SX.zeros(s.v_x.shape), ca.SX.zeros(s.v_y.shape)
    fx[0], fy[0], fx[-1], fy[-1] = per_m * left, -per_m * ahead, -per_m * left, per_m * ahead
    return fx, fy


def neighbours(e: Symbols, a: Actuation) -> ca.SX:
    """Return the valves' states with a share of the neighbours' added."""
    zero = ca.SX.zeros(1, 1)
    return a.valve + e["ratio"] * (ca.vertcat(zero, a.valve[:-1]) + ca.vertcat(a.valve[1:], zero))


def late(side: float) -> dict[str, Any]:
    """Return hooks of a pressure of which a share comes late on one side, +1 or -1; it goes in time."""

    def asked(valve: ca.SX) -> ca.SX:
        return (side * valve + ca.fabs(valve)) / 2

    return {
        "command": lambda e, a: a.valve - side * e["ratio"] * ca.fmax(asked(a.valve) - a.memory, 0),
        "state_rate": lambda e, a: (asked(a.valve) - a.memory) / ca.fmax(e["lag_s"], TERM.least_lag_s),
    }


def slack(e: Symbols, rate: ca.SX, memory: ca.SX) -> ca.SX:
    """Return the rate of a play that is taken up over a width of bend; none where there is no width."""
    # Dahl's model: memory' = kappa' - |kappa'| memory / width, which saturates at the width
    return (e["width"] > 0) * (rate - ca.fabs(rate) * memory / ca.fmax(e["width"], TERM.least_play_1_m))


def swing(e: Symbols, a: Actuation) -> ca.SX:
    """Return the valves' states under a pressure that swings."""
    phase = 2 * ca.pi * e["frequency_hz"] * a.time_s
    return a.valve * (1 + e["ratio"] * ca.sin(phase) + e["ahead"] * ca.cos(phase))


def lens(e: Symbols, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return where a lens shows a point."""
    stretch = 1 + e["per_m2"] * (x**2 + y**2)
    return stretch * x, stretch * y


def one_sided(side: float) -> Callable[[Symbols, ca.SX, ca.SX], ca.SX]:
    """Return the hook of time constants that are longer while one chamber fills."""
    return lambda e, valve, kappa: 1 + e["ratio"] * (side * valve + ca.fabs(valve)) / 2
