"""Take off in Offboard mode, hover, and land: an example of a node that flies through the relay.

    ros2 run msggen_ros offboard --ros-args -p height:=5.0

It needs the topics of PX4 and `odom`, as `msggen relay --standard` makes them. PX4 leaves Offboard mode if the
heartbeat stops: at Ctrl-C, at an error, or if the link is lost.
"""

from contextlib import suppress

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from msggen.generate.cache import package_of
from msggen.ros.relay import profile
from msggen.ros.types import installed

NEAR = 0.5
"""The distance in m from which the vehicle counts as being there."""
WARM_UP = 1.5
"""The time in s for which PX4 wants to hear the heartbeat before it takes the mode."""
PERIOD = 0.1
RETRY = 2.0
"""The time in s after which a command is repeated: a sample can be lost."""
OFFBOARD = {"mav_mode_value": 1, "param2": 6}  # PX4's main mode 6
HOLD = {"mav_mode_value": 1, "param2": 4, "param3": 3}  # AUTO, LOITER


class Offboard(Node):
    """A node that flies. Its topics are relative, so that they are in its namespace.

    Parameters: `height` in m, `hover` in s, and `px4`, the release whose messages the vehicle has.
    """

    def __init__(self) -> None:
        super().__init__("offboard")
        self.height = float(self.declare_parameter("height", 3.0).value)
        self.hover = float(self.declare_parameter("hover", 5.0).value)
        self.types = package_of(self.declare_parameter("px4", "v1.18").value)
        self.is_done = self.is_armed = self.is_in_hold = False
        self.above = 0.0
        self.stage, self.since, self.commanded = self.warm_up, self.seconds(), 0.0
        topics = self.types.topics
        self.publishers_ = {
            endpoint.message: self.create_publisher(
                installed(endpoint.message.__msg__.ros_type), endpoint.ros_name[1:], profile(endpoint.qos.writer)
            )
            for endpoint in (
                topics.in_.offboard_control_mode,
                topics.in_.trajectory_setpoint,
                topics.in_.vehicle_command,
            )
        }
        status = topics.out.vehicle_status
        ros_type = installed(status.message.__msg__.ros_type)
        self.create_subscription(ros_type, status.ros_name[1:], self.hear_status, profile(status.qos.reader), raw=True)
        self.create_subscription(Odometry, "odom", self.hear_odometry, 10)
        self.create_timer(PERIOD, self.step)

    def seconds(self) -> float:
        """Return the time of the node's clock in s."""
        return self.get_clock().now().nanoseconds / 1e9

    def hear_status(self, data: bytes) -> None:
        """Keep whether the vehicle is armed, and in Hold."""
        status = self.types.VehicleStatus.decode(data)
        self.is_armed = status.arming_state == status.ARMING_STATE_ARMED
        self.is_in_hold = status.nav_state == status.NAVIGATION_STATE_AUTO_LOITER

    def hear_odometry(self, message: Odometry) -> None:
        """Keep the height in m above the start: z of ENU."""
        self.above = message.pose.pose.position.z

    def step(self) -> None:
        """Send the heartbeat and the setpoint, and do what the stage of the flight asks for."""
        if self.stage not in (self.land, self.let_go):  # PX4 takes setpoints in Land, too
            self.publish(self.types.OffboardControlMode(position=True))
            setpoint = self.types.frames.from_ros(self.types.TrajectorySetpoint, position=(0.0, 0.0, self.height))
            self.publish(setpoint)
        self.stage()

    def enter(self, stage: object, text: str) -> None:
        """Go on to another stage of the flight."""
        self.get_logger().info(text)
        self.stage, self.since, self.commanded = stage, self.seconds(), 0.0

    def warm_up(self) -> None:
        """Wait until PX4 has heard the heartbeat for a while."""
        if self.seconds() - self.since > WARM_UP:
            self.enter(self.take_off, "taking off")

    def take_off(self) -> None:
        """Arm in Offboard mode, and wait until the vehicle is up."""
        arm = self.types.VehicleCommand.ARMING_ACTION_ARM
        if not self.is_armed:
            self.command(
                self.types.commands.DO_SET_MODE(**OFFBOARD), self.types.commands.COMPONENT_ARM_DISARM(arming_action=arm)
            )
        elif abs(self.above - self.height) < NEAR:
            self.enter(self.hold, f"at {self.above:.1f} m")

    def hold(self) -> None:
        """Hover."""
        if self.seconds() - self.since > self.hover:
            self.enter(self.land, "landing")

    def land(self) -> None:
        """Land, and wait until the vehicle has disarmed."""
        if self.is_armed:
            self.command(self.types.commands.NAV_LAND())
        else:
            self.enter(self.let_go, "landed")

    def let_go(self) -> None:
        """Select Hold: in Offboard mode, nobody could arm the vehicle without a heartbeat."""
        if self.is_in_hold:
            self.is_done = True
        else:
            self.command(self.types.commands.DO_SET_MODE(**HOLD))

    def command(self, *messages: object) -> None:
        """Send commands, not more often than every `RETRY`."""
        if self.seconds() - self.commanded > RETRY:
            self.commanded = self.seconds()
            for message in messages:
                message.from_external = True
                self.publish(message)

    def publish(self, message: object) -> None:
        """Send a message to PX4. rclpy takes its bytes as they are."""
        self.publishers_[type(message)].publish(message.encode())


def main() -> None:
    """Fly once."""
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        node = Offboard()
        while not node.is_done:
            rclpy.spin_once(node)


if __name__ == "__main__":
    main()
