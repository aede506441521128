"""The differential drive: wanted speed and turn rate to gait parameters, and back.

The paper's closing idea made precise. A map over (frequency, offset) at one pressure and lag is a
sheet in the plane of speed and turn rate; every grid cell becomes two triangles, and the union of all
triangles of all sheets, their mirror images and their reversed waves is what the robot can do.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from srs_opt.drive.calibration import NO_CALIBRATION, DriveCalibration
from srs_opt.drive.settings import DRIVE_MAP
from srs_opt.errors import InputError, OutOfReachError
from srs_opt.gait import Gait, Wave
from srs_opt.gait_map.grid import GaitMap
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.result import Result
from srs_opt.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class DriveGait(Result):
    """A gait for a wanted motion: the wave, its direction, and what it is expected to do.

    `speed_m_s` and `turn_rate_rad_s` are calibrated; `speed_sd_m_s` and `turn_rate_sd_rad_s` their
    standard deviations.
    """

    wave: Wave
    reverse: bool
    gait: Gait
    orbit: Orbit
    speed_m_s: float
    turn_rate_rad_s: float
    speed_sd_m_s: float
    turn_rate_sd_rad_s: float

    def to_dict(self) -> dict[str, Any]:
        """Return the wave and the motion that it is expected to make."""
        return {
            "wave": asdict(self.wave),
            "reverse": self.reverse,
            "speed_m_s": self.speed_m_s,
            "speed_sd_m_s": self.speed_sd_m_s,
            "turn_rate_rad_s": self.turn_rate_rad_s,
            "turn_rate_sd_rad_s": self.turn_rate_sd_rad_s,
        }

    def in_words(self) -> str:
        """Return the expected motion and the wave's frequency and pressure."""
        wave, way = self.wave, "backwards" if self.reverse else "forward"
        return (
            f"{way} at {self.speed_m_s:+.3f} m/s, {self.turn_rate_rad_s:+.3f} rad/s by "
            f"{wave.frequency_hz:.3f} Hz, {wave.pressure_kpa:.1f} kPa, offset {wave.offset[0]:+.3f}"
        )

    def figure(self) -> Figure:
        """Return the gait sheet."""
        return self.orbit.figure()


