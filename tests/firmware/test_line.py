"""The C and the Python end of the valve line against each other, over a pseudo-terminal and a bad wire."""

import contextlib
import os
import shutil
import threading
import time
import tty

import numpy as np
import pytest

from planners.pilot import protocol
from planners.pilot.protocol import Command, Fault, Receiver, State
from planners.pilot.valve_line import ValveLine
from srs_opt.errors import NoAnswerError
from virtual_lab.controller import Controller

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


class Wire:
    """A controller that ticks with a clock of its own, on a wire that loses, doubles and damages bytes."""

    def __init__(self, controller, seed=0, lost=0.0, doubled=0.0, damaged=0.0, delay_s=0.0):
        self.controller, self.rng = controller, np.random.default_rng(seed)
        self.rates = lost, doubled, damaged
        self.delay_s, self.time_s = delay_s, 0.0
        self.there, self.back = [], []
        self.states = []

    def now(self):
        return self.time_s

    def sleep(self, seconds):
        for _ in range(max(1, round(seconds / 1e-3))):
            self.time_s += 1e-3
            self.controller.receive(self._due(self.there))
            self.states.append(self.controller.tick()[0])
            self._put(self.back, self.controller.send())

    def write(self, data):
        self._put(self.there, data)

    def read(self, size):
        return self._due(self.back)

    def _put(self, queue, data):
        lost, doubled, damaged = self.rates
        for byte in data:
            luck = self.rng.random(3)
            if luck[0] < lost:
                continue
            value = byte ^ int(self.rng.integers(1, 256)) if luck[1] < damaged else byte
            queue += [(self.time_s + self.delay_s, value)] * (1 + (luck[2] < doubled))

    def _due(self, queue):
        count = sum(due <= self.time_s + 1e-9 for due, _ in queue)
        data = bytes(value for _, value in queue[:count])
        del queue[:count]
        return data


def test_checksum_is_the_published_one():
    assert protocol.checksum(b"123456789") == 0x906E  # CRC-16/X-25's check value


def test_a_frame_byte_by_byte():
    # version 1, select (2), sequence 0x7E (escaped), gait 0x7D (escaped), checksum of the five bytes before
    body = bytes([1, 2, 0x7E, 0x7D, 0])
    crc = protocol.checksum(body)
    tail = b"".join(
        bytes([0x7D, b ^ 0x20]) if b in (0x7E, 0x7D) else bytes([b]) for b in (crc & 255, crc >> 8)
    )
    want = bytes([0x7E, 1, 2, 0x7D, 0x5E, 0x7D, 0x5D, 0]) + tail + b"\x7e"
    assert protocol.frame(Command.SELECT, 0x7E, b"\x7d\x00") == want


def test_what_the_controller_holds(header, program):
    wire = Wire(Controller(header), delay_s=0.005)
    hello = ValveLine(wire, wire).ping()
    assert (hello.segments, hello.words, hello.gaits, hello.steps) == (4, 1, len(program.gaits), 0)
    assert hello.tick_s == pytest.approx(program.tick_s) and hello.program == program.identity


@pytest.mark.parametrize("seed", range(6))
def test_commands_arrive_once_over_a_bad_wire(header, seed):
    # a command and its answer have some 50 bytes: with 0.24 % of them bad, every ninth exchange fails
    wire = Wire(Controller(header), seed, lost=8e-4, doubled=8e-4, damaged=8e-4, delay_s=0.002)
    line = ValveLine(wire, wire)
    line.ping()
    heard = []
    line._hear = lambda status, time_s: heard.append(status)
    gaits = list(np.random.default_rng(seed).integers(0, line.hello.gaits, 40))
    for gait in gaits:
        line.select(int(gait), int(gait))
        wire.sleep(0.05)
        line.poll()
    assert line.statistics.repeats > 0
    assert all(np.isin(wire.states, (-1, 0, 1)).ravel())
    # the last command stands, whatever happened on the way
    status = line.query()
    assert gaits[-1] in (status.gait, status.pending)


