"""Pose sources: UDP packets, NatNet frames written here after the published layout, and what is missing."""

import json
import socket
import struct

import numpy as np
import pytest

from planners.pilot.hardware import MachineClock, open_port
from planners.pilot.sources import natnet_bodies, open_source
from srs_opt.errors import InputError
from srs_opt.robot import wpi_srs


def frame(bodies, sized):
    """Return a NatNet frame: a marker set, two other markers, rigid bodies (id, x, y, z, tracked)."""

    def section(count, content):
        return struct.pack("<i", count) + (struct.pack("<I", len(content)) if sized else b"") + content

    named = b"snake\0" + struct.pack("<i", 2) + struct.pack("<6f", *range(6))
    body = struct.pack("<i", 17) + section(1, named) + section(2, struct.pack("<6f", *range(6)))
    rigid = b"".join(
        struct.pack("<ifff", i, x, y, z)
        + struct.pack("<4f", 0, 0, 0, 1)
        + struct.pack("<fh", 0.001, int(seen))
        for i, x, y, z, seen in bodies
    )
    body += section(len(bodies), rigid) + struct.pack("<i", 0) * 4
    return struct.pack("<HH", 7, len(body)) + body


@pytest.mark.parametrize("sized", [False, True])
def test_rigid_bodies_of_both_layouts(sized):
    bodies = [(1, 0.1, 0.02, -0.5, True), (5, 0.3, 0.02, -0.6, True), (2, 9.0, 9.0, 9.0, False)]
    found = natnet_bodies(frame(bodies, sized))
    assert sorted(found) == [1, 5]
    assert found[5] == pytest.approx((0.3, 0.02, -0.6), abs=1e-6)


def test_other_messages_and_noise_are_no_frames():
    assert natnet_bodies(struct.pack("<HH", 5, 0)) is None
    rng = np.random.default_rng(3)
    whole = frame([(1, 0.1, 0.02, -0.5, True)], False)
    for _ in range(200):
        cut = whole[: rng.integers(4, len(whole) - 20)]
        with pytest.raises((ValueError, struct.error)):
            natnet_bodies(cut)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def poll(source, count):
    clock, found = MachineClock(), []
    for _ in range(200):
        found += source.poll()
        if len(found) >= count:
            break
        clock.sleep(0.005)
    return found


def test_udp_lines_arrive_and_bad_ones_are_told_a_few_times():
    port, told = free_port(), []
    source = open_source(f"udp://127.0.0.1:{port}", wpi_srs(), MachineClock(), told.append)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            line = {"t_s": 1.5, "x_m": 0.2, "y_m": 1.0, "heading_rad": 0.1}
            for _ in range(9):
                sender.sendto(b"nonsense", ("127.0.0.1", port))
            sender.sendto((json.dumps(line) + "\n" + json.dumps(line)).encode(), ("127.0.0.1", port))
        found = poll(source, 2)
    finally:
        source.close()
    assert len(found) == 2 and found[0].stamp_s == 1.5
    assert found[0].pose == pytest.approx([0.2, 1.0, 0.1])
    assert len(told) == 3 and "expected JSON" in told[0]


def test_natnet_packets_become_links_on_the_ground_plane():
    port = free_port()
    source = open_source(f"natnet://127.0.0.1:{port}", wpi_srs(), MachineClock(), print)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(frame([(2, 0.3, 0.02, -0.6, True)], True), ("127.0.0.1", port))
        (report,) = poll(source, 1)
    finally:
        source.close()
    assert report.markers_m[1] == pytest.approx([0.3, 0.6], abs=1e-6)
    assert np.isnan(report.markers_m[[0, 2, 3, 4]]).all()


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("tcp://1.2.3.4:5", "expected udp://"),
        ("udp://127.0.0.1", "expected udp://"),
        ("udp://127.0.0.1:99999", "expected udp://"),
        ("ros2://", "expected udp://"),
        ("ros2://pose", "no rclpy"),
    ],
)
def test_sources_that_are_none_are_refused(spec, words):
    with pytest.raises(InputError, match=words):
        open_source(spec, wpi_srs(), MachineClock(), print)


def test_a_port_that_is_not_there_is_told():
    with pytest.raises(InputError, match="cannot be opened"):
        open_port("/dev/absent", 115_200)
