"""The paper's simplified model (10)-(12): joint forces ignored.

Yaw: sum j(i) theta_i'' = sum over links of the moments about link i of its neighbours'
friction forces, with j(i) of (4). Its yaw inertia is too small by design (8/3 m l^2 against
10 m l^2 for five point masses in line); that is the approximation, and it is kept.
"""

from __future__ import annotations

import casadi as ca

from srs_opt.model.kinematics import chord_length
from srs_opt.model.mechanics import Forces, Mechanics


class SimplifiedModel(Mechanics):
    """Translation exact, yaw from neighbours' friction moments only."""

    name = "simplified"

    def _link_inertia(self) -> ca.SX:
        """Return j(i) of (4), (N, 1): a third of m l^2 for every arc that ends at the link."""
        # the arms are those of (3)
        arms2 = chord_length(self.kappa, self.length) ** 2
        zero = ca.SX(0)
        return self.mass / 3 * (ca.vertcat(zero, arms2) + ca.vertcat(arms2, zero))

    def yaw_inertia(self) -> ca.SX:
        """Return sum j(i)."""
        return ca.sum1(self._link_inertia())

    def yaw_momentum_of_shape(self) -> ca.SX:
        """Return sum j(i) alpha_i'."""
        return ca.dot(self._link_inertia(), self.chain_rate.angle)

    def yaw_momentum_rate(self, forces: Forces, yaw_rate: ca.SX) -> ca.SX:
        """Return the neighbours' moments plus sum j'(i) theta_i' (the momentum's j varies with the bend)."""
        # the friction terms of (12), summed over the links: neighbours' forces at the arms between them
        x, y = self.chain.x, self.chain.y
        moment = ca.SX(0)
        for i in range(self.links):
            for k in (i - 1, i + 1):
                if 0 <= k < self.links:
                    moment += (x[k] - x[i]) * forces.y[k] - (y[k] - y[i]) * forces.x[k]
        inertia_rate = ca.jtimes(self._link_inertia(), self.kappa, self.dkappa)
        return moment + ca.dot(inertia_rate, yaw_rate + self.chain_rate.angle)
