"""Print what PX4's accelerometer and gyroscope measure, once a second. Stop with Ctrl-C.

Usage: python listener.py [udp://127.0.0.1:8888]
"""

import sys

from msggen.live import Vehicle
from px4_types import SensorCombined

with Vehicle(*sys.argv[1:]) as vehicle:
    for count, message in enumerate(vehicle.subscribe(SensorCombined)):
        if count % 100 == 0:
            print(message.accelerometer_m_s2, "m/s^2", message.gyro_rad, "rad/s", flush=True)
