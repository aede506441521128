"""A state's yaw inertia and the yaw momentum of its changing shape, as one model has them."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build, state_layout


@lru_cache(maxsize=32)
def yaw_momenta(structure: Structure) -> ca.Function:
    """Return ``(state, p) -> (inertia, momentum)``: momentum of yaw = inertia yaw rate + momentum of shape.

    Inertia in kg m^2, momentum in kg m^2/s; both depend on the model (`Mechanics.yaw_inertia`).
    """
    parameters, mechanics, _ = build(structure)
    layout = state_layout(structure)
    state = ca.SX.sym("state", layout.size)
    actuators, s = state[layout.actuator], structure.segments
    symbols = [mechanics.kappa, mechanics.dkappa]
    values = [state[layout.kappa], state[layout.dkappa]]
    if structure.compliant:
        symbols += [mechanics.no_load, mechanics.no_load_rate]
        values += [actuators[:s], actuators[s : 2 * s]]
    outputs = ca.substitute([mechanics.yaw_inertia(), mechanics.yaw_momentum_of_shape()], symbols, values)
    return ca.Function("yaw_momenta", [state, parameters.vector], outputs, {"cse": True})
