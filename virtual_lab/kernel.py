"""The robot's equations of motion, compiled.

Coordinates are the tail's place and heading in the room; the curvatures follow
the valves on their own. Link i sits at ``rho_i`` in the tail's frame, so its
velocity is ``v_1 + R (rho_i' + omega J rho_i)`` with ``J`` a quarter turn. Kane's
equations then ask that the links' inertia forces and the applied forces do the
same work in the three partial motions (two translations and the turn about the
tail).

The cache of compiled code notices changes of a function's own file only, so what
is compiled lives in this one file; `soft`, which calls it, asks for its state.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# columns of the table of links
MASS, INERTIA, LOAD, MU_T, MU_N, TOE = range(6)
LINK_COLUMNS = 6
# columns of the chain: place, velocity, acceleration in the tail's frame; direction; turning; bend
(RX, RY, VX, VY, AX, AY, COS, SIN, TURN, TURN_RATE, BEND) = range(11)
CHAIN_COLUMNS = 11
# physics of wheels, tether and floor
(
    SMOOTHING, CONE, ROLL_DAMPING, STRIBECK, STRIBECK_SPEED, SLIP, TETHER_DRAG, TETHER_DAMPING,
    PULL, PULL_X, PULL_Y, SLOPE_X, SLOPE_Y, QUADRATIC, HOSE, HOSE_X, HOSE_Y, HOSE_SLACK,
    CARPET, CARPET_EDGE, CARPET_X, CARPET_Y, REVERSE, WAVE, WAVE_NUMBER, WAVE_X, WAVE_Y,
    STICTION, STICTION_SPEED, UNLOADING, STEER, TORSION, PLACES, GAP, GAP_RATIO,
) = range(35)  # fmt: skip
GROUND_SIZE = 35
# physics of the bending segments
(
    TAU1, TAU2, ASYMMETRY, STIFFENING, HYSTERESIS, WIDTH, DECAY, RIPPLE, RIPPLE_HZ, WARMING, STRETCH,
) = range(11)  # fmt: skip
BEND_SIZE = 11

_compiled = njit(cache=True, error_model="numpy")


@_compiled
def smooth_sign(x):
    """Return tanh(x)."""
    if x > 20.0:
        return 1.0
    if x < -20.0:
        return -1.0
    return 1.0 - 2.0 / (math.exp(2.0 * x) + 1.0)


@_compiled
def supply(t, bend):
    """Return the share of the nominal pressure that is there at time `t`."""
    share = 1.0
    if bend[DECAY] != 0.0:
        share *= math.exp(-bend[DECAY] * t)
    if bend[RIPPLE] != 0.0:
        share *= 1.0 + bend[RIPPLE] * math.sin(2.0 * math.pi * bend[RIPPLE_HZ] * t)
    return share


@_compiled
def bend_acceleration(kappa, rate, z, drive, sign, warmth, bend):
    """Return kappa'' of one segment."""
    slow = warmth
    if sign * kappa < 0.0:
        slow *= 1.0 + bend[ASYMMETRY]
    tau1, tau2 = bend[TAU1] * slow, bend[TAU2] * slow
    restoring = kappa + bend[STIFFENING] * kappa**3 + bend[HYSTERESIS] * z
    return (drive - restoring) / (tau1 * tau2) - (1.0 / tau1 + 1.0 / tau2) * rate


@_compiled
def bend_step(t, h, shape, push, bias, sign, bend, result):
    """Advance curvature, its rate and the hysteresis variable of every segment by `h` (Runge-Kutta 4).

    `shape` and `result` hold the columns kappa, kappa', z and, in `result`, kappa'' at the end.
    """
    g0, g1, g2 = supply(t, bend), supply(t + 0.5 * h, bend), supply(t + h, bend)
    warmth = 1.0 + bend[WARMING] * (t + 0.5 * h)
    width = bend[WIDTH]
    for s in range(shape.shape[0]):
        k, d, z = shape[s, 0], shape[s, 1], shape[s, 2]
        sg, f0, f1, f2 = sign[s], g0 * push[s] + bias[s], g1 * push[s] + bias[s], g2 * push[s] + bias[s]
        a1 = bend_acceleration(k, d, z, f0, sg, warmth, bend)
        z1 = d - abs(d) * z / width
        d2 = d + 0.5 * h * a1
        a2 = bend_acceleration(k + 0.5 * h * d, d2, z + 0.5 * h * z1, f1, sg, warmth, bend)
        z2 = d2 - abs(d2) * (z + 0.5 * h * z1) / width
        d3 = d + 0.5 * h * a2
        a3 = bend_acceleration(k + 0.5 * h * d2, d3, z + 0.5 * h * z2, f1, sg, warmth, bend)
        z3 = d3 - abs(d3) * (z + 0.5 * h * z2) / width
        d4 = d + h * a3
        a4 = bend_acceleration(k + h * d3, d4, z + h * z3, f2, sg, warmth, bend)
        z4 = d4 - abs(d4) * (z + h * z3) / width
        result[s, 0] = k + h * (d + 2.0 * d2 + 2.0 * d3 + d4) / 6.0
        result[s, 1] = d + h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        result[s, 2] = z + h * (z1 + 2.0 * z2 + 2.0 * z3 + z4) / 6.0
    set_accelerations(t + h, result, push, bias, sign, bend)


@_compiled
def set_accelerations(t, shape, push, bias, sign, bend):
    """Fill in kappa'' at time `t`."""
    g, warmth = supply(t, bend), 1.0 + bend[WARMING] * t
    for s in range(shape.shape[0]):
        drive = g * push[s] + bias[s]
        shape[s, 3] = bend_acceleration(shape[s, 0], shape[s, 1], shape[s, 2], drive, sign[s], warmth, bend)


@_compiled
def sinc_derivatives(x):
    """Return sin(x)/x and its first two derivatives."""
    if abs(x) < 0.02:
        q = x * x
        return (
            1.0 - q / 6.0 + q * q / 120.0,
            x * (-1.0 / 3.0 + q / 30.0 - q * q / 840.0),
            -1.0 / 3.0 + q / 10.0 - q * q / 168.0,
        )
    f = math.sin(x) / x
    f1 = (math.cos(x) - f) / x
    return f, f1, -f - 2.0 * f1 / x


@_compiled
def chord(kappa, length, gap, ratio):
    """Return the distance c between neighbouring links, and c_k, c_kk, c_l, c_kl, c_ll.

    Derivatives are in curvature (k) and chamber length (l). Half gap, arc and half gap are symmetric about
    the bisector of the links' headings, so the whole lies along it; with `ratio` the half gaps are arcs of
    curvature ratio * kappa.
    """
    u = 0.5 * length
    f, f1, f2 = sinc_derivatives(u * kappa)
    c, c1, c2 = length * f, length * u * f1, length * u * u * f2
    sine = math.sin(u * kappa)
    l1, kl, ll = math.cos(u * kappa), -u * sine, -0.5 * kappa * sine
    a, b = 0.5 * (length + 0.5 * ratio * gap), 0.25 * ratio * gap
    f, f1, f2 = sinc_derivatives(b * kappa)
    f1, f2 = b * f1, b * b * f2
    g, sine = math.cos(a * kappa), math.sin(a * kappa)
    g1, g2 = -a * sine, -a * a * g
    h, h1, hh = -0.5 * kappa * sine, -0.5 * sine - 0.5 * a * kappa * g, -0.25 * kappa * kappa * g
    return (
        c + gap * f * g, c1 + gap * (f1 * g + f * g1), c2 + gap * (f2 * g + 2.0 * f1 * g1 + f * g2),
        l1 + gap * f * h, kl + gap * (f1 * h + f * h1), ll + gap * f * hh,
    )  # fmt: skip


@_compiled
def set_lengths(shape, natural, stretch, lengths):
    """Fill in lengths, their rates and accelerations of chambers of no-load curvatures `shape`."""
    for s in range(natural.shape[0]):
        kappa, rate, size = shape[s, 0], shape[s, 1], stretch * natural[s]
        lengths[s, 0] = natural[s] + size * kappa * kappa
        lengths[s, 1] = 2.0 * size * kappa * rate
        lengths[s, 2] = 2.0 * size * (rate * rate + kappa * shape[s, 3])


@_compiled
def set_chain(shape, lengths, ground, chain):
    """Fill in places, velocities and accelerations of the links in the tail's frame."""
    chain[0, :] = 0.0
    chain[0, COS] = 1.0
    segments = lengths.shape[0]
    for s in range(segments):
        kappa, rate, acc = shape[s, 0], shape[s, 1], shape[s, 3]
        length, grow, grow2 = lengths[s, 0], lengths[s, 1], lengths[s, 2]
        c, c1, c2, l1, kl, ll = chord(kappa, length, ground[GAP], ground[GAP_RATIO])
        cd = c1 * rate + l1 * grow
        cdd = c2 * rate * rate + 2.0 * kl * rate * grow + ll * grow * grow + c1 * acc + l1 * grow2
        half = 0.5 * (length + ground[GAP_RATIO] * ground[GAP])
        turn1 = half * rate + 0.5 * grow * kappa
        turn2 = half * acc + grow * rate + 0.5 * grow2 * kappa
        ch, sh = math.cos(half * kappa), math.sin(half * kappa)
        co, si = chain[s, COS], chain[s, SIN]
        mc, ms = co * ch - si * sh, si * ch + co * sh
        w, wd = chain[s, TURN] + turn1, chain[s, TURN_RATE] + turn2
        along, across = cdd - c * w * w, 2.0 * cd * w + c * wd
        chain[s + 1, RX] = chain[s, RX] + c * mc
        chain[s + 1, RY] = chain[s, RY] + c * ms
        chain[s + 1, VX] = chain[s, VX] + cd * mc - c * w * ms
        chain[s + 1, VY] = chain[s, VY] + cd * ms + c * w * mc
        chain[s + 1, AX] = chain[s, AX] + along * mc - across * ms
        chain[s + 1, AY] = chain[s, AY] + along * ms + across * mc
        chain[s + 1, COS] = mc * ch - ms * sh
        chain[s + 1, SIN] = ms * ch + mc * sh
        chain[s + 1, TURN] = chain[s, TURN] + 2.0 * turn1
        chain[s + 1, TURN_RATE] = chain[s, TURN_RATE] + 2.0 * turn2
        chain[s, BEND] += 0.5 * kappa
        chain[s + 1, BEND] = 0.5 * kappa
    chain[0, BEND] *= 2.0
    chain[segments, BEND] *= 2.0


