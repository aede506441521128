"""The pneumatic segments: valve state to curvature, the paper's (14)-(15).

kappa'' = -(1/tau_1 + 1/tau_2) kappa' - kappa/(tau_1 tau_2) + K/(tau_1 tau_2), where the
target K is C0 S plus biases. Linear between switches: the response to a held valve has a
closed form, also for tau_1 = tau_2. Effects with a nonlinear restoring term or rate break it.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from srs_opt.model.effects.effect import Actuation
from srs_opt.model.parameters import Parameters

_SERIES_RADIUS = 0.1


def decay(time: ca.SX, tau1: ca.SX, tau2: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the impulse response phi(t) of the two time constants and its derivative.

    phi = (exp(-t/tau_2) - exp(-t/tau_1)) / (1/tau_1 - 1/tau_2), regular for tau_1 = tau_2 (a series
    there) and without overflow however unlike the two are.
    """
    mean = (1 / tau1 + 1 / tau2) / 2
    z = (1 / tau1 - 1 / tau2) / 2 * time
    slow, fast = ca.exp(-time / tau1), ca.exp(-time / tau2)
    small = ca.fabs(z) < _SERIES_RADIUS
    safe = ca.if_else(small, 1.0, z)
    z2 = ca.if_else(small, z * z, 0.0)
    series = 1 + z2 / 6 * (1 + z2 / 20 * (1 + z2 / 42 * (1 + z2 / 72)))  # sinh(z)/z
    phi = time * ca.if_else(small, ca.exp(-mean * time) * series, (fast - slow) / (2 * safe))
    return phi, (slow + fast) / 2 - mean * phi


@dataclass(frozen=True)
class ActuatorState:
    """Curvature (1/m), its rate (1/(m s)) and the memory of hysteresis-like effects, (N-1, 1) each."""

    kappa: ca.SX
    dkappa: ca.SX
    memory: tuple[ca.SX, ...] = ()

    def vector(self) -> ca.SX:
        """Return the stacked state."""
        return ca.vertcat(self.kappa, self.dkappa, *self.memory)


class Actuator:
    """The actuators of one structure: closed form where it exists, rates always."""

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.segments = parameters.structure.segments
        self.linear = not any(effect.nonlinear_actuator for effect, _ in parameters.effects)
        self.memories = sum(effect.remembers for effect, _ in parameters.effects)
        self.states = self.segments * (2 + self.memories)

    def unstack(self, vector: ca.SX) -> ActuatorState:
        """Split a stacked state."""
        n = self.segments
        parts = [vector[i * n : (i + 1) * n] for i in range(2 + self.memories)]
        return ActuatorState(parts[0], parts[1], tuple(parts[2:]))

    def target(self, valve: ca.SX, state: ActuatorState | None = None) -> ca.SX:
        """Return the curvature K that each segment settles at, for valve states in [-1, 1], (N-1, 1).

        Effects that depend on time ask for the `state`.
        """
        p, none = self.parameters, ca.SX.zeros(self.segments, 1)
        amplitude = p["curvature_per_pressure_1_m_kpa"] * p["pressure_kpa"]
        bias = none
        memories = iter(state.memory if state else ())
        for effect, e in p.effects:
            memory = next(memories, none) if effect.remembers else none
            if effect.command is not None:
                kappa = state.kappa if state else none
                valve = effect.command(e, Actuation(valve, kappa, p["pressure_kpa"], memory))
            if effect.gain is not None:
                amplitude = amplitude * effect.gain(e, p["frequency_hz"])
            if effect.bias is not None:
                bias = bias + effect.bias(e)
        return amplitude * valve + bias

    def rates(self, state: ActuatorState, valve: ca.SX) -> ActuatorState:
        """Return the time derivative of the actuators' state (15), effects included."""
        p = self.parameters
        slow = ca.SX.ones(self.segments, 1)
        restoring = state.kappa
        memory_rates: list[ca.SX] = []
        for effect, e in p.effects:
            memory = ca.SX.zeros(self.segments, 1)
            if effect.remembers:
                memory = state.memory[len(memory_rates)]
                own = (
                    effect.memory_rate(e, state.dkappa, memory)
                    if effect.memory_rate
                    else ca.SX.ones(memory.shape)
                )
                memory_rates.append(own)
            if effect.restoring is not None:
                restoring = restoring + effect.restoring(e, state.kappa, memory)
            if effect.slow_down is not None:
                slow = slow * effect.slow_down(e, valve, state.kappa)
            if effect.slowness is not None:
                slow = slow * effect.slowness(e, Actuation(valve, state.kappa, p["pressure_kpa"], memory))
        tau1, tau2 = p["tau1_s"] * slow, p["tau2_s"] * slow
        ddkappa = (self.target(valve, state) - restoring) / (tau1 * tau2) - (
            1 / tau1 + 1 / tau2
        ) * state.dkappa
        return ActuatorState(state.dkappa, ddkappa, tuple(memory_rates))

    def jerk(self, state: ActuatorState, valve: ca.SX) -> ca.SX:
        """Return the curvatures' third time derivatives while the valves are held, (N-1, 1)."""
        free = self.unstack(ca.SX.sym("state", self.states))
        rates = self.rates(free, valve)
        third = ca.jtimes(rates.dkappa, free.vector(), rates.vector())
        return ca.substitute(third, free.vector(), state.vector())

    def advance(self, state: ActuatorState, valve: ca.SX, time: ca.SX) -> ActuatorState:
        """Return the state after holding `valve` for `time`: exact where linear, else one RK4 step."""
        if self.linear:
            tau1, tau2 = self.parameters["tau1_s"], self.parameters["tau2_s"]
            phi, dphi = decay(time, tau1, tau2)
            offset = state.kappa - self.target(valve)
            stay = dphi + (1 / tau1 + 1 / tau2) * phi
            kappa = self.target(valve) + stay * offset + phi * state.dkappa
            dkappa = dphi * state.dkappa - phi / (tau1 * tau2) * offset
            return ActuatorState(kappa, dkappa)
        x = state.vector()

        def slope(v: ca.SX) -> ca.SX:
            return self.rates(self.unstack(v), valve).vector()

        k1 = slope(x)
        k2 = slope(x + time / 2 * k1)
        k3 = slope(x + time / 2 * k2)
        k4 = slope(x + time * k3)
        return self.unstack(x + time / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
