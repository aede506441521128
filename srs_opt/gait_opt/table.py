"""Gait tables: families of certified gaits that a controller plays and the planner drives with."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.document import Document, load_schema, read_yaml, validate
from srs_opt.errors import InputError
from srs_opt.files import write_text
from srs_opt.gait import Gait
from srs_opt.gait_opt.changes import Changes, Moved
from srs_opt.gait_opt.table_settings import TABLE, TableSettings
from srs_opt.orbit.steady import Orbit
from srs_opt.result import Result
from srs_opt.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VERSION = 1


@dataclass(frozen=True)
class EntryCertificate:
    """What simulation found of an entry that passed; see `RobotCertificate` for the checks.

    Attributes
    ----------
    relative_error : float
        Of the speed that direct collocation claims for the gait, beside the simulated one.
    periodicity_gap, largest_floquet_multiplier, standing_start_m_s : float
    self_clearance_m : float or None
        Least room between parts of the body that are not neighbours; None for a body too short to have any.
    """

    relative_error: float
    periodicity_gap: float
    largest_floquet_multiplier: float
    standing_start_m_s: float
    self_clearance_m: float | None

    def settling_s(self, period_s: float) -> float:
        """Return the time in which a disturbance decays to 1/e: -period / ln(largest multiplier)."""
        multiplier = self.largest_floquet_multiplier
        # a disturbance falls by the multiplier once per period
        return -period_s / math.log(multiplier) if multiplier > 0 else 0.0


@dataclass(frozen=True)
class TableGait:
    """One gait of a table with its steady motion.

    Attributes
    ----------
    name : str
    gait : Gait
    speed_m_s, turn_rate_rad_s : float
        Mean speed (negative: the robot backs up) and turn rate (+ left).
    radius_m : float or None
        Radius of the mean path, + with the centre on the left; None when straight.
    envelope_m : (right, left)
        Reach of the body about the mean path, body width included.
    displacement : (dx_m, dy_m, turn_rad)
        Rigid displacement per cycle, in the frame of the pose (centre of mass, mean heading) at its start.
    friction_work_j : float
        Per cycle.
    certificate : EntryCertificate, optional
        None where the motion is taken from the model without one.
    worst_speed_m_s : float, optional
        Of a table for several robots: the least of the speeds that they make, without sign.
    planned : bool
        Whether planners use it; slow gaits and pivots are for drivers only.
    """

    name: str
    gait: Gait
    speed_m_s: float
    turn_rate_rad_s: float
    radius_m: float | None
    envelope_m: tuple[float, float]
    displacement: tuple[float, float, float]
    friction_work_j: float
    certificate: EntryCertificate | None = None
    worst_speed_m_s: float | None = None
    planned: bool = True

    @property
    def settling_s(self) -> float | None:
        """Time in which what a change of gait disturbs decays to 1/e; None without a certificate."""
        return None if self.certificate is None else self.certificate.settling_s(self.gait.period_s)

    @staticmethod
    def of_orbit(name: str, orbit: Orbit) -> TableGait:
        """Return the entry of a gait whose steady state is known."""
        dx, dy, turn = (float(v) for v in orbit.motion.displacement)
        return TableGait(
            name,
            orbit.gait,
            orbit.speed_m_s,
            orbit.turn_rate_rad_s,
            orbit.radius_m,
            orbit.envelope_m,
            (dx, dy, turn),
            orbit.work_j,
        )

    def record(self) -> dict[str, Any]:
        """Return the entry as JSON holds it."""
        found = self.certificate
        return {
            "name": self.name,
            **self.gait.record(),
            "speed_m_s": self.speed_m_s,
            "turn_rate_rad_s": self.turn_rate_rad_s,
            "radius_m": self.radius_m,
            "envelope_m": list(self.envelope_m),
            "displacement": list(self.displacement),
            "friction_work_j": self.friction_work_j,
            **({} if self.worst_speed_m_s is None else {"worst_speed_m_s": self.worst_speed_m_s}),
            **({} if self.planned else {"planned": False}),
            **({} if found is None else {"settling_s": self.settling_s, "certificate": dict(vars(found))}),
        }

    @staticmethod
    def of_record(record: dict[str, Any]) -> TableGait:
        """Return the entry of a record; InputError if its gait is not valid."""
        right, left = record["envelope_m"]
        dx, dy, turn = record["displacement"]
        return TableGait(
            record["name"],
            Gait.of_record(record),
            record["speed_m_s"],
            record["turn_rate_rad_s"],
            record["radius_m"],
            (right, left),
            (dx, dy, turn),
            record["friction_work_j"],
            EntryCertificate(**record["certificate"]) if "certificate" in record else None,
            record.get("worst_speed_m_s"),
            record.get("planned", True),
        )


@dataclass(frozen=True, repr=False)
class GaitTable(Result):
    """Gaits of one robot under one model; `fingerprint` is the robot's.

    Those that planners do not use come last, so that an index means the same gait with and without them.
    `changes` says what a cycle does after a cycle of another gait, where that was simulated.
    """

    robot_name: str
    fingerprint: str
    model: str
    gaits: tuple[TableGait, ...]
    changes: Changes | None = None

    def __getitem__(self, name: str) -> TableGait:
        for gait in self.gaits:
            if gait.name == name:
                return gait
        raise KeyError(name)

    def for_planning(self) -> GaitTable:
        """Return the table without what only a driver wants."""
        gaits = tuple(gait for gait in self.gaits if gait.planned)
        if gaits == self.gaits:
            return self
        changes = None if self.changes is None else self.changes.of_first(len(gaits))
        return replace(self, gaits=gaits, changes=changes)

    def with_gaits(self, gaits: tuple[TableGait, ...]) -> GaitTable:
        """Return a table of other gaits; how they follow each other is not known."""
        return replace(self, gaits=gaits, changes=None)

    def after(self, before: str | None, now: str, speed_m_s: float = 0.0) -> Moved | None:
        """Return what a cycle of gait `now` does after one of `before` (None: from rest).

        `speed_m_s` is the forward speed at its begin: what the cycle before ended with. None where the gait
        cannot follow, or the table does not say. `srs_after` of the firmware answers the same.

        Raises
        ------
        KeyError
            For a name that is not in the table.
        """
        if self.changes is None:
            return None
        numbers = {gait.name: number for number, gait in enumerate(self.gaits)}
        return self.changes.after(
            self.changes.rest if before is None else numbers[before], numbers[now], speed_m_s
        )

    def nearest_after(
        self, before: str | None, begun_m_s: float, speed_m_s: float, turn_rate_rad_s: float
    ) -> TableGait | None:
        """Return the gait whose next cycle, after `before`, and steady motion come nearest to a wanted one.

        The steady motion is as near as `nearest` asks, and weighs twice; without `changes`, `nearest` itself.
        `begun_m_s` is the forward speed now. `srs_nearest_after` of the firmware answers the same.
        """
        if self.changes is None:
            return self.nearest(speed_m_s, turn_rate_rad_s)
        start = self.changes.rest if before is None else self.gaits.index(self[before])
        near = [
            (number, self.gaits[number].gait.period_s, float(off))
            for number, off in enumerate(self._off(speed_m_s, turn_rate_rad_s, TABLE.lever_m))
            if off <= TABLE.near_m_s and (speed_m_s != 0 or turn_rate_rad_s != 0)
        ]
        best = self.changes.nearest(near, start, begun_m_s, (speed_m_s, turn_rate_rad_s))
        return None if best is None else self.gaits[best]

    def nearest(
        self,
        speed_m_s: float,
        turn_rate_rad_s: float,
        settings: TableSettings = TABLE,
    ) -> TableGait | None:
        """Return the gait nearest to a wanted motion; turn rates count as speeds at `settings.lever_m`.

        None, which is to vent, for standing still and where no gait is within `settings.near_m_s`: a robot
        that is asked to turn on the spot must not shoot ahead. `srs_nearest` of the firmware answers the
        same.
        """
        if speed_m_s == 0 and turn_rate_rad_s == 0:
            return None
        distance = self._off(speed_m_s, turn_rate_rad_s, settings.lever_m)
        best = int(distance.argmin())
        return self.gaits[best] if distance[best] <= settings.near_m_s else None

    def _off(self, speed_m_s: float, turn_rate_rad_s: float, lever_m: float) -> np.ndarray:
        """Return how far every gait's steady motion, in the controller's mm/s and mrad/s, is from another."""
        # as the firmware holds them, so that both choose the same gait
        motion = np.round([[g.speed_m_s, g.turn_rate_rad_s] for g in self.gaits], 3)
        off = (motion - [speed_m_s, turn_rate_rad_s]) * [1.0, lever_m]
        # rounded, so that images of one gait are equally far and the first of them wins
        return np.asarray(np.hypot(*off.T).round(9))

    def to_dict(self) -> dict[str, Any]:
        """Return the table as gait_table.json holds it."""
        return {
            "version": VERSION,
            "robot": self.robot_name,
            "fingerprint": self.fingerprint,
            "model": self.model,
            "gaits": [g.record() for g in self.gaits],
            **({} if self.changes is None else {"changes": self.changes.record()}),
        }

    def in_words(self) -> str:
        """Return the number of gaits and the fastest of them."""
        fastest = max((g.speed_m_s for g in self.gaits), default=0.0)
        return f"{len(self.gaits)} gaits of robot '{self.robot_name}' up to {fastest:.3f} m/s"

    def figure(self) -> Figure:
        """Return speed against the path's curvature, coloured by the width of the swept band."""
        from srs_opt.gait_opt.figures import pareto_figure

        return pareto_figure(self)