@_compiled
def wheel_force(vt, vn, load, mu_t, mu_n, ground):
    """Return the force of the floor on one wheel pair, along and across the wheels."""
    vs = ground[SMOOTHING]
    if ground[CONE] != 0.0:
        size = math.sqrt(vt * vt + vn * vn + vs * vs)
        along, across = mu_t * vt / size, mu_n * vn / size
    else:
        along, across = mu_t * smooth_sign(vt / vs), mu_n * smooth_sign(vn / vs)
    if ground[STRIBECK] != 0.0:
        along *= 1.0 + ground[STRIBECK] * math.exp(-((vt / ground[STRIBECK_SPEED]) ** 2))
    if ground[REVERSE] != 0.0 and vt < 0.0:
        along *= 1.0 + ground[REVERSE]
    across *= 1.0 + ground[SLIP] * abs(vn)
    if ground[STICTION] != 0.0:
        across *= 1.0 + ground[STICTION] * math.exp(-((vn / ground[STICTION_SPEED]) ** 2))
    return -load * along - ground[ROLL_DAMPING] * vt, -load * across


@_compiled
def place_force(x, y, first, mass, ground):
    """Return the force on a link at (x, y) of the room, and how much harder rolling is there (ratio)."""
    fx, fy, grip = mass * ground[SLOPE_X], mass * ground[SLOPE_Y], 1.0
    if first and ground[PULL] != 0.0:
        dx, dy = ground[PULL_X] - x, ground[PULL_Y] - y
        away = max(math.sqrt(dx * dx + dy * dy), 1e-9)
        fx, fy = fx + ground[PULL] * dx / away, fy + ground[PULL] * dy / away
    if first and ground[HOSE] != 0.0:
        dx, dy = ground[HOSE_X] - x, ground[HOSE_Y] - y
        away = max(math.sqrt(dx * dx + dy * dy), 1e-9)
        stretch = max(away - ground[HOSE_SLACK], 0.0)
        fx, fy = fx + ground[HOSE] * stretch * dx / away, fy + ground[HOSE] * stretch * dy / away
    if ground[WAVE] != 0.0:
        down = (
            -mass * ground[WAVE] * math.cos(ground[WAVE_NUMBER] * (x * ground[WAVE_X] + y * ground[WAVE_Y]))
        )
        fx, fy = fx + down * ground[WAVE_X], fy + down * ground[WAVE_Y]
    if ground[CARPET] != 0.0:
        beyond = x * ground[CARPET_X] + y * ground[CARPET_Y] - ground[CARPET_EDGE]
        grip = 1.0 + ground[CARPET] * 0.5 * (1.0 + smooth_sign(beyond / 0.01))
    return fx, fy, grip


