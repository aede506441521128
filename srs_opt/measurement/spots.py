"""Where markers sit on the robot: on a link, or beside a pressure chamber."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from srs_opt.document import Document, format_place, load_schema, read_yaml, violations
from srs_opt.errors import InputError

LAYOUTS = ("links", "chamber_ends", "chamber_middles")


@dataclass(frozen=True)
class Spot:
    """The place of one marker.

    Attributes
    ----------
    link : int or None
        Link that carries it, from 1 at the tail; the marker moves rigidly with the link.
    segment : int or None
        Segment whose chamber carries it, instead of a link.
    at : float
        Share of the chamber's length from its tail end, 0 to 1 (segment only).
    dx_m : float
        Towards the head from the link's centre (link only).
    dy_m : float
        To the left of the centre line.
    """

    link: int | None = None
    segment: int | None = None
    at: float = 0.0
    dx_m: float = 0.0
    dy_m: float = 0.0

    @property
    def carrier(self) -> int:
        """Return the index of the link at or before the marker, from 0."""
        number = self.link if self.link is not None else self.segment
        assert number is not None
        return number - 1

    def record(self) -> dict[str, Any]:
        """Return the entry of dataset.yaml."""
        own = {"link": self.link} if self.link is not None else {"segment": self.segment, "at": self.at}
        return own | {key: value for key in ("dx_m", "dy_m") if (value := getattr(self, key))}


Spots = tuple[Spot, ...]


def one_per_link(links: int) -> Spots:
    """Return a marker on the centre of every link."""
    return tuple(Spot(link=i) for i in range(1, links + 1))


def named_layout(name: str, links: int) -> Spots:
    """Return a layout of `LAYOUTS`, tail to head."""
    segments = range(1, links)
    if name == "links":
        return one_per_link(links)
    shares = (0.0, 1.0) if name == "chamber_ends" else (0.5,)
    return tuple(Spot(segment=i, at=share) for i in segments for share in shares)


def load_spots(place: str, links: int) -> Spots:
    """Return a layout by its name (`LAYOUTS`), or from a file: a list, or a list under the key ``markers``.

    Raises
    ------
    InputError
        If there is no such file, or it breaks the schema or does not fit the robot.
    """
    if place in LAYOUTS:
        return named_layout(place, links)
    if not Path(place).is_file():
        raise InputError(f"--markers: expected {', '.join(LAYOUTS)} or a file, found '{place[:60]}'")
    document = read_yaml(place, "a list of markers (YAML)")
    spots, problems = spots_of(document, ("markers",) if isinstance(document.value, dict) else (), links)
    if problems:
        raise problems[0]
    return spots


def spots_of(document: Document, place: tuple[str, ...], links: int) -> tuple[Spots, list[InputError]]:
    """Return the spots listed at a place of a document, and what is wrong with them (then no spots)."""
    value = document.value
    for key in place:
        value = value.get(key) if isinstance(value, dict) else None
    lines = {where[len(place) :]: n for where, n in document.lines.items() if where[: len(place)] == place}
    part = Document(document.source, value, lines)
    problems = violations(part, load_schema("srs_opt.measurement", "markers.schema.json"))
    if problems:
        return (), problems
    spots = _spots_of_records(value)
    wrong = _mixed(value) or spots_problem(spots, links)
    if wrong:
        line = lines.get((wrong[0],))
        where = f"{document.source}:{line}" if line else document.source
        return (), [InputError(f"{where}: {format_place((*place, wrong[0]))}: {wrong[1]}")]
    return spots, []


def _mixed(records: list[dict[str, Any]]) -> tuple[int, str] | None:
    """Return the first entry whose keys do not belong together, and why."""
    for k, record in enumerate(records):
        if ("link" in record) == ("segment" in record):
            return k, "expected either link (and dx_m) or segment (and at)"
        alien = {"at"} if "link" in record else {"dx_m"}
        if alien & set(record):
            return k, f"{alien.pop()} does not go with {'link' if 'link' in record else 'segment'}"
        if "segment" in record and "at" not in record:
            return k, "at is missing (share of the chamber's length from its tail end, 0 to 1)"
    return None


def _spots_of_records(records: list[dict[str, Any]]) -> Spots:
    return tuple(
        Spot(
            link=None if r.get("link") is None else int(r["link"]),
            segment=None if r.get("segment") is None else int(r["segment"]),
            at=float(r.get("at", 0.0)),
            dx_m=float(r.get("dx_m", 0.0)),
            dy_m=float(r.get("dy_m", 0.0)),
        )
        for r in records
    )


def spots_problem(spots: Spots, links: int) -> tuple[int, str] | None:
    """Return the first entry that does not fit the robot, and why; None if all do."""
    seen: dict[Spot, int] = {}
    for k, spot in enumerate(spots):
        what, count = ("link", links) if spot.link is not None else ("segment", links - 1)
        if spot.carrier >= count:
            return k, f"{what} {spot.carrier + 1}: the robot has {count} {what}s"
        if spot in seen:
            return k, f"is the place of marker {seen[spot] + 1} too"
        seen[spot] = k
    if len(spots) < 2:
        return 0, "one marker does not tell the heading (expected two or more; or markers: centre_of_mass)"
    return None
