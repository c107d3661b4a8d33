"""The same types in a ROS 2 node: print each flight mode once.

Usage: python rclpy_node.py

It needs ROS 2 with px4_msgs, and MicroXRCEAgent. With `raw=True`, the callback gets bytes, which the types of msggen
decode. px4_msgs only tells ROS the name of the type.
"""

import rclpy
from px4_msgs.msg import VehicleStatus as RosVehicleStatus
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from px4_types import VehicleStatus, topics

endpoint = topics.out.vehicle_status
qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.TRANSIENT_LOCAL)
shown = set()


def show(data: bytes) -> None:
    """Print the mode if it has not been printed."""
    mode = VehicleStatus.NavigationState(VehicleStatus.decode(data).nav_state)
    if mode not in shown:
        shown.add(mode)
        print("mode:", mode.name, flush=True)


rclpy.init()
node = rclpy.create_node("mode_listener")
node.create_subscription(RosVehicleStatus, endpoint.ros_name, show, qos, raw=True)
rclpy.spin(node)