@_compiled
def link_force(i, wx, wy, co, si, state, chain, links, ground):
    """Return the applied force on link `i` in the tail's frame; (wx, wy) is its velocity there."""
    load, grip, fx, fy = links[i, LOAD], 1.0, 0.0, 0.0
    if ground[PLACES] != 0.0:
        x = state[0] + co * chain[i, RX] - si * chain[i, RY]
        y = state[1] + si * chain[i, RX] + co * chain[i, RY]
        gx, gy, grip = place_force(x, y, i == 0, links[i, MASS], ground)
        fx, fy = co * gx + si * gy, co * gy - si * gx
    if ground[UNLOADING] != 0.0:
        load *= max(1.0 - ground[UNLOADING] * abs(chain[i, BEND]), 0.0)
    toe = links[i, TOE] + ground[STEER] * chain[i, BEND]
    ec, es = chain[i, COS], chain[i, SIN]
    if toe != 0.0:
        ct, st = math.cos(toe), math.sin(toe)
        ec, es = ec * ct - es * st, es * ct + ec * st
    along, across = wheel_force(
        wx * ec + wy * es, wy * ec - wx * es, load, grip * links[i, MU_T], links[i, MU_N], ground
    )
    fx, fy = fx + along * ec - across * es, fy + along * es + across * ec
    speed2 = wx * wx + wy * wy
    if ground[QUADRATIC] != 0.0:
        drag = ground[QUADRATIC] * math.sqrt(speed2)
        fx, fy = fx - drag * wx, fy - drag * wy
    if i == 0:
        drag = ground[TETHER_DAMPING]
        if ground[TETHER_DRAG] != 0.0:
            drag += ground[TETHER_DRAG] / math.sqrt(speed2 + ground[SMOOTHING] ** 2)
        fx, fy = fx - drag * wx, fy - drag * wy
    return fx, fy


