"""Equations of motion of a body whose segments bend under load, compiled.

The bends join the tail's pose as coordinates, so Kane's equations have N - 1 further partial motions: with
segment s held but for its bend, every link ahead of it moves by

    d rho_i / d kappa_s = c_k e + (c/2 + ...) turn e' + turn J (rho_i - rho_{s+1}),

c the distance of the segment's links, e its direction, turn = d(heading)/d kappa. The generalized force of
kappa_s is l EI [kappa0 - kappa + t_r (kappa0' - kappa')] besides what the applied forces do. What the
pneumatics do on their own (`kernel.bend_step`) is the curvature kappa0 without load.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit

from virtual_lab import kernel

# columns of the table of segments
LENGTH, STIFFNESS, RELAXATION = range(3)
_inline = njit(error_model="numpy")


@_inline
def set_partial_motions(bends, long, ground, chain, partial):
    """Fill in (x, y, turn) of every link per unit rate of every bend, in the tail's frame."""
    segments = bends.shape[0]
    partial[:] = 0.0
    for s in range(segments):
        c, c1, _, _, _, _ = kernel.chord(
            bends[s, 0], long[s, 0], ground[kernel.GAP], ground[kernel.GAP_RATIO]
        )
        half = 0.5 * (long[s, 0] + ground[kernel.GAP_RATIO] * ground[kernel.GAP])
        co, si = chain[s, kernel.COS], chain[s, kernel.SIN]
        ch, sh = math.cos(half * bends[s, 0]), math.sin(half * bends[s, 0])
        mc, ms = co * ch - si * sh, si * ch + co * sh
        x, y = chain[s + 1, kernel.RX], chain[s + 1, kernel.RY]
        for i in range(s + 1, segments + 1):
            partial[s, i, 0] = c1 * mc - half * c * ms - 2.0 * half * (chain[i, kernel.RY] - y)
            partial[s, i, 1] = c1 * ms + half * c * mc + 2.0 * half * (chain[i, kernel.RX] - x)
            partial[s, i, 2] = 2.0 * half


