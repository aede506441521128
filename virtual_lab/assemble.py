"""From a truth and a trial to the tables that the compiled equations read."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from virtual_lab import kernel, soft
from virtual_lab.catalogue import ENGINE_KINDS
from virtual_lab.errors import LabError
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth
from virtual_lab.valves import delayed, merge, segment_switches, slow_to_fill

Hidden = dict[str, dict[str, float]]
STEP_OVER_DECAY = 1.8  # Runge-Kutta 4 is stable up to 2.78
LONGEST_STEP_S = 2.5e-4
SHORTEST_STEP_S = 1e-6  # a body that asks for shorter ones is rigid for every purpose
RELAXATION_S = 0.005  # of silicone, where nothing else is said


@dataclass(frozen=True)
class Factors:
    """What this trial's friction and curvature are, over the robot's."""

    friction_tangential: float = 1.0
    friction_normal: float = 1.0
    curvature: float = 1.0


NOMINAL = Factors()


@dataclass(frozen=True)
class Tables:
    """Everything the integrator needs, as arrays (columns: see the kernels).

    `segments` is that of a body which bends under load; a rigid one has none.
    """

    links: np.ndarray
    lengths: np.ndarray
    segments: np.ndarray | None
    longest_step_s: float
    ground: np.ndarray
    bend: np.ndarray
    bias: np.ndarray
    push: np.ndarray
    sign: np.ndarray
    edges: np.ndarray
    steps: np.ndarray


def assemble(
    truth: Truth, trial: Trial, end_s: float, factors: Factors = NOMINAL, refine: float = 1.0
) -> Tables:
    """Return the tables for a run to `end_s`, with steps `refine` times finer than stability asks."""
    hidden = hidden_effects(truth, trial)
    links = link_table(truth, factors, hidden)
    ground = ground_table(truth, hidden)
    edges, sign = valve_table(truth, trial, end_s, hidden)
    push = push_table(truth, trial, sign, factors, hidden)
    count = truth.parameters.links - 1
    lengths = np.full(count, truth.parameters.segment_length_m)
    if "long_segment" in hidden:
        lengths[int(hidden["long_segment"]["segment"]) - 1] *= 1.0 + hidden["long_segment"]["extra"]
    segments = segment_table(truth, lengths, ground[kernel.GAP], hidden)
    longest = longest_step_s(links, lengths, ground, segments)
    steps = np.maximum(np.ceil(np.diff(edges) * refine / longest), 1).astype(np.int64)
    bias = np.zeros(count)
    bias += hidden.get("curvature_bias", {}).get("bias", 0.0)
    if "segment_bias" in hidden:
        bias[int(hidden["segment_bias"]["segment"]) - 1] += hidden["segment_bias"]["bias"]
    bend = bend_table(truth, hidden)
    return Tables(links, lengths, segments, longest, ground, bend, bias, push, sign, edges, steps)


def segment_table(truth: Truth, lengths: np.ndarray, gap_m: float, hidden: Hidden) -> np.ndarray | None:
    """Return length, bending stiffness (chamber and gap in series) and relaxation time of every segment."""
    p = truth.parameters
    compliance = hidden.get("bending_compliance", {"flexibility": 0.0, "relaxation_s": RELAXATION_S})
    flexibility = np.full(len(lengths), compliance["flexibility"])
    if p.bending_stiffness_n_m2 is not None:
        flexibility += 1 / p.bending_stiffness_n_m2
    if p.gap_stiffness_n_m2 is not None:
        flexibility += gap_m / (lengths * p.gap_stiffness_n_m2)
    if not flexibility.any():
        return None
    own = p.bending_stiffness_n_m2 is not None or p.gap_stiffness_n_m2 is not None
    relaxation = (p.bending_relaxation_s or RELAXATION_S) if own else compliance["relaxation_s"]
    table = np.empty((len(lengths), 3))
    table[:, soft.LENGTH], table[:, soft.STIFFNESS] = lengths, 1 / flexibility
    table[:, soft.RELAXATION] = relaxation
    return table


def is_soft(truth: Truth) -> bool:
    """Return whether the body bends under load."""
    own = truth.parameters.bending_stiffness_n_m2, truth.parameters.gap_stiffness_n_m2
    flexible = dict(truth.hidden()).get("bending_compliance", {"flexibility": 0.0})
    return own != (None, None) or flexible["flexibility"] != 0


def longest_step_s(
    links: np.ndarray, lengths: np.ndarray, ground: np.ndarray, segments: np.ndarray | None
) -> float:
    """Return the step at which friction and the material's own damping are integrated stably.

    Raises
    ------
    LabError
        The body is so stiff that this would take for ever.
    """
    decay = max(fastest_decay(links, ground), 1.0)
    if segments is not None:
        stiffest = fastest_bending(links, lengths + ground[kernel.GAP], segments)
        decay += max(stiffest * segments[0, soft.RELAXATION], math.sqrt(stiffest))
    step = min(STEP_OVER_DECAY / decay, LONGEST_STEP_S)
    if step < SHORTEST_STEP_S:
        raise LabError(
            f"a stiffness of {segments[0, soft.STIFFNESS]:g} N m^2 is rigid beside the loads; leave it out"
            if segments is not None
            else "friction is smoothed over too low a speed"
        )
    return step


def fastest_bending(links: np.ndarray, pitch: np.ndarray, segments: np.ndarray) -> float:
    """Return the square of the highest bending mode's angular frequency, straight body, 1/s^2.

    Bends move links across only; a bent body's links move no more across than the straight one's, but along
    as well, which the factor allows for.
    """
    n = len(pitch)
    place = np.concatenate([[0.0], np.cumsum(pitch)])
    across = np.zeros((n + 2, n + 1))  # of every link, per motion: across, turn, bend of each segment
    turn = np.zeros((n + 2, n + 1))
    across[0], across[1], turn[1] = 1.0, place, 1.0
    for s in range(n):
        ahead = place > place[s]
        middle = place[s] + 0.5 * pitch[s]
        across[2 + s] = np.where(ahead, (place - middle) * segments[s, soft.LENGTH], 0.0)
        turn[2 + s] = np.where(ahead, segments[s, soft.LENGTH], 0.0)
    mass = (across * links[:, kernel.MASS]) @ across.T + (turn * links[:, kernel.INERTIA]) @ turn.T
    free = mass[2:, 2:] - mass[2:, :2] @ np.linalg.solve(mass[:2, :2], mass[:2, 2:])
    spring = np.diag(segments[:, soft.LENGTH] * segments[:, soft.STIFFNESS])
    return 1.3 * float(np.max(np.linalg.eigvals(np.linalg.solve(free, spring)).real))


def hidden_effects(truth: Truth, trial: Trial) -> Hidden:
    """Return the effects at work in a trial, by name."""
    hidden: Hidden = {}
    for name, values in truth.hidden(tether=trial.tether):
        if name in hidden:
            raise LabError(f"effect '{name}' is hidden twice; add up its sizes instead")
        if name in ENGINE_KINDS and truth.engine != "dart":
            raise LabError(f"effect '{name}' needs --engine dart")
        hidden[name] = values
    return hidden


def link_table(truth: Truth, factors: Factors, hidden: Hidden) -> np.ndarray:
    """Return mass, inertia, normal force, friction and toe of every link."""
    p = truth.parameters
    table = np.zeros((p.links, kernel.LINK_COLUMNS))
    table[:, kernel.MASS] = p.link_mass_kg
    table[:, kernel.INERTIA] = p.link_inertia_kg_m2
    if "head_mass" in hidden:
        table[-1, kernel.MASS] += hidden["head_mass"]["extra_kg"]
    if "payload" in hidden:
        table[int(hidden["payload"]["link"]) - 1, kernel.MASS] += hidden["payload"]["extra_kg"]
    if not (table[:, kernel.MASS] > 0).all():
        raise LabError("a link's mass must stay above 0; make the extra mass less negative")
    table[:, kernel.LOAD] = table[:, kernel.MASS] * p.gravity_m_s2
    table[0, kernel.LOAD] += hidden.get("tether_weight", {}).get("load_n", 0.0)
    table[:, kernel.MU_T] = p.friction_tangential * factors.friction_tangential
    table[:, kernel.MU_N] = p.friction_normal * factors.friction_normal
    if "stiff_wheel" in hidden:
        table[int(hidden["stiff_wheel"]["link"]) - 1, kernel.MU_T] *= 1.0 + hidden["stiff_wheel"]["excess"]
    if "worn_wheels" in hidden:
        place = np.linspace(-0.5, 0.5, p.links)
        table[:, kernel.MU_N] *= 1.0 + hidden["worn_wheels"]["gradient"] * place
    table[:, kernel.TOE] += hidden.get("wheel_toe", {}).get("angle", 0.0)
    if "single_wheel_toe" in hidden:
        one = hidden["single_wheel_toe"]
        table[int(one["link"]) - 1, kernel.TOE] += one["angle"]
    return table


# which slot of the kernel's table holds which parameter of which effect
_GROUND_SLOTS = {
    "tether_drag": {"force_n": kernel.TETHER_DRAG},
    "tether_viscous": {"damping": kernel.TETHER_DAMPING},
    "tether_pull": {"force_n": kernel.PULL, "ax_m": kernel.PULL_X, "ay_m": kernel.PULL_Y},
    "gap_bending": {"ratio": kernel.GAP_RATIO},
    "viscous_rolling": {"damping": kernel.ROLL_DAMPING},
    "stribeck": {"excess": kernel.STRIBECK, "speed": kernel.STRIBECK_SPEED},
    "slip_rate": {"per_speed": kernel.SLIP},
    "quadratic_drag": {"drag": kernel.QUADRATIC},
    "hose_spring": {
        "stiffness": kernel.HOSE,
        "ax_m": kernel.HOSE_X,
        "ay_m": kernel.HOSE_Y,
        "slack_m": kernel.HOSE_SLACK,
    },
    "hose_torsion": {"torque_n_m": kernel.TORSION},
    "carpet_edge": {"extra": kernel.CARPET, "edge_m": kernel.CARPET_EDGE},
    "reverse_friction": {"excess": kernel.REVERSE},
    "sideways_stiction": {"excess": kernel.STICTION, "speed": kernel.STICTION_SPEED},
    "bend_unloads": {"per_curv": kernel.UNLOADING},
    "bend_steers": {"per_curv": kernel.STEER},
}


def ground_table(truth: Truth, hidden: Hidden) -> np.ndarray:
    """Return the physics of wheels, tether and floor."""
    p = truth.parameters
    table = np.zeros(kernel.GROUND_SIZE)
    table[kernel.SMOOTHING] = truth.friction_speed_m_s
    table[kernel.CONE] = float(p.friction_law == "cone")
    table[kernel.STRIBECK_SPEED] = table[kernel.STICTION_SPEED] = 1.0
    for name, slots in _GROUND_SLOTS.items():
        for key, slot in slots.items():
            if name in hidden:
                table[slot] = hidden[name][key]
    table[kernel.GAP] = p.gap_length_m + hidden.get("gap_length", {}).get("extra_m", 0.0)
    if "floor_slope" in hidden:
        slope = hidden["floor_slope"]
        along = p.gravity_m_s2 * math.sin(slope["angle"])
        table[kernel.SLOPE_X] = along * math.cos(slope["direction"])
        table[kernel.SLOPE_Y] = along * math.sin(slope["direction"])
    if "carpet_edge" in hidden:
        direction = hidden["carpet_edge"]["direction"]
        table[kernel.CARPET_X], table[kernel.CARPET_Y] = math.cos(direction), math.sin(direction)
    if "floor_waves" in hidden:
        waves = hidden["floor_waves"]
        table[kernel.WAVE] = p.gravity_m_s2 * waves["slope"]
        table[kernel.WAVE_NUMBER] = 2 * math.pi / waves["wavelength_m"]
        table[kernel.WAVE_X], table[kernel.WAVE_Y] = (
            math.cos(waves["direction"]),
            math.sin(waves["direction"]),
        )
    knows_place = ("tether_pull", "hose_spring", "floor_slope", "carpet_edge", "floor_waves")
    table[kernel.PLACES] = float(any(name in hidden for name in knows_place))
    return table


def bend_table(truth: Truth, hidden: Hidden) -> np.ndarray:
    """Return the physics of the bending segments."""
    table = np.zeros(kernel.BEND_SIZE)
    table[kernel.TAU1], table[kernel.TAU2] = truth.parameters.tau1_s, truth.parameters.tau2_s
    table[kernel.ASYMMETRY] = hidden.get("fill_exhaust_asymmetry", {}).get("ratio", 0.0)
    table[kernel.STIFFENING] = hidden.get("curvature_stiffening", {}).get("per_curv2", 0.0)
    hysteresis = hidden.get("hysteresis", {"ratio": 0.0, "width": 1.0})
    table[kernel.HYSTERESIS], table[kernel.WIDTH] = hysteresis["ratio"], hysteresis["width"]
    table[kernel.DECAY] = hidden.get("tank_empties", {}).get("per_s", 0.0)
    ripple = hidden.get("compressor_ripple", {"ratio": 0.0, "frequency_hz": 0.0})
    table[kernel.RIPPLE], table[kernel.RIPPLE_HZ] = ripple["ratio"], ripple["frequency_hz"]
    table[kernel.STRETCH] = hidden.get("chamber_stretch", {}).get("per_curv2", 0.0)
    table[kernel.WARMING] = hidden.get("warming_silicone", {}).get("per_s", 0.0)
    return table


def valve_table(truth: Truth, trial: Trial, end_s: float, hidden: Hidden) -> tuple[np.ndarray, np.ndarray]:
    """Return the switch times of all valves together and S between them."""
    per_segment = []
    for segment in range(1, truth.parameters.links):
        switches = segment_switches(trial, segment, end_s)
        slow = hidden.get("slow_valve")
        if slow and int(slow["segment"]) == segment:
            switches = slow_to_fill(switches, slow["delay_s"])
        delay_s = truth.parameters.valve_delay_s + hidden.get("dead_time", {}).get("delay_s", 0.0)
        per_segment.append(delayed(switches, delay_s))
    return merge(per_segment, end_s)


def push_table(truth: Truth, trial: Trial, sign: np.ndarray, factors: Factors, hidden: Hidden) -> np.ndarray:
    """Return the curvature that the valves drive each segment to, C0 S with what acts on C0."""
    c0 = truth.parameters.curvature_per_pressure_1_m_kpa * trial.pressure_kpa * factors.curvature
    c0 *= 1.0 - hidden.get("supply_droop", {}).get("per_hz", 0.0) * trial.frequency_hz
    c0 /= 1.0 + hidden.get("bending_resistance", {}).get("ratio", 0.0)
    reach = sign.copy()
    if "crosstalk" in hidden:
        ratio = hidden["crosstalk"]["ratio"]
        reach[:, 1:] += ratio * sign[:, :-1]
        reach[:, :-1] += ratio * sign[:, 1:]
    if "leaking_segment" in hidden:
        reach[:, int(hidden["leaking_segment"]["segment"]) - 1] *= 1.0 - hidden["leaking_segment"]["loss"]
    if "lopsided_chambers" in hidden:
        reach *= 1.0 + hidden["lopsided_chambers"]["ratio"] * sign
    return c0 * reach


def fastest_decay(links: np.ndarray, ground: np.ndarray) -> float:
    """Return a bound on the rate (1/s) at which friction stops any motion of the body.

    The body moves as one, so no motion of it decays faster than a single link would alone.
    """
    grip = 1.0 + max(ground[kernel.CARPET], 0.0)
    along = links[:, kernel.MU_T] * (1.0 + ground[kernel.STRIBECK]) * (1.0 + max(ground[kernel.REVERSE], 0.0))
    along *= grip
    across = links[:, kernel.MU_N] * (1.0 + ground[kernel.STICTION])
    damping = links[:, kernel.LOAD] * np.maximum(along, across) / ground[kernel.SMOOTHING]
    damping += ground[kernel.ROLL_DAMPING] + ground[kernel.QUADRATIC]
    damping[0] += ground[kernel.TETHER_DRAG] / ground[kernel.SMOOTHING] + ground[kernel.TETHER_DAMPING]
    return float(np.max(damping / links[:, kernel.MASS]))