@_compiled
def body_rates(state, chain, links, ground, result):
    """Fill in the rates of (x, y, heading, vx, vy, turn rate) of the tail; return the power of all forces."""
    co, si, omega = math.cos(state[2]), math.sin(state[2]), state[5]
    ux, uy = co * state[3] + si * state[4], co * state[4] - si * state[3]
    mass, sx, sy, inertia = 0.0, 0.0, 0.0, 0.0
    px, py, moment, power = 0.0, 0.0, ground[TORSION], ground[TORSION] * omega
    for i in range(links.shape[0]):
        m, rx, ry = links[i, MASS], chain[i, RX], chain[i, RY]
        wx, wy = ux + chain[i, VX] - omega * ry, uy + chain[i, VY] + omega * rx
        fx, fy = link_force(i, wx, wy, co, si, state, chain, links, ground)
        power += fx * wx + fy * wy
        # force less the part of the inertia force that holds no unknown acceleration
        fx -= m * (chain[i, AX] - 2.0 * omega * chain[i, VY] - omega * omega * rx)
        fy -= m * (chain[i, AY] + 2.0 * omega * chain[i, VX] - omega * omega * ry)
        px, py = px + fx, py + fy
        moment += rx * fy - ry * fx - links[i, INERTIA] * chain[i, TURN_RATE]
        mass, sx, sy = mass + m, sx + m * rx, sy + m * ry
        inertia += m * (rx * rx + ry * ry) + links[i, INERTIA]
    spin = (moment - (sx * py - sy * px) / mass) / (inertia - (sx * sx + sy * sy) / mass)
    ax, ay = (px + spin * sy) / mass, (py - spin * sx) / mass
    result[0], result[1], result[2] = state[3], state[4], omega
    result[3], result[4], result[5] = co * ax - si * ay, si * ax + co * ay, spin
    return power


