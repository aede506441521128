"""Files written whole or not at all, and files read with one-line complaints."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from srs_opt.errors import InputError
from srs_opt.interrupts import signals_deferred

MAX_TEXT_BYTES = 64 * 1024 * 1024


@contextlib.contextmanager
def atomic_path(target: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside `target`; move it into place on success, remove it on failure."""
    target = Path(target)
    temporary = None
    try:
        with _explained(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with signals_deferred():  # else the file could be there and its name not yet known here
                handle, name = tempfile.mkstemp(dir=target.parent, prefix=".partial-", suffix=target.suffix)
                temporary = Path(name)
            os.close(handle)
            yield temporary
            umask = os.umask(0)
            os.umask(umask)
            temporary.chmod(0o666 & ~umask)
            os.replace(temporary, target)
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def temporary_folder(parent: Path | None = None, prefix: str = "srs_opt-") -> Iterator[Path]:
    """Yield a new folder (in `parent`, else the system's) that is removed with what it holds.

    tempfile.TemporaryDirectory leaves it behind if SIGTERM arrives while it is made or removed.
    """
    folder = None
    try:
        with signals_deferred():
            folder = Path(tempfile.mkdtemp(dir=parent, prefix=prefix))
        yield folder
    finally:
        if folder is not None:
            with signals_deferred():
                shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _explained(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{target}: cannot write: {reason}; choose another folder with --out") from error


def check_can_write(folder: Path, *, or_file: bool = False) -> None:
    """Complain before long work rather than after it.

    Parameters
    ----------
    folder : Path
        Where files will be made.
    or_file : bool
        Whether `folder` may instead be the name of one file, which may exist.

    Raises
    ------
    InputError
        If files cannot be made in `folder`, or, when it does not exist yet, where it would be made.
    """
    with _explained(folder):
        place = folder
        while not place.exists():
            place = place.parent
        if or_file and place == folder and place.is_file():
            return
        with tempfile.TemporaryFile(dir=place):
            pass


def write_text(target: Path | str, text: str) -> Path:
    """Write `text` (UTF-8, Unix line ends) to `target` atomically."""
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return Path(target)


def write_json(target: Path | str, value: Any) -> Path:
    """Write `value` as indented JSON, atomically; not-a-number is refused."""
    return write_text(target, json.dumps(value, indent=2, allow_nan=False) + "\n")


def write_with(target: Path | str, writer: Callable[[IO[str]], None]) -> Path:
    """Let `writer` fill a text file, atomically (for CSV and other streamed output)."""
    with atomic_path(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer(stream)
    return Path(target)


def read_bytes(path: Path | str, what: str, limit: int = MAX_TEXT_BYTES) -> bytes:
    """Read the file at `path`, at most `limit` bytes.

    Raises
    ------
    InputError
        If the file is missing, unreadable, not a regular file or too large.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise InputError(f"{path}: {_not_a_file(path)} (expected {what})")
        size = path.stat().st_size
        if size > limit:
            raise InputError(
                f"{path}: {size / 1e6:.0f} MB is too large for {what} (limit {limit / 1e6:.0f} MB)"
            )
        return path.read_bytes()
    except OSError as error:  # includes symlink loops and missing permissions
        raise InputError(f"{path}: cannot read {what}: {error.strerror or error}") from error


def _not_a_file(path: Path) -> str:
    if path.is_dir():
        return "is a folder"
    if path.is_symlink() and not path.exists():
        return "a symbolic link that leads nowhere or in a circle"
    return "not a file" if path.exists() else "no such file"


def read_text(path: Path | str, what: str, limit: int = MAX_TEXT_BYTES) -> str:
    """Read a UTF-8 text file (a byte-order mark and any line ends are fine)."""
    data = read_bytes(path, what, limit)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start}: not UTF-8 text (expected {what})") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")
