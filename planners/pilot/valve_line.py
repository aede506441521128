"""The pilot's end of the valve line: commands repeated until they are answered, the controller's clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from planners.pilot import protocol
from planners.pilot.protocol import Command, Fault, Hello, State, Status
from planners.pilot.settings import VALVE_LINE
from srs_opt.errors import NoAnswerError


class Port(Protocol):
    """A line of bytes, such as ``serial.Serial(..., timeout=0)``."""

    def read(self, size: int = 1, /) -> bytes | None:
        """Return the bytes that have come, at most `size`, without waiting."""

    def write(self, data: bytes, /) -> int | None:
        """Send bytes."""


class Clock(Protocol):
    """Time for everything that the pilot does: the machine's, or a simulation's."""

    def now(self) -> float:
        """Return the time in seconds."""

    def sleep(self, seconds: float) -> None:
        """Let time pass."""


@dataclass(frozen=True)
class LineStatistics:
    """What the line was like.

    Attributes
    ----------
    commands, repeats : int
        Sent, and sent again because no answer came.
    bad_frames : int
        Dropped at the pilot's end.
    round_trip_s : float
        Least time from a command to its answer.
    """

    commands: int
    repeats: int
    bad_frames: int
    round_trip_s: float


class ValveLine:
    """Commands to the controller over a port.

    Every command carries a sequence number; the controller answers a repeated one without carrying it out
    again, so that lost, doubled and damaged frames change nothing but the time that a command takes.

    Parameters
    ----------
    port : Port
    clock : Clock
    hear : callable, optional
        Called with every status that comes, and the time at which it came.
    """

    def __init__(
        self, port: Port, clock: Clock, hear: Callable[[Status, float], None] = lambda status, time_s: None
    ) -> None:
        self._port, self._clock, self._hear = port, clock, hear
        self._receiver = protocol.Receiver()
        self._seq = self._commands = self._repeats = 0
        self._round_trip_s = math.inf
        self._last_sent_s = -math.inf
        self.hello: Hello | None = None
        self.status: Status | None = None
        # time of the controller's boot on the pilot's clock: the least found, since answers only come late
        self._boot_s = math.inf

    @property
    def statistics(self) -> LineStatistics:
        """What the line was like so far."""
        return LineStatistics(self._commands, self._repeats, self._receiver.bad_frames, self._round_trip_s)

    def ping(self) -> Hello:
        """Ask what the controller holds."""
        answer = self._ask(Command.PING, b"")
        assert isinstance(answer, Hello)  # only a hello answers a ping
        self.hello = answer
        return answer

    def select(self, gait: int, then: int | None) -> Status:
        """Ask for one cycle of a gait from the end of the present cycle on, then for `then` (None: vent)."""
        return self._command(Command.SELECT, protocol.select_payload(gait, then))

    def cycle(
        self, then: int | None, period: int, pressure_pa: int, events: Sequence[tuple[int, int]], words: int
    ) -> Status:
        """Ask for one cycle, given in ticks, from the end of the present cycle on."""
        whole = protocol.cycle_payload(then, period, pressure_pa, events, words)
        return self._command(Command.CYCLE, whole)

    def run(self) -> Status:
        """Start the controller's own plan."""
        return self._command(Command.RUN)

    def vent(self) -> Status:
        """Ask for vented chambers at once."""
        return self._command(Command.VENT)

    def query(self) -> Status:
        """Ask for the state."""
        return self._command(Command.QUERY)

    def poll(self) -> None:
        """Take in what has come; say a word to the controller when it is due."""
        self._take()
        if self._clock.now() - self._last_sent_s > VALVE_LINE.keep_alive_s:
            self._send(Command.QUERY, b"", self._next_seq())

    def time_of(self, ticks: int) -> float:
        """Return the time on the pilot's clock at which the controller had counted so many ticks."""
        assert self.hello is not None  # every session begins with a ping
        return self._boot_s + ticks * self.hello.tick_s

    def _command(self, kind: Command, payload: bytes = b"") -> Status:
        answer = self._ask(kind, payload)
        assert isinstance(answer, Status)  # all other commands are answered so
        if answer.result is not Fault.OK:
            raise NoAnswerError(f"{kind.name.lower()}: {answer.result.in_words}")
        return answer

    def _ask(self, kind: Command, payload: bytes) -> Hello | Status:
        """Send a command until it is answered."""
        seq = self._next_seq()
        for attempt in range(VALVE_LINE.most_tries):
            sent_s = self._send(kind, payload, seq)
            self._commands += attempt == 0
            self._repeats += attempt > 0
            while self._clock.now() - sent_s < VALVE_LINE.answer_s:
                for message in self._take():
                    wanted = Hello if kind is Command.PING else Status
                    if message.seq == seq and isinstance(message, wanted):
                        self._round_trip_s = min(self._round_trip_s, self._clock.now() - sent_s)
                        return message
                self._clock.sleep(0.001)
        raise NoAnswerError(
            f"the valve controller does not answer ({kind.name.lower()} sent {VALVE_LINE.most_tries} times, "
            f"{self._receiver.bad_frames} damaged frames received); check port, baud rate and power"
        )

    def _next_seq(self) -> int:
        self._seq = self._seq % 255 + 1  # 0 is for reports
        return self._seq

    def _send(self, kind: Command, payload: bytes, seq: int) -> float:
        self._port.write(protocol.frame(kind, seq, payload))
        self._last_sent_s = self._clock.now()
        return self._last_sent_s

    def _take(self) -> list[Hello | Status]:
        data = self._port.read(4096) or b""
        now = self._clock.now()
        messages = self._receiver.feed(data)
        for message in messages:
            if isinstance(message, Status):
                self.status = message
                if self.hello is not None:
                    self._boot_s = min(self._boot_s, now - message.time * self.hello.tick_s)
                self._hear(message, now)
        return messages


__all__ = ["Clock", "LineStatistics", "Port", "State", "ValveLine"]
