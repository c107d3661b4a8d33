"""Take off in Offboard mode, fly a square, and land, with messages alone.

Use this for PX4 v1.14, or to see what crosses the link. From v1.15 on, msggen.flight needs less code: its `offboard()`
keeps the heartbeat, its actions take off and land, and pilots can choose its flight modes (examples/flight/square.py).

Usage: python offboard.py [udp://127.0.0.1:8888]

PX4 leaves Offboard mode if the heartbeat stops for a second: at Ctrl-C, at an error, or if the link is lost.
"""

import math
import sys
import time

from msggen.live import LinkError, Vehicle
from px4_types import (
    OffboardControlMode,
    TrajectorySetpoint,
    VehicleCommand,
    VehicleLocalPosition,
    VehicleStatus,
    commands,
    frames,
    srv,
)

HEIGHT = 3.0
NEAR = 0.5  # meters
SQUARE = [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0)]
OFFBOARD = {"mav_mode_value": 1, "param2": 6}  # PX4's main mode 6
HOLD = {"mav_mode_value": 1, "param2": 4, "param3": 3}  # AUTO, LOITER


class Flight:
    """A vehicle that follows a goal in ENU: meters to the east, to the north, and up from where it started."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.position = vehicle.subscribe(VehicleLocalPosition)
        self.status = vehicle.subscribe(VehicleStatus)
        self.goal = (0.0, 0.0, HEIGHT)

    def setpoint(self) -> TrajectorySetpoint:
        """Return the setpoint for the goal; PX4 holds what is NaN as it likes."""
        return frames.from_ros(TrajectorySetpoint, position=self.goal)

    def command(self, message: VehicleCommand) -> None:
        """Send a command, and fail unless PX4 accepts it."""
        message.from_external = True
        ack = self.vehicle.call(srv.VehicleCommand.Request(request=message)).reply
        if ack.result != ack.VEHICLE_CMD_RESULT_ACCEPTED:
            raise RuntimeError(f"command {message.command}: {ack.VehicleCmdResult(ack.result).name}")

    def has_arrived(self, message: VehicleLocalPosition) -> bool:
        """Return whether the vehicle is near the goal."""
        return math.dist((message.y, message.x, -message.z), self.goal) < NEAR

    def fly_to(self, *goal: float) -> None:
        """Set the goal, and wait until the vehicle is there."""
        self.goal = goal
        self.position.wait_for(self.has_arrived, timeout=60)
        print("at", goal, flush=True)


def main() -> None:
    """Fly once around the square."""
    with Vehicle(*sys.argv[1:]) as vehicle:
        print("connected:", vehicle.wait_connected(30), vehicle.firmware, flush=True)
        flight = Flight(vehicle)
        with vehicle.every(10, OffboardControlMode(position=True)), vehicle.every(20, flight.setpoint):
            time.sleep(1.5)  # PX4 wants to hear the heartbeat for a while
            flight.command(commands.DO_SET_MODE(**OFFBOARD))
            flight.command(commands.COMPONENT_ARM_DISARM(arming_action=VehicleCommand.ARMING_ACTION_ARM))
            for east, north in SQUARE:
                flight.fly_to(east, north, HEIGHT)
            flight.command(commands.NAV_LAND())
        # no setpoint goes on: PX4 takes them in Land, too
        flight.status.wait_for(lambda each: each.arming_state == each.ARMING_STATE_DISARMED, timeout=60)
        flight.command(commands.DO_SET_MODE(**HOLD))  # in Offboard mode, nobody could arm it without a heartbeat
        print("landed", flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("interrupted: without the heartbeat, PX4 leaves Offboard mode")
    except (LinkError, RuntimeError) as error:
        sys.exit(str(error))
