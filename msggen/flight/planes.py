"""Planes that PX4 neither lands nor disarms: waits for them end all the same."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from logging import getLogger
from typing import Any, Final

from msggen.flight.errors import FlightError
from msggen.flight.feeds import Feeds
from msggen.flight.places import wrapped
from msggen.flight.states import is_disarmed, is_plane
from msggen.messages.nav_states import EXTERNAL, HOLD, LAND, RETURN

LOGGER = getLogger("msggen.flight")
_CIRCLES = 2 * math.tau
"""The turns in rad after which a plane that returns counts as circling over home."""
_LEVEL = 10.0
"""The difference in m up to which it keeps its height: NAV_FW_ALT_RAD."""
_STANDING: Final = frozenset({HOLD, LAND, RETURN, *EXTERNAL})
"""The modes in which PX4 does not take off."""
_FORGOTTEN = 10.0
"""The time in s after which a plane that stands counts as forgotten: COM_DISARM_PRFLT of other vehicles."""


async def circling(feeds: Feeds) -> None:
    """Wait until the vehicle has flown two circles at one height."""
    turned, height, last = 0.0, math.inf, 0.0

    def is_circling(here: Any) -> bool:
        nonlocal turned, height, last
        course = math.atan2(here.vy, here.vx)
        if abs(here.z - height) > _LEVEL:
            turned, height = 0.0, here.z
        else:
            turned += wrapped(course - last)
        last = course
        return abs(turned) > _CIRCLES

    await feeds["vehicle_local_position"].following(is_circling)
    LOGGER.warning("the return has ended in a circle, and PX4 does not land the plane: `await flight.land()` does")


def until_disarmed() -> Callable[[Any], bool]:
    """Return a condition of a VehicleStatus that is disarmed. It raises FlightError for a plane that only stands."""
    clock = asyncio.get_running_loop().time
    since = math.inf

    def is_over(status: Any) -> bool:
        nonlocal since
        if is_disarmed(status):
            return True
        stands = is_plane(status) and not status.takeoff_time and status.nav_state in _STANDING
        since = min(since, clock()) if stands else math.inf
        if clock() - since > _FORGOTTEN:
            raise FlightError(
                "the plane has not taken off, and PX4 disarms it only after a flight: `await flight.takeoff(30.0)` "
                "before, or `await flight.disarm()`"
            )
        return False

    return is_over
