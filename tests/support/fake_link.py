"""A link without a vehicle: a test says what the vehicle does, and looks at what it was sent."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any

from msggen.link.age import NEVER, is_over
from msggen.link.link import Link, LinkError, Listener, Remote, Route, Service, StaleError, Statistics

SERVICE = Service(
    "/fmu/vehicle_command", "px4_msgs/srv/VehicleCommand_Request", "px4_msgs/srv/VehicleCommand_Response", 2048
)


def routes_of(package: ModuleType, namespace: str = "") -> tuple[Route, ...]:
    """Return the routes of a vehicle with the firmware of a generated package."""
    front = f"/{namespace}" if namespace else ""
    return tuple(
        Route(front + each.ros_name, each.message.__msg__.ros_type, each.direction, each.object_id)
        for each in package.topics.ENDPOINTS
    )


class FakeLink(Link):
    """A link whose vehicles are simulated by the thread of the test."""

    def __init__(self, package: ModuleType | None = None) -> None:
        self.package = package
        self.listener: Listener | None = None
        self.published: list[tuple[Remote, Route, bytes]] = []
        self.calls: list[tuple[Remote, Service, int, bytes]] = []
        self.called = threading.Event()
        self.sent = threading.Event()
        self.closed = threading.Event()
        self.error: LinkError | None = None
        self.refusal: LinkError | None = None
        """Why the vehicle takes no request."""
        self.opened: dict[int, list[Route | Service]] = {}
        self.remotes: dict[int, Remote] = {}
        self._numbers = 0
        self.starts = self.unsent = 0

    # Link

    def start(self, listener: Listener) -> None:
        self.starts += 1
        if self.error is not None:
            raise self.error
        self.listener = listener

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int = 0) -> None:
        if until and is_over(until):
            self.unsent += 1
            raise StaleError("late")
        if remote.number not in self.opened:
            raise LinkError("the vehicle is no longer connected")
        self.published.append((remote, route, payload))
        self.sent.set()

    def call(self, remote: Remote, service: Service, number: int, payload: bytes, until: int = NEVER) -> None:  # noqa: ARG002
        if self.refusal is not None:
            raise self.refusal
        self.calls.append((remote, service, number, payload))
        self.called.set()

    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        return tuple(self.opened[remote.number])

    def statistics(self) -> Statistics:
        return Statistics(0, len(self.published), 0, 0, 0, 0, unsent=self.unsent)

    def close(self) -> None:
        self.closed.set()

    # the vehicles

    def user(self) -> Listener:
        """Return the listener of the link."""
        assert self.listener is not None
        return self.listener

    def connect(  # noqa: PLR0913 - what a test may need
        self,
        key: int = 1,
        namespace: str = "",
        address: str = "127.0.0.1:40000",
        *,
        continued: bool = False,
        routes: Iterable[Route] | None = None,
        is_open: bool = True,
    ) -> Remote:
        """Let a vehicle connect and open the routes, by default those of the package, and the service."""
        self._numbers += 1
        remote = Remote(self._numbers, address, key, namespace, continued)
        self.opened[remote.number] = []
        self.remotes[remote.number] = remote
        self.user().connected(remote)
        if is_open:
            chosen = routes if routes is not None else routes_of(self.package, namespace) if self.package else ()
            for route in chosen:
                self.open(remote, route)
            self.open(remote, SERVICE)
        return remote

    def open(self, remote: Remote, route: Route | Service) -> None:
        self.opened[remote.number].append(route)
        self.user().opened(remote, route)

    def disconnect(self, remote: Remote, reason: str = "no answer for 3 s") -> None:
        del self.opened[remote.number], self.remotes[remote.number]
        self.user().disconnected(remote, reason)

    def fail(self, reason: str = "the link failed: OSError: no more") -> None:
        """End the link by an error."""
        for remote in [*self.remotes.values()]:
            self.disconnect(remote, reason)
        self.user().failed(reason)

    def route(self, remote: Remote, name: str) -> Route:
        """Return the route whose name without version ends so."""
        found = [
            route
            for route in self.opened[remote.number]
            if isinstance(route, Route)
            and route.name.partition("_v")[0].endswith(name.partition("_v")[0])
            and route.name.endswith(name if "_v" in name else "")
        ]
        return found[0]

    def sample(self, remote: Remote, message: Any, name: str = "", when: int | None = None) -> None:
        """Let a vehicle publish a message, on the topic of its type or the named one."""
        payload = message if isinstance(message, bytes) else message.encode()
        if name:
            route = self.route(remote, name)
        else:
            ros_type = message.__msg__.ros_type
            rows = [each for each in self.opened[remote.number] if isinstance(each, Route)]
            route = next(each for each in rows if each.ros_type == ros_type and each.direction == "out")
        self.user().sample(remote, route, payload, time.time_ns() if when is None else when)

    def answer(self, remote: Remote, hashes: dict[str, int] | None = None, most: int = 1000) -> list[str]:
        """Answer format requests until no more come. Return the names that were asked for."""
        package, asked = self.package, list[str]()
        assert package is not None
        own = {each.uorb_topic: each.message.__msg__.message_hash for each in package.topics.ENDPOINTS}
        own |= hashes or {}
        done = 0
        while done < len(self.published) and len(asked) < most:
            _, route, payload = self.published[done]
            done += 1
            if not route.name.endswith("/fmu/in/message_format_request"):
                continue
            request = package.MessageFormatRequest.decode(payload)
            name = request.topic_name.rstrip(b"\0").decode()
            asked.append(name)
            topic = name.rpartition("/")[2]
            response = package.MessageFormatResponse(
                protocol_version=request.protocol_version,
                topic_name=request.topic_name,
                success=topic in own,
                message_hash=own.get(topic, 0),
            )
            self.sample(remote, response)
        return asked
