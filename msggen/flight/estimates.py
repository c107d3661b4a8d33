"""What is known of where the vehicle is, and whether it is on the ground."""

from __future__ import annotations

import math
from typing import Any, Final

from msggen.flight.errors import NoAnswerError, UnsupportedError
from msggen.flight.feeds import Feeds

FRESH: Final = 0.5
"""The age in s up to which estimates are valid."""
SLOW: Final = 3.0
"""The same for values that are published rarely: home, battery, landing."""
_LIFTED = 1.0
"""The height in m above the origin of the local frame from which on a vehicle is in the air, with v1.15."""


def is_estimate(message: Any) -> bool:
    """Whether a VehicleLocalPosition has a valid position and velocity."""
    return bool(message.xy_valid and message.z_valid and message.v_xy_valid and message.v_z_valid)


def valid_estimate(feeds: Feeds) -> Any:
    """Return the last VehicleLocalPosition, or None if it is not valid, or older than 0.5 s."""
    feed = feeds["vehicle_local_position"]
    is_valid = feed.latest is not None and feed.age < FRESH and is_estimate(feed.latest)
    return feed.latest if is_valid else None


def checked_estimate(feeds: Feeds) -> Any:
    """Return the last VehicleLocalPosition. Raises NoAnswerError if it is not valid, or older than 0.5 s."""
    found = valid_estimate(feeds)
    if found is None:
        raise no_estimate(feeds)
    return found


def no_estimate(feeds: Feeds) -> NoAnswerError:
    """Return the error of a vehicle without a valid estimate: it has none, or is not heard."""
    age = feeds["vehicle_local_position"].age
    if math.isfinite(age) and age > FRESH:
        return feeds.no_answer(f"no vehicle_local_position for {age:.1f} s: is the link lost?")
    return NoAnswerError("the vehicle has no valid local position: it needs GPS, or another source of its position")


def is_landed(feeds: Feeds) -> bool:
    """Whether the vehicle is on the ground, as far as it has told. The first call asks for that."""
    try:
        found = feeds["vehicle_land_detected"].latest
    except UnsupportedError:  # v1.15 tells only when it has taken off
        status = feeds["vehicle_status"].latest
        return status is not None and not status.takeoff_time
    return found is not None and bool(found.landed)


def is_known_landed(feeds: Feeds) -> bool:
    """Whether a disarmed vehicle says that it is on the ground. v1.15 does not: its height above the origin counts."""
    try:
        feeds["vehicle_land_detected"]
    except UnsupportedError:
        place = valid_estimate(feeds)
        return place is not None and place.z >= -_LIFTED
    return is_landed(feeds)


def is_known_in_air(feeds: Feeds) -> bool:
    """Whether the vehicle says that it is not on the ground. v1.15 does not: its height above the origin counts."""
    try:
        found = feeds["vehicle_land_detected"].latest
    except UnsupportedError:
        place = valid_estimate(feeds)
        return not is_landed(feeds) and place is not None and place.z < -_LIFTED
    return found is not None and not found.landed


async def has_landed(feeds: Feeds) -> bool:
    """Return whether the vehicle is on the ground, by a message of the last 3 s. Raises NoAnswerError without one.

    v1.15 does not tell: its height above the origin counts.
    """
    try:
        feed = feeds["vehicle_land_detected"]
    except UnsupportedError:
        return not is_known_in_air(feeds)
    if feed.latest is None or feed.age > SLOW:
        try:
            await feed.following(lambda _: True, SLOW)
        except TimeoutError:
            raise feeds.no_answer(f"no vehicle_land_detected within {SLOW:.0f} s") from None
    return bool(feed.latest.landed)
