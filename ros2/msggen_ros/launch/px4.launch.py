"""Start msggen's relay for a vehicle, after its doctor has found nothing, and on request an example that flies.

    ros2 launch msggen_ros px4.launch.py link:=serial:///dev/ttyUSB0?baud=921600 offboard:=true

A link belongs to one program at a time. So the doctor comes first, and the relay continues its session.
"""

import shlex

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, RegisterEventHandler, Shutdown
from launch.event_handlers import OnProcessExit
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = "msggen_ros"

ARGUMENTS = (
    ("link", "udp://127.0.0.1:8888", "address of the link: udp://HOST:PORT, serial://DEVICE?baud=N or tap://..."),
    ("topics", "", "topics or patterns, separated by spaces; all if there are none"),
    ("types", "", "generated package of the vehicle's messages; the embedded release by default"),
    ("namespace", "", "namespace of the vehicle"),
    ("standard", "true", "also publish odom, pose, imu, fix and TF"),
    ("translate", "false", "also carry the versions of messages that px4_msgs has"),
    ("doctor", "true", "look for the usual causes of silence first, and stop if there is one"),
    ("offboard", "false", "fly: take off to `height`, hover, and land"),
    ("height", "3.0", "height of the flight in m"),
    ("px4", "v1.18", "release of the vehicle, for the flight"),
)


def generate_launch_description() -> LaunchDescription:
    """Return what to start."""
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[object]:
    """Return the programs for the values of the arguments."""
    values = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    flags = {
        name: values[name].lower() in ("1", "true", "yes") for name in ("standard", "translate", "doctor", "offboard")
    }
    link = [word for name in ("link", "types", "namespace") if values[name] for word in (f"--{name}", values[name])]
    chosen = [f"--{name}" for name in ("standard", "translate") if flags[name]]
    nodes = [
        Node(
            package=PACKAGE,
            executable="relay",
            arguments=[*shlex.split(values["topics"]), *chosen, *link],
            output="screen",
        )
    ]
    if flags["offboard"]:
        nodes.append(
            Node(
                package=PACKAGE,
                executable="offboard",
                namespace=values["namespace"] or None,
                parameters=[{"height": float(values["height"]), "px4": values["px4"]}],
                output="screen",
            )
        )
    if not flags["doctor"]:
        return nodes
    doctor = Node(package=PACKAGE, executable="doctor", arguments=link, output="screen")

    def decide(event: object, _: LaunchContext) -> list[object]:
        if event.returncode == 0:
            return nodes
        return [LogInfo(msg="the doctor found a cause of silence: doctor:=false starts anyway"), Shutdown()]

    return [doctor, RegisterEventHandler(OnProcessExit(target_action=doctor, on_exit=decide))]
