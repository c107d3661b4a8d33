"""Print every 100th acceleration that PX4 measures. Stop with Ctrl-C.

Usage: python listener.py [udp://127.0.0.1:8888]
"""

import sys
from contextlib import suppress

from msggen.live import LinkError, Vehicle
from px4_types import SensorCombined

try:
    with Vehicle(*sys.argv[1:]) as vehicle, suppress(KeyboardInterrupt):
        for count, message in enumerate(vehicle.subscribe(SensorCombined)):
            if count % 100 == 0:
                x, y, z = message.accelerometer_m_s2
                print(f"acceleration {x:6.2f} {y:6.2f} {z:6.2f} m/s^2", flush=True)
except LinkError as error:
    sys.exit(str(error))
