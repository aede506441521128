"""The valve controller's firmware, compiled for this machine and run tick by tick."""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from virtual_lab.errors import LabError

FIRMWARE = Path(__file__).resolve().parent.parent / "firmware"
FLAGS = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")


class Controller:
    """One controller with a flashed program, vented until a command comes over its line.

    Parameters
    ----------
    program : Path
        Header that ``gait_opt --table`` or ``plan`` wrote.
    words : int
        32-bit words per valve mask that the header asks for.

    Raises
    ------
    LabError
        There is no C compiler, or the program does not compile.
    """

    def __init__(self, program: Path, words: int = 1) -> None:
        self._library = ctypes.CDLL(str(_build(Path(program), words)))
        self._library.srs_host_new.restype = ctypes.c_void_p
        self._library.srs_host_tick.restype = ctypes.c_uint32
        self._library.srs_host_send.restype = ctypes.c_uint32
        self._device = ctypes.c_void_p(self._library.srs_host_new())
        self.segments = int(self._library.srs_host_segments())
        self._states = (ctypes.c_int8 * self.segments)()
        self._out = (ctypes.c_uint8 * 512)()

    def receive(self, data: bytes) -> None:
        """Give the controller bytes from its line."""
        self._library.srs_host_receive(self._device, data, ctypes.c_uint32(len(data)))

    def send(self) -> bytes:
        """Return the bytes that the controller has for its line."""
        found = b""
        while count := self._library.srs_host_send(self._device, self._out, ctypes.c_uint32(len(self._out))):
            found += bytes(self._out[:count])
        return found

    def tick(self) -> tuple[np.ndarray, float]:
        """Advance one tick; return S per segment (1 left, -1 right, 0 vented) and the pressure in kPa."""
        pressure_pa = self._library.srs_host_tick(self._device, self._states)
        return np.array(self._states[:], dtype=np.int8), 1e-3 * pressure_pa

    def corrupt(self, mask: int) -> None:
        """Overwrite the valve mask that comes next, as a fault in memory would."""
        self._library.srs_host_corrupt(self._device, ctypes.c_uint32(mask))

    @property
    def fault(self) -> int:
        """The controller's last fault code."""
        return int(self._library.srs_host_fault(self._device))

    def __del__(self) -> None:
        if hasattr(self, "_device"):
            self._library.srs_host_free(self._device)


def _build(program: Path, words: int) -> Path:
    """Compile the firmware with `program`; the library is kept by the hash of its sources."""
    compiler = shutil.which(os.environ.get("CC", "cc")) or shutil.which("cc")
    if compiler is None:
        raise LabError("the virtual robot runs the firmware's C code; install a C compiler (cc)")
    sources = [FIRMWARE / "srs_player.c", FIRMWARE / "srs_link.c", FIRMWARE / "host" / "srs_host.c"]
    read = [*sources, FIRMWARE / "srs_player.h", FIRMWARE / "srs_link.h", program]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in read) + bytes([words])).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"virtual_lab-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        raise LabError(f"{folder} belongs to another user; set TMPDIR to a folder of your own")
    library = folder / f"firmware-{digest}.so"
    if not library.exists():
        part = folder / f"firmware-{digest}-{os.getpid()}.so"
        define = [f"-DSRS_WORDS={words}", f'-DSRS_PROGRAM="{program.resolve()}"', f"-I{FIRMWARE}"]
        command = [compiler, *FLAGS, *define, *map(str, sources), "-o", str(part)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise LabError(f"{program} does not compile: {done.stderr.strip().splitlines()[0]}")
        part.replace(library)
    return library