@dataclass(frozen=True, repr=False)
class Drive(Result):
    """Reachable motions of a robot with the gait behind each.

    Attributes
    ----------
    robot, model
    corners : array (t, 3, 6)
        Triangles; per corner frequency, pressure, offset, lag (parameters) and speed, turn rate (calibrated).
    width : array (t,)
        Envelope's whole width at each triangle, m: of several gaits for a motion the slimmest is taken.
    calibration : DriveCalibration
    """

    robot: Robot
    model: str
    corners: np.ndarray
    width: np.ndarray
    calibration: DriveCalibration = field(default=NO_CALIBRATION)

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration and the span of the motions within reach."""
        speed, turn_rate = self.corners[..., 4], self.corners[..., 5]
        return {
            "robot": self.robot.name,
            "model": self.model,
            "calibration": asdict(self.calibration),
            "speed_m_s": [float(speed.min()), float(speed.max())],
            "turn_rate_rad_s": float(abs(turn_rate).max()),
        }

    def in_words(self) -> str:
        """Return the greatest speed and turn rate within reach."""
        speed, turn_rate = (float(abs(self.corners[..., k]).max()) for k in (4, 5))
        return f"up to {speed:.3f} m/s and {turn_rate:.3f} rad/s, forward and backwards"

    def figure(self) -> Figure:
        """Return the reachable set of speed and turn rate."""
        from srs_opt.drive.figures import reachable_figure

        return reachable_figure(self)

    def reachable(self) -> shapely.Geometry:
        """Return the set of reachable (speed m/s, turn rate rad/s), forward, both sides."""
        triangles = shapely.polygons(self.corners[:, :, 4:6])
        # the buffer closes slits that rounding leaves between neighbouring triangles
        left = shapely.union_all(shapely.buffer(triangles, 1e-9))
        return shapely.union(left, shapely.affinity.scale(left, 1, -1, origin=(0, 0)))

    def motion(self, wave: Wave, *, reverse: bool = False) -> DriveGait:
        """Return what a wave does (forward map), calibrated, with standard deviations."""
        gait = wave.gait().reversed_wave() if reverse else wave.gait()
        orbit = steady_gait(self.robot, gait, self.model)
        speed, turn = self.calibration.motion(orbit.speed_m_s, orbit.turn_rate_rad_s)
        sd_speed, sd_turn = self.calibration.deviations(speed, turn)
        return DriveGait(wave, reverse, gait, orbit, speed, turn, sd_speed, sd_turn)

    def gait_for(self, speed_m_s: float, turn_rate_rad_s: float) -> DriveGait:
        """Return a gait for a wanted speed (negative: backwards) and turn rate (+ left): the inverse map.

        Raises
        ------
        InputError
            For numbers that no robot moves with, or none.
        OutOfReachError
            Outside the reachable set; the message names the nearest reachable motion.
        """
        if not (abs(speed_m_s) <= DRIVE_MAP.most_m_s and abs(turn_rate_rad_s) <= DRIVE_MAP.most_rad_s):
            raise InputError(
                f"expected a speed of at most {DRIVE_MAP.most_m_s:g} m/s and a turn rate of at most "
                f"{DRIVE_MAP.most_rad_s:g} rad/s, found {speed_m_s:g} m/s turning {turn_rate_rad_s:+g} rad/s"
            )
        reverse = speed_m_s < 0
        # a reversed wave runs the same arc backwards: speed and turn rate change sign together
        speed, turn = abs(speed_m_s), turn_rate_rad_s * (-1 if reverse else 1)
        side = -1.0 if turn < 0 else 1.0
        found = self._triangle(speed, abs(turn))
        if found is None:
            raise self._refusal(speed_m_s, turn_rate_rad_s)
        corners, weights = found
        wave = self._wave(weights @ corners[:, :4], side)
        sign = -1 if reverse else 1
        target = np.array([speed_m_s, turn_rate_rad_s])
        best = self.motion(wave, reverse=reverse)
        jacobian = _jacobian(corners)
        slow_m_s = DRIVE_MAP.slow * self.robot.length_m
        for _ in range(DRIVE_MAP.refinements):
            # seen in the triangle's quadrant, forwards and to the left, where its derivatives hold
            missing = (target - [best.speed_m_s, best.turn_rate_rad_s]) * [sign, sign * side]
            if self._size(missing) < DRIVE_MAP.tolerance * max(speed, slow_m_s):
                break
            step = jacobian @ missing
            uniform = np.array(
                [best.wave.frequency_hz, best.wave.pressure_kpa, abs(best.wave.offset[0]), _lag(best.wave)]
            )
            # within the triangle: beyond it the map may fold
            limits = corners[:, :4].min(axis=0), corners[:, :4].max(axis=0)
            following = self.motion(self._wave(np.clip(uniform + step, *limits), side), reverse=reverse)
            if self._distance(following, target) >= self._distance(best, target):
                break
            best = following
        return best

    def gait_for_radius(self, speed_m_s: float, radius_m: float) -> DriveGait:
        """Return a gait for a wanted speed and signed radius (+ centre on the left; infinite: straight)."""
        if radius_m == 0:
            raise InputError("radius must not be 0: the robot cannot turn on the spot; use a turn rate")
        return self.gait_for(speed_m_s, 0.0 if np.isinf(radius_m) else speed_m_s / radius_m)

    def nearest_reachable(self, speed_m_s: float, turn_rate_rad_s: float) -> tuple[float, float]:
        """Return the reachable motion nearest to a wanted one; turn rates count by `DRIVE_MAP.lever`."""
        sign, lever_m = -1.0 if speed_m_s < 0 else 1.0, self._lever_m
        scaled = shapely.affinity.scale(self.reachable(), 1, lever_m, origin=(0, 0))
        wanted = shapely.Point(abs(speed_m_s), sign * turn_rate_rad_s * lever_m)
        nearest = scaled.boundary.interpolate(scaled.boundary.project(wanted))
        if scaled.contains(wanted):
            nearest = wanted
        return sign * nearest.x, sign * nearest.y / lever_m

    @property
    def _lever_m(self) -> float:
        return DRIVE_MAP.lever * self.robot.length_m

    def _size(self, motion: np.ndarray) -> float:
        """Return how large a difference of (speed, turn rate) is, m/s."""
        return float(np.hypot(motion[0], self._lever_m * motion[1]))

    def _distance(self, gait: DriveGait, target: np.ndarray) -> float:
        return self._size(np.array([gait.speed_m_s, gait.turn_rate_rad_s]) - target)

    def _wave(self, parameters: np.ndarray, side: float) -> Wave:
        frequency, pressure, offset, lag = (float(v) for v in parameters)
        return Wave.uniform(self.robot.segments, frequency, pressure, lag, side * max(offset, 0.0))

    def _triangle(self, speed: float, turn: float) -> tuple[np.ndarray, np.ndarray] | None:
        a, b, c = (self.corners[:, k, 4:6] for k in range(3))
        wanted = np.array([speed, turn])
        area = _cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            # barycentric coordinates by ratios of areas; flat triangles give no number and are left out
            w1, w2 = _cross(wanted - a, c - a) / area, _cross(b - a, wanted - a) / area
        weights = np.stack([1 - w1 - w2, w1, w2], axis=1)
        # a motion on an edge is inside both neighbours
        inside = (weights >= -1e-6).all(axis=1) & (np.abs(area) > 1e-12)
        if not inside.any():
            return None
        best = np.flatnonzero(inside)[np.argmin(self.width[inside])]
        return self.corners[best], weights[best]

    def _refusal(self, speed: float, turn: float) -> OutOfReachError:
        near_speed, near_turn = self.nearest_reachable(speed, turn)
        radius = f" (radius {abs(near_speed / near_turn):.3f} m)" if abs(near_turn) > 1e-3 else ""
        return OutOfReachError(
            f"no gait of '{self.robot.name}' moves at {speed:.3g} m/s turning {turn:+.3g} rad/s; "
            f"nearest reachable: {near_speed:.3g} m/s at {near_turn:+.3g} rad/s{radius}"
        )


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _lag(wave: Wave) -> float:
    return wave.phase_rad[1] - wave.phase_rad[0]


def _jacobian(corners: np.ndarray) -> np.ndarray:
    """Return d(parameters)/d(motion) on a triangle, (4, 2)."""
    # two edges as columns: parameters and motion are linear on a triangle
    motion = (corners[1:, 4:6] - corners[0, 4:6]).T
    parameters = (corners[1:, :4] - corners[0, :4]).T
    return np.asarray(parameters @ np.linalg.inv(motion))


def drive_from_map(
    robot: Robot,
    gaits: GaitMap,
    calibration: DriveCalibration = NO_CALIBRATION,
    model: str | None = None,
) -> Drive:
    """Build the drive from a simulated map (a grid over frequency and offsets >= 0, per pressure and lag).

    Raises
    ------
    InputError
        If the map has no pressure and lag with at least two frequencies and two offsets.
    """
    triangles, widths = [], []
    key = np.stack([gaits.column("pressure_kpa"), gaits.column("phase_lag_rad")], axis=1)
    for sheet in np.unique(key, axis=0):
        part = GaitMap(gaits.rows[(key == sheet).all(axis=1) & (gaits.column("offset") >= 0)])
        for cell in _cells(part, calibration):
            triangles.append(cell[:, :6])
            widths.append(cell[:, 6].mean())
    if not triangles:
        raise InputError(
            "the map needs at least two frequencies and two offsets (>= 0) at one pressure and lag"
        )
    return Drive(robot, model or robot.own_model, np.array(triangles), np.array(widths), calibration)


def _cells(part: GaitMap, calibration: DriveCalibration) -> list[np.ndarray]:
    """Return the triangles of one sheet: rows frequency, pressure, offset, lag, speed, turn rate, width."""
    frequency, offset = np.unique(part.column("frequency_hz")), np.unique(part.column("offset"))
    table = np.full((offset.size, frequency.size, 7), np.nan)
    at = (
        np.searchsorted(offset, part.column("offset")),
        np.searchsorted(frequency, part.column("frequency_hz")),
    )
    speed, turn = calibration.motion(part.column("speed_m_s"), part.column("turn_rate_rad_s"))
    width = part.column("envelope_right_m") + part.column("envelope_left_m")
    # a symmetric gait's turn rate is zero up to the integration's error
    turn = np.where(part.column("offset") == 0, 0.0, turn)
    table[at] = np.column_stack([part.rows[:, :4], speed, turn, width])
    found = []
    for i in range(offset.size - 1):
        for j in range(frequency.size - 1):
            square = table[[i, i, i + 1, i + 1], [j, j + 1, j, j + 1]]
            found += [square[k] for k in ([0, 1, 2], [1, 3, 2]) if np.isfinite(square[k]).all()]
    return found
