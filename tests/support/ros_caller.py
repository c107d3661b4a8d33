"""Calls the service of a relay for a vehicle, and prints the answers. Run by the Python of ROS 2.

Arguments: the name of the service, and the numbers of the commands to send.
"""

from __future__ import annotations

import sys

import rclpy
from px4_msgs.srv import VehicleCommand


def main(name: str, commands: list[int]) -> None:
    """Call the service once for each command, all at once, and wait for the answers."""
    rclpy.init()
    node = rclpy.create_node("caller")
    client = node.create_client(VehicleCommand, name)
    while not client.wait_for_service(timeout_sec=1.0):
        pass
    calls = []
    for number in commands:
        request = VehicleCommand.Request()
        request.request.command = number
        request.request.param1 = 1.0
        request.request.target_system = request.request.target_component = 0  # all
        calls.append(client.call_async(request))
    for call in calls:
        rclpy.spin_until_future_complete(node, call)
        reply = call.result().reply
        print(name, reply.command, reply.result, reply.timestamp > 0, flush=True)
    print("all answered", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], [int(word) for word in sys.argv[2:]])
