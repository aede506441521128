"""An objective: a merit to be made large, constraints, and the motion that it asks for by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from srs_opt import plugins
from srs_opt.errors import InputError
from srs_opt.gait_opt.objectives.cycle import SAMPLES, SCALARS, GaitCycle

Formula = Callable[[GaitCycle], Any]
TURNS = ("straight", "side", "any")


@dataclass(frozen=True)
class Objective:
    """What a gait is optimized for.

    Attributes
    ----------
    name : str
    merit : callable
        Takes a `GaitCycle`, returns what is to be as large as possible. Scale it so that 0.001 matters
        little and 1 is a lot: tolerances of the search are of that size.
    what : str
        For people, in a few words.
    constraints : tuple of callables
        Each takes a `GaitCycle` and returns an expression that must not be negative, or
        ``(low, expression, high)``. They hold for every robot. A miss of 0.01 counts as one.
    turn : {"straight", "side", "any"}
        The turn where no radius or turn rate is wanted: none; one to the wanted side; any.
    least_speed : bool
        Whether the gait has to keep `Goal.least_speed_m_s` (0.02 m/s unless told) or the wanted speed.
    needs_speed : bool
        Whether a wanted speed must be given.
    quick : bool
        Whether rough optima found early do, as where nothing but the speed straight ahead counts.
    unit : str
        Of what the merit stands for, with its sense ("m/s", "m less radius").
    unit_per_merit : float
        How many of them a merit of 1 is.
    unless_turn : Objective, optional
        What takes its place where no radius or turn rate is wanted.
    definition : str
        Hash of the formulas; two objectives are equal where name and definition are.
    """

    name: str
    merit: Formula = field(compare=False, repr=False)
    what: str = field(default="", compare=False, repr=False)
    constraints: tuple[Formula, ...] = field(default=(), compare=False, repr=False)
    turn: str = "straight"
    least_speed: bool = False
    needs_speed: bool = False
    quick: bool = False
    unit: str = field(default="", compare=False, repr=False)
    unit_per_merit: float = field(default=1.0, compare=False, repr=False)
    unless_turn: Objective | None = None
    definition: str = field(init=False)

    def __post_init__(self) -> None:
        if self.turn not in TURNS:
            raise InputError(f"objective '{self.name}': turn must be one of {', '.join(TURNS)}")
        for formula in (self.merit, *self.constraints):
            if not callable(formula):
                raise InputError(f"objective '{self.name}': expected functions of a gait's cycle")
        object.__setattr__(self, "definition", plugins.digest((self.merit, *self.constraints)))

    def __reduce__(self) -> tuple[Any, ...]:
        state = {k: v for k, v in vars(self).items() if k != "definition"}
        return _restored, (plugins.dumped(state, (self.merit, *self.constraints)),)


def _restored(state: bytes) -> Objective:
    import pickle

    return Objective(**pickle.loads(state))


@dataclass(frozen=True)
class Formulas:
    """An objective's formulas for robots with so many segments, valves with so many intervals.

    Attributes
    ----------
    function : Function
        ``(scalars, switches, curvature) -> (merit, constraints)``; scalars as in `SCALARS`, switches segment
        by segment (all on, all off), curvature (segments, SAMPLES).
    low, high : arrays
        Bounds of the constraints.
    names : tuple of str
        The constraints' functions, one per row.
    uses_band, uses_curvature, uses_switches : bool
        What the formulas depend on.
    """

    function: ca.Function
    low: np.ndarray
    high: np.ndarray
    names: tuple[str, ...]
    uses_band: bool
    uses_curvature: bool
    uses_switches: bool

    def __call__(
        self, scalars: np.ndarray, switches: np.ndarray, curvature: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Return merit and constraints in numbers; a merit that is no finite number is a very bad one."""
        merit, rows = self.function(scalars, switches, curvature)
        value = float(merit)
        # a search goes on past a merit that is not a number
        return value if np.isfinite(value) else -1e4, np.asarray(rows).ravel()


@lru_cache(maxsize=64)
def formulas(objective: Objective, segments: int, intervals: int) -> Formulas:
    """Return the objective's formulas.

    Raises
    ------
    InputError
        If a function fails or returns something else than it should.
    """
    scalars = [ca.SX.sym(name) for name in SCALARS]
    switches = ca.SX.sym("switches", 2 * intervals * segments)
    curvature = ca.SX.sym("curvature", segments, SAMPLES)
    table = ca.reshape(switches, 2 * intervals, segments).T
    cycle = GaitCycle(
        **dict(zip(SCALARS, scalars)),
        on=table[:, :intervals],
        off=table[:, intervals:],
        curvature_1_m=curvature,
    )
    merit = _scalar(objective, objective.merit, _called(objective, objective.merit, cycle))
    rows, low, high, names = [], [], [], []
    for constraint in objective.constraints:
        least, value, most = _bounded(objective, constraint, _called(objective, constraint, cycle))
        rows.append(value)
        low += [least] * value.numel()
        high += [most] * value.numel()
        names += [_name(constraint)] * value.numel()
    both = ca.vertcat(merit, *rows)
    place = {name: k for k, name in enumerate(SCALARS)}
    band = ca.vertcat(scalars[place["left_m"]], scalars[place["right_m"]])
    function = ca.Function(
        "objective", [ca.vertcat(*scalars), switches, curvature], [merit, ca.vertcat(ca.SX(0, 1), *rows)]
    )
    return Formulas(
        function,
        np.array(low),
        np.array(high),
        tuple(names),
        bool(ca.depends_on(both, band)),
        bool(ca.depends_on(both, ca.vec(curvature))),
        bool(ca.depends_on(both, switches)),
    )


def _name(formula: Formula) -> str:
    return getattr(formula, "__name__", type(formula).__name__)


def _called(objective: Objective, formula: Formula, cycle: GaitCycle) -> Any:
    try:
        return formula(cycle)
    except Exception as error:
        raise InputError(
            f"objective '{objective.name}': {_name(formula)} fails: {type(error).__name__}: {error}"
        ) from error


def _expression(objective: Objective, formula: Formula, value: Any) -> ca.SX:
    try:
        return ca.SX(value)
    except (NotImplementedError, TypeError) as error:
        raise InputError(
            f"objective '{objective.name}': {_name(formula)} must return a CasADi expression of the cycle, "
            f"found {type(value).__name__}"
        ) from error


def _scalar(objective: Objective, formula: Formula, value: Any) -> ca.SX:
    expression = _expression(objective, formula, value)
    if expression.numel() != 1:
        raise InputError(
            f"objective '{objective.name}': {_name(formula)} must return one number, found {expression.shape}"
        )
    return expression


def _bounded(objective: Objective, formula: Formula, value: Any) -> tuple[float, ca.SX, float]:
    if not isinstance(value, tuple):
        return 0.0, ca.vec(_expression(objective, formula, value)), np.inf
    try:
        least, inner, most = value
        low, high = float(least), float(most)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InputError(
            f"objective '{objective.name}': {_name(formula)} must return an expression (not negative) or "
            "(low, expression, high) with numbers low <= high"
        ) from error
    if not low <= high:
        raise InputError(f"objective '{objective.name}': {_name(formula)} has bounds {low:g} > {high:g}")
    return low, ca.vec(_expression(objective, formula, inner)), high
