"""Send the vehicle to a goal in ENU, as ROS programs have it, and show where it is in ENU. Stop with Ctrl-C.

Usage: python enu_goal.py EAST NORTH UP [udp://127.0.0.1:8888]

The vehicle must be in Offboard mode already, as after offboard.py has armed it.
"""

import sys
from contextlib import suppress

from msggen.live import LinkError, Vehicle
from px4_types import OffboardControlMode, TrajectorySetpoint, VehicleLocalPosition, frames

try:
    east, north, up = map(float, sys.argv[1:4])
except ValueError:
    sys.exit("usage: python enu_goal.py EAST NORTH UP [udp://127.0.0.1:8888], in m")
goal = east, north, up
setpoint = frames.from_ros(TrajectorySetpoint, position=goal)  # NED; all other values are NaN, "not controlled"

try:
    with Vehicle(*sys.argv[4:]) as vehicle, suppress(KeyboardInterrupt):
        vehicle.wait_connected(30)
        with vehicle.every(10, OffboardControlMode(position=True)), vehicle.every(20, setpoint):
            for count, message in enumerate(vehicle.subscribe(VehicleLocalPosition)):
                if count % 10 == 0:
                    place = frames.to_ros(message, "xyz").value
                    print("east {:.2f}, north {:.2f}, up {:.2f} m".format(*place), flush=True)
except LinkError as error:
    sys.exit(str(error))
