"""How an effect's parameters and the coordinates of a fit turn into each other, by kind of parameter.

In the coordinates an effect is absent at zero and smooth around it: a size stands for itself, a size with a
direction for its two components, a size towards a point for its components as seen from the room's origin
and the logarithm of the point's nearness; a scale for its logarithm. Every place has coordinates of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca

from srs_opt.calibrate.coordinates import INFINITY, Coordinate
from srs_opt.calibrate.fit_settings import PRIOR
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import Direction, EffectParameter, Place, Scale, Towards


@dataclass(frozen=True)
class Form:
    """One effect, at one place where it has places, in the coordinates of a fit."""

    effect: Effect
    place: int | None = None

    @cached_property
    def direction(self) -> Direction | None:
        """The parameter that says in which direction the size points."""
        return next((p for p in self.effect.parameters if isinstance(p, Direction)), None)

    @cached_property
    def point(self) -> tuple[Towards, ...]:
        """The coordinates of the point to which the size points; empty when there is none."""
        return tuple(p for p in self.effect.parameters if isinstance(p, Towards))

    @cached_property
    def plain(self) -> tuple[EffectParameter, ...]:
        """Parameters that stand for themselves."""
        mixed = (self.effect.size,) if self.direction or self.point else ()
        skip = (Direction, Towards, Scale, Place)
        return tuple(p for p in self.effect.parameters if p not in mixed and not isinstance(p, skip))

    @cached_property
    def logs(self) -> tuple[Scale, ...]:
        """Parameters whose logarithm is fitted."""
        return tuple(p for p in self.effect.parameters if isinstance(p, Scale))

    @property
    def copies(self) -> int:
        """How often it stands in the equations: twice where it has a direction, once per axis of the room.

        While its size is zero the second one takes the component along y.
        """
        return 2 if self.direction or self.point else 1

    def name(self, part: str) -> str:
        """Return the name of a coordinate."""
        return f"{self.effect.name}.{part}" + ("" if self.place is None else f"[{self.place}]")

    @cached_property
    def sizes(self) -> tuple[Coordinate, ...]:
        """Coordinates that are zero when the effect is absent."""
        size, name = self.effect.size, self.effect.name
        found = [Coordinate(self.name(a), name, size.typical) for a in ("x", "y")] if self.copies == 2 else []
        found += [Coordinate(self.name(p.name), name, abs(p.typical), p.lower) for p in self.plain]
        return tuple(found)

    @cached_property
    def scales(self) -> tuple[Coordinate, ...]:
        """Coordinates that mean nothing at zero size: logarithms, within a spread of the typical one."""
        found = [(p.name, math.log(p.typical), p.spread) for p in self.logs]
        if self.point:
            found.append(("nearness", -math.log(self._distance()), PRIOR.log_nearness_sd))
        name = self.effect.name
        return tuple(
            Coordinate(self.name(f"log_{part}"), name, PRIOR.log_typical, -INFINITY, spread, start, log=True)
            for part, start, spread in found
        )

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Sizes, then scales."""
        return self.sizes + self.scales

    def _distance(self) -> float:
        return math.hypot(*(p.typical for p in self.point)) or 1.0

    def parameters(self, values: Mapping[str, Any], copy: int = 0) -> dict[str, Any]:
        """Return the effect's parameters as expressions of the coordinates, for one of its copies."""
        found = {p.name: values[self.name(p.name)] for p in self.plain}
        found |= {p.name: ca.exp(values[self.name(f"log_{p.name}")]) for p in self.logs}
        if self.copies == 2:
            x, y = values[self.name("x")], values[self.name("y")]
            there = ca.logic_or(x != 0, y != 0)
            # inner values that keep the branch not taken regular, its derivatives too
            safe_x, safe_y = ca.if_else(there, x, 1.0), ca.if_else(there, y, 0.0)
            length = ca.sqrt(safe_x**2 + safe_y**2)
            found[self.effect.size.name] = (
                ca.if_else(there, length, x) if copy == 0 else ca.if_else(there, 0.0, y)
            )
            along = (safe_x / length, safe_y / length) if copy == 0 else (ca.SX(0), ca.SX(1))
            if self.direction:
                angle = ca.atan2(safe_y, safe_x) if copy == 0 else ca.SX(math.pi / 2)
                found[self.direction.name] = angle
            for p, component in zip(self.point, along):
                found[p.name] = component * ca.exp(-values[self.name("log_nearness")])
        return found

    def entry(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the robot file's entry for fitted values."""
        whole = {c.name: values.get(c.name, c.start) for c in self.coordinates}
        found = {key: float(value) for key, value in self.parameters(whole).items()}
        if self.copies == 2 and found[self.effect.size.name] < 0:  # only along y: the copies part
            found[self.effect.size.name] *= -1
        places = {self.effect.place.name: self.place} if self.effect.place else {}
        order = [p.name for p in self.effect.parameters]
        return {"name": self.effect.name, **{k: {**found, **places}[k] for k in order}}

    def values(self, entry: Mapping[str, Any]) -> dict[str, float]:
        """Return the coordinates of a robot file's entry."""
        found = {self.name(p.name): float(entry[p.name]) for p in self.plain}
        found |= {self.name(f"log_{p.name}"): math.log(entry[p.name]) for p in self.logs}
        size = float(entry[self.effect.size.name])
        if self.direction:
            angle = entry[self.direction.name]
            found |= {self.name("x"): size * math.cos(angle), self.name("y"): size * math.sin(angle)}
        if self.point:
            x, y = (float(entry[p.name]) for p in self.point)
            # a point at the origin has no direction
            away = max(math.hypot(x, y), 1e-6)
            found |= {self.name("x"): size * x / away, self.name("y"): size * y / away}
            found[self.name("log_nearness")] = -math.log(away)
        return found

    def refitted(self, entry: Mapping[str, Any]) -> tuple[Coordinate, ...]:
        """Return the coordinates that an entry leaves free: those of parameters with a deviation.

        They start at the entry's values; the deviations of sizes are priors, in first order.
        """
        from dataclasses import replace

        sd, values = entry.get("sd", {}), self.values(entry)
        found = []
        for c in self.coordinates:
            part = c.name.split(".")[1].split("[")[0]
            if part in ("x", "y"):
                mixed = {self.effect.size.name, *(p.name for p in (self.direction, *self.point) if p)}
                if mixed & set(sd):
                    found.append(replace(c, start=values[c.name]))
            elif part == "log_nearness":
                if {p.name for p in self.point} & set(sd):
                    found.append(replace(c, start=values[c.name]))
            elif part.removeprefix("log_") in sd:
                own = sd[part.removeprefix("log_")]
                own = own / entry[part.removeprefix("log_")] if c.log else own
                found.append(replace(c, start=values[c.name], prior_sd=own))
        return tuple(found)


def forms_of(effect: Effect, links: int) -> tuple[Form, ...]:
    """Return an effect's forms, one per place."""
    if effect.place is None:
        return (Form(effect),)
    return tuple(Form(effect, k) for k in range(1, effect.place.count(links) + 1))


def form_of_entry(entry: Mapping[str, Any]) -> Form:
    """Return the form of a robot file's entry."""
    from srs_opt.effects import known_effects

    effect = known_effects()[entry["name"]]
    return Form(effect, int(entry[effect.place.name]) if effect.place else None)
