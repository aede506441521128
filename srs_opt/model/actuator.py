"""The pneumatic segments of a structure: valve state to curvature, with the effects that act on it.

The law is that of `srs_opt.model.actuator_law`, (14)-(15), with the target K = C0 S plus biases. Effects
with a nonlinear restoring term or rate break its closed form; then it is integrated.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from srs_opt.effects.effect import Actuation, Effect, Symbols
from srs_opt.model.actuator_law import acceleration, held
from srs_opt.model.parameters import Parameters


@dataclass(frozen=True)
class ActuatorState:
    """Curvature (1/m), its rate (1/(m s)) and the memory of hysteresis-like effects, (N-1, 1) each; the time.

    The time (s) is there where effects depend on it.
    """

    kappa: ca.SX
    dkappa: ca.SX
    memory: tuple[ca.SX, ...] = ()
    clock: ca.SX | None = None

    @property
    def time_s(self) -> ca.SX:
        """Time since the start of the motion; zero where no effect depends on it."""
        return ca.SX(0) if self.clock is None else self.clock

    def vector(self) -> ca.SX:
        """Return the stacked state."""
        return ca.vertcat(
            self.kappa, self.dkappa, *self.memory, *([] if self.clock is None else [self.clock])
        )


class Actuator:
    """The actuators of one structure: closed form where it exists, rates always."""

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.segments = parameters.structure.segments
        self.linear = not any(effect.nonlinear_actuator for effect, _ in parameters.effects)
        self.memories = sum(effect.remembers for effect, _ in parameters.effects)
        self.timed = any(effect.timed for effect, _ in parameters.effects)
        frequency = parameters["frequency_hz"]
        # effects that go by the gait's frequency, which valves that are played once do not have
        self.by_frequency = tuple(
            effect.name
            for effect, e in parameters.effects
            if effect.gain and ca.depends_on(ca.SX(effect.gain(e, frequency)), frequency)
        )
        self.states = self.segments * (2 + self.memories) + self.timed

    def unstack(self, vector: ca.SX) -> ActuatorState:
        """Split a stacked state."""
        n = self.segments
        parts = [vector[i * n : (i + 1) * n] for i in range(2 + self.memories)]
        return ActuatorState(parts[0], parts[1], tuple(parts[2:]), vector[-1] if self.timed else None)

    def target(self, valve: ca.SX, state: ActuatorState | None = None) -> ca.SX:
        """Return the curvature K that each segment settles at, for valve states in [-1, 1], (N-1, 1).

        Effects that depend on time or have a state of their own ask for the `state`.
        """
        p, none = self.parameters, ca.SX.zeros(self.segments, 1)
        # C_0 of (14), proportional to the pressure
        amplitude = p["curvature_per_pressure_1_m_kpa"] * p["pressure_kpa"]
        bias = none
        memories = iter(state.memory if state else ())
        for effect, e in p.effects:
            memory = next(memories, none) if effect.remembers else none
            if effect.command is not None:
                kappa, time = (state.kappa, state.time_s) if state else (none, ca.SX(0))
                # commands act one after the other, in the effects' canonical order
                valve = effect.command(e, Actuation(valve, kappa, p["pressure_kpa"], time, memory))
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
                # memories stand in the order of the effects that remember
                memory = state.memory[len(memory_rates)]
            acting = Actuation(valve, state.kappa, p["pressure_kpa"], state.time_s, memory)
            if effect.remembers:
                memory_rates.append(_memory_rate(effect, e, state, acting))
            if effect.restoring is not None:
                restoring = restoring + effect.restoring(e, state.kappa, memory)
            if effect.slow_down is not None:
                slow = slow * effect.slow_down(e, valve, state.kappa)
            if effect.slowness is not None:
                slow = slow * effect.slowness(e, acting)
        # both stretch alike, so that the shape of the response (14) stays
        tau1, tau2 = p["tau1_s"] * slow, p["tau2_s"] * slow
        ddkappa = acceleration(self.target(valve, state), restoring, state.dkappa, tau1, tau2)
        clock = None if state.clock is None else ca.SX(1)
        return ActuatorState(state.dkappa, ddkappa, tuple(memory_rates), clock)

    def jerk(self, state: ActuatorState, valve: ca.SX) -> ca.SX:
        """Return the curvatures' third time derivatives while the valves are held, (N-1, 1)."""
        free = self.unstack(ca.SX.sym("state", self.states))
        rates = self.rates(free, valve)
        # chain rule along the motion: d kappa''/dt = (d kappa''/dx) x', the valve constant
        third = ca.jtimes(rates.dkappa, free.vector(), rates.vector())
        return ca.substitute(third, free.vector(), state.vector())

    def advance(self, state: ActuatorState, valve: ca.SX, time: ca.SX) -> ActuatorState:
        """Return the state after holding `valve` for `time`: exact where linear, else one RK4 step."""
        if self.linear:
            tau1, tau2 = self.parameters["tau1_s"], self.parameters["tau2_s"]
            return ActuatorState(*held(self.target(valve), state.kappa, state.dkappa, time, tau1, tau2))
        x = state.vector()

        def rate(v: ca.SX) -> ca.SX:
            return self.rates(self.unstack(v), valve).vector()

        k1 = rate(x)
        k2 = rate(x + time / 2 * k1)
        k3 = rate(x + time / 2 * k2)
        k4 = rate(x + time * k3)
        return self.unstack(x + time / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


def _memory_rate(effect: Effect, e: Symbols, state: ActuatorState, acting: Actuation) -> ca.SX:
    if effect.memory_rate is not None:
        return effect.memory_rate(e, state.dkappa, acting.memory)
    assert effect.state_rate is not None
    return effect.state_rate(e, acting)
