"""Show the heights of two vehicles on one port. Stop with Ctrl-C.

Usage: python two_vehicles.py [udp://127.0.0.1:8888]

Each vehicle has a key of its own (UXRCE_DDS_KEY): here 1 and 2.
"""

import sys
import time
from contextlib import suppress

from msggen.live import LinkError, Vehicle
from px4_types import VehicleLocalPosition

try:
    with Vehicle(*sys.argv[1:], key=1) as first, Vehicle(*sys.argv[1:], key=2) as second, suppress(KeyboardInterrupt):
        positions = [vehicle.subscribe(VehicleLocalPosition) for vehicle in (first, second)]
        for vehicle in (first, second):
            print("connected:", vehicle.wait_connected(30), flush=True)
        while True:
            heights = [-position.wait_for(lambda _: True, timeout=5).z for position in positions]
            print("heights: {:.2f} m, {:.2f} m".format(*heights), flush=True)
            time.sleep(1)
except LinkError as error:
    sys.exit(str(error))
