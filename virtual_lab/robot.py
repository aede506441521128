"""A robot to pilot, in real time: a serial line (a pseudo-terminal) and a stream of poses over UDP.

    python -m virtual_lab.robot --program out/gait_opt/gait_table.h --start 0.2,1.02,0 --effect tether_drag

The controller's C firmware runs in the loop. Stops on Ctrl-C, or when --duration is over.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import socket
import sys
import time
import tty
from pathlib import Path

import numpy as np

from virtual_lab.catalogue import find_kind
from virtual_lab.command_line import Parser
from virtual_lab.draw import draw_effect
from virtual_lab.errors import LabError
from virtual_lab.truth import Truth
from virtual_lab.world import Imperfections, World

PROG = "python -m virtual_lab.robot"
STEP_S = 0.002


def build_parser() -> argparse.ArgumentParser:
    """Return the command's parser."""
    parser = Parser(
        prog=PROG,
        description="A virtual snake in real time behind a serial line and a pose stream, its valve\n"
        "controller's C firmware in the loop.",
        epilog=f"example:\n  {PROG} --program out/gait_opt/gait_table.h --start 0.2,1.02,0",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("--program", type=Path, required=True, metavar="FILE", help="header that is flashed")
    add(
        "--start", type=_start, default=(0.0, 0.0, 0.0), metavar="X,Y,HEADING", help="centre of mass, heading"
    )
    add("--link", type=Path, default=Path("out/valves"), metavar="PATH", help="name of the serial port")
    add("--pose", default="127.0.0.1:5005", metavar="HOST:PORT", help="where pose lines go (UDP)")
    add("--effect", action="append", default=[], metavar="NAME", help="hidden effect of typical size")
    add("--noise", type=float, default=0.001, metavar="M", help="of a marker's coordinate (default 0.001)")
    add("--latency", type=float, default=0.03, metavar="S", help="of the camera (default 0.03)")
    add(
        "--slow-motion",
        type=float,
        default=1.0,
        metavar="X",
        help="X times slower than real time (default 1)",
    )
    add("--duration", type=float, metavar="S", help="end by itself after so long")
    add("--seed", type=int, default=0, metavar="N", help="seed of the noise")
    return parser


def _start(text: str) -> tuple[float, float, float]:
    try:
        x, y, heading = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected X,Y,HEADING, found '{text}'") from None
    return x, y, heading


class _Terminal:
    """A pseudo-terminal whose other end has a name of its own in the file system."""

    def __init__(self, link: Path) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        self.link = link
        link.parent.mkdir(parents=True, exist_ok=True)
        if link.is_symlink():
            link.unlink()
        link.symlink_to(os.ttyname(self._slave))

    def read(self) -> bytes:
        """Return the bytes that have come."""
        try:
            return os.read(self.master, 4096)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """Send bytes; what nobody reads is lost, as on a real line."""
        with contextlib.suppress(BlockingIOError):
            os.write(self.master, data)

    def close(self) -> None:
        """Take the name away."""
        self.link.unlink(missing_ok=True)
        os.close(self.master)
        os.close(self._slave)


def serve(world: World, terminal: _Terminal, camera: _Quiet, end_s: float, slow_motion: float = 1.0) -> None:
    """Keep the world at real time until `end_s` seconds have passed or a signal comes."""
    world.sleep(0.05)  # loads compiled code
    begun = time.monotonic() / slow_motion - world.now()
    late_told = False
    while (passed := time.monotonic() / slow_motion - begun) < end_s:
        if data := terminal.read():
            world.write(data)
        while world.now() < passed - STEP_S / 2:
            world.sleep(STEP_S)
        if data := world.read(4096):
            terminal.write(data)
        for line in world.pictures():
            camera.send(line)
        behind = time.monotonic() / slow_motion - begun - world.now()
        if behind > 0.1 and not late_told:
            print(f"warning: this machine is {behind:.2f} s behind real time", file=sys.stderr)
            late_told = True
        time.sleep(STEP_S / 2)


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    options = build_parser().parse_args(argv)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    terminal = None
    try:
        if not options.program.is_file():
            raise LabError(f"--program {options.program}: no such file; write it with gait_opt --table")
        words = re.search(r"-DSRS_WORDS=(\d+)", options.program.read_text(encoding="utf-8"))
        truth = _truth(options.effect, options.seed)
        imperfections = Imperfections(noise_m=options.noise, latency_s=options.latency)
        count = int(words[1]) if words else 1
        world = World(truth, options.program, options.start, options.seed, imperfections, words=count)
        host, _, port = options.pose.rpartition(":")
        camera = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            camera.connect((host, int(port)))
        except (OSError, ValueError, OverflowError) as error:
            raise LabError(f"--pose: expected HOST:PORT, found '{options.pose}'") from error
        camera.setblocking(False)
        terminal = _Terminal(options.link)
        print(f"valves: {options.link}  poses: udp://{options.pose}", flush=True)
        serve(world, terminal, _Quiet(camera), options.duration or float("inf"), options.slow_motion)
    except LabError as error:
        print(f"{PROG}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        pass
    finally:
        if terminal is not None:
            terminal.close()
    return 0


def _truth(names: list[str], seed: int) -> Truth:
    """Return the built-in robot with effects of typical size, their signs and places from the seed."""
    rng = np.random.default_rng(seed)
    kinds = [find_kind(name) for name in names]
    drawn = [(kind.listed, draw_effect(kind, rng, 5, (1.0, 1.0))) for kind in kinds]
    return Truth(
        effects=tuple(effect for listed, effect in drawn if listed),
        unlisted=tuple(effect for listed, effect in drawn if not listed),
    )


class _Quiet:
    """Sends packets; that nobody listens is no fault of the camera."""

    def __init__(self, packets: socket.socket) -> None:
        self._packets = packets

    def send(self, data: bytes) -> None:
        """Send one packet."""
        with contextlib.suppress(OSError):
            self._packets.send(data)


if __name__ == "__main__":
    raise SystemExit(main())
