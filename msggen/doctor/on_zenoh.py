"""What a vehicle on Zenoh cannot do, or not safely."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.check.finding import Change
from msggen.doctor.case import Case
from msggen.link.rmw_zenoh.vehicles import NO_BEAT
from msggen.messages.firmware import SMALL_STACK
from msggen.messages.names import uorb_name

_LARGE = "arming_check_reply"
_FIRMWARE = ("CONFIG_ZENOH_", "in the form of PX4 v1.16", "cannot be told apart", NO_BEAT)
"""What tells warnings that explain why a vehicle is not as it should be from others."""


def find_limited(case: Case) -> Iterator[Change]:
    """Find vehicles of which too little is told, or whose samples are not CDR: the link warns of them."""
    for text in case.seen.warnings if case.seen.link_type.has_router else ():
        if any(mark in text for mark in _FIRMWARE):
            yield case.change(case.seen.link, text)


def find_small_stack(case: Case) -> Iterator[Change]:
    """Find programs that answer checks over Zenoh."""
    for vehicle in case.vehicles if case.seen.link_type.has_router else ():
        if vehicle.remote.guid and any(uorb_name(name) == _LARGE for name in vehicle.inputs):
            yield case.of(vehicle, f"gets {_LARGE}: {SMALL_STACK}")