def save_table(table: GaitTable, path: Path | str) -> Path:
    """Write a gait table as JSON (schema: gait_table.schema.json)."""
    return write_text(path, json.dumps(table.to_dict(), indent=1, allow_nan=False) + "\n")


def load_table(path: Path | str, robot: Robot | None = None) -> GaitTable:
    """Read a gait table; with `robot`, refuse a table that was built for another one.

    Raises
    ------
    InputError
        For a wrong version, a foreign robot, or any gait that is not valid.
    """
    document = read_yaml(path, "a gait table (JSON)")
    record = document.value
    if isinstance(record, dict) and record.get("version", VERSION) != VERSION:
        raise document.error(
            ("version",), f"this program reads version {VERSION}, found {record['version']!r}"
        )
    validate(document, load_schema("srs_opt.gait_opt", "gait_table.schema.json"))
    used = [gait.get("planned", True) for gait in record["gaits"]]
    if used != sorted(used, reverse=True) or not used[0]:
        raise document.error(("gaits",), "gaits with 'planned: false' must come after all others")
    table = GaitTable(record["robot"], record["fingerprint"], record["model"], _entries(document))
    if "changes" in record:
        try:
            changes = Changes.of_record(record["changes"], len(table.gaits))
        except ValueError as error:
            raise document.error(("changes",), str(error)) from error
        table = replace(table, changes=changes)
    if robot is not None and table.fingerprint != robot.fingerprint():
        raise InputError(
            f"{path}: table was built for robot '{table.robot_name}' ({table.fingerprint}), not for "
            f"'{robot.name}' ({robot.fingerprint()}); rebuild it: python -m srs_opt.gait_opt --table"
        )
    return table


def _entries(document: Document) -> tuple[TableGait, ...]:
    entries = []
    for index, record in enumerate(document.value["gaits"]):
        try:
            entries.append(TableGait.of_record(record))
        except InputError as error:
            raise document.error(("gaits", index), str(error)) from error
    return tuple(entries)
