"""Pose sources: UDP packets with JSON lines, a NatNet multicast, a ROS 2 topic."""

from __future__ import annotations

import contextlib
import math
import socket
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from planners.pilot.pose import PoseSource, Report, parse_report
from planners.pilot.valve_line import Clock
from srs_opt.errors import InputError
from srs_opt.robot import Robot

MOST_COMPLAINTS = 3  # about malformed input; more only repeat themselves
FRAME_OF_DATA = 7  # NatNet's message identifier


class _Packets(ABC):
    """A bound UDP socket, read without waiting."""

    def __init__(self, host: str, port: int, clock: Clock, complain: Callable[[str], None]) -> None:
        self._clock, self._complain, self._complaints = clock, complain, 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._bind(host, port)
        except OSError as error:
            self._socket.close()
            raise InputError(f"--pose: {host}:{port}: {error.strerror or error}") from error
        self._socket.setblocking(False)

    def _bind(self, host: str, port: int) -> None:
        self._socket.bind((host, port))

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def poll(self) -> list[Report]:
        """Return the reports of the packets that have come."""
        reports: list[Report] = []
        while True:
            try:
                packet = self._socket.recv(65536)
            except (BlockingIOError, ConnectionError):
                return reports
            try:
                reports += self._parse(packet, self._clock.now())
            except InputError as error:
                self._complaints += 1
                if self._complaints <= MOST_COMPLAINTS:
                    self._complain(f"note: {error}")

    @abstractmethod
    def _parse(self, packet: bytes, arrived_s: float) -> list[Report]:
        """Return the reports in one packet."""


class UdpPoses(_Packets):
    """JSON lines, one or more in a packet (see `parse_report`)."""

    def __init__(
        self, host: str, port: int, links: int, clock: Clock, complain: Callable[[str], None]
    ) -> None:
        super().__init__(host, port, clock, complain)
        self._links = links

    def _parse(self, packet: bytes, arrived_s: float) -> list[Report]:
        lines = [line for line in packet.split(b"\n") if line.strip()]
        return [parse_report(line, arrived_s, self._links) for line in lines]


class NatNetPoses(_Packets):
    """Rigid bodies with streaming identifiers 1 (tail) to N (head), of a NatNet 3 or 4 multicast.

    Only what stands in every frame before the rigid bodies is read, and the bodies. The ground plane is
    Motive's default, x to the right and z towards the viewer: the room's (x, y) is (x, -z).
    """

    def __init__(
        self, group: str, port: int, links: int, clock: Clock, complain: Callable[[str], None]
    ) -> None:
        self._group, self._links = group, links
        super().__init__(group, port, clock, complain)

    def _bind(self, host: str, port: int) -> None:
        self._socket.bind(("", port))
        if socket.inet_aton(host)[0] in range(224, 240):  # else unicast
            member = socket.inet_aton(host) + socket.inet_aton("0.0.0.0")
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)

    def _parse(self, packet: bytes, arrived_s: float) -> list[Report]:
        try:
            places = natnet_bodies(packet)
        except (struct.error, ValueError) as error:
            raise InputError(f"pose: a NatNet packet of {len(packet)} bytes is not understood") from error
        if places is None:
            return []
        markers = np.full((self._links, 2), np.nan)
        for body, (x, _, z) in places.items():
            if 1 <= body <= self._links:
                markers[body - 1] = x, -z
        return [Report(arrived_s, None, None, markers)]


def natnet_bodies(packet: bytes) -> dict[int, tuple[float, float, float]] | None:
    """Return the positions of a NatNet frame's tracked rigid bodies; None for other messages.

    Layout (little-endian): message u16, bytes u16; frame i32; marker sets: count i32, per set a
    zero-terminated name, count i32 and three floats each; other markers: count i32, three floats each; rigid
    bodies: count i32, per body id i32, position 3 floats, quaternion 4 floats, error float, flags i16 (bit 0:
    tracked). NatNet 4.1 puts the bytes of each section (u32) behind its count.
    """
    message, _ = struct.unpack_from("<HH", packet, 0)
    if message != FRAME_OF_DATA:
        return None
    for sized in (False, True):  # a wrong reading runs past the end or meets impossible counts
        with contextlib.suppress(struct.error, ValueError):
            return _natnet_frame(packet, sized)
    raise ValueError("not a frame of NatNet 3 or 4")