@_compiled
def body_step(h, state, start, middle, end, links, ground, rates, trial):
    """Advance the tail's pose and velocity in place by one Runge-Kutta step of order 4."""
    body_rates(state, start, links, ground, rates[0])
    for j in range(6):
        trial[j] = state[j] + 0.5 * h * rates[0, j]
    body_rates(trial, middle, links, ground, rates[1])
    for j in range(6):
        trial[j] = state[j] + 0.5 * h * rates[1, j]
    body_rates(trial, middle, links, ground, rates[2])
    for j in range(6):
        trial[j] = state[j] + h * rates[2, j]
    body_rates(trial, end, links, ground, rates[3])
    for j in range(6):
        state[j] += h * (rates[0, j] + 2.0 * rates[1, j] + 2.0 * rates[2, j] + rates[3, j]) / 6.0


@_compiled
def hermite(u, h, x0, v0, x1, v1):
    """Return the cubic through two values and two slopes, `u` in [0, 1]."""
    w = 1.0 - u
    return w * w * ((1.0 + 2.0 * u) * x0 + u * h * v0) + u * u * ((1.0 + 2.0 * w) * x1 - w * h * v1)


@_compiled
def record(u, h, before, after, shape0, shape1, row):
    """Fill in one sample: pose, velocity, curvatures, their rates."""
    n = shape0.shape[0]
    for j in range(3):
        row[j] = hermite(u, h, before[j], before[j + 3], after[j], after[j + 3])
        row[j + 3] = (1.0 - u) * before[j + 3] + u * after[j + 3]
    for s in range(n):
        row[6 + s] = hermite(u, h, shape0[s, 0], shape0[s, 1], shape1[s, 0], shape1[s, 1])
        row[6 + n + s] = (1.0 - u) * shape0[s, 1] + u * shape1[s, 1]


@_compiled
def integrate(state, shape, edges, steps, push, sign, bias, bend, lengths, links, ground, times):
    """Integrate from `edges[0]` over valve states that are constant between edges; return the samples.

    Parameters
    ----------
    state : (6,) array
        Pose and velocity of the tail at the start.
    shape : (N-1, 4) array
        Curvature, its rate, hysteresis variable; the last column is scratch. Holds the end's afterwards.
    edges, steps : (K+1,) and (K,) arrays
        Times of the valve switches and number of Runge-Kutta steps between them.
    push, sign : (K, N-1) arrays
        What the valves drive each curvature to (1/m), and their sign.
    times : (T,) array
        Sample times, increasing; those before the start show the start.

    Returns
    -------
    (T, 6 + 2 (N-1)) array
        Pose, velocity, curvatures, curvature rates.
    """
    n, t_end = lengths.shape[0], edges[0]
    samples = np.empty((times.shape[0], 6 + 2 * n))
    now, old, middle, after = state.copy(), state.copy(), shape.copy(), shape.copy()
    start, half, end = np.zeros((3, n + 1, CHAIN_COLUMNS))
    long, stretch = np.empty((n, 3)), bend[STRETCH]
    rates, trial = np.empty((4, 6)), np.empty(6)
    taken = 0
    while taken < times.shape[0] and times[taken] <= t_end:
        record(0.0, 1.0, now, now, shape, shape, samples[taken])
        taken += 1
    before = shape.copy()
    for k in range(steps.shape[0]):
        h = (edges[k + 1] - edges[k]) / steps[k]
        set_accelerations(edges[k], before, push[k], bias, sign[k], bend)
        set_lengths(before, lengths, stretch, long)
        set_chain(before, long, ground, start)
        for j in range(steps[k]):
            t = edges[k] + j * h
            bend_step(t, 0.5 * h, before, push[k], bias, sign[k], bend, middle)
            bend_step(t + 0.5 * h, 0.5 * h, middle, push[k], bias, sign[k], bend, after)
            set_lengths(middle, lengths, stretch, long)
            set_chain(middle, long, ground, half)
            set_lengths(after, lengths, stretch, long)
            set_chain(after, long, ground, end)
            old[:] = now
            body_step(h, now, start, half, end, links, ground, rates, trial)
            last = j == steps[k] - 1
            t_end = edges[k + 1] if last else t + h
            while taken < times.shape[0] and times[taken] <= t_end:
                record((times[taken] - t) / (t_end - t), h, old, now, before, after, samples[taken])
                taken += 1
            before, after = after, before
            start, end = end, start
    shape[:] = before
    return samples[:taken]
