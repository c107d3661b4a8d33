"""The same types in a ROS 2 node: print the flight mode, and send the heartbeat of offboard control. Stop with Ctrl-C.

Usage: python rclpy_node.py

It needs ROS 2 with px4_msgs, and MicroXRCEAgent. The classes of px4_msgs only tell ROS the types of the topics: with
`raw=True`, the callback gets bytes, and `publish` accepts bytes.
"""

from contextlib import suppress

import px4_msgs.msg
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from px4_types import OffboardControlMode, VehicleStatus, topics


def profile(qos: topics.Qos) -> QoSProfile:
    """Return a QoS as rclpy has it. A depth of 0 leaves the choice to the middleware, but rclpy needs a number."""
    return QoSProfile(
        reliability=ReliabilityPolicy[qos.reliability],
        durability=DurabilityPolicy[qos.durability],
        history=HistoryPolicy[qos.history],
        depth=max(qos.depth, 1),
    )


class Companion(Node):
    """A node that reads a topic of PX4 and writes another."""

    def __init__(self) -> None:
        super().__init__("companion")
        self.mode = None
        status = topics.out.vehicle_status
        self.create_subscription(
            px4_msgs.msg.VehicleStatus, status.ros_name, self.show_mode, profile(status.qos.reader), raw=True
        )
        heartbeat = topics.in_.offboard_control_mode
        self.publisher = self.create_publisher(
            px4_msgs.msg.OffboardControlMode, heartbeat.ros_name, profile(heartbeat.qos.writer)
        )
        self.create_timer(0.1, self.send_heartbeat)

    def show_mode(self, data: bytes) -> None:
        """Print the mode if it has changed."""
        mode = VehicleStatus.NavigationState(VehicleStatus.decode(data).nav_state)
        if mode != self.mode:
            self.mode = mode
            print("mode:", mode.name, flush=True)

    def send_heartbeat(self) -> None:
        """Tell PX4 that position setpoints follow. Offboard mode needs this at least twice a second."""
        self.publisher.publish(OffboardControlMode(position=True).encode())


rclpy.init()
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(Companion())
