"""A vehicle: subscribe to its messages, publish to it, call its service."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, get_args, overload

from msggen.base.diagnostics import suggestion
from msggen.link.age import expiry
from msggen.link.link import (
    Link,
    LinkError,
    LinkTimeoutError,
    NotConnectedError,
    Publisher,
    Remote,
    Route,
    Service,
    Statistics,
    TopicError,
)
from msggen.link.link_types import DEFAULT
from msggen.messages.names import stem_of
from msggen.messages.packages import (
    Endpoint,
    MessageT,
    check_convertible,
    check_message,
    check_sent,
    decoding_of,
    find_topic,
    heard_way,
    package_of_class,
    packages_of,
    response_of,
    zenoh_endpoints,
)
from msggen.vehicle.absence import PATIENCE, absence
from msggen.vehicle.entry import Entry, Member
from msggen.vehicle.feed import LOGGER, Feed, Options
from msggen.vehicle.repeater import Repeater
from msggen.vehicle.selection import NO_SERVICES, Selection, why_missing
from msggen.vehicle.sharing import join_hub, leave_hub, leave_soon, link_of, opened_at
from msggen.vehicle.subscription import Subscription
from msggen.vehicle.watch import Direction, Watch, Watcher

if TYPE_CHECKING:
    from typing_extensions import Self

    from msggen.messages.firmware import Firmware
    from msggen.messages.packages import Message, NamedTopic, Packages, Target, Way

QUEUE = 1000
"""The number of samples that a subscription keeps, by default."""


class Vehicle:
    """A vehicle on a link: `with Vehicle("udp://127.0.0.1:8888") as vehicle`.

    `url` is `udp://HOST:PORT`, `serial:///dev/ttyUSB0?baud=921600`, `tap://HOST:PORT?agent=HOST:PORT`, `dds://DOMAIN`,
    `zenoh://HOST:PORT`, or a Link. Vehicles of one program with the same URL share the link. `udp://127.0.0.1:0` opens
    a free port, in this program alone: the attribute `url` tells which.

    `types` is a generated package, or several: the first one is preferred, and a topic whose definition is not that of
    the first one is decoded with the others. Without it, the package follows from the classes in `subscribe` and
    `publish`.

    `key` (parameter UXRCE_DDS_KEY), `namespace` and `address` select a vehicle. Without them it is the first one that
    connects. After that, only the same vehicle is accepted when it connects again.

    `allow` has the addresses and keys of clients that may connect, the same for all that share a link; docs/links.md.
    `queue` is the number of samples that a subscription keeps.

    A process of its own owns the link, for all programs of the user: this one joins it, or starts it (docs/links.md).
    With `direct`, or the variable MSGGEN_DIRECT, this program owns the link, and others cannot use it meanwhile.

    Raises LinkError if the address is wrong or the link cannot be opened.
    """

    def __init__(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        url: str | Link = DEFAULT,
        types: ModuleType | Sequence[ModuleType] | None = None,
        *,
        key: int | None = None,
        namespace: str | None = None,
        address: str | None = None,
        allow: str | int | Sequence[str | int] = (),
        queue: int = QUEUE,
        direct: bool = False,
    ) -> None:
        if not isinstance(url, (str, Link)):
            raise TypeError(f"expected an address such as '{DEFAULT}', or a Link, got {url!r}")
        if key is not None and not (isinstance(key, int) and 0 < key < 1 << 32):
            raise ValueError(f"expected a key from 1 to {(1 << 32) - 1} (UXRCE_DDS_KEY), got {key!r}")
        if not isinstance(queue, int) or queue < 1:
            raise ValueError(f"expected a queue of 1 sample or more, got {queue!r}")
        self._queue = queue
        self._packages: Packages = packages_of(types)
        selection = Selection(key, None if namespace is None else namespace.strip("/"), address)
        self._member = Member(selection, self._packages)
        self._routes: dict[tuple[type, object], tuple[Entry, Route, object]] = {}
        allowed = (allow,) if isinstance(allow, (str, int)) else tuple(allow)
        self._name, opened = link_of(url, allowed, is_direct=direct)
        self._hub = join_hub(self._name, opened, self._member, allowed)
        self.url = opened_at(self._name, self._hub.link)
        """The address of the link. With `udp://127.0.0.1:0`, it has the port that the system has chosen."""
        self._has_told_of_absence = False
        self._repeaters: weakref.WeakSet[Repeater] = weakref.WeakSet()
        weakref.finalize(self, leave_soon, self._name, self._hub, self._member).atexit = False

    def __repr__(self) -> str:
        entry = self._member.entry  # once, because the thread of the link can remove it
        absence = self._hub.failure or "not connected"
        state = "closed" if self._member.is_closed else str(entry.remote) if entry else absence
        return f"<Vehicle on {self.url}: {state}>"

    def _repr_html_(self) -> str | None:
        """Return what is known of the vehicle, without waiting, for Jupyter."""
        from msggen.vehicle.display import html_of_vehicle, html_or_none

        title, member = f"Vehicle on {self.url}", self._member
        absence = self._hub.failure or "not connected"
        state = "closed" if member.is_closed else "connected" if self.is_connected else absence
        return html_or_none(lambda: html_of_vehicle(title, state, member))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all subscriptions and repeaters, and close the link if no other Vehicle uses it. Can be repeated."""
        for repeater in tuple(self._repeaters):
            repeater.close()
        leave_hub(self._name, self._hub, self._member)

    # the connection

    @property
    def is_connected(self) -> bool:
        """Whether a vehicle is connected, and its topics are known."""
        entry = self._member.entry
        return entry is not None and entry.is_ready

    def wait_connected(self, timeout: float | None = None) -> Remote:
        """Wait until a vehicle is connected and its topics are known, and return it. `timeout` is in s.

        Without a `timeout`, a warning in the log says after 12 s what to check.

        Raises LinkTimeoutError, NotConnectedError if the Vehicle is closed, and LinkError if the link has failed.
        """
        hub, member, received = self._hub, self._member, self.statistics.received
        seconds = PATIENCE if timeout is None else timeout

        def is_over() -> bool:
            return self.is_connected or member.is_closed or bool(hub.failure)

        if not hub.wait(is_over, seconds, 0.05):
            text = absence(self.url, hub, member, seconds, received)
            if timeout is not None:
                raise LinkTimeoutError(text)
            LOGGER.warning("%s", text)
            hub.wait(is_over, None, 0.05)
        return self.remote

    def _tell_absence(self) -> None:
        """Warn a program that waits for samples, once, if no vehicle has connected."""
        if self._member.last is None and not self._member.is_closed and not self._has_told_of_absence:
            self._has_told_of_absence = True
            LOGGER.warning("%s", absence(self.url, self._hub, self._member, PATIENCE))

    def wait_disconnected(self, timeout: float | None = None) -> str:
        """Wait until the vehicle is disconnected, and return the reason. `timeout` is in s.

        Raises LinkTimeoutError.
        """
        if not self._hub.wait(lambda: self._member.entry is None, timeout):
            raise LinkTimeoutError(f"{self.remote} is still connected after {timeout:g} s")
        return self._member.reason

    @property
    def remote(self) -> Remote:
        """The vehicle that is connected: its address, key and namespace. Raises NotConnectedError."""
        return self._entry().remote

    @property
    def others(self) -> Sequence[Remote]:
        """The further vehicles on the link. None if this one was selected by key, namespace or address."""
        return self._hub.others(self._member)

    @property
    def is_settled(self) -> bool:
        """Whether `others` has all vehicles that send to the link, as far as it is known.

        It is false in the first 2.5 s of a link, in which each vehicle asks for a connection, and while one connects.
        It is true if this vehicle was selected by key, namespace or address.
        """
        return self._hub.is_settled(self._member)

    @property
    def routes(self) -> tuple[Route, ...]:
        """The topics of the vehicle that is connected. Raises NotConnectedError."""
        return tuple(self._entry().routes.values())

    @property
    def services(self) -> tuple[Service, ...]:
        """The services of the vehicle that is connected. Raises NotConnectedError."""
        return tuple(self._entry().services.values())

    @property
    def firmware(self) -> Firmware:
        """The firmware of the vehicle, as far as it is known. `wait_firmware` waits for all of it.

        Raises NotConnectedError.
        """
        return self._entry().firmware()

    def wait_firmware(self, timeout: float | None = None) -> Firmware:
        """Wait until the vehicle was asked for all its definitions, and return its firmware. `timeout` is in s.

        The requests begin with the first sample of the vehicle, and take 1 to 2 s. Raises LinkTimeoutError, and
        NotConnectedError if the vehicle disconnects.
        """
        entry = self._entry()
        if not self._hub.wait(lambda: entry.check.is_complete or self._member.entry is not entry, timeout):
            text = f"{entry.remote} has not answered for all its messages within {timeout:g} s"
            raise LinkTimeoutError(f"{text}: {entry.firmware()}")
        return self.firmware

    @property
    def types(self) -> tuple[ModuleType, ...]:
        """The generated packages that were given."""
        return tuple(self._packages)

    @property
    def lost(self) -> int:
        """The samples of this session that did not arrive: their sequence numbers are missing."""
        return self._entry().lost

    @property
    def statistics(self) -> Statistics:
        """The counters of the link, for all vehicles on it."""
        return self._hub.link.statistics()

    @property
    def problem(self) -> str:
        """Why messages to the vehicle do not get through, "" if they do, as far as it is known.

        The vehicle has disconnected. Also known on a shared link: the process that owns it stands still, or messages
        reach it too late and are dropped.
        """
        member = self._member
        if self._hub.failure or (member.entry is None and member.last is not None):
            return self._hub.failure or f"the vehicle has disconnected: {member.reason}"
        return self._hub.link.problem()

    @property
    def is_shared(self) -> bool:
        """Whether another process owns the link, for all programs of the user."""
        return self._hub.link.is_shared

    @property
    def publishers(self) -> tuple[Publisher, ...]:
        """The running programs that have published to the vehicle on a shared link, by topic.

        Empty if this program owns the link.
        """
        return tuple(self._hub.publishers(self._member))

    @property
    def time(self) -> int:
        """The time for the field `timestamp` of a message to PX4, in us.

        It is UTC since 1970, because PX4 subtracts the offset that its time synchronization measured
        (docs/wire.md, section 14). A `timestamp` of 0 becomes the time of arrival, and so does a time in the future.

        If the vehicle's samples have times since boot, as on Zenoh and with UXRCE_DDS_SYNCT 0, so has this one: it is
        estimated from the samples of the topics that this program follows.
        """
        entry, now = self._member.entry, time.time_ns()
        return (now - (entry.boot_ns(now) if entry is not None else 0)) // 1000

    # samples

    @overload  # a class alone: jedi does not find the message of a union
    def subscribe(
        self,
        topic: type[MessageT],
        callback: Callable[[MessageT], object] | None = None,
        *,
        queue: int | None = None,
        raw: Literal[False] = False,
        convert: bool = False,
    ) -> Subscription[MessageT]: ...
    @overload
    def subscribe(
        self,
        topic: Endpoint[MessageT],
        callback: Callable[[MessageT], object] | None = None,
        *,
        queue: int | None = None,
        raw: Literal[False] = False,
        convert: bool = False,
    ) -> Subscription[MessageT]: ...
    @overload
    def subscribe(
        self,
        topic: str,
        callback: Callable[[Any], object] | None = None,
        *,
        queue: int | None = None,
        raw: Literal[False] = False,
        convert: bool = False,
    ) -> Subscription[Any]: ...
    @overload
    def subscribe(
        self,
        topic: type[Any] | Endpoint[Any] | str,
        callback: Callable[[bytes], object] | None = None,
        *,
        queue: int | None = None,
        raw: Literal[True],
    ) -> Subscription[bytes]: ...

    def subscribe(
        self,
        topic: Target,
        callback: Callable[[Any], object] | None = None,
        *,
        queue: int | None = None,
        raw: bool = False,
        convert: bool = False,
    ) -> Subscription[Any]:
        """Return the samples of a topic, from now on and whenever the vehicle is connected.

        `topic` is a message class, an endpoint such as `topics.out.vehicle_status`, or a name, with or without
        namespace and version: "vehicle_status", "/fmu/out/vehicle_status_v1". A name with a version means that version.
        A name with "/fmu/in/", or an endpoint such as `topics.in_.offboard_control_mode`, gives what all programs on a
        shared link publish to the vehicle (docs/links.md).

        The thread of the link calls `callback` for each message; it must return at once. Without it, samples wait in a
        queue of `queue` samples, which drops the oldest. With `raw`, the values are the bytes of CDR samples with their
        headers, of any definition. With `convert`, messages of other versions are converted by `versions.convert`.

        Raises TopicError. The readers of the subscription raise FormatError if the vehicle's definition differs.
        """
        if callback is not None and not callable(callback):
            raise TypeError(f"expected a function as callback, got {callback!r}: the size of the queue is queue=")
        found = find_topic(topic, heard_way(topic), self._packages)
        self._check_heard(found.direction, f"'{found.name}'")
        self._check_namespace(found)
        if convert:
            check_convertible(found, self._packages)
        size = self._queue if queue is None else queue
        if size < 1:
            raise ValueError(f"expected a queue of 1 sample or more, got {size}")
        self._check_open()
        feed = Feed(found, size, callback, Options(raw, convert))
        hub, member = self._hub, self._member

        def attach(feed: Feed) -> None:
            hub.attach(member, feed)

        subscription: Subscription[Any] = Subscription(
            feed,
            attach,
            lambda feed: hub.detach(member, feed),
            lambda feed: hub.last(member, feed),
            self._tell_absence,
            is_shared=hub.link.is_shared,
        )
        attach(feed)
        return subscription

    def watch(self, watcher: Watcher, direction: Direction = "out") -> Watch:
        """Call `watcher(route, payload, time)` for each sample of all topics, also of unknown ones, undecoded.

        `direction` is "out" for what PX4 publishes, "in" for what all programs on a shared link publish to PX4
        (docs/links.md), or "both".

        The thread of the link calls it; it must return at once. `payload` are the bytes of a CDR sample with its
        header, and `time` is that of its arrival in ns, of the clock `time.time_ns`. Goes on when the vehicle connects
        again, until `close` of the Watch that is returned. Raises NotConnectedError if the Vehicle is closed, and
        TopicError for what is published to PX4 if this program owns the link.
        """
        if direction not in get_args(Direction):
            raise ValueError(f"expected out, in or both as direction, got {direction!r}")
        if direction != "out":
            self._check_heard("in", "what programs send")
        self._check_open()
        hub, member = self._hub, self._member
        watch = Watch(watcher, direction, lambda watch: hub.remove_watch(member, watch))
        hub.add_watch(member, watch)
        return watch

    def decode(self, route: Route, payload: bytes) -> Any:
        """Return the message in a sample that a watcher got.

        Raises TopicError if the types do not have the topic, FormatError if the vehicle's definition differs,
        NotConnectedError, and the package's DecodeError.
        """
        entry = self._entry()
        topic = find_topic(stem_of(route.name), route.direction, self._packages)
        known = entry.hash_of(route.ros_type)
        return decoding_of(topic, route, self._packages, known, is_converted=False).decode(payload)

    def publish(self, message: Message, topic: Endpoint[Any] | str | None = None, *, waited: float = 0.0) -> None:
        """Send a message to the vehicle, once. From any thread.

        It is dropped and counted, `statistics.unsent`, if it cannot be sent within 0.5 s. Warnings in the log tell when
        messages begin not to get through, and `problem` tells why. `waited` is the time in s that it has waited before,
        such as in another middleware, which counts.

        `topic` is needed if several topics have messages of this class, and none of them is named after it. Raises
        NotConnectedError, TopicError, FormatError if the vehicle's definition differs, and the package's EncodeError.
        """
        until = expiry(waited)
        check_message(message)
        entry, route = self._route_to(message, topic)
        payload = message.encode()
        try:
            self._hub.delivery.publish(entry.remote, route, payload, until)
        except LinkError as error:
            if self._member.entry is entry:
                raise
            raise NotConnectedError(str(error)) from None

    def every(
        self,
        hz: float,
        message: MessageT | Callable[[], MessageT | None],
        topic: Endpoint[Any] | str | None = None,
    ) -> Repeater:
        """Publish a message at a rate, from a thread of its own, until `close` of the Repeater that is returned.

        A callable makes each message, and returns None to send none. Nothing is filled in: a message goes out as it is,
        with its `timestamp`. While no vehicle is connected, nothing is sent. `Repeater.jitter` has the delays.

        Raises TopicError if the message has no topic to the vehicle, and ValueError for a rate of 0 or above 10000 Hz.
        """
        self._check_open()
        if isinstance(message, type):
            check_message(message)
        if not callable(message):
            check_message(message)
            find_topic(type(message) if topic is None else topic, "in", self._packages)
        vehicle = weakref.ref(self)

        def publish(each: Message) -> None:
            found = vehicle()
            if found is None:
                raise ReferenceError
            found.publish(each, topic)

        repeater = Repeater(hz, message, publish)
        self._repeaters.add(repeater)
        repeater.start()  # now that `close` knows it, because its callable may close this Vehicle
        return repeater

    def call(self, request: Message, timeout: float = 5.0) -> Any:
        """Send a request such as `srv.VehicleCommand.Request(...)`, and return the reply: `VehicleCommand.Response`.

        Calls of several threads wait for each other, and one is on the wire at a time. `timeout` is in s, with the time
        in the queue. PX4 replies when a module acknowledges the command; if none does, there is no reply.

        Raises LinkTimeoutError, NotConnectedError, LinkError, and TopicError if the vehicle has no such service.
        """
        entry = self._entry()
        response, service_name = response_of(request)
        service = entry.services.get(type(request).__msg__.ros_type)
        if service is None:
            have = ", ".join(f"'{each.name}'" for each in tuple(entry.services.values())) or "no service"
            why = NO_SERVICES if entry.is_on_zenoh else f"it has {have}; PX4 has one since v1.15"
            raise TopicError(f"{entry.remote} has no service '{service_name}': {why}")
        payload = entry.calls.call(service, request.encode(), timeout)
        return response.decode(payload)

    def _check_open(self) -> None:
        if self._member.is_closed:
            raise NotConnectedError("the Vehicle is closed: make a new one")
        if self._hub.failure:
            raise LinkError(f"{self._hub.failure}; close the Vehicle, and make a new one")

    def _entry(self) -> Entry:
        self._check_open()
        entry = self._member.entry
        if entry is None:
            last = self._member.last
            if last is None:
                raise NotConnectedError(f"no vehicle is connected to {self.url} yet: call wait_connected() first")
            raise NotConnectedError(
                f"{last} disconnected: {self._member.reason}; wait_connected() waits until it is back"
            )
        return entry

    def _check_heard(self, way: Way, what: str) -> None:
        """Raise TopicError for what is published to PX4, if other programs cannot use the link."""
        if way == "in" and not self._hub.link.is_shared:
            text = f"{what} is read by PX4: use publish, or name a topic of '/fmu/out'; what other programs send can"
            raise TopicError(f"{text} be read on a link that they share, and this program owns its link")

    def _check_namespace(self, topic: NamedTopic) -> None:
        own = self._member.selection.namespace
        if topic.namespace is not None and own is not None and topic.namespace != own:
            text = f"'/{topic.namespace}{topic.stem}' is a topic of another vehicle: this one has the namespace '{own}'"
            raise TopicError(text)

    def _route_to(self, message: Message, topic: Endpoint[Any] | str | None) -> tuple[Entry, Route]:
        entry = self._entry()
        # an endpoint takes 15 us to hash; its id cannot become that of another one, because it is kept here
        name = (type(message), topic if isinstance(topic, str) else id(topic))
        found = self._routes.get(name)
        if found is not None and found[0] is entry:
            return entry, found[1]
        route = self._find_route(entry, type(message), topic)
        if (
            entry.check.is_complete or route.ros_type in entry.check.hashes
        ):  # before, the definition may turn out to differ
            if len(self._routes) >= 1000:  # noqa: PLR2004 - endpoints made anew for each call
                self._routes.clear()
            self._routes[name] = entry, route, topic
        return entry, route

    def _find_route(self, entry: Entry, cls: type[Message], topic: Endpoint[Any] | str | None) -> Route:
        package = package_of_class(cls)
        found = find_topic(cls if topic is None else topic, "in", (*self._packages, package))
        self._check_namespace(found)
        if cls.__msg__.ros_type != found.message.__msg__.ros_type:
            expected = found.message.__name__
            raise TopicError(f"'{found.stem}' has messages of {expected}, not of {cls.__name__}")
        for route in tuple(entry.routes.values()):
            if route.direction == "in" and entry.has(found, route):
                check_sent(cls, route, entry.hash_of(route.ros_type))
                return route
        if not entry.is_ready:
            raise NotConnectedError(f"{entry.remote} is still connecting: call wait_connected() first")
        names = [stem_of(route.name) for route in tuple(entry.routes.values()) if route.direction == "in"]
        is_own = found.namespace in (None, entry.remote.namespace)
        on_zenoh = {stem_of(each.ros_name) for each in zenoh_endpoints(found.package)} if entry.remote.guid else ()
        is_absent = bool(entry.remote.guid) and found.stem not in on_zenoh
        near = suggestion(found.stem, names) if is_own and not is_absent else ""
        why = near or f": {why_missing(entry.remote, found.namespace)}"
        raise TopicError(f"{entry.remote} does not read '{found.name}'{why}")
