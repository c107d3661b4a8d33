"""Publish a DebugVect to PX4 twice a second. Stop with Ctrl-C.

Usage: python advertiser.py [udp://127.0.0.1:8888]

The firmware needs `/fmu/in/debug_vect` in the subscriptions of its dds_topics.yaml.
"""

import itertools
import sys
import time
from contextlib import suppress

from msggen.live import LinkError, Vehicle
from px4_types import DebugVect, text

numbers = itertools.count()


def message() -> DebugVect:
    """Return the next message. PX4 replaces a timestamp of 0 with the time at which it arrives."""
    return DebugVect(name=text.pack("test", 10), x=float(next(numbers)), y=2.0, z=3.0)


try:
    with Vehicle(*sys.argv[1:]) as vehicle, suppress(KeyboardInterrupt):
        vehicle.wait_connected()
        with vehicle.every(2, message) as repeater:
            while repeater.is_running:
                time.sleep(2)
                print(repeater.jitter, flush=True)
except LinkError as error:
    sys.exit(str(error))
