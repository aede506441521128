"""The constraints of a manoeuvre as numbers that must not be negative, with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from srs_opt.geometry import points_in_room, quarter_turn, rotate
from srs_opt.manoeuvre.settings import CONSTRAINT, END
from srs_opt.manoeuvre.shooting import Shot
from srs_opt.manoeuvre.task import Task
from srs_opt.model.state import HEADING, PLACE, POSE
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.shapes import centre_lines

Part = tuple[np.ndarray, np.ndarray]  # values and derivatives


@dataclass(frozen=True)
class Rows:
    """Constraints in lengths (m): values (n,), to be at least 0, and Jacobian (n, m) (None where not asked).

    The columns are those of `Shot.sensitivity` and one more: the radius of the disc that holds the body.
    """

    values: np.ndarray
    jacobian: np.ndarray | None


class RowMaker:
    """Makes the rows of one task; `inside` (0 to 1) tightens the end's tolerances, for ticks to keep them."""

    def __init__(self, run: Integrator, task: Task, inside: float | None = None) -> None:
        self.run, self.task = run, task
        self.inside = CONSTRAINT.inside if inside is None else inside
        length = run.robot.length_m
        # a certificate takes off the measured error instead
        self.spare_m = CONSTRAINT.spare * length if self.inside < 1 else 0.0
        # all rows are lengths, so that one penalty and one tolerance serve them all
        self.lever_m, self.bend_m2 = CONSTRAINT.lever * length, CONSTRAINT.bend * length * length

    def __call__(self, shot: Shot, radius_m: float = 0.0) -> Rows:
        """Return the rows of a simulated manoeuvre."""
        parts = [*self._end(shot), *self._on_the_way(shot, self.looks(shot), radius_m)]
        values = np.concatenate([np.atleast_1d(v) for v, _ in parts])
        if shot.sensitivity is None:
            return Rows(values, None)
        return Rows(values, np.vstack([np.atleast_2d(s) for _, s in parts]))

    def end_values(self, shot: Shot) -> np.ndarray:
        """Return what the end asks for, without derivatives, (n,)."""
        return np.array([value for value, _ in self._end(replace(shot, sensitivity=None))])

    def space_values(self, shot: Shot, looked: np.ndarray) -> np.ndarray:
        """Return by how much the body keeps to its room at the nodes `looked`, (n,)."""
        room = replace(self.task, objective="time", bounds=replace(self.task.bounds, max_curvature_1_m=None))
        maker = RowMaker(self.run, room, self.inside)
        parts = maker._on_the_way(replace(shot, sensitivity=None), looked, 0.0)
        return np.concatenate([np.zeros(0), *(values for values, _ in parts)])

    def _linear(self, shot: Shot, node: int, weights: np.ndarray, offset: float) -> Part:
        value = np.asarray(weights @ shot.states[node] + offset)
        if shot.sensitivity is None:
            return value, np.zeros(0)
        return value, np.append(weights @ shot.sensitivity[node], 0.0)

    def _band(self, shot: Shot, index: int, wanted: float, tolerance: float, unit: float) -> list[Part]:
        """Return two rows: a final state lies within a tolerance of what is wanted."""
        weights = np.zeros(self.run.states)
        weights[index] = unit
        room = self.inside * tolerance * unit
        return [
            self._linear(shot, -1, weights, room - wanted * unit),
            self._linear(shot, -1, -weights, room + wanted * unit),
        ]

    def _end(self, shot: Shot) -> list[Part]:
        end, layout, rows = self.task.end, self.run.layout, list[Part]()
        if end.past_m is not None:
            weights = np.zeros(self.run.states)
            weights[0] = np.sign(end.past_m)
            rows.append(self._linear(shot, -1, weights, -abs(end.past_m) - self.spare_m))
        if end.turn_rad is not None:
            weights = np.zeros(self.run.states)
            # the heading is unwrapped: a turn by more than half a circle counts as it is
            weights[2] = np.sign(end.turn_rad) * self.lever_m
            begun = float(weights @ self.task.start.state)
            rows.append(
                self._linear(shot, -1, weights, -abs(end.turn_rad) * self.lever_m - begun - self.spare_m)
            )
        if end.pose is not None:
            for index, tolerance, unit in (
                (0, END.pose_m, 1.0),
                (1, END.pose_m, 1.0),
                (2, END.pose_rad, self.lever_m),
            ):
                rows += self._band(shot, index, end.pose[index], tolerance, unit)
        if end.rest:
            for index in (3, 4):
                rows += self._band(shot, index, 0.0, END.rest_speed_m_s / 2, CONSTRAINT.rest_speed_s)
            for index in range(layout.kappa.start, layout.kappa.stop):
                rows += self._band(shot, index, 0.0, END.rest_curvature_1_m, self.bend_m2)
        if end.orbit is not None:
            wanted = end.orbit.solution.start
            for index in (3, 4):
                rows += self._band(shot, index, wanted[index], END.gait_speed_m_s, CONSTRAINT.gait_speed_s)
            largest = float(np.abs(end.orbit.kappa).max())
            for index in range(layout.kappa.start, layout.kappa.stop):
                rows += self._band(
                    shot, index, wanted[index], END.gait_curvature_share * largest, self.bend_m2
                )
        return rows

    def _on_the_way(self, shot: Shot, looked: np.ndarray, radius_m: float) -> list[Part]:
        task, rows = self.task, list[Part]()
        if task.end.within_m is not None:
            rows.append(self._near_start(shot, looked, task.end.within_m))
        if task.space is not None or task.objective == "space":
            points, jacobian = self.points(shot, looked)
            half = self.run.robot.body_width_m / 2
            flat = points.reshape(-1, 2)
            if task.space is not None:
                depth, toward = task.space.depth(flat)
                rows.append((depth - half - self.spare_m, self._chain(toward, jacobian)))
            if task.objective == "space":
                centre = self.centre(points)
                away = flat - centre
                distance = np.hypot(*away.T)
                # the circle's centre is held within a step and found anew for the next
                by_unknowns = self._chain(-away / np.maximum(distance, 1e-9)[:, None], jacobian)
                if by_unknowns.size:
                    by_unknowns[:, -1] = 1.0
                rows.append((radius_m - distance - half, by_unknowns))
        most = task.bounds.max_curvature_1_m
        if most is not None:
            for index in range(self.run.layout.kappa.start, self.run.layout.kappa.stop):
                for sign in (1.0, -1.0):
                    values = self.bend_m2 * (most - sign * shot.states[looked, index])
                    by_unknowns = np.zeros((looked.size, 0))
                    if shot.sensitivity is not None:
                        by_unknowns = -sign * self.bend_m2 * shot.sensitivity[looked, index]
                        by_unknowns = np.column_stack([by_unknowns, np.zeros(looked.size)])
                    rows.append((values, by_unknowns))
        return rows

    def _near_start(self, shot: Shot, looked: np.ndarray, radius: float) -> Part:
        away = shot.states[looked, :2] - self.task.start.state[PLACE]
        distance = np.hypot(*away.T)
        by_unknowns = np.zeros((looked.size, 0))
        if shot.sensitivity is not None:
            # at the start itself there is no direction
            toward = -away / np.maximum(distance, 1e-9)[:, None]
            by_unknowns = np.einsum("nk,nkm->nm", toward, shot.sensitivity[looked, :2])
            by_unknowns = np.column_stack([by_unknowns, np.zeros(looked.size)])
        return radius - distance - self.spare_m, by_unknowns

    @staticmethod
    def _chain(toward: np.ndarray, jacobian: np.ndarray | None) -> np.ndarray:
        if jacobian is None:
            return np.zeros((len(toward), 0))
        flat = jacobian.reshape(-1, 2, jacobian.shape[-1])
        return np.column_stack([np.einsum("nk,nkm->nm", toward, flat), np.zeros(len(flat))])

    @staticmethod
    def centre(points: np.ndarray) -> np.ndarray:
        """Return the centre of the smallest circle about the body's points, to a millimetre."""
        import shapely

        circle = shapely.minimum_bounding_circle(shapely.MultiPoint(points.reshape(-1, 2)))
        return np.asarray(circle.centroid.coords[0])

    @staticmethod
    def looks(shot: Shot) -> np.ndarray:
        """Return the nodes at which the body is measured."""
        count = max(int(np.ceil(shot.time_s[-1] / CONSTRAINT.interval_s)), 2)
        wanted = np.linspace(0.0, shot.time_s[-1], count + 1)
        # 1e-9: a node that rounding puts just before an instant serves it
        return np.unique(np.searchsorted(shot.time_s, wanted - 1e-9).clip(max=shot.time_s.size - 1))

    def points(self, shot: Shot, looked: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the centre lines (n, points, 2) in the room and their derivatives (n, points, 2, m)."""
        moved = None if shot.sensitivity is None else shot.sensitivity[looked]
        return body_points(self.run, shot.states[looked], moved)


def body_points(
    run: Integrator, states: np.ndarray, moved: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the centre lines (n, points, 2) in the room and their derivatives (n, points, 2, m).

    Parameters
    ----------
    states : array (n, nx)
    moved : array (n, nx, m) or None
        Their derivatives, where those of the lines are asked for.
    """
    kappa, heading = states[:, run.layout.kappa], states[:, HEADING]
    line = centre_lines(run, kappa)
    points = points_in_room(line, states[:, POSE])
    if moved is None:
        return points, None
    jacobian = np.repeat(moved[:, None, :2], line.shape[1], axis=1)
    # d(point) = d(place) + d(heading) e_z x arm + R(heading) d(line)/d(kappa) d(kappa)
    arm = points - states[:, None, PLACE]
    jacobian = jacobian + quarter_turn(arm)[..., None] * moved[:, None, None, 2]
    for k in range(kappa.shape[1]):
        step = np.zeros(kappa.shape[1])
        step[k] = CONSTRAINT.curvature_step_1_m
        bent = (centre_lines(run, kappa + step) - centre_lines(run, kappa - step)) / (
            2 * CONSTRAINT.curvature_step_1_m
        )
        gx, gy = rotate(heading[:, None], bent[..., 0], bent[..., 1])
        by_kappa = moved[:, run.layout.kappa.start + k]
        jacobian += np.stack([gx, gy], axis=-1)[..., None] * by_kappa[:, None, None]
    return points, jacobian
