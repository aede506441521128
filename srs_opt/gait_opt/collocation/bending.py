"""Collocation of the compliant model: bends and their rates are states, driven by the no-load curvature."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.bending_chain import BendingChain
from srs_opt.model.chain_derivatives import mass_matrix
from srs_opt.model.chambers import Drive
from srs_opt.model.compliant import CompliantModel


def bend_acceleration(model: CompliantModel, velocity: ca.SX, heading: ca.SX) -> ca.SX:
    """Return kappa'' (N-1, 1) from the model's own kappa, kappa', no-load curvature and its derivatives.

    Parameters
    ----------
    model : CompliantModel
    velocity : SX (3, 1)
        u_x, u_y in the robot's frame and yaw momentum.
    heading : SX
        Mean heading in the room, rad.
    """
    chain, yaw_rate = BendingChain(model), model.yaw_rate(velocity[2])
    place, rate = model.chain, model.link_velocities(velocity[0], velocity[1], yaw_rate)
    y = ca.vertcat(place.x[0], place.y[0], place.angle)
    dy = ca.vertcat(rate.x[0], rate.y[0], rate.angle)
    # where in the room does not matter: effects that know the room have no steady gait
    frame = ca.vertcat(0, 0, heading)
    drive = Drive(model.no_load, model.no_load_rate, frame, model.no_load_acceleration)
    force, _ = chain.residual(y, dy, ca.SX.zeros(chain.size, 1), drive, ca.SX(1))
    return chain.chambers(drive).ddkappa(y, dy, mass_matrix(chain, y, drive).solver()(force))
