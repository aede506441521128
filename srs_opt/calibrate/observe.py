"""What the camera sees of a simulated trial, and its derivatives by the fit's coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.fit_settings import DERIVATIVE
from srs_opt.calibrate.mapped import evaluate, mapped
from srs_opt.calibrate.model import Model, Values
from srs_opt.calibrate.sensitivity import Variation, onset, variation
from srs_opt.calibrate.trial_simulation import Nodes, conditions_of
from srs_opt.effects import known_effects
from srs_opt.effects.effect import Effect
from srs_opt.geometry import turn_by
from srs_opt.measurement.records import Trial
from srs_opt.measurement.spots import Spots
from srs_opt.model.kinematics import Chain, arc
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Structure, effect_symbols
from srs_opt.model.registry import build, state_layout
from srs_opt.model.state import POSE, VELOCITY, StateLayout
from srs_opt.simulate.compiled import compiled
from srs_opt.simulate.interpolate import hermite, linear


@dataclass(frozen=True)
class Prediction:
    """Predicted picture coordinates of one trial.

    Attributes
    ----------
    points : array (T, 2 M)
        x1, y1, x2, y2 ... per frame.
    jacobian : array (T, 2 M, K)
        Derivatives by the coordinates asked for.
    pose, kappa : array (T, 3), (T, N-1)
        Motion at the frames.
    free : array (T, 2 M, 4) or None
        Derivatives by a trial's own pose and clock, where these are fitted to its track.
    """

    points: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray
    kappa: np.ndarray
    free: np.ndarray | None = None


@lru_cache(maxsize=8)
def _picture(
    structure: Structure, centre_only: bool, spots: Spots | None, seen: tuple[str, ...]
) -> ca.Function:
    """Return ``(pose, shape, camera, p) -> (points, by pose, by shape, by camera, by p)``, mapped."""

    def make() -> ca.Function:
        parameters, m, _ = build(structure)
        pose = ca.SX.sym("pose", 3)
        effects = [known_effects()[name] for name in seen]
        values = {e.name: effect_symbols(e, structure.links) for e in effects}
        camera = ca.vertcat(*(v for own in values.values() for v in own.values()))
        c, s = ca.cos(pose[2]), ca.sin(pose[2])
        body = _body_points(m, spots)
        dx, dy = turn_by(c, s, body.x, body.y)
        x, y = pose[0] + dx, pose[1] + dy
        x, y = _seen(x, y, pose[2] + body.angle, effects, values, m.mass if centre_only else None)
        points = ca.vec(ca.horzcat(x, y).T)
        p = parameters.vector
        by = [ca.densify(ca.jacobian(points, v)) for v in (pose, m.shape, camera, p)]
        outputs = [points, *(ca.reshape(o, -1, 1) for o in by)]
        single = ca.Function("picture", [pose, m.shape, camera, p], outputs, {"cse": True})
        return mapped(single, (2, 3))

    return compiled(f"picture {centre_only} {spots or ''} {structure} {' '.join(seen)}", make)


def _body_points(m: Mechanics, spots: Spots | None) -> Chain:
    """Return the markers' places and headings in the robot's frame.

    From the carrying link's centre straight on, then along the chamber's arc, then to the left.
    """
    if spots is None:
        return m.chain
    gap = m.gap_length
    columns = []
    for spot in spots:
        i = spot.carrier
        x, y, angle = m.chain.x[i], m.chain.y[i], m.chain.angle[i]
        if spot.link is not None:
            x, y = x + spot.dx_m * ca.cos(angle), y + spot.dx_m * ca.sin(angle)
        else:
            for way, kappa in ((gap / 2, m.gap_ratio * m.kappa[i]), (spot.at * m.length[i], m.kappa[i])):
                dx, dy, angle = arc(way, kappa, angle)
                x, y = x + dx, y + dy
        columns.append((x - spot.dy_m * ca.sin(angle), y + spot.dy_m * ca.cos(angle), angle))
    return Chain(*(ca.vertcat(*column) for column in zip(*columns)))


def _seen(
    x: ca.SX,
    y: ca.SX,
    angle: ca.SX,
    effects: Sequence[Effect],
    values: dict[str, dict[str, ca.SX]],
    mass: ca.SX | None,
) -> tuple[ca.SX, ca.SX]:
    """Apply marker offsets, the mean over the body where only that is recorded, then the camera's errors."""
    for effect in effects:
        if effect.marker:
            x, y = effect.marker(values[effect.name], x, y, angle)
    if mass is not None:
        x, y = (ca.dot(mass, v) / ca.sum1(mass) for v in (x, y))
    for effect in effects:
        if effect.camera:
            x, y = effect.camera(values[effect.name], x, y)
    return x, y


