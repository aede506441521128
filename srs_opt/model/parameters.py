"""The models' parameters as symbols, and how a robot and a gait fill them with numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from srs_opt.effects import known_effects
from srs_opt.effects.effect import Effect
from srs_opt.errors import InputError, UnsupportedEffectError
from srs_opt.robot import Robot

ROBOT_PARAMETERS = (
    "segment_length_m",
    "gap_length_m",
    "link_mass_kg",
    "link_inertia_kg_m2",
    "friction_tangential",
    "friction_normal",
    "friction_speed_m_s",
    "gravity_m_s2",
    "curvature_per_pressure_1_m_kpa",
    "tau1_s",
    "tau2_s",
)
_RIGID_N_M2 = 1e15  # what is absent: below rounding beside any stiffness, and with finite derivatives
# values where the robot file says nothing; no relaxation time means that of an effect
COMPLIANCE_PARAMETERS = {
    "bending_stiffness_n_m2": _RIGID_N_M2,
    "bending_relaxation_s": 0.0,
    "gap_stiffness_n_m2": _RIGID_N_M2,
}
GAIT_PARAMETERS = ("pressure_kpa", "frequency_hz")


@dataclass(frozen=True)
class Structure:
    """What fixes the equations: number of links, laws and effects; all else is a parameter.

    Two robots with the same structure share one compiled model. `effects` lists effect
    names, sorted, once per occurrence.
    """

    model: str
    links: int
    friction_law: str
    effects: tuple[str, ...] = ()

    @staticmethod
    def of(robot: Robot, model: str | None = None, *, room: bool = True) -> Structure:
        """Return the structure of `robot` without effects of zero size.

        Without `model` the robot's own is taken (`Robot.own_model`). ``room=False`` leaves out effects that
        know the room.

        Raises
        ------
        InputError
            If the compliant model is asked for a robot without a stiffness.
        """
        present = [str(e["name"]) for e in dynamic_effects(robot, room=room) if _present(e)]
        # an effect of single places is there once for all of them
        names = tuple(
            n for k, n in enumerate(present) if not known_effects()[n].place or n not in present[:k]
        )
        structure = Structure(model or robot.own_model, robot.links, robot.friction_law, names)
        if structure.compliant and not robot.is_soft:
            raise InputError(
                f"robot '{robot.name}' is rigid: the compliant model needs bending_stiffness_n_m2 or "
                "gap_stiffness_n_m2 in the robot file (a silicone segment of this size has 0.002 to 0.02)"
            )
        return structure

    @property
    def compliant(self) -> bool:
        """Whether the bends are coordinates of their own."""
        return self.model == "compliant"

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, those of effects apart."""
        return (*ROBOT_PARAMETERS, *(COMPLIANCE_PARAMETERS if self.compliant else ()), *GAIT_PARAMETERS)

    @property
    def segments(self) -> int:
        """Number of bending segments."""
        return self.links - 1


def dynamic_effects(robot: Robot, *, room: bool = True) -> list[Mapping[str, Any]]:
    """Return the robot's effects that enter the equations of motion, in a canonical order.

    Delays act on the valve schedule and measurement effects on the camera; neither is here.
    """
    known = known_effects()
    chosen = [
        s for s in robot.effects
        if known[s["name"]].in_equations and (room or not known[s["name"]].knows_the_room)
    ]  # fmt: skip
    # sorted, so that the order in a robot file changes neither the compiled model nor the parameter vector
    order = list(known)
    return sorted(
        chosen,
        key=lambda s: (order.index(s["name"]), *[float(s[p.name]) for p in known[s["name"]].parameters]),
    )


def _present(spec: Mapping[str, Any]) -> bool:
    return bool(spec[known_effects()[spec["name"]].size.name] != 0)


def room_effects(robot: Robot) -> list[str]:
    """Return the names of the robot's effects that break the periodic orbit."""
    return [
        str(s["name"]) for s in robot.effects if known_effects()[s["name"]].knows_the_room and _present(s)
    ]


