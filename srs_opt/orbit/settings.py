"""How other orbits are looked for, how derivatives are taken, and how many gaits are searched together."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AttractorSettings:
    """Other stable orbits of a gait.

    Attributes
    ----------
    starts : tuple of float
        Forward speeds from which the motion is simulated, over body lengths per period; no snake of this
        kind reaches one. Each costs a simulation until the motion repeats; fewer may miss an orbit.
    same : float
        Orbits whose dynamic states, scaled to speeds, differ by less are one, body lengths per second;
        Newton closes them to 1e-9.
    """

    starts: tuple[float, ...] = (-0.5, 0.25, 0.5, 0.75, 1.0)
    same: float = 0.00847457627118644


@dataclass(frozen=True)
class EnvelopeSettings:
    """The swept band.

    Attributes
    ----------
    samples : int
        Body shapes per cycle: it errs by less than 0.1 mm, with half of them by 1 mm.
    """

    samples: int = 96


@dataclass(frozen=True)
class DifferenceSettings:
    """Steps of finite differences.

    Attributes
    ----------
    velocity_m_s : float
        Of the dynamic states at a cycle's start, scaled to speeds: far below any smoothing speed of
        friction; rounding costs 1e-8 of a derivative.
    actuator : float
        Of an actuator's state, over its size: central differences err by about 1e-10 from rounding and by
        less from curvature.
    """

    velocity_m_s: float = 1e-8
    actuator: float = 1e-6


@dataclass(frozen=True)
class ChainSettings:
    """Many gaits' orbits.

    Attributes
    ----------
    chains : int
        Searched side by side, to share calls of the compiled step.
    length : int
        Gaits per chain, in which one's orbit is the guess for the next; every chain begins from rest.
    """

    chains: int = 8
    length: int = 12


@dataclass(frozen=True)
class OrbitSettings:
    """How a periodic orbit is searched. Speeds in m/s measure all dynamic states, scaled to compare.

    Attributes
    ----------
    newton_steps : int
        At most, on one mesh; six are usual.
    closed_m_s : float
        By how much the states of a closed orbit change per cycle: rounding leaves 1e-12.
    rough_m_s : float
        The same on the even first mesh: only there is the mesh worth adapting, because friction's sharp
        features move with the motion. Smaller: Newton steps that the next mesh repeats; larger: a mesh
        adapted to another motion.
    meshes : int
        Adapted at most.
    first_step_s : float
        Of the even first mesh.
    warm_up_periods : int
        Simulated from rest before the first Newton step.
    settle_periods : int
        Simulated where Newton's step does not lead nearer.
    settling_periods : int
        Simulated, on adapted meshes, where Newton fails from the warm-up's end.
    free_attempts, attempts : int
        Of a mesh for the motion from rest, in place of those of `MeshSettings`: this motion decides which
        orbit is found, so that its mesh may get coarser once more than others.
    bend_time_s : float
        Turns a bend into a rate: about 1/omega of a soft body's slowest mode.
    nearly_m_s, quiet_periods : float, int
        From rest: Newton starts where so many cycles in a row change by less than this. Larger: Newton may
        find another orbit than the one that is reached.
    nearness, farthest_m_s : float
        And its orbit counts within so many times what the last change says is left to go, and within this.
    same_m_s : float
        Allowed besides: Newton's mesh is finer than that on which the motion settled, which moves the
        orbit.
    most_periods : int
        From rest, before the motion (or the actuators alone) counts as one that does not repeat.
    actuator_step_s : float
        Runge-Kutta steps of actuators without a closed form at most: a twentieth of the built-in robot's
        shorter time constant. Smaller: as many more steps in every search; larger: a curvature whose own
        cycle is not the simulation's.
    """

    newton_steps: int = 30
    closed_m_s: float = 1e-9
    rough_m_s: float = 1e-3
    meshes: int = 4
    first_step_s: float = 0.004
    warm_up_periods: int = 2
    settle_periods: int = 5
    settling_periods: int = 10
    free_attempts: int = 4
    attempts: int = 12
    bend_time_s: float = 0.05
    nearly_m_s: float = 2e-3
    quiet_periods: int = 3
    nearness: float = 3.0
    farthest_m_s: float = 0.15
    same_m_s: float = 2e-3
    most_periods: int = 200
    actuator_step_s: float = 0.0025


ATTRACTOR = AttractorSettings()
ENVELOPE = EnvelopeSettings()
DIFFERENCE = DifferenceSettings()
CHAIN = ChainSettings()
ORBIT = OrbitSettings()
