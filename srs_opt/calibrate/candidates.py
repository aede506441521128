"""What a fit may add to the model: every effect at every place; and what a robot's own entries leave free."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from srs_opt.calibrate.coordinates import Coordinate, base_coordinates
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.fit_settings import DERIVATIVE
from srs_opt.calibrate.forms import Form, form_of_entry, forms_of
from srs_opt.effects import all_effects
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Candidate:
    """One effect at one place: what a fit adds to the model.

    Attributes
    ----------
    form : Form
    """

    form: Form

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.form.effect.name

    @property
    def place(self) -> int | None:
        """Link or segment, from 1."""
        return self.form.place

    @property
    def sizes(self) -> tuple[Coordinate, ...]:
        """Coordinates that are zero when the effect is absent."""
        return self.form.sizes

    @property
    def scales(self) -> tuple[Coordinate, ...]:
        """Logs that mean nothing at zero size."""
        return self.form.scales

    @property
    def label(self) -> str:
        """Name with the place, for people."""
        return self.effect if self.place is None else f"{self.effect}[{self.place}]"

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Sizes, then scales."""
        return self.form.coordinates


def all_candidates(links: int, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
    """Return every effect at every place of a robot with `links` links (or those of the given names)."""
    chosen = None if names is None else set(names)
    effects = [e for name, e in all_effects().items() if chosen is None or name in chosen]
    return tuple(Candidate(form) for effect in effects for form in forms_of(effect, links))


def fitted_coordinates(robot: Robot) -> tuple[Coordinate, ...]:
    """Return what every fit moves: robot parameters, and effects of the robot file that have a deviation."""
    own = (c for entry in robot.effects for c in form_of_entry(entry).refitted(entry))
    return (*base_coordinates(robot), *own)


def effect_spec(candidate: Candidate, values: Mapping[str, float]) -> dict[str, Any]:
    """Return the robot file's entry for a fitted candidate."""
    return candidate.form.entry(values)


def entry_sd(form: Form, fit: Fit) -> dict[str, float]:
    """Return the standard deviations of an effect's parameters after a fit, to first order.

    Places have none, nor has what the fit did not move.
    """
    names = [c.name for c in fit.coordinates]
    free = [c for c in form.coordinates if c.name in names]
    own = [names.index(c.name) for c in free]
    values = {c.name: fit.point.values.get(c.name, c.start) for c in form.coordinates}
    keys = [p.name for p in form.effect.parameters if p is not form.effect.place]
    jacobian = np.zeros((len(keys), len(own)))
    for j, c in enumerate(free):
        h = DERIVATIVE.central_step * c.typical
        ends = [form.entry({**values, c.name: values[c.name] + s * h}) for s in (1, -1)]
        for i, key in enumerate(keys):
            change = ends[0][key] - ends[1][key]
            if form.direction is not None and key == form.direction.name:
                # angles on either side of the cut differ by a whole turn
                change = math.remainder(change, 2 * math.pi)
            jacobian[i, j] = change / (2 * h)
    variances = np.diag(jacobian @ fit.covariance[np.ix_(own, own)] @ jacobian.T)
    # rounding can leave a variance just below zero
    return {k: float(math.sqrt(max(v, 0.0))) for k, v in zip(keys, variances)}


def entry_after(entry: Mapping[str, Any], fit: Fit) -> dict[str, Any]:
    """Return a robot file's entry with what a fit found for the parameters that have a deviation."""
    form = form_of_entry(entry)
    if not form.refitted(entry):
        return dict(entry)
    moved = {c.name: fit.point.values[c.name] for c in form.refitted(entry) if c.name in fit.point.values}
    return with_sd(form.entry({**form.values(entry), **moved}), entry_sd(form, fit))


def with_sd(entry: Mapping[str, Any], sd: Mapping[str, float]) -> dict[str, Any]:
    """Return an entry with its deviations; a parameter at its bound has none."""
    known = {key: value for key, value in sd.items() if value > 0}
    return {**entry, "sd": known} if known else dict(entry)
