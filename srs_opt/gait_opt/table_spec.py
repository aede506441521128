"""What a gait table asks for, and in which order each gait starts from a neighbour."""

from __future__ import annotations

from dataclasses import dataclass, replace

from srs_opt.gait_opt.table_settings import TABLE_CONTENT, TableContentSettings
from srs_opt.robot import Robot


@dataclass(frozen=True)
class TableSpec:
    """One entry to optimize.

    Attributes
    ----------
    name : str
    radius_m, band_m : float or None
        Wanted radius (None: straight) and widest band (None: any).
    after : str or None
        Name of the spec whose gait this one starts from; None: the first of all.
    load : float
        Share by which the rolling friction is larger, for which the gait is optimized. Its radius and band
        are asked for under that load; without it they come out a little different.
    """

    name: str
    radius_m: float | None
    band_m: float | None
    after: str | None
    load: float = 0.0

    def laden(self, robot: Robot) -> Robot:
        """Return the robot with the load."""
        if not self.load:
            return robot
        # accelerating at a is, by d'Alembert, like rolling on wheels whose friction is larger by a/g
        return replace(robot, friction_tangential=(1 + self.load) * robot.friction_tangential)


def table_specs(
    robot: Robot, *, quick: bool = False, content: TableContentSettings = TABLE_CONTENT
) -> tuple[TableSpec, ...]:
    """Return what a table, or a quick one, holds, forward and to the left; the other quadrants are images.

    Fast gaits go from the straight one to the tightest turn; at every radius, bands go from the fast gait's
    to the slimmest. (A slim gait hardly leads to a slim one at another radius: its on-intervals are
    another matter altogether.) Strong gaits and those that rush off from rest do the same under their loads.
    """
    first = TableSpec("fast", None, None, None)
    if quick:
        return _fan(robot, first, content.quick_straight_bands, ((), ()), content.quick_radii)
    fast = _fan(robot, first, content.straight_bands, content.turn_bands, content.radii)
    strong = TableSpec("strong", None, None, "fast", content.strong_load)
    rush = TableSpec("rush", None, None, "strong", content.rush_load)
    laden = _fan(robot, strong, content.strong_bands, content.strong_turn_bands, content.radii) + _fan(
        robot, rush, (), content.rush_turn_bands, content.radii
    )
    return fast + laden


def _fan(
    robot: Robot,
    first: TableSpec,
    straight: tuple[float, ...],
    turns: tuple[tuple[float, ...], ...],
    radii_over_length: tuple[float, ...],
) -> tuple[TableSpec, ...]:
    """Return the first spec, its narrower companions, and the same at every radius."""
    spine = robot.segments * robot.pitch_m
    found = [first, *_narrower(robot, first, straight)]
    wider = first
    for share, bands in zip(radii_over_length, turns):
        radius = round(share * spine, 3)
        wider = replace(first, name=f"{first.name} R{radius:g}", radius_m=radius, after=wider.name)
        found += [wider, *_narrower(robot, wider, bands)]
    return tuple(found)


def _narrower(robot: Robot, widest: TableSpec, bands: tuple[float, ...]) -> list[TableSpec]:
    found = []
    kind = "strong" if widest.load else "slim"
    for share in bands:
        band = round(share * robot.body_width_m, 4)
        radius = "" if widest.radius_m is None else f" R{widest.radius_m:g}"
        widest = replace(widest, name=f"{kind}{band * 1e3:.0f}{radius}", band_m=band, after=widest.name)
        found.append(widest)
    return found


def generations(asked: tuple[TableSpec, ...]) -> tuple[tuple[TableSpec, ...], ...]:
    """Return the specs in groups: each needs only gaits of the groups before."""
    depth: dict[str | None, int] = {None: -1}
    for spec in asked:
        depth[spec.name] = depth[spec.after] + 1
    groups: list[list[TableSpec]] = [[] for _ in range(max(depth.values()) + 1)]
    for spec in asked:
        groups[depth[spec.name]].append(spec)
    return tuple(map(tuple, groups))