def test_a_doubled_command_is_carried_out_once(header):
    controller = Controller(header)
    frame = protocol.frame(Command.SELECT, 7, protocol.select_payload(3, 3))
    receiver = Receiver()
    controller.receive(frame + protocol.frame(Command.VENT, 8) + protocol.frame(Command.VENT, 8))
    controller.tick()
    first, second, third = (m for m in receiver.feed(controller.send()) if m.seq)
    assert first.state is State.SETTLING and second == third and second.state is State.VENTING


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_no_command(header, seed):
    rng = np.random.default_rng(seed)
    controller = Controller(header)
    good = protocol.frame(Command.SELECT, 1, protocol.select_payload(3, 3))
    for _ in range(200):
        noise = bytes(rng.integers(0, 256, rng.integers(1, 60), dtype=np.uint8))
        cut = bytearray(good)
        cut[int(rng.integers(1, len(good) - 1))] ^= int(rng.integers(1, 256))
        controller.receive(noise + b"\x7e" + bytes(cut))
        controller.receive(b"\x7e")
        assert not controller.tick()[0].any()
        controller.send()
    assert controller.fault == Fault.OK
    controller.receive(good)  # and it still listens
    for _ in range(400):
        states, _ = controller.tick()
    assert states.any()


def test_silence_and_refusals_are_told_in_words(header):
    wire = Wire(Controller(header), lost=1.0)
    with pytest.raises(NoAnswerError, match=r"does not answer .*check port, baud rate and power"):
        ValveLine(wire, wire).ping()
    assert wire.now() < 0.8
    wire = Wire(Controller(header))
    line = ValveLine(wire, wire)
    line.ping()
    with pytest.raises(NoAnswerError, match="select: the controller holds no such gait"):
        line.select(9999, None)


def test_the_controller_vents_when_the_pilot_dies(header):
    wire = Wire(Controller(header))
    line = ValveLine(wire, wire)
    line.ping()
    line.select(0, 0)
    for _ in range(100):
        wire.sleep(0.01)
        line.poll()
    assert wire.states[-1].any()
    wire.sleep(0.51)  # and not a word
    assert not wire.states[-1].any()
    with pytest.raises(NoAnswerError, match="still venting"):
        line.select(0, 0)


class Clock:
    def now(self):
        return time.monotonic()

    def sleep(self, seconds):
        time.sleep(seconds)


class Terminal:
    """The pilot's end of a pseudo-terminal, read without waiting."""

    def __init__(self, handle):
        self.handle = handle
        os.set_blocking(handle, False)

    def read(self, size):
        try:
            return os.read(self.handle, size)
        except BlockingIOError:
            return b""

    def write(self, data):
        return os.write(self.handle, data)


def test_over_a_pseudo_terminal_in_real_time(header):
    master, slave = os.openpty()
    tty.setraw(slave)
    controller, done = Controller(header), threading.Event()
    os.set_blocking(master, False)
    terminal = Terminal(slave)

    def run():
        begin, ticks = time.monotonic(), 0
        while not done.is_set():
            with contextlib.suppress(BlockingIOError):
                controller.receive(os.read(master, 4096))
            while ticks < (time.monotonic() - begin) / 1e-3:
                controller.tick()
                ticks += 1
            os.write(master, controller.send())
            time.sleep(0.001)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        line = ValveLine(terminal, Clock())
        assert line.ping().segments == 4
        line.select(5, 5)
        end = time.monotonic() + 0.6
        while time.monotonic() < end:
            line.poll()
            time.sleep(0.005)
        late = []
        for _ in range(20):  # on a busy machine single answers come late
            status = line.query()
            late.append(abs(line.time_of(status.time) - time.monotonic()))
        assert status.state is State.PLAYING and status.gait == 5
        assert min(late) < 0.1
        assert line.vent().state is State.VENTING
    finally:
        done.set()
        thread.join()
        os.close(master)
        os.close(slave)