def valve_delay_s(robot: Robot) -> float:
    """Return the total delay between command and valve, s (the robot's own and that of its effects)."""
    delay = robot.valve_delay_s
    for spec in robot.effects:
        hook = known_effects()[spec["name"]].delay
        if hook is not None:
            delay += float(hook(spec))
    return delay


class Parameters:
    """Symbols of one structure, in a fixed order, with their packing from robots.

    Attributes
    ----------
    names : tuple of str
        ``friction_normal``, ..., ``pressure_kpa``, then ``0.tether_drag.force_n`` per effect; those of
        effects at single places take one entry per place (``1.segment_bias.bias[2]``).
    vector : SX (n, 1)
    """

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        symbols: dict[str, ca.SX] = {n: ca.SX.sym(n) for n in structure.parameter_names}
        self.effects: list[tuple[Effect, dict[str, ca.SX]]] = []
        for index, name in enumerate(structure.effects):
            effect = known_effects().get(name)
            if effect is None:
                raise UnsupportedEffectError(f"effect '{name}' is not part of any model")
            own = effect_symbols(effect, structure.links, f"{index}.")
            symbols |= {f"{index}.{name}.{part}": symbol for part, symbol in own.items()}
            self.effects.append((effect, own))
        self._symbols = symbols
        self.vector = ca.vertcat(*symbols.values())

    def __getitem__(self, name: str) -> ca.SX:
        return self._symbols[name]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of every entry of the packed vector."""
        names: list[str] = []
        for key, symbol in self._symbols.items():
            n = symbol.numel()
            names += [key] if n == 1 else [f"{key}[{i + 1}]" for i in range(n)]
        return tuple(names)

    def pack(self, robot: Robot, pressure_kpa: float, frequency_hz: float) -> np.ndarray:
        """Return the numbers for `robot` under one pressure and frequency, shape (n,)."""
        values: list[float] = [float(getattr(robot, name)) for name in ROBOT_PARAMETERS]
        if self.structure.compliant:
            values += [getattr(robot, n) or default for n, default in COMPLIANCE_PARAMETERS.items()]
        values += [pressure_kpa, frequency_hz]
        specs = dynamic_effects(robot, room=True)
        # effects of zero size are left out only where the structure was made without them
        if [s["name"] for s in specs if not _placed(s)] != [
            n for n in self.structure.effects if not _placed(n)
        ]:
            specs = [s for s in specs if _present(s)]
        for effect, own in self.effects:
            mine = [s for s in specs if s["name"] == effect.name]
            if effect.place is not None:
                values += _over_places(effect, mine, own)
                continue
            if not mine:
                raise ValueError(f"robot's effects {specs} do not match the structure {self.structure}")
            specs.remove(mine[0])  # of an effect that stands twice each takes its own
            values += [float(mine[0][name]) for name in own]
        return np.array(values)


def effect_symbols(effect: Effect, links: int, prefix: str = "") -> dict[str, ca.SX]:
    """Return the symbols of an effect's parameters, over all places where it sits at one."""
    count = effect.place.count(links) if effect.place else 1
    chosen = [p.name for p in effect.parameters if p is not effect.place]
    return {name: ca.SX.sym(f"{prefix}{effect.name}.{name}", count) for name in chosen}


def _placed(effect: str | Mapping[str, Any]) -> bool:
    name = effect if isinstance(effect, str) else effect["name"]
    return known_effects()[name].place is not None


def _over_places(effect: Effect, entries: list[Mapping[str, Any]], own: Mapping[str, ca.SX]) -> list[float]:
    """Return the parameters of an effect at single places, one after the other, over all places."""
    assert effect.place is not None
    found: list[float] = []
    defaults = {p.name: p.default for p in effect.parameters if p is not effect.size}
    for name, symbol in own.items():
        vector = [defaults.get(name, 0.0)] * symbol.numel()
        for entry in entries:
            vector[int(entry[effect.place.name]) - 1] = float(entry[name])
        found += vector
    return found
