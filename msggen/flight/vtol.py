"""What only vehicles with wings do: change between hovering and forward flight, circle, and stand armed."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from contextlib import suppress
from logging import getLogger
from typing import Any, Final

from msggen.flight.commands import Commands
from msggen.flight.errors import FlightError, NotReachedError, UnsupportedError
from msggen.flight.estimates import is_known_in_air
from msggen.flight.feeds import Feeds
from msggen.flight.places import wrapped
from msggen.flight.states import described, is_armed, is_disarmed, is_in_transition, is_on_wings, is_plane, title_of
from msggen.messages import commands
from msggen.messages.nav_states import EXTERNAL, HOLD, LAND, RETURN
from msggen.messages.vehicle_types import VtolState

LOGGER = getLogger("msggen.flight")
TRANSITION: Final = 20.0
"""The time in s within which a VTOL changes: PX4 gives up after VT_TRANS_TIMEOUT, 15 s."""
KNOWN: Final = 5.0
"""The age in s up to which the status of a VTOL counts."""
_CIRCLES = 2 * math.tau
"""The turns in rad after which a plane that returns counts as circling over home."""
_LEVEL = 10.0
"""The difference in m up to which it keeps its height: NAV_FW_ALT_RAD."""
_STANDING: Final = frozenset({HOLD, LAND, RETURN, *EXTERNAL})
"""The modes in which PX4 does not take off."""
_FORGOTTEN = 10.0
"""The time in s after which a plane that stands counts as forgotten: COM_DISARM_PRFLT of other vehicles."""


def must_change(feeds: Feeds, *, is_forward: bool, seconds: float) -> bool:
    """Whether a VTOL does not fly as it is to. Raise the errors of `Flight.to_fixed_wing` if it cannot change now."""
    if not seconds > 0.0:
        raise ValueError(f"expected a timeout above 0 s, got {seconds:g}")
    feed = feeds["vehicle_status"]
    if feed.latest is None or feed.age > KNOWN:
        raise feeds.no_answer(f"no vehicle_status within {KNOWN:g} s: whether the vehicle hovers is not known")
    if not feed.latest.is_vtol:
        raise UnsupportedError(f"only a VTOL changes between hovering and forward flight, not {title_of(feed.latest)}")
    if not (is_armed(feed.latest) and is_known_in_air(feeds)):
        raise FlightError("on the ground, PX4 changes at once, and the vehicle flips over: take off first")
    return not _is_there(feed.latest, is_forward=is_forward)


async def change(sender: Commands, feeds: Feeds, *, is_forward: bool, seconds: float) -> None:
    """Let a VTOL change, and wait for the end: see `Flight.to_fixed_wing`."""
    if not must_change(feeds, is_forward=is_forward, seconds=seconds):
        return
    status, name = feeds["vehicle_status"], "forward flight" if is_forward else "hovering"
    has_begun = False

    def follow(each: Any) -> None:
        nonlocal has_begun
        has_begun = has_begun or is_in_transition(each)

    def is_over(each: Any) -> bool:
        return _is_there(each, is_forward=is_forward) or (has_begun and not is_in_transition(each))

    with suppress(UnsupportedError):  # v1.15 does not tell of a quad-chute
        feeds["vtol_vehicle_status"]
    end = status.call(follow)  # a short transition can be over before the acknowledgement
    try:
        state = VtolState.FORWARD if is_forward else VtolState.HOVER
        await sender.send(commands.VTOL_TRANSITION, float(state), 0.0, what=f"change to {name}", shown=is_in_transition)
        found = await status.wait(is_over, seconds)
    except TimeoutError:
        raise NotReachedError(f"the vehicle has not changed to {name} within {seconds:g} s") from None
    finally:
        end()
    if not _is_there(found, is_forward=is_forward):
        raise NotReachedError(f"the vehicle has not changed to {name}: {_why_not(feeds, found)}")


def _is_there(status: Any, *, is_forward: bool) -> bool:
    return not is_in_transition(status) and is_on_wings(status) == is_forward


def _why_not(feeds: Feeds, status: Any) -> str:
    """Return why a transition has ended, as far as the vehicle tells."""
    with suppress(UnsupportedError):
        found = feeds["vtol_vehicle_status"].latest
        if found is not None and found.fixed_wing_system_failure:
            return "a quad-chute has ended it (VT_TRANS_TIMEOUT, VT_F_TR_OL_TM, VT_QC_T_ALT_LOSS), and it hovers"
    return described(status)


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
