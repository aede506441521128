"""The paper's complex model (8): joint forces kept, so yaw is angular momentum about the centre of mass.

Summing the rows of the Newton-Euler equations (1) and (5) removes the joint forces:
d/dt [sum m rho_i x v_i + sum J theta_i'] = sum rho_i x f_i.
"""

from __future__ import annotations

import casadi as ca

from srs_opt.model.mechanics import Forces, Mechanics


class ComplexModel(Mechanics):
    """Exact rigid-link mechanics with the curvature given by the actuators."""

    name = "complex"

    def yaw_inertia(self) -> ca.SX:
        """Return sum m |rho_i|^2 + sum J."""
        c = self.chain
        # about the centre of mass, where the body's translation carries no angular momentum
        return ca.dot(self.mass, c.x**2 + c.y**2) + ca.sum1(self.inertia)

    def yaw_momentum_of_shape(self) -> ca.SX:
        """Return sum m rho_i x rho_i' + sum J alpha_i'."""
        c, d = self.chain, self.chain_rate
        return ca.dot(self.mass, c.x * d.y - c.y * d.x) + ca.dot(self.inertia, d.angle)

    def yaw_momentum_rate(self, forces: Forces, yaw_rate: ca.SX) -> ca.SX:
        """Return the moment of the external forces about the centre of mass."""
        # joint forces act on neighbours in opposite directions and cancel in the sum
        return ca.dot(self.chain.x, forces.y) - ca.dot(self.chain.y, forces.x)
