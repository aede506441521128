"""A robot, its controller and its camera on one clock: what a pilot meets, without waiting for real time."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from virtual_lab.camera import to_camera
from virtual_lab.controller import Controller
from virtual_lab.live import LiveRobot
from virtual_lab.truth import Truth

LONGEST_HOLD_S = 0.01  # the robot is moved on at least so often
STAIR_S = 0.005  # of a changing pressure


@dataclass(frozen=True)
class Imperfections:
    """What stands between the robot and the pilot.

    Attributes
    ----------
    noise_m : float
        Standard deviation of a marker's coordinate.
    lost : float
        Probability that a marker is lost in a picture.
    latency_s : float
        From a picture until it is there.
    line_s : float
        Of the valve line, each way.
    rate_hz : float
        Pictures per second.
    clock_s : float
        The camera's clock when the world's is 0.
    settle_s : float
        The regulator goes from one pressure to the next linearly, in this time.
    """

    noise_m: float = 0.001
    lost: float = 0.002
    latency_s: float = 0.03
    line_s: float = 0.004
    rate_hz: float = 100.0
    clock_s: float = 12345.678
    settle_s: float = 0.1


DEFAULT = Imperfections()


@dataclass
class _Queue:
    """Things that arrive later."""

    delay_s: float
    items: list[tuple[float, bytes]] = field(default_factory=list)

    def put(self, now_s: float, data: bytes) -> None:
        if data:
            self.items.append((now_s + self.delay_s, data))

    def due(self, now_s: float) -> list[bytes]:
        count = sum(due <= now_s + 1e-9 for due, _ in self.items)
        found = [data for _, data in self.items[:count]]
        del self.items[:count]
        return found


class World:
    """A live robot behind a controller's line and a camera's stream, advanced by `sleep`.

    It is a clock (`now`, `sleep`) and a serial port (`read`, `write`) at once; `pictures` returns the
    camera's JSON lines that have come.

    Attributes
    ----------
    track : list of (time_s, (N, 2) places, (N,) headings, (N-1,) curvatures)
        What really happened, at every picture.
    blind : bool
        Set to let no picture through any more.
    """

    def __init__(
        self,
        truth: Truth,
        program: Path,
        start: tuple[float, float, float],
        seed: int = 0,
        imperfections: Imperfections = DEFAULT,
        tick_s: float = 1e-3,
        words: int = 1,
    ) -> None:
        self.robot = LiveRobot(truth, *start)
        self.controller = Controller(program, words)
        self._truth, self._tick_s, self._i = truth, tick_s, imperfections
        self._rng = np.random.default_rng(seed)
        self._time_s, self._next_picture_s = 0.0, 0.0
        self._there, self._back = _Queue(imperfections.line_s), _Queue(imperfections.line_s)
        self._camera = _Queue(imperfections.latency_s)
        self._valves, self._pressure_kpa = np.zeros(truth.parameters.links - 1), 0.0
        self._ramp = (-math.inf, 0.0, 0.0)  # since when the regulator goes from which pressure to which
        self._held_s = 0.0
        self.track: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []
        self.blind = False

    def now(self) -> float:
        """Return the world's time, s."""
        return self._time_s

    def sleep(self, seconds: float) -> None:
        """Let time pass, in whole ticks of the controller."""
        for _ in range(max(1, round(seconds / self._tick_s))):
            self._tick()

    def write(self, data: bytes) -> int:
        """Send bytes to the controller."""
        self._there.put(self._time_s, bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Return the controller's bytes that have come."""
        return b"".join(self._back.due(self._time_s))

    def pictures(self) -> list[bytes]:
        """Return the camera's lines that have come."""
        return self._camera.due(self._time_s)

    def _tick(self) -> None:
        for data in self._there.due(self._time_s):
            self.controller.receive(data)
        valves, set_kpa = self.controller.tick()
        pressure_kpa = self._regulated(set_kpa)
        self._back.put(self._time_s, self.controller.send())
        if pressure_kpa != self._pressure_kpa or not np.array_equal(valves, self._valves):
            self._move()
            self._valves, self._pressure_kpa = valves, pressure_kpa
        self._time_s += self._tick_s
        self._held_s += self._tick_s
        if self._held_s >= LONGEST_HOLD_S - 1e-9:
            self._move()
        if self._time_s >= self._next_picture_s - 1e-9:
            self._next_picture_s += 1 / self._i.rate_hz
            self._picture()

    def _regulated(self, set_kpa: float) -> float:
        """Return the regulator's pressure, in stairs of STAIR_S."""
        began_s, from_kpa, to_kpa = self._ramp
        if set_kpa != to_kpa:
            began_s, from_kpa, to_kpa = self._ramp = self._time_s, self._pressure_kpa, set_kpa
        stairs = math.floor((self._time_s - began_s) / STAIR_S + 1e-6) if math.isfinite(began_s) else math.inf
        share = (stairs + 0.5) * STAIR_S / self._i.settle_s if self._i.settle_s else 1.0
        return to_kpa if share >= 1 else from_kpa + share * (to_kpa - from_kpa)

    def _move(self) -> None:
        if self._held_s > 0:
            self.robot.advance(self._valves, self._pressure_kpa, self._held_s)
            self._held_s = 0.0

    def _picture(self) -> None:
        self._move()
        seen = self.robot.look()
        places = np.stack([seen.x[0], seen.y[0]], axis=1)
        self.track.append((self._time_s, places, seen.theta[0], seen.kappa[0]))
        if self.blind:
            return
        shown = to_camera(self._truth, places[None], np.array([self._time_s]))[0]
        shown = shown + self._i.noise_m * self._rng.standard_normal(shown.shape)
        lost = self._rng.random(len(shown)) < self._i.lost
        markers = [
            None if gone else [round(float(x), 6), round(float(y), 6)] for (x, y), gone in zip(shown, lost)
        ]
        line = {"t_s": round(self._time_s + self._i.clock_s, 6), "markers_m": markers}
        self._camera.put(self._time_s, json.dumps(line).encode())
