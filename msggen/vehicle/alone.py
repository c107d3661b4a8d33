"""Whether the vehicle of a program that acts is the only one on its link: chance must not decide which one acts."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from msggen.link.link import LinkError, Remote
from msggen.vehicle.selection import order

if TYPE_CHECKING:
    from msggen.vehicle.vehicle import Vehicle

LOOK: Final = 0.1
"""The time in s between two looks."""
_OTHERS: Final = 3.0
"""The longest time in s to wait for further vehicles: that by which PX4's clients can connect one after the other."""


class SeveralError(LinkError):
    """Several vehicles are on a link, and the program has not said which one is meant. The text names the cure."""


class Alone:
    """The check of a vehicle that a program took without a selection.

    A vehicle that sends to a link which was just opened can connect after the first one: `is_sure` tells until when.
    """

    def __init__(self, vehicle: Vehicle, choice: str) -> None:
        """Take a vehicle, and how to choose one of several, such as "Say which one flies: Flight(url, key={key})"."""
        self._vehicle, self._choice = vehicle, choice
        self._end = time.monotonic() + _OTHERS

    def is_sure(self) -> bool:
        """Look once whether all vehicles on the link have connected. Raises what `check` raises.

        It can take a second, because the process that owns the link is asked.
        """
        is_late = time.monotonic() > self._end
        is_settled = is_late or self._vehicle.is_settled
        self.check(are_twins_two=is_late)
        return is_late or (is_settled and len(self._found()) == 1)

    def check(self, *, are_twins_two: bool = False) -> None:
        """Raise SeveralError if a program has not said which of several vehicles it means, and NotConnectedError.

        Two with the same key and namespace are one that has restarted, until both are heard for long.
        """
        found = self._found()
        count = len({each.identity for each in found})
        if count == 1 and not (are_twins_two and len(found) > 1):
            return
        listed = ", ".join(map(str, found))
        twins = "Set the parameter UXRCE_DDS_KEY of each to another number"
        cure = self._choice.format(key=found[0].key) if count > 1 else twins
        if found[0].guid:
            name = next((each.namespace for each in found if each.namespace), "")
            cure = f"Name its namespace, such as '{name}'" if name else "Build each with a namespace, PX4_UXRCE_DDS_NS"
        raise SeveralError(f"{len(found)} vehicles are on {self._vehicle.url}: {listed}. {cure}")

    def _found(self) -> list[Remote]:
        return sorted([self._vehicle.remote, *self._vehicle.others], key=order)


def wait_alone(vehicle: Vehicle, choice: str) -> None:
    """Wait until all vehicles on the link have connected. Raises SeveralError and NotConnectedError."""
    alone = Alone(vehicle, choice)
    while not alone.is_sure():
        time.sleep(LOOK)
