"""The same types in a ROS 2 node: print each change of the flight mode.

    python rclpy_node.py

It needs ROS 2 with px4_msgs, PX4 and Micro-XRCE-DDS-Agent. The callback gets bytes, because `raw=True`, and the types of
msggen decode them. px4_msgs only tells ROS the name of the type.
"""

import rclpy
from px4_msgs.msg import VehicleStatus as RosVehicleStatus
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from px4_types import VehicleStatus, topics

endpoint = topics.out.vehicle_status
qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.TRANSIENT_LOCAL)
last = None


def show(data: bytes) -> None:
    """Print the mode if it has changed."""
    global last
    message = VehicleStatus.decode(data)
    if message.nav_state != last:
        last = message.nav_state
        print("mode:", VehicleStatus.NavigationState(last).name, flush=True)


rclpy.init()
node = rclpy.create_node("mode_listener")
node.create_subscription(RosVehicleStatus, endpoint.ros_name, show, qos, raw=True)
rclpy.spin(node)
