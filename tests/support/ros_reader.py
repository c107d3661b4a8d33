"""Reads the topics of a relay for the vehicle uav_1, and prints what each has, once. Run by the Python of ROS 2."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import px4_msgs.msg
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu, NavSatFix
from tf2_msgs.msg import TFMessage

SPACE = "/uav_1"
STATUS = f"{SPACE}/fmu/out/vehicle_status_v4"
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=5)
KEPT = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def frame_of(message: Any) -> str:
    """Return the frame of a message."""
    return str(message.header.frame_id)


def frames_of(message: Any) -> str:
    """Return the frames of an odometry or a transform."""
    return f"{message.header.frame_id} {message.child_frame_id}"


def frames_of_first(message: Any) -> str:
    """Return the frames of the first transform."""
    return frames_of(message.transforms[0])


def name_of(message: Any) -> str:
    """Return the name of a type."""
    return type(message).__name__


TOPICS: tuple[tuple[str, Any, QoSProfile, Callable[[Any], str]], ...] = (
    (STATUS, px4_msgs.msg.VehicleStatus, BEST_EFFORT, bytes.hex),
    (
        f"{SPACE}/fmu/out/airspeed_validated",
        px4_msgs.msg.AirspeedValidated,
        BEST_EFFORT,
        lambda one: type(one).__name__,
    ),
    (f"{SPACE}/odom", Odometry, RELIABLE, frames_of),
    (f"{SPACE}/pose", PoseStamped, BEST_EFFORT, frame_of),
    (f"{SPACE}/imu", Imu, RELIABLE, frame_of),
    (f"{SPACE}/fix", NavSatFix, RELIABLE, frame_of),
    ("/tf", TFMessage, RELIABLE, frames_of_first),
    ("/tf_static", TFMessage, KEPT, frames_of_first),
)


def main() -> None:
    """Read until every topic has a message."""
    rclpy.init()
    node = rclpy.create_node("reader")
    seen = set()

    def subscribe(name: str, ros_type: Any, qos: QoSProfile, text: Callable[[Any], str]) -> None:
        def receive(message: Any) -> None:
            if name not in seen:
                seen.add(name)
                print(name, text(message), flush=True)

        node.create_subscription(ros_type, name, receive, qos, raw=text is bytes.hex)

    for row in TOPICS:
        subscribe(*row)
    while len(seen) < len(TOPICS):
        rclpy.spin_once(node)
    (writer,) = node.get_publishers_info_by_topic(STATUS)
    while "UNKNOWN" in writer.node_name:  # the name of a node is discovered after its writer
        rclpy.spin_once(node, timeout_sec=0.1)
        (writer,) = node.get_publishers_info_by_topic(STATUS)
    print(f"{STATUS}:hash", writer.topic_type_hash)
    print(f"{STATUS}:node", f"{writer.node_namespace}/{writer.node_name}")
    print(f"{STATUS}:qos", writer.qos_profile.reliability.name, writer.qos_profile.durability.name)
    print("all arrived", flush=True)


if __name__ == "__main__":
    main()
