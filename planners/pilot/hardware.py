"""This machine's clock and serial ports."""

from __future__ import annotations

import time
from typing import Any

from srs_opt.errors import InputError


class MachineClock:
    """The machine's monotonic clock; in slow motion it runs so many times slower."""

    def __init__(self, slow_motion: float = 1.0) -> None:
        self._slow_motion = slow_motion

    def now(self) -> float:
        """Return the time in seconds."""
        return time.monotonic() / self._slow_motion

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds * self._slow_motion)


def open_port(name: str, baud: int) -> Any:
    """Return an open serial port, read without waiting.

    Raises
    ------
    InputError
        If pyserial is missing or the port cannot be opened.
    """
    try:
        import serial
    except ImportError as error:
        raise InputError("--valves needs pyserial: pip install 'srs-opt[pilot]'") from error
    try:
        return serial.serial_for_url(name, baudrate=baud, timeout=0, write_timeout=0.2)
    except (serial.SerialException, OSError, ValueError) as error:
        raise InputError(
            f"--valves {name}: cannot be opened ({error}); is the controller plugged in?"
        ) from error
