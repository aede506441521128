"""From curvature and body velocity to forces: what both models of the paper share.

The body's state is its pose (x, y of the centre of mass, mean heading psi), the velocity
(u_x, u_y) of the centre of mass in the robot's frame, and a yaw momentum. With momenta as
states no model needs the second derivative of the curvature, so the right-hand side stays
continuous where a valve switches.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from srs_opt.effects.effect import LinkState
from srs_opt.geometry import turn_back_by, turn_by
from srs_opt.model.friction import FRICTION_LAWS
from srs_opt.model.kinematics import Chain, body_frame_chain
from srs_opt.model.parameters import Parameters


@dataclass(frozen=True)
class Forces:
    """Ground and tether forces on the links, in the robot's frame, and what they dissipate.

    Attributes
    ----------
    x, y : SX (N, 1)
        Force on each link, N.
    friction_power : SX
        Power that friction takes out of the motion, W (not negative for passive friction).
    power : SX
        Power of all external forces on the robot, W.
    """

    x: ca.SX
    y: ca.SX
    friction_power: ca.SX
    power: ca.SX


class Mechanics(ABC):
    """Kinematics, inertia and forces of one structure; a model adds its yaw equation.

    Attributes
    ----------
    kappa, dkappa : SX (N-1, 1)
        Curvatures (1/m) and their rates.
    no_load, no_load_rate : SX (N-1, 1)
        Curvatures that the actuators would give without load: the same unless segments bend under load.
    length : SX (N-1, 1)
        The chambers' lengths, m.
    time : SX
        Since the start of the motion, s: only forces of effects that are timed know it.
    shape, shape_rate : SX
        The symbols that the places of all points of the body depend on (`StateLayout.shape`), their rates.
    """

    name: ClassVar[str]  # as --model has it

    def __init__(self, parameters: Parameters) -> None:
        p = self.parameters = parameters
        self.links = n = parameters.structure.links
        self.kappa = ca.SX.sym("kappa", n - 1)
        self.dkappa = ca.SX.sym("dkappa", n - 1)
        self.time = ca.SX.sym("time")
        self.no_load, self.no_load_rate = self.without_load()
        gap, ratio = p["gap_length_m"], ca.SX(0)
        self.mass = p["link_mass_kg"] * ca.SX.ones(n, 1)
        self.inertia = p["link_inertia_kg_m2"] * ca.SX.ones(n, 1)
        for effect, e in p.effects:
            gap = gap + effect.gap_extra(e) if effect.gap_extra else gap
            ratio = ratio + effect.gap_ratio(e) if effect.gap_ratio else ratio
            self.mass = self.mass + effect.extra_mass(e, n) if effect.extra_mass else self.mass
        self.gap_length, self.gap_ratio = gap, ratio
        self.length = self.chamber_lengths(self.no_load)
        # chain rule: chambers lengthen with the curvature without load
        growth = ca.jtimes(self.length, self.no_load, self.no_load_rate)
        self.shape, self.shape_rate = self.kappa, self.dkappa
        if self.stretches and parameters.structure.compliant:
            self.shape = ca.vertcat(self.kappa, self.no_load)
            self.shape_rate = ca.vertcat(self.dkappa, self.no_load_rate)
        self.chain = body_frame_chain(self.kappa, self.mass, self.length, gap, ratio, self.dkappa, growth)
        self.chain_rate = self.chain.rates

    def without_load(self) -> tuple[ca.SX, ca.SX]:
        """Return the curvatures without load and their rates, (N-1, 1) each."""
        return self.kappa, self.dkappa

    def unloaded(self, expression: ca.SX) -> ca.SX:
        """Return an expression for bends that are those without load."""
        if not self.parameters.structure.compliant:
            return expression
        free = ca.vertcat(self.no_load, self.no_load_rate)
        return ca.substitute(expression, free, ca.vertcat(self.kappa, self.dkappa))

    @property
    def ages(self) -> bool:
        """Whether forces depend on the time since the start of the motion."""
        return any(effect.timed and effect.wheel_factors for effect, _ in self.parameters.effects)

    @property
    def stretches(self) -> bool:
        """Whether chambers lengthen as they are pressed."""
        return any(effect.stretch for effect, _ in self.parameters.effects)

    def chamber_lengths(self, no_load: ca.SX) -> ca.SX:
        """Return the chambers' lengths (N-1, 1), m, at curvatures without load."""
        longer = ca.SX.ones(self.links - 1, 1)
        for effect, e in self.parameters.effects:
            longer = longer + effect.stretch(e, no_load) if effect.stretch else longer
        return self.parameters["segment_length_m"] * longer

    @abstractmethod
    def yaw_inertia(self) -> ca.SX:
        """Return the inertia that turns yaw rate into yaw momentum, kg m^2."""

    @abstractmethod
    def yaw_momentum_of_shape(self) -> ca.SX:
        """Return the yaw momentum of the changing shape alone (yaw rate zero), kg m^2/s."""

    @abstractmethod
    def yaw_momentum_rate(self, forces: Forces, yaw_rate: ca.SX) -> ca.SX:
        """Return the rate of the yaw momentum, N m."""

    def yaw_rate(self, momentum: ca.SX) -> ca.SX:
        """Return the rate of the mean heading, rad/s."""
        # L = L_shape + I omega, solved for omega
        return (momentum - self.yaw_momentum_of_shape()) * (1 / self.yaw_inertia())

    def total_mass(self) -> ca.SX:
        """Return the robot's mass, kg."""
        return ca.sum1(self.mass)

    def normal_force(self) -> ca.SX:
        """Return the load on each link's wheels, N, (N, 1)."""
        normal = self.mass * self.parameters["gravity_m_s2"]
        for effect, e in self.parameters.effects:
            normal = normal + effect.extra_load(e, self.links) if effect.extra_load else normal
        return normal

    def link_velocities(self, u_x: ca.SX, u_y: ca.SX, yaw_rate: ca.SX) -> Chain:
        """Return the links' velocities in the robot's frame (m/s) and their turn rates (rad/s)."""
        c, d = self.chain, self.chain_rate
        # v_i = u + omega x rho_i + rho_i'
        return Chain(u_x - yaw_rate * c.y + d.x, u_y + yaw_rate * c.x + d.y, yaw_rate + d.angle)

    def forces(self, pose: ca.SX, u_x: ca.SX, u_y: ca.SX, yaw_rate: ca.SX) -> Forces:
        """Return the forces on the links, in the robot's frame, for a pose and a body velocity."""
        c, s = ca.cos(pose[2]), ca.sin(pose[2])
        chain = self.chain
        x, y = turn_by(c, s, chain.x, chain.y)
        room_x, room_y = pose[0] + x, pose[1] + y
        v = self.link_velocities(u_x, u_y, yaw_rate)
        frame = pose[2], self.time
        return self.forces_on_links(v, chain.cos, chain.sin, room_x, room_y, frame, self.kappa)

    def forces_on_links(
        self,
        v: Chain,
        cos: ca.SX,
        sin: ca.SX,
        room_x: ca.SX,
        room_y: ca.SX,
        frame: tuple[ca.SX, ca.SX],
        kappa: ca.SX,
    ) -> Forces:
        """Return the forces on links that move at `v`, in any frame.

        Friction on link i is -(normal force) [mu_t d_t t + mu_n d_n n] in wheel axes, with the
        smoothed sliding directions d of the robot's friction law (paper, Fig. 2 and Table 1).
        `cos`, `sin` are those of the links' headings in the frame, `room_x`, `room_y` their places in
        the room (effects of the room ask for them), (N, 1) each; `frame` its heading in the room and
        the time; `kappa` (N-1, 1) the curvatures.
        """
        p, n = self.parameters, self.links
        normal = self.normal_force()
        c, s = cos, sin
        curvature = _at_links(kappa)
        skews = [effect.wheel_angle(e, n) for effect, e in p.effects if effect.wheel_angle]
        skews += [effect.steering(e, curvature) for effect, e in p.effects if effect.steering]
        if skews:
            skew = sum(skews[1:], skews[0])
            c, s = turn_by(ca.cos(skew), ca.sin(skew), cos, sin)
        # wheel axes: t along the rolling direction, n to its left
        v_t, v_n = turn_back_by(c, s, v.x, v.y)
        along, across = FRICTION_LAWS[p.structure.friction_law](v_t, v_n, p["friction_speed_m_s"])
        # against the sliding direction (+1 forwards or to the left), hence the minus
        f_t = -p["friction_tangential"] * normal * along
        f_n = -p["friction_normal"] * normal * across
        for effect, e in p.effects:
            # factors scale Coulomb friction only, so they come before forces that are added
            f_t = f_t * effect.rolling_factor(e, v_t) if effect.rolling_factor else f_t
            f_n = f_n * effect.skidding_factor(e, v_n) if effect.skidding_factor else f_n
        state = LinkState(
            room_x=room_x,
            room_y=room_y,
            heading=frame[0],
            v_x=v.x,
            v_y=v.y,
            mass=self.mass,
            gravity=p["gravity_m_s2"],
            friction_speed=p["friction_speed_m_s"],
            cos=cos,
            sin=sin,
            along=v_t,
            across=v_n,
            curvature=curvature,
            time_s=frame[1],
        )
        for effect, e in p.effects:
            if effect.wheel_factors:
                on_rolling, on_skidding = effect.wheel_factors(e, state)
                f_t, f_n = f_t * on_rolling, f_n * on_skidding
        for effect, e in p.effects:
            f_t = f_t + effect.rolling_force(e, v_t) if effect.rolling_force else f_t
        # taken before other forces are added: what a tether or a slope does is no friction
        friction_power = -(ca.dot(f_t, v_t) + ca.dot(f_n, v_n))
        x, y = c * f_t - s * f_n, s * f_t + c * f_n
        for effect, e in p.effects:
            if effect.link_force:
                fx, fy = effect.link_force(e, state)
                x, y = x + fx, y + fy
        return Forces(x, y, friction_power, ca.dot(x, v.x) + ca.dot(y, v.y))

    def pose_rate(self, pose: ca.SX, velocity: ca.SX) -> ca.SX:
        """Return (x', y', psi') for the body velocity (u_x, u_y, yaw momentum)."""
        c, s = ca.cos(pose[2]), ca.sin(pose[2])
        return ca.vertcat(*turn_by(c, s, velocity[0], velocity[1]), self.yaw_rate(velocity[2]))

    def velocity_rate(self, pose: ca.SX, velocity: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the rate of (u_x, u_y, yaw momentum) and the friction power.

        Translation is N m p'' = sum f, the paper's (8) and (10), seen from the turning frame.
        """
        u_x, u_y = velocity[0], velocity[1]
        yaw_rate = self.yaw_rate(velocity[2])
        f = self.forces(pose, u_x, u_y, yaw_rate)
        # u = R(-psi) p', so u' = R(-psi) p'' - psi' e_z x u
        per_mass = 1 / self.total_mass()
        rate = ca.vertcat(
            ca.sum1(f.x) * per_mass + yaw_rate * u_y,
            ca.sum1(f.y) * per_mass - yaw_rate * u_x,
            self.yaw_momentum_rate(f, yaw_rate),
        )
        return rate, f.friction_power


def _at_links(kappa: ca.SX) -> ca.SX:
    """Return the mean curvature of the segments beside each link, (N, 1)."""
    # the end links have one neighbour only
    return ca.vertcat(kappa[0], (kappa[1:] + kappa[:-1]) / 2, kappa[-1])