@_inline
def solve(matrix, right):
    """Solve a symmetric positive definite system in place (Cholesky)."""
    n = right.shape[0]
    for j in range(n):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = math.sqrt(matrix[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@_inline
def rates(state, no_load, segments, stretch, links, ground, chain, work, result):
    """Fill in the rates of (pose, velocity of the tail, bends, their rates).

    `work` holds scratch: bends (N-1, 4), chamber lengths (N-1, 3), partial motions, matrix, right-hand side.
    """
    bends, long, partial, matrix, right = work
    n = segments.shape[0]
    for s in range(n):
        bends[s, 0], bends[s, 1], bends[s, 3] = state[6 + s], state[6 + n + s], 0.0
    kernel.set_lengths(no_load, segments[:, LENGTH], stretch, long)
    kernel.set_chain(bends, long, ground, chain)
    set_partial_motions(bends, long, ground, chain, partial)
    co, si, omega = math.cos(state[2]), math.sin(state[2]), state[5]
    ux, uy = co * state[3] + si * state[4], co * state[4] - si * state[3]
    matrix[:] = 0.0
    right[:] = 0.0
    right[2] = ground[kernel.TORSION]
    for s in range(n):
        slack = no_load[s, 0] - bends[s, 0] + segments[s, RELAXATION] * (no_load[s, 1] - bends[s, 1])
        right[3 + s] = segments[s, LENGTH] * segments[s, STIFFNESS] * slack
    for i in range(n + 1):
        m, inertia = links[i, kernel.MASS], links[i, kernel.INERTIA]
        rx, ry = chain[i, kernel.RX], chain[i, kernel.RY]
        wx = ux + chain[i, kernel.VX] - omega * ry
        wy = uy + chain[i, kernel.VY] + omega * rx
        fx, fy = kernel.link_force(i, wx, wy, co, si, state, chain, links, ground)
        # less the part of the inertia force that holds no unknown acceleration
        fx -= m * (chain[i, kernel.AX] - 2.0 * omega * chain[i, kernel.VY] - omega * omega * rx)
        fy -= m * (chain[i, kernel.AY] + 2.0 * omega * chain[i, kernel.VX] - omega * omega * ry)
        moment = -inertia * chain[i, kernel.TURN_RATE]
        matrix[0, 0] += m
        matrix[2, 0] -= m * ry
        matrix[2, 1] += m * rx
        matrix[2, 2] += m * (rx * rx + ry * ry) + inertia
        right[0], right[1] = right[0] + fx, right[1] + fy
        right[2] += rx * fy - ry * fx + moment
        for s in range(i):
            px, py, turn = partial[s, i, 0], partial[s, i, 1], partial[s, i, 2]
            right[3 + s] += px * fx + py * fy + turn * moment
            matrix[3 + s, 0] += m * px
            matrix[3 + s, 1] += m * py
            matrix[3 + s, 2] += m * (rx * py - ry * px) + inertia * turn
            for r in range(s + 1):
                matrix[3 + s, 3 + r] += (
                    m * (px * partial[r, i, 0] + py * partial[r, i, 1]) + inertia * turn * partial[r, i, 2]
                )
    matrix[1, 1] = matrix[0, 0]
    solve(matrix, right)
    result[0], result[1], result[2] = state[3], state[4], omega
    result[3], result[4] = co * right[0] - si * right[1], si * right[0] + co * right[1]
    result[5] = right[2]
    for s in range(n):
        result[6 + s], result[6 + n + s] = state[6 + n + s], right[3 + s]


@_inline
def keep(u, h, before, after, no_load0, no_load1, row):
    """Fill in one sample: pose, velocity, bends, their rates, then no-load curvatures and their rates."""
    n = no_load0.shape[0]
    for j in range(3):
        row[j] = kernel.hermite(u, h, before[j], before[j + 3], after[j], after[j + 3])
        row[j + 3] = (1.0 - u) * before[j + 3] + u * after[j + 3]
    for s in range(n):
        a, b = 6 + s, 6 + n + s
        row[a] = kernel.hermite(u, h, before[a], before[b], after[a], after[b])
        row[b] = (1.0 - u) * before[b] + u * after[b]
        row[6 + 2 * n + s] = kernel.hermite(
            u, h, no_load0[s, 0], no_load0[s, 1], no_load1[s, 0], no_load1[s, 1]
        )
        row[6 + 3 * n + s] = (1.0 - u) * no_load0[s, 1] + u * no_load1[s, 1]


def _cached(kernel_state: str) -> Callable[..., np.ndarray]:
    """Return the compiled integrator; its cache is keyed by the kernel's state, which it closes over."""

    @njit(cache=True, error_model="numpy")
    def integrate(state, shape, edges, steps, push, sign, bias, bend, segments, links, ground, times):
        """Integrate as `kernel.integrate` does, with bends in the state and segments in the table.

        Returns
        -------
        (T, 6 + 4 (N-1)) array
            See `keep`.
        """
        assert len(kernel_state) > 0
        n, t_end = segments.shape[0], edges[0]
        size = 6 + 2 * n
        samples = np.empty((times.shape[0], size + 2 * n))
        now, old, trial = state.copy(), state.copy(), np.empty(size)
        before, middle, after = shape.copy(), shape.copy(), shape.copy()
        chain = np.zeros((n + 1, kernel.CHAIN_COLUMNS))
        work = (
            np.zeros((n, 4)), np.empty((n, 3)), np.empty((n, n + 1, 3)),
            np.empty((3 + n, 3 + n)), np.empty(3 + n),
        )  # fmt: skip
        k = np.empty((4, size))
        stretch = bend[kernel.STRETCH]
        taken = 0
        while taken < times.shape[0] and times[taken] <= t_end:
            keep(0.0, 1.0, now, now, shape, shape, samples[taken])
            taken += 1
        for phase in range(steps.shape[0]):
            h = (edges[phase + 1] - edges[phase]) / steps[phase]
            kernel.set_accelerations(edges[phase], before, push[phase], bias, sign[phase], bend)
            for j in range(steps[phase]):
                t = edges[phase] + j * h
                kernel.bend_step(t, 0.5 * h, before, push[phase], bias, sign[phase], bend, middle)
                kernel.bend_step(t + 0.5 * h, 0.5 * h, middle, push[phase], bias, sign[phase], bend, after)
                old[:] = now
                rates(now, before, segments, stretch, links, ground, chain, work, k[0])
                for c in range(size):
                    trial[c] = now[c] + 0.5 * h * k[0, c]
                rates(trial, middle, segments, stretch, links, ground, chain, work, k[1])
                for c in range(size):
                    trial[c] = now[c] + 0.5 * h * k[1, c]
                rates(trial, middle, segments, stretch, links, ground, chain, work, k[2])
                for c in range(size):
                    trial[c] = now[c] + h * k[2, c]
                rates(trial, after, segments, stretch, links, ground, chain, work, k[3])
                for c in range(size):
                    now[c] += h * (k[0, c] + 2.0 * k[1, c] + 2.0 * k[2, c] + k[3, c]) / 6.0
                t_end = edges[phase + 1] if j == steps[phase] - 1 else t + h
                while taken < times.shape[0] and times[taken] <= t_end:
                    u = (times[taken] - t) / (t_end - t)
                    keep(u, h, old, now, before, after, samples[taken])
                    taken += 1
                before, after = after, before
        shape[:] = before
        return samples[:taken]

    return integrate


integrate = _cached(hashlib.sha256(Path(kernel.__file__).read_bytes()).hexdigest())