def predict(
    model: Model,
    trial: Trial,
    nodes: Nodes,
    values: Values,
    coordinates: Sequence[Coordinate] = (),
    *,
    centre_only: bool = False,
) -> Prediction:
    """Return what the camera sees at the trial's labels, with derivatives by `coordinates`.

    Parameters
    ----------
    nodes : Nodes
        The trial simulated at `values`.
    """
    markers = 1 if centre_only else model.links if trial.spots is None else len(trial.spots)
    if nodes.marker_lag_s == 0 or markers == 1:
        return _at_once(model, trial, nodes, values, coordinates, centre_only=centre_only)
    frames, at_once = trial.time_s.size, replace(nodes, marker_lag_s=0.0)
    # all markers at all their times, then of each what was seen at its own: one call of the compiled picture
    later = nodes.marker_lag_s * np.arange(markers)[:, None]
    every = replace(trial, time_s=(trial.time_s + later).ravel())
    seen = _at_once(model, every, at_once, values, coordinates, centre_only=centre_only)
    own = np.arange(markers)

    def each(values: np.ndarray) -> np.ndarray:
        """Return of every marker what was seen at its own times."""
        whole = values.reshape(markers, frames, markers, 2, *values.shape[2:])[own, :, own]
        return np.moveaxis(whole, 0, 1).reshape(frames, 2 * markers, *values.shape[2:])

    return Prediction(each(seen.points), each(seen.jacobian), seen.pose[:frames], seen.kappa[:frames])