def _natnet_frame(packet: bytes, sized: bool) -> dict[int, tuple[float, float, float]]:
    at = 8

    def count() -> int:
        nonlocal at
        (number,) = struct.unpack_from("<i", packet, at)
        at += 4
        if not 0 <= number < 10_000:
            raise ValueError(number)
        return int(number)

    def section() -> int:
        nonlocal at
        number = count()
        if sized:
            (length,) = struct.unpack_from("<I", packet, at)
            at += 4
            if length > len(packet) - at:
                raise ValueError(length)
        return number

    for _ in range(section()):
        at = packet.index(b"\0", at) + 1
        markers = count()  # it moves `at` itself
        at += 12 * markers
    others = section()
    at += 12 * others
    bodies = {}
    for _ in range(section()):
        body, x, y, z = struct.unpack_from("<ifff", packet, at)
        (flags,) = struct.unpack_from("<h", packet, at + 36)
        at += 38
        if not all(map(math.isfinite, (x, y, z))):
            raise ValueError(body)
        if flags & 1:
            bodies[int(body)] = (x, y, z)
    return bodies


class Ros2Poses:
    """A geometry_msgs/PoseStamped topic (needs rclpy of a ROS 2 installation)."""

    def __init__(self, topic: str, clock: Clock) -> None:
        try:
            import rclpy
            from geometry_msgs.msg import PoseStamped
        except ImportError as error:
            raise InputError(
                "--pose ros2://…: this Python has no rclpy; source the ROS 2 set-up script, or send poses "
                "over udp://"
            ) from error
        self._rclpy, self._clock = rclpy, clock
        if not rclpy.ok():
            rclpy.init()
        self._node = rclpy.create_node("srs_pilot")
        self._reports: list[Report] = []
        self._node.create_subscription(PoseStamped, topic, self._heard, 10)

    def _heard(self, message: Any) -> None:
        p, q = message.pose.position, message.pose.orientation
        heading = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        pose = np.array([p.x, p.y, heading])
        self._reports.append(Report(self._clock.now(), stamp or None, pose, None))

    def poll(self) -> list[Report]:
        """Return the messages that have come."""
        self._rclpy.spin_once(self._node, timeout_sec=0.0)
        found, self._reports = self._reports, []
        return found

    def close(self) -> None:
        """Destroy the node."""
        self._node.destroy_node()


def open_source(spec: str, robot: Robot, clock: Clock, complain: Callable[[str], None]) -> PoseSource:
    """Return the source that `spec` names.

    ``udp://HOST:PORT``: JSON lines in UDP packets. ``natnet://GROUP:PORT``: rigid bodies 1 (tail) to N (head)
    of a NatNet multicast. ``ros2://TOPIC``: geometry_msgs/PoseStamped of the robot's pose.

    Raises
    ------
    InputError
        For another `spec`, an address that cannot be had, or a missing package.
    """
    scheme, _, rest = spec.partition("://")
    if scheme == "ros2" and rest:
        return Ros2Poses("/" + rest.lstrip("/"), clock)
    host, _, port = rest.rpartition(":")
    if scheme not in ("udp", "natnet") or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise InputError(
            f"--pose: expected udp://HOST:PORT, natnet://GROUP:PORT or ros2://TOPIC, found '{spec}'"
        )
    if scheme == "udp":
        return UdpPoses(host, int(port), robot.links, clock, complain)
    return NatNetPoses(host, int(port), robot.links, clock, complain)
