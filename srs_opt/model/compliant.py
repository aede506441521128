"""The compliant model: the bends q_i = l kappa_i are coordinates, driven through the bending stiffness.

The actuators (13)-(15) give the no-load curvature kappa0; a segment answers with the bending moment

    Q_i = (EI/l) [l kappa0_i - q_i + t_r (l kappa0_i' - q_i')],

conjugate to q_i. EI is that of the chamber, the gap's spring and effects in series, t_r the material's
relaxation time. EI to infinity is the complex model (8).
"""

from __future__ import annotations

import casadi as ca

from srs_opt.model.complex import ComplexModel
from srs_opt.model.parameters import Parameters


class CompliantModel(ComplexModel):
    """The complex model's bodies and ground with segments that bend under load.

    Attributes
    ----------
    no_load_acceleration : SX (N-1, 1)
        Second time derivative of the curvatures without load (chambers that lengthen feel it).
    """

    name = "compliant"

    def __init__(self, parameters: Parameters) -> None:
        super().__init__(parameters)
        self.no_load_acceleration = ca.SX.sym("no_load_acceleration", self.links - 1)

    def without_load(self) -> tuple[ca.SX, ca.SX]:
        """Return the symbols of the no-load curvatures and their rates, which the actuators give."""
        return ca.SX.sym("no_load", self.links - 1), ca.SX.sym("no_load_rate", self.links - 1)

    def stiffness(self) -> ca.SX:
        """Return EI of a segment, N m^2: chamber, gap and effects in series, 1/EI + L_o/(l EI_gap) + ..."""
        p = self.parameters
        # springs in series: flexibilities add
        flexibility = self.gap_length / (p["segment_length_m"] * p["gap_stiffness_n_m2"])
        flexibility = flexibility + 1 / p["bending_stiffness_n_m2"]
        for effect, e in p.effects:
            flexibility = flexibility + effect.flexibility(e) if effect.flexibility else flexibility
        return 1 / flexibility

    def relaxation(self) -> ca.SX:
        """Return the material's relaxation time, s: the robot's, else an effect's."""
        found = own = self.parameters["bending_relaxation_s"]
        for effect, e in self.parameters.effects:
            found = ca.if_else(own > 0, own, effect.relaxation(e)) if effect.relaxation else found
        return found

    def moment(self, kappa: ca.SX, dkappa: ca.SX, no_load: ca.SX, no_load_rate: ca.SX) -> ca.SX:
        """Return the bending moments Q, N m, conjugate to l kappa, (N-1, 1)."""
        # Q > 0 bends the segment further to the left, towards its no-load curvature
        slack = no_load - kappa + self.relaxation() * (no_load_rate - dkappa)
        return self.stiffness() * slack

    def elastic_energy(self) -> ca.SX:
        """Return the energy stored in the segments, J: sum l EI (kappa0 - kappa)^2 / 2."""
        return (
            self.parameters["segment_length_m"] * self.stiffness() * ca.sumsqr(self.no_load - self.kappa) / 2
        )

    def pressure_power(self) -> ca.SX:
        """Return the power that the pressure puts in, W: sum Q l kappa0'."""
        q = self.moment(self.kappa, self.dkappa, self.no_load, self.no_load_rate)
        return self.parameters["segment_length_m"] * ca.dot(q, self.no_load_rate)

    def material_loss(self) -> ca.SX:
        """Return the power lost in the material, W: sum l EI t_r (kappa0' - kappa')^2."""
        rate = ca.sumsqr(self.no_load_rate - self.dkappa)
        return self.parameters["segment_length_m"] * self.stiffness() * self.relaxation() * rate

    def kinetic_energy(self, velocity: ca.SX) -> ca.SX:
        """Return the kinetic energy, J, for the body velocity (u_x, u_y, yaw momentum)."""
        v = self.link_velocities(velocity[0], velocity[1], self.yaw_rate(velocity[2]))
        return (ca.dot(self.mass, v.x**2 + v.y**2) + ca.dot(self.inertia, v.angle**2)) / 2