def _at_once(
    model: Model,
    trial: Trial,
    nodes: Nodes,
    values: Values,
    coordinates: Sequence[Coordinate],
    *,
    centre_only: bool,
) -> Prediction:
    """Return what the camera sees of all markers at the trial's labels."""
    # when a frame was really taken
    at = trial.time_s * (1 + nodes.clock_rate) + nodes.clock_s
    # with the rates at the nodes interpolation is of fourth order, as the steps are
    rate = _pose_rate(model, nodes, values)
    pose = hermite(nodes.time_s, nodes.body[:, :3], rate, at)
    structure, kept = model.structure(values, coordinates)
    layout = state_layout(structure)
    shape = hermite(nodes.time_s, nodes.shape(layout), nodes.shape_rate(layout), at)
    kappa = shape[:, : model.segments]
    spots = None if centre_only else trial.spots
    function = _picture(structure, centre_only, spots, model.camera)
    points, by_pose, by_shape, by_camera, by_p = evaluate(
        function, (pose, shape), nodes.camera, nodes.p[kept]
    )
    frames, seen = points.shape
    jacobian = np.zeros((frames, seen, len(coordinates)))
    if not coordinates:
        return Prediction(points, jacobian, pose, kappa)
    by = model.seeds(values, conditions_of(trial), coordinates)
    seeds = by.p[kept]
    softening = np.array([model.softens(c, values) for c in coordinates])
    # what acts on camera or clock alone needs no integration
    moving = np.flatnonzero(np.any(seeds != 0, axis=0) & ~softening)
    jac_pose = by_pose.reshape(frames, 3, seen).transpose(0, 2, 1)
    jac_shape = by_shape.reshape(frames, -1, seen).transpose(0, 2, 1)
    if moving.size:
        typical = np.array([coordinates[int(k)].typical for k in moving])
        varied = variation(structure, nodes, nodes.p[kept], seeds[:, moving], typical, trial.heading_rad)
        part = jac_pose @ linear(nodes.time_s, varied.pose, at)
        part += jac_shape @ linear(nodes.time_s, varied.shape, at)
        jac_p = by_p.reshape(frames, -1, seen).transpose(0, 2, 1)
        # parameters that are lengths move points of the picture directly, beside the motion
        touched = np.any(seeds != 0, axis=1) & np.any(by_p.reshape(frames, -1, seen) != 0, axis=(0, 2))
        part += jac_p[:, :, touched] @ seeds[touched][:, moving]
        jacobian[:, :, moving] = part
    for k in np.flatnonzero(softening):
        began, soft, p = _onset(model, trial, nodes, values, coordinates[int(k)])
        by_bend = jac_shape
        if (bent := state_layout(soft)).stretches:  # lengths follow the pressure, not the bend
            loaded = hermite(nodes.time_s, nodes.shape(bent), nodes.shape_rate(bent), at)
            picture = _picture(soft, centre_only, spots, model.camera)
            by_bend = evaluate(picture, (pose, loaded), nodes.camera, p)[2]
            by_bend = by_bend.reshape(frames, -1, seen).transpose(0, 2, 1)
        jacobian[:, :, k] = (jac_pose @ linear(nodes.time_s, began.pose, at))[..., 0]
        jacobian[:, :, k] += (by_bend @ linear(nodes.time_s, began.shape, at))[..., 0]
    jac_camera = by_camera.reshape(frames, -1, seen).transpose(0, 2, 1)
    velocity = _velocity(nodes, layout, rate, at)
    # what all do that only shift time: delays, clocks, markers seen late
    in_time = jac_pose @ velocity[0][..., None] + jac_shape @ velocity[1][..., None]
    later = (by.clock_s - by.delay_s)[0]  # a delay of the valves shifts the motion in time
    jacobian[:, :, later != 0] += in_time * later[later != 0]
    faster = by.clock_rate[0]
    jacobian[:, :, faster != 0] += in_time * trial.time_s[:, None, None] * faster[faster != 0]
    lagging = by.marker_lag_s[0]
    order = np.repeat(np.arange(seen // 2), 2)[None, :, None]
    jacobian[:, :, lagging != 0] += in_time * order * lagging[lagging != 0]
    shown = np.any(by.camera != 0, axis=0)
    jacobian[:, :, shown] += jac_camera @ by.camera[:, shown]
    return Prediction(points, jacobian, pose, kappa)


def _onset(
    model: Model, trial: Trial, nodes: Nodes, values: Values, c: Coordinate
) -> tuple[Variation, Structure, np.ndarray]:
    """Return the sensitivities to a body's beginning to bend, the bending body and its parameters."""
    ends = [{**values, c.name: share * DERIVATIVE.stiff_share * c.typical} for share in (0.5, 1.0)]
    structure, kept = model.structure(ends[0])
    flexible = tuple(model.pack(end, conditions_of(trial)).p[kept] for end in ends)
    return onset(structure, nodes, flexible, 0.5 * DERIVATIVE.stiff_share * c.typical), structure, flexible[0]


@lru_cache(maxsize=8)
def _pose_rate_function(structure: Structure) -> ca.Function:
    def make() -> ca.Function:
        parameters, m, _ = build(structure)
        body = ca.SX.sym("body", 6)
        rate = m.pose_rate(body[POSE], body[VELOCITY])
        inputs = [body, m.shape, m.shape_rate, parameters.vector]
        return mapped(ca.Function("rate", inputs, [rate], {"cse": True}), (3,))

    return compiled(f"pose rate {structure}", make)


def _pose_rate(model: Model, nodes: Nodes, values: Values) -> np.ndarray:
    structure, kept = model.structure(values)
    function = _pose_rate_function(structure)
    layout = state_layout(structure)
    return evaluate(function, (nodes.body, nodes.shape(layout), nodes.shape_rate(layout)), nodes.p[kept])[0]


def _velocity(
    nodes: Nodes, layout: StateLayout, rate: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rates of pose and shape at the frames; none before the start."""
    # before time 0 the robot stands, whatever the clock says
    moving = (at >= 0)[:, None]
    return (
        np.asarray(linear(nodes.time_s, rate, at) * moving),
        np.asarray(linear(nodes.time_s, nodes.shape_rate(layout), at) * moving),
    )
