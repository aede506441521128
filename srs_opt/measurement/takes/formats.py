"""The registry of recording formats: which reader reads a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from srs_opt.errors import InputError
from srs_opt.files import read_bytes
from srs_opt.measurement.takes.binary import (
    MOST_BYTES,
    is_deeplabcut,
    read_c3d,
    read_deeplabcut,
    read_deeplabcut_h5,
)
from srs_opt.measurement.takes.columns import is_table, read_columns
from srs_opt.measurement.takes.marker_systems import (
    is_qualisys,
    is_trc,
    is_vicon,
    read_qualisys,
    read_trc,
    read_vicon,
)
from srs_opt.measurement.takes.motive import is_motive, read_motive
from srs_opt.measurement.takes.sheet import decode
from srs_opt.measurement.takes.take import ReadSettings, Take

Reader = Callable[[Path, ReadSettings], Take]
HEAD_BYTES = 4096


@dataclass(frozen=True)
class TrackFormat:
    """One format of recordings.

    Attributes
    ----------
    name : str
        As ``--format`` takes it.
    what : str
        For people.
    recognises : callable
        ``(path, first bytes, the same as text) -> bool``.
    read : callable
        ``(path, ReadSettings) -> Take``.
    """

    name: str
    what: str
    recognises: Callable[[Path, bytes, str], bool]
    read: Reader


FORMATS: list[TrackFormat] = [
    TrackFormat("c3d", "C3D", lambda path, data, text: path.suffix.lower() == ".c3d", read_c3d),
    TrackFormat(
        "deeplabcut-h5",
        "DeepLabCut HDF5",
        lambda path, data, text: data.startswith(b"\x89HDF"),
        read_deeplabcut_h5,
    ),
    TrackFormat("motive", "OptiTrack Motive CSV", lambda path, data, text: is_motive(text), read_motive),
    TrackFormat("qualisys", "Qualisys TSV", lambda path, data, text: is_qualisys(text), read_qualisys),
    TrackFormat("vicon", "Vicon Nexus CSV", lambda path, data, text: is_vicon(text), read_vicon),
    TrackFormat("trc", "TRC", lambda path, data, text: is_trc(text), read_trc),
    TrackFormat(
        "deeplabcut", "DeepLabCut CSV", lambda path, data, text: is_deeplabcut(text), read_deeplabcut
    ),
    TrackFormat("table", "any table of positions", lambda path, data, text: is_table(text), read_columns),
]


def register(track_format: TrackFormat) -> None:
    """Add a format of one's own; it is asked before the others."""
    FORMATS.insert(0, track_format)


def read_take(path: Path | str, settings: ReadSettings | None = None, name: str = "auto") -> Take:
    """Read a recording in whatever format it is (or in the one called `name`).

    Raises
    ------
    InputError
        If no reader knows the file, or the one that does finds a fault.
    """
    path, settings = Path(path), settings or ReadSettings()
    known = {f.name: f for f in FORMATS}
    if name != "auto":
        if name not in known:
            raise InputError(f"--format: expected auto, {', '.join(known)}, found '{name[:40]}'")
        return known[name].read(path, settings)
    if settings.columns is not None:
        return known["table"].read(path, settings)
    data = read_bytes(path, "a recording of positions", MOST_BYTES)[:HEAD_BYTES]
    text = decode(data[: len(data) // 2 * 2 if b"\x00" in data else len(data)])[0]
    for track_format in FORMATS:
        if track_format.recognises(path, data, text):
            return track_format.read(path, settings)
    raise InputError(
        f"{path}: not a recording in a known format ({', '.join(f.what for f in FORMATS)}); say which column "
        "is what with --columns, or write trials/NAME.csv of a data set yourself: time_s, x1_m, y1_m, ..."
    )
