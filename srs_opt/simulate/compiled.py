"""Generated C, compiled once and cached on disk; without a compiler the interpreter does the same work.

The cache key holds everything the machine code depends on: the package's own equations (source hash),
the structure, casadi's version, the compiler and its version, the flags. Libraries are moved into place
atomically, so two processes may build the same one at once. A library ends with its own hash (loaders
ignore what follows the sections): one that is damaged is never loaded, which could kill the process, but
built again.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import shlex
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import casadi as ca

from srs_opt.effects.plugins import registered
from srs_opt.errors import InputError
from srs_opt.files import temporary_folder
from srs_opt.interrupts import signals_deferred
from srs_opt.registry import own_names
from srs_opt.simulate.parts import in_parts

FLAGS = ("-O1", "-fPIC", "-shared", "-fno-math-errno")

_SEAL = 32  # bytes of a SHA-256

compile_seconds = 0.0  # spent in this process, for the commands' reports


def cache_folder() -> Path:
    """Return the folder of compiled models (``SRS_OPT_CACHE`` overrides the platform's own place)."""
    import platformdirs

    wanted = os.environ.get("SRS_OPT_CACHE")
    if wanted:
        return Path(wanted).absolute()
    place = Path(platformdirs.user_cache_dir("srs-opt", appauthor=False))
    # the base directory specification asks to ignore a relative XDG_CACHE_HOME
    return place if place.is_absolute() else Path.home() / ".cache" / "srs-opt"


@lru_cache(maxsize=1)
def compiler() -> tuple[tuple[str, ...], str] | None:
    """Return the C compiler's command and its version line, or None (``SRS_OPT_CC=none`` switches it off).

    The variables may hold options or a wrapper, as with make: ``CC="ccache gcc"``.
    """
    wanted = os.environ.get("SRS_OPT_CC") or os.environ.get("CC")
    for command in [shlex.split(wanted)] if wanted else [["cc"], ["gcc"], ["clang"]]:
        path = shutil.which(command[0]) if command else None
        if path is None:
            continue
        command = [path, *command[1:]]
        try:
            done = _run([*command, "--version"], timeout_s=20)
        except (OSError, subprocess.SubprocessError):
            continue
        return tuple(command), (done.splitlines() or [path])[0]
    note_interpreted("no C compiler found")
    return None


@lru_cache(maxsize=1)
def _source_digest() -> str:
    """Return a hash of the package's equations: what the generated code is made from."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    files = [package / "geometry.py"]
    for folder in ("model", "effects", "simulate"):
        files += sorted(p for p in (package / folder).rglob("*.*") if p.suffix in (".py", ".in"))
    for file in files:
        # bytes, not meaning: a changed comment builds anew, which costs time and is never wrong
        digest.update(file.read_bytes())
    return digest.hexdigest()


def compiled(key: str, build: Callable[[], ca.Function], flags: tuple[str, ...] = FLAGS) -> ca.Function:
    """Return the function that `build` makes, as compiled code where a compiler is there.

    Parameters
    ----------
    key : str
        Says, with the package's sources, what `build` makes; equal keys must mean equal functions.
    build : callable
        Makes the casadi.Function; called only when the cache does not hold it.
    flags : tuple of str
        For the compiler.
    """
    found = shared_library(key, build, _casadi_source, flags)
    if found is not None:
        try:
            return ca.external(found.stem, str(found))
        except RuntimeError:  # made for another machine, or a file system without execution
            note_interpreted(f"{found.parent}: compiled models cannot be loaded from this folder")
    return build()


@lru_cache
def note_interpreted(reason: str) -> None:
    """Say once that models run interpreted."""
    print(f"note: {reason}; models run interpreted, about ten times slower", file=sys.stderr)


def shared_library(
    key: str,
    build: Callable[[], ca.Function],
    source: Callable[[ca.Function, str], str],
    flags: tuple[str, ...],
) -> Path | None:
    """Return the shared library of ``source(build(), name)``, built if need be; its name is the file's stem.

    None where there is no compiler or it fails (said once, on stderr).
    """
    global compile_seconds
    cc = compiler()
    if cc is None:
        return None
    parts = [key, _source_digest(), ca.CasadiMeta.version(), platform.machine(), *cc[0], cc[1], *flags]
    if any(
        name in key for name in (*registered(), *own_names("model"))
    ):  # their equations are not part of the package's sources
        parts.append(build().serialize())
    # the zero character between parts keeps two lists from reading alike
    path = cache_folder() / f"srs_{hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:32]}.so"
    _check_owner(path.parent)
    if path.exists() and _whole(path):
        return path
    started = time.perf_counter()
    try:
        _compile(source(build(), path.stem), path, [*cc[0], *flags])
    except (OSError, subprocess.SubprocessError) as error:
        print(f"note: compiling a model failed ({error}); it runs interpreted, slower", file=sys.stderr)
        return None
    finally:
        compile_seconds += time.perf_counter() - started
    return path


def _check_owner(folder: Path) -> None:
    """Refuse a cache that somebody else can write: its machine code would be run."""
    if not folder.exists() or not hasattr(os, "getuid"):
        return
    status = folder.stat()
    if status.st_uid not in (os.getuid(), 0) or status.st_mode & stat.S_IWOTH:
        raise InputError(
            f"{folder}: others can write into this folder, and compiled models in it would be run; take away "
            "their permission, or name another folder with SRS_OPT_CACHE"
        )


def _whole(path: Path) -> bool:
    """Whether a library is what was once written; a damaged one is removed."""
    try:
        content = path.read_bytes()
        if hashlib.sha256(content[:-_SEAL]).digest() == content[-_SEAL:]:
            return True
    except OSError:  # unreadable: rebuild
        pass
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
    return False


def _compile(source: str, path: Path, command: list[str]) -> None:
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with temporary_folder(path.parent, ".building-") as folder:
        file, target = folder / "model.c", folder / "model.so"
        file.write_text(source, encoding="utf-8")
        command = [*command, str(file), "-o", str(target), "-lm"]
        _run(command, timeout_s=900)
        content = target.read_bytes()
        target.write_bytes(content + hashlib.sha256(content).digest())
        os.replace(target, path)


def _run(command: list[str], timeout_s: float) -> str:
    """Run a compiler and return what it prints, in whatever encoding; none of its processes outlives us."""
    apart = os.name == "posix"  # Ctrl-C is ours to pass on
    process = None
    try:
        with signals_deferred():  # one that came while the process starts would leave it unknown to us
            process = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                start_new_session=apart,
            )
        out, complaints = process.communicate(timeout=timeout_s)
    except BaseException:
        if process is not None:
            if apart:
                os.killpg(process.pid, signal.SIGKILL)  # gcc's own processes too
            process.kill()
            process.communicate()
        raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command, out, complaints)
    return out


def _casadi_source(function: ca.Function, name: str) -> str:
    inputs = function.mx_in()
    names_in = [function.name_in(i) for i in range(function.n_in())]
    names_out = [function.name_out(i) for i in range(function.n_out())]
    generator = ca.CodeGenerator(f"{name}.c")
    generator.add(ca.Function(name, inputs, function.call(inputs), names_in, names_out))
    return in_parts(str(generator.dump()))
