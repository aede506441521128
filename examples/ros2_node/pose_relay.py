"""A ROS 2 node without a package: takes tracked rigid bodies of the links, sends their centres to the pilot.

    (after the set-up script of your ROS 2 installation)
    python3 examples/ros2_node/pose_relay.py --links 5 --topic /mocap/link --to 127.0.0.1:5005
    python -m planners.pilot maze.yaml --valves /dev/ttyACM0 --pose udp://127.0.0.1:5005

Link i (from the tail) is geometry_msgs/PoseStamped on TOPICi, in a frame with z out of the floor, metres.
"""

import argparse
import json
import socket

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node


class PoseRelay(Node):
    """Sends one JSON line per pose of the head, with what the other links said last."""

    def __init__(self, links: int, topic: str, host: str, port: int) -> None:
        super().__init__("srs_pose_relay")
        self._places: list[list[float] | None] = [None] * links
        self._to = (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for k in range(links):
            self.create_subscription(PoseStamped, f"{topic}{k + 1}", lambda m, k=k: self._heard(k, m), 10)

    def _heard(self, link: int, message: PoseStamped) -> None:
        self._places[link] = [message.pose.position.x, message.pose.position.y]
        if link == len(self._places) - 1:
            stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            line = {"t_s": stamp, "markers_m": self._places}
            self._socket.sendto(json.dumps(line).encode(), self._to)
            self._places = [None] * len(self._places)


def main() -> None:
    """Run the node until it is interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--links", type=int, default=5)
    parser.add_argument("--topic", default="/mocap/link")
    parser.add_argument("--to", default="127.0.0.1:5005")
    options = parser.parse_args()
    host, _, port = options.to.rpartition(":")
    rclpy.init()
    rclpy.spin(PoseRelay(options.links, options.topic, host, int(port)))


if __name__ == "__main__":
    main()
