"""The definitions of the topics of a running vehicle, which a recording keeps: those with the hashes that it tells."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.link.link import NotConnectedError
from msggen.messages.firmware import releases
from msggen.messages.packages import classes_of, has_definition

if TYPE_CHECKING:
    from msggen.exports.writer import Channel
    from msggen.link.link import Route
    from msggen.vehicle.vehicle import Vehicle

PATIENCE = 5.0
"""How long to wait in s for the hashes of a vehicle. It tells all of them within 2 s, or none."""


class Definitions:
    """The definitions of a vehicle: those of `package`, or of an embedded release if the vehicle's hash is there.

    `package_of` returns the generated package of a release. A vehicle that tells no hash of a message has that of
    `package`, as for `subscribe`.
    """

    def __init__(self, vehicle: Vehicle, package: ModuleType, package_of: Callable[[str], ModuleType]) -> None:
        self._vehicle, self._package, self._package_of = vehicle, package, package_of
        self._hashes: Mapping[str, int] = {}
        self._is_complete = False
        self._deadline = time.monotonic() + PATIENCE

    def is_complete(self) -> bool:
        """Whether the hashes of the vehicle are known, or will not be."""
        if not self._is_complete:
            self._is_complete = self.update() or time.monotonic() > self._deadline
        return self._is_complete

    def update(self) -> bool:
        """Take over the hashes that the vehicle has told. Return whether it was asked for all of them."""
        try:
            firmware = self._vehicle.firmware
        except NotConnectedError:
            return False
        if firmware.hashes:
            self._hashes = {**self._hashes, **firmware.hashes}
        return firmware.is_complete

    @property
    def hashes(self) -> Mapping[str, int]:
        """The hashes that the vehicle has told, by ROS type."""
        return self._hashes

    def channel(self, route: Route) -> Channel:
        """Return the channel of a route. Its definition is "" if no package has the vehicle's."""
        from msggen.exports.writer import Channel

        told = self._hashes.get(route.ros_type)
        for package in self._packages(route, told):
            for cls in classes_of(package, route.name, route.ros_type):
                info = cls.__msg__
                if has_definition(cls, route, told):
                    return Channel(route.name, route.ros_type, info.definition, info.type_hash)
        return Channel(route.name, route.ros_type, "", "")

    def _packages(self, route: Route, told: int | None) -> Iterator[ModuleType]:
        yield self._package
        name = route.ros_type.rpartition("/")[2]
        for release, rows in releases().items():
            if told is not None and any(row.message == name and row.message_hash == told for row in rows.values()):
                yield self._package_of(release)
