"""A friction coefficient with its uncertainty, and which friction it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["breakaway", "sliding"]


@dataclass(frozen=True)
class FrictionEstimate:
    """Coefficient of friction in one direction.

    Attributes
    ----------
    direction : {"tangential", "normal"}
    kind : {"breakaway", "sliding"}
        Breakaway is what starts the motion, sliding what goes on during it. Models of the moving robot
        need sliding friction; breakaway is an upper bound for it.
    mean, sd, standard_error : float
        Over repeats; the last two are None for a single one.
    repeats : int
    """

    direction: str
    kind: Kind
    mean: float
    sd: float | None
    standard_error: float | None
    repeats: int
