"""What a gait table asks for, and in which order each gait starts from a neighbour."""

from __future__ import annotations

from dataclasses import dataclass, replace

from srs_opt.robot import Robot

RADII_OVER_LENGTH = (4.0, 1.6, 0.9, 0.6, 0.45)
# total width of the swept band over the body's: of straight gaits, and of turns by radius (as above)
STRAIGHT_BANDS = (1.95, 1.8, 1.65, 1.5, 1.4, 1.36, 1.3)
TURN_BANDS = ((1.75, 1.5, 1.35), (1.75, 1.5, 1.35), (1.75, 1.5), (1.75, 1.5, 1.4), (1.6,))
# Gathering speed at a is like rolling on wheels whose friction is larger by a/g: what is the fastest then
# accelerates best. For the built-in robot the loads stand for 0.15 and 0.34 m/s2: what gathers the last
# speed, and what sets off from rest.
STRONG_LOAD, RUSH_LOAD = 0.35, 0.8
# enough to see how a new robot goes and to plan through a wide maze: two radii, one slimmer band
QUICK_RADII_OVER_LENGTH, QUICK_STRAIGHT_BANDS = (1.6, 0.6), (1.65,)
STRONG_BANDS, STRONG_TURN_BANDS = (1.95, 1.75, 1.6), ((), (1.75,), (1.75,), (1.75,), ())
RUSH_TURN_BANDS: tuple[tuple[float, ...], ...] = ((), (), (), ())


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
        return replace(robot, friction_tangential=(1 + self.load) * robot.friction_tangential)


def table_specs(robot: Robot, *, quick: bool = False) -> tuple[TableSpec, ...]:
    """Return what a table, or a quick one, holds, forward and to the left; the other quadrants are images.

    Fast gaits go from the straight one to the tightest turn; at every radius, bands go from the fast gait's
    to the slimmest. (A slim gait hardly leads to a slim one at another radius: its on-intervals are
    another matter altogether.) Strong gaits and those that rush off from rest do the same under their loads.
    """
    first = TableSpec("fast", None, None, None)
    if quick:
        return _fan(robot, first, QUICK_STRAIGHT_BANDS, ((), ()), QUICK_RADII_OVER_LENGTH)
    fast = _fan(robot, first, STRAIGHT_BANDS, TURN_BANDS)
    strong = TableSpec("strong", None, None, "fast", STRONG_LOAD)
    rush = TableSpec("rush", None, None, "strong", RUSH_LOAD)
    laden = _fan(robot, strong, STRONG_BANDS, STRONG_TURN_BANDS) + _fan(robot, rush, (), RUSH_TURN_BANDS)
    return fast + laden


def _fan(
    robot: Robot,
    first: TableSpec,
    straight: tuple[float, ...],
    turns: tuple[tuple[float, ...], ...],
    radii_over_length: tuple[float, ...] = RADII_OVER_LENGTH,
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
