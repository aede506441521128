"""What a gait table asks for, and in which order each gait starts from a neighbour."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.robot import Robot

RADII_OVER_LENGTH = (4.0, 1.6, 0.9, 0.6, 0.45)
# total width of the swept band over the body's: of straight gaits, and of turns by radius (as above)
STRAIGHT_BANDS = (1.95, 1.8, 1.65, 1.5, 1.4, 1.36, 1.3)
TURN_BANDS = ((1.75, 1.5, 1.35), (1.75, 1.5, 1.35), (1.75, 1.5), (1.75, 1.5, 1.4), (1.6,))


@dataclass(frozen=True)
class Wish:
    """One entry to optimize.

    Attributes
    ----------
    name : str
    radius_m, band_m : float or None
        Wanted radius (None: straight) and widest band (None: any).
    after : str or None
        Name of the wish whose gait this one starts from; None: the first of all.
    """

    name: str
    radius_m: float | None
    band_m: float | None
    after: str | None


def wishes(robot: Robot) -> tuple[Wish, ...]:
    """Return what a table holds, forward and to the left; the other three quadrants are images.

    Fast gaits go from the straight one to the tightest turn; at every radius, bands go from the fast gait's
    to the slimmest. (A slim gait hardly leads to a slim one at another radius: its on-intervals are
    another matter altogether.)
    """
    spine = robot.segments * robot.pitch_m
    found = [Wish("fast", None, None, None)]
    found += _narrower(robot, "fast", None, STRAIGHT_BANDS)
    wider = "fast"
    for share, bands in zip(RADII_OVER_LENGTH, TURN_BANDS):
        radius = round(share * spine, 3)
        name = f"fast R{radius:g}"
        found.append(Wish(name, radius, None, wider))
        found += _narrower(robot, name, radius, bands)
        wider = name
    return tuple(found)


def _narrower(robot: Robot, after: str, radius: float | None, bands: tuple[float, ...]) -> list[Wish]:
    found = []
    for share in bands:
        band = round(share * robot.body_width_m, 4)
        name = f"slim{band * 1e3:.0f}" + ("" if radius is None else f" R{radius:g}")
        found.append(Wish(name, radius, band, after))
        after = name
    return found


def generations(asked: tuple[Wish, ...]) -> tuple[tuple[Wish, ...], ...]:
    """Return the wishes in groups: each needs only gaits of the groups before."""
    depth: dict[str | None, int] = {None: -1}
    for wish in asked:
        depth[wish.name] = depth[wish.after] + 1
    groups: list[list[Wish]] = [[] for _ in range(max(depth.values()) + 1)]
    for wish in asked:
        groups[depth[wish.name]].append(wish)
    return tuple(map(tuple, groups))
