"""How a mesh follows a motion, and what is read from a simulated one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StepSettings:
    """The steps of a mesh that is adapted.

    Attributes
    ----------
    largest_change : float
        Factor at most by which a step becomes shorter or longer at once: estimates of the error hold no
        further.
    beside : float
        Share of a step's density of new steps that its neighbours get at least: features move a little when
        steps change.
    most_per_s, most : int
        Of a motion that still deserves the name; parameters far from any robot's ask for millions, and
        gigabytes.
    """

    largest_change: float = 4.0
    beside: float = 0.7
    most_per_s: int = 50_000
    most: int = 20_000


@dataclass(frozen=True)
class MotionSettings:
    """What is reported of a motion.

    Attributes
    ----------
    straight_radius_m : float
        A larger radius is reported as straight.
    checked_cycles : int
        Integrated again for the estimate of the error: friction and valves repeat, and so does the error.
    finer : float
        Ratio of the tolerances of the two integrations; the finer one's error is then negligible.
    """

    straight_radius_m: float = 50.0
    checked_cycles: int = 4
    finer: float = 16.0


@dataclass(frozen=True)
class MeshSettings:
    """When a mesh is fine enough, and how long that is tried.

    Attributes
    ----------
    accepted : float
        A mesh serves while no step errs by more than this many tolerances: friction forgets an error of speed
        within milliseconds, so that single steps may be worse. Half: the error of the track as it is;
        double: a fifth more. The tolerance is what changes it.
    free_attempts : int
        Attempts in which the new mesh may be coarser in places. A stretch at rest looks easy until its steps
        are longer than what happens at its end; after these attempts a mesh only gets finer.
    attempts : int
        Integrations at most; the last is taken as it is. With four, trials were left a millimetre off where
        friction is sharpest.
    halvings : int
        Of a mesh whose steps are so long that the motion leaves what numbers can hold.
    wasteful : float
        A mesh of which this share of the steps would do is made anew although it serves. 0: never.
    """

    accepted: float = 8.0
    free_attempts: int = 3
    attempts: int = 13
    halvings: int = 5
    wasteful: float = 0.0


@dataclass(frozen=True)
class IntegrationSettings:
    """How finely a timeline is integrated.

    Attributes
    ----------
    tolerance_m_s : float
        Local error of the body's speed per step: about 1e-4 of the distance travelled. An error of 1/16 takes
        twice as many steps.
    first_step_s : float
        First guess of the steps; only what the first attempt costs depends on it.
    most_alike : int
        Alike pieces integrated in one call. More: more is integrated in vain where the mesh stops serving.
    longest_phases : int
        Phases of one piece at most, where a gait switches its valves so often: a mesh is adapted as a whole.
    """

    tolerance_m_s: float = 3e-5
    first_step_s: float = 0.005
    most_alike: int = 32
    longest_phases: int = 400


STEP = StepSettings()
MOTION = MotionSettings()
MESH = MeshSettings()
INTEGRATION = IntegrationSettings()
