"""A manoeuvre.json played in the engine: its valves, after cycles of the gait that it begins in."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dart_snake.engine import Snake
from srs_opt.document import read_json
from srs_opt.errors import InputError
from srs_opt.gait import Gait, check_gait
from srs_opt.geometry import distance_along, rotate
from srs_opt.judge.bodies import body_of, pull_of
from srs_opt.judge.replay import Drift, play_blind, whole_step_s
from srs_opt.judge.settings import ENGINE, REPLAY, EngineSettings
from srs_opt.orbit.body import integrator
from srs_opt.robot import Robot
from srs_opt.simulate.timeline import Timeline
from srs_opt.simulate.valve_file import read_valves

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Played(Drift):
    """A manoeuvre in the engine; places are in the frame of centre of mass and mean heading at its start.

    Attributes
    ----------
    turn_rad, our_turn_rad : float
        By which the mean heading has turned.
    """

    turn_rad: float
    our_turn_rad: float

    def to_record(self) -> dict[str, Any]:
        """Return the `manoeuvre` entry of judge.json."""
        return {
            **super().to_record(),
            "turn_rad": round(self.turn_rad, 6),
            "our_turn_rad": round(self.our_turn_rad, 6),
        }

    def in_words(self) -> str:
        """Return what happened, in a line."""
        return (
            f"{'agrees' if self.agrees else 'DISAGREES'}: the manoeuvre, played open loop: "
            f"{1e3 * self.drift_m:.1f} mm from ours after {self.way_m:.2f} m, turned by "
            f"{self.turn_rad:+.3f} rad (ours {self.our_turn_rad:+.3f})"
        )


def load_manoeuvre(file: str, robot: Robot) -> tuple[Timeline, Gait | None]:
    """Return the valves of a manoeuvre (valves.csv beside its JSON) and the gait that it begins in, if any.

    Raises
    ------
    InputError
        If the file is no manoeuvre, or one of another robot.
    """
    path = Path(file)
    record = read_json(path, "a manoeuvre (JSON of srs_opt.manoeuvre)").value
    if not isinstance(record, dict) or not isinstance(record.get("start"), dict):
        raise InputError(f"{file}: expected a key 'start', as srs_opt.manoeuvre writes it")
    begun = record["start"].get("gait")
    gait = None
    if begun is not None:
        try:
            gait = Gait.of_record(begun)
        except (KeyError, TypeError) as error:
            raise InputError(f"{file}: start: its gait lacks {error}") from error
        check_gait(robot, gait)
    return read_valves(str(path.with_name("valves.csv")), robot.segments), gait


def replay_manoeuvre(
    robot: Robot,
    valves: Timeline,
    before: Gait | None,
    model: str = "complex",
    settings: EngineSettings = ENGINE,
) -> Played:
    """Play a manoeuvre here and in the engine, both from rest (and some cycles of the gait before).

    A constant delay of the valves only shifts both in time and is left out.
    """
    robot = robot.with_values(valve_delay_s=0.0)
    lead_s = 0.0 if before is None else REPLAY.cycles_before * before.period_s
    whole = valves if before is None else Timeline.join([Timeline.of_gait(before, lead_s), valves])
    run = integrator(robot, model)
    run.check_played_once()
    path = run.integrate(whole, run.rest())
    step_s = whole_step_s(whole.end_s, settings)
    snake = Snake(body_of(robot), step_s=step_s, pairs=settings.pairs, pull=pull_of(robot, room=False))
    seen, centre = play_blind(robot, snake, whole)
    heading = seen.theta_rad.mean(axis=1)
    began = seen.time_s >= lead_s - 1e-9 if before is not None else np.ones(len(centre), dtype=bool)
    first = int(np.flatnonzero(began)[0])
    # from rest the motion begins before the engine's first row
    theirs0 = np.zeros(3) if before is None else np.array([*centre[first], heading[first]])
    times = seen.time_s[began]
    pose = path.at(times)[0]
    ours0 = np.zeros(3) if before is None else pose[0]
    there, here = _in_frame(centre[began], theirs0), _in_frame(pose[:, :2], ours0)
    lines = _in_frame(seen.line_m[began].reshape(-1, 2), theirs0).reshape(len(times), -1, 2)
    return Played(
        "manoeuvre",
        float(np.hypot(*(there[-1] - here[-1]))),
        float(distance_along(here)[-1]),
        robot.length_m,
        times - (times[0] if before is not None else 0.0),
        there,
        lines,
        here,
        float(heading[-1] - theirs0[2]),
        float(pose[-1, 2] - ours0[2]),
    )


def _in_frame(points: Array, origin: Array) -> Array:
    """Return points (n, 2) as seen from a pose."""
    x, y = rotate(-origin[2], points[:, 0] - origin[0], points[:, 1] - origin[1])
    return np.stack([x, y], axis=1)
