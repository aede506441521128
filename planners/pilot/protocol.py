"""Messages between pilot and valve controller, byte by byte (docs/howto/firmware.md describes them).

Frames follow RFC 1662: the flag 0x7E before and after, 0x7D escapes a byte whose bit 5 is then changed, and
CRC-16/X.25 (least significant byte first) ends the frame. A frame holds: version, type, sequence number,
payload. All integers are little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

VERSION = 1
FLAG, ESCAPE, CHANGED_BIT = 0x7E, 0x7D, 0x20
NONE = 0xFFFF
MOST_FRAME = 2048  # bytes; longer input without a flag is noise


class Command(IntEnum):
    """Types of messages to the controller."""

    PING = 1
    SELECT = 2
    VENT = 3
    RUN = 4
    QUERY = 5
    CYCLE = 6


class State(IntEnum):
    """What the controller is doing."""

    VENTED = 0
    SETTLING = 1
    PLAYING = 2
    VENTING = 3


class Fault(IntEnum):
    """Faults and refusals of the controller."""

    OK = 0
    PROGRAM = 1
    BOTH_VALVES = 2
    TIMEOUT = 3
    DWELL = 4
    REFUSED_GAIT = 5
    REFUSED_CYCLE = 6
    REFUSED_BUSY = 7
    REFUSED_PLAN = 8
    REFUSED_MESSAGE = 9

    @property
    def in_words(self) -> str:
        """What the fault means."""
        return _FAULT_WORDS[self]


_FAULT_WORDS = {
    Fault.OK: "no fault",
    Fault.PROGRAM: "the flashed program is not valid; generate and flash it again",
    Fault.BOTH_VALVES: "a valve mask would have opened both valves of a segment; the controller vented",
    Fault.TIMEOUT: "the controller heard nothing from the pilot in time and vented",
    Fault.DWELL: "a valve switch came before the dwell time was over and was delayed",
    Fault.REFUSED_GAIT: "the controller holds no such gait",
    Fault.REFUSED_CYCLE: "the controller found the cycle that was sent not playable",
    Fault.REFUSED_BUSY: "the controller is still venting",
    Fault.REFUSED_PLAN: "the controller holds no plan, or is not vented",
    Fault.REFUSED_MESSAGE: "the controller does not know this message",
}

HELLO, STATUS = 0x81, 0x82


@dataclass(frozen=True)
class Hello:
    """The controller's answer to a ping."""

    seq: int
    segments: int
    words: int
    most_events: int
    gaits: int
    steps: int
    tick_s: float
    program: int
    fault: Fault


@dataclass(frozen=True)
class Status:
    """The controller's answer to any other command, and its report of every cycle that starts.

    Attributes
    ----------
    seq : int
        Of the command that it answers; 0 for a report.
    result : Fault
        Of that command.
    state, fault : State, Fault
    gait, pending : int or None
        Being played, and next; None where there is none or where the cycle was sent over the line.
    has_pending : bool
    tick, period : int
        Ticks played of the cycle (or of settling, venting), ticks of the cycle.
    step : int or None
        Of the plan.
    cycles : int
        Started since boot.
    time : int
        Ticks since boot.
    pressure_pa : int
        The regulator's set point.
    bad_frames : int
        That the controller has dropped.
    """

    seq: int
    result: Fault
    state: State
    fault: Fault
    has_pending: bool
    gait: int | None
    pending: int | None
    tick: int
    period: int
    step: int | None
    cycles: int
    time: int
    pressure_pa: int
    bad_frames: int


_HELLO = struct.Struct("<BBBHHIIB")
_STATUS = struct.Struct("<BBBBHHHHHIIIH")


def checksum(data: bytes) -> int:
    """Return CRC-16/X.25 of `data`."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x8408 if crc & 1 else 0)
    return crc ^ 0xFFFF


def frame(kind: int, seq: int, payload: bytes = b"") -> bytes:
    """Return a whole frame with flags, escapes and checksum."""
    body = bytes([VERSION, kind, seq]) + payload
    body += struct.pack("<H", checksum(body))
    out = bytearray([FLAG])
    for byte in body:
        out += bytes([ESCAPE, byte ^ CHANGED_BIT]) if byte in (FLAG, ESCAPE) else bytes([byte])
    return bytes(out + bytes([FLAG]))


def select_payload(gait: int, then: int | None) -> bytes:
    """Return the payload of the command to play one cycle of a gait, then the gait `then` (None: vent)."""
    return struct.pack("<HH", gait, NONE if then is None else then)


def cycle_payload(
    then: int | None, period: int, pressure_pa: int, events: Sequence[tuple[int, int]], words: int
) -> bytes:
    """Return the payload of the command to play one cycle from the end of the present cycle on.

    Parameters
    ----------
    then : int or None
        Gait after it; None: vent.
    events : sequence of (tick, mask)
    words : int
        32-bit words per mask, as the controller's hello says.
    """
    payload = struct.pack("<HHIB", NONE if then is None else then, period, pressure_pa, len(events))
    for tick, mask in events:
        payload += struct.pack("<H", tick) + mask.to_bytes(4 * words, "little")
    return payload


@dataclass
class Receiver:
    """Takes bytes as they come and returns the messages that are whole and right.

    Attributes
    ----------
    bad_frames : int
        Dropped so far: wrong checksum, version, length or type.
    """

    bad_frames: int = 0
    _body: bytearray = field(default_factory=bytearray)
    _escaped: bool = False

    def feed(self, data: bytes) -> list[Hello | Status]:
        """Return the messages that `data` completes."""
        found: list[Hello | Status] = []
        for byte in data:
            if byte == FLAG:
                if self._body:
                    message = _parse(bytes(self._body))
                    if message is None:
                        self.bad_frames += 1
                    else:
                        found.append(message)
                self._body.clear()
                self._escaped = False
            elif byte == ESCAPE:
                self._escaped = True
            elif len(self._body) < MOST_FRAME:
                self._body.append(byte ^ CHANGED_BIT if self._escaped else byte)
                self._escaped = False
        return found


def _parse(body: bytes) -> Hello | Status | None:
    """Return the message of a frame's content, None if it is not one."""
    if len(body) < 5 or checksum(body[:-2]) != int.from_bytes(body[-2:], "little") or body[0] != VERSION:
        return None
    kind, seq, payload = body[1], body[2], body[3:-2]
    try:
        if kind == HELLO and len(payload) == _HELLO.size:
            segments, words, events, gaits, steps, tick_us, program, fault = _HELLO.unpack(payload)
            return Hello(seq, segments, words, events, gaits, steps, tick_us * 1e-6, program, Fault(fault))
        if kind == STATUS and len(payload) == _STATUS.size:
            result, state, fault, has, gait, pending, tick, period, step, cycles, time, pressure, bad = (
                _STATUS.unpack(payload)
            )
            return Status(
                seq,
                Fault(result),
                State(state),
                Fault(fault),
                bool(has),
                _index(gait),
                _index(pending),
                tick,
                period,
                _index(step),
                cycles,
                time,
                pressure,
                bad,
            )
    except ValueError:  # a state or fault that this version does not know
        return None
    return None


def _index(value: int) -> int | None:
    return None if value == NONE else value
