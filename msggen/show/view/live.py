"""Shows a running vehicle in Foxglove."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.show.view.scene import KINDS, Scene
from msggen.show.view.server import Channel, Server

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.vehicle.vehicle import Vehicle


class LiveView:
    """Gives the samples of a vehicle to a server: a watcher for `Vehicle.watch`.

    A topic is shown with the definition in `package`, if that is the vehicle's. `tell` gets the names of topics that
    cannot be shown, once each, with the reason.
    """

    def __init__(self, server: Server, vehicle: Vehicle, package: ModuleType, tell: Callable[[str], None]) -> None:
        self.samples = 0
        self._server, self._vehicle, self._package, self._tell = server, vehicle, package, tell
        self._scene = Scene(package)
        self._classes: dict[str, Any] = {}
        """The class of the message of each topic, None for one that is not shown."""
        self._refused: list[str] = []
        self._lock = threading.Lock()

    def __call__(self, route: Route, payload: bytes, time: int) -> None:
        """Show a sample."""
        with self._lock:
            if route.name not in self._classes:
                self._add(route)
            message = self._classes[route.name]
        if message is None:
            return
        self._server.sample(route.name, payload, time)
        self.samples += 1
        if route.ros_type in KINDS:
            with suppress(ValueError):  # a damaged sample, or one of another definition
                found = self._scene.feed(route.ros_type, message.decode(payload), time)
                if found is not None:
                    self._server.draw(found, time)

    def check(self) -> None:
        """Remove the topics whose definition differs, as the vehicle has answered in the meantime.

        Call it about once a second: it also tells clients that have connected later.
        """
        hashes = self._vehicle.firmware.hashes
        with self._lock:
            for route in self._vehicle.routes:
                message = self._classes.get(route.name)
                if (
                    message is not None
                    and hashes.get(route.ros_type, message.__msg__.message_hash) != message.__msg__.message_hash
                ):
                    self._classes[route.name] = None
                    self._server.remove(route.name)
                    self._refuse(f"'{route.name}': its definition is not that of {self._package.__name__}")
        for text in tuple(self._refused):
            self._server.tell(text)

    def _add(self, route: Route) -> None:
        try:
            message = self._package.by_type(route.ros_type)
        except KeyError:
            self._classes[route.name] = None
            self._refuse(f"'{route.name}': {self._package.__name__} has no {route.ros_type}")
            return
        self._classes[route.name] = message
        self._server.add(Channel(route.name, route.ros_type, message.__msg__.definition))

    def _refuse(self, reason: str) -> None:
        text = f"not shown, {reason}: build types of the vehicle's firmware and give them with --types"
        self._refused.append(text)
        self._tell(text)
