"""Lists, reads and publishes topics with zenoh-ros2-sdk, at a router whose port is the argument. It is a program.

It prints JSON: the names of the topics, the publishers of one, and a message of it.
"""

from __future__ import annotations

import json
import os
import queue
import sys
from typing import Any

import zenoh_ros2_sdk as sdk

PORT = int(sys.argv[1])
ATTITUDE, MODE = "/fmu/out/vehicle_attitude", "/fmu/in/offboard_control_mode"
DEFINITIONS = {
    "VehicleAttitude": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\nfloat32[4] delta_q_reset\n"
    "uint8 quat_reset_counter\n",
    "OffboardControlMode": "uint64 timestamp\nbool position\nbool velocity\nbool acceleration\nbool attitude\n"
    "bool body_rate\nbool thrust_and_torque\nbool direct_actuator\n",
}


def main() -> None:
    """Print what is there, and publish until the standard input ends."""
    names = [name for name, _ in sdk.get_topic_names_and_types(router_port=PORT)]
    (publisher,) = sdk.get_topic_info(ATTITUDE, router_port=PORT, verbose=True).publishers
    messages: queue.Queue[Any] = queue.Queue()
    given: dict[str, Any] = {"router_port": PORT}
    reader = sdk.ROS2Subscriber(
        ATTITUDE,
        "px4_msgs/msg/VehicleAttitude",
        messages.put,
        msg_definition=DEFINITIONS["VehicleAttitude"],
        **given,
    )
    writer = sdk.ROS2Publisher(
        MODE, "px4_msgs/msg/OffboardControlMode", msg_definition=DEFINITIONS["OffboardControlMode"], **given
    )
    found = messages.get(timeout=20)
    off = dict.fromkeys(("velocity", "acceleration", "attitude", "body_rate", "thrust_and_torque"), False)
    writer.publish(timestamp=0, position=True, direct_actuator=False, **off)
    told = {"names": names, "node": publisher.node_name, "hash": publisher.type_hash, "qos": publisher.qos}
    print(json.dumps({**told, "timestamp": int(found.timestamp), "q": [float(each) for each in found.q]}), flush=True)
    sys.stdin.read()
    reader.close()
    writer.close()
    os._exit(0)  # its threads would go on


if __name__ == "__main__":
    main()
