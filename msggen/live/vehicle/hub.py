"""A link that several vehicles of this process share: which vehicle belongs to whom, and where its samples go."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from logging import getLogger

from msggen.live.link import FormatError, Link, Remote, Route, Service
from msggen.live.messages.names import is_topic, stem_of
from msggen.live.messages.packages import Decoding, NamedTopic, Packages, UnknownFormatError, decoding_of
from msggen.live.vehicle.calls import Calls
from msggen.live.vehicle.feed import Feed, check_outside_callback
from msggen.live.vehicle.firmware import RESPONSE, RETRY_NS, Firmware, FormatCheck, Remembering, identify, releases
from msggen.live.vehicle.selection import Selection, is_same, is_unnamed, shown, why_missing
from msggen.live.vehicle.watch import Watch

LOGGER = getLogger("msggen.live")

SETTLED_S = 1.0
"""A vehicle with routes, but without a service and samples, has all of them if none was opened for this time, in s."""

_IDLE = 1 << 63
_MISSING_NS = 2_000_000_000
"""How long after the first sample a subscribed topic must have a route before the user is told that it has none."""

Row = tuple[Callable[[bytes, int, Decoding], None], Decoding]


class Entry:
    """A connected vehicle: its routes, and where the samples of each go."""

    def __init__(self, remote: Remote, hub: Hub) -> None:
        self.remote = remote
        self.routes: dict[str, Route] = {}
        self.services: dict[str, Service] = {}
        self.table: dict[str, tuple[Row, ...]] = {}
        self.opened_at = time.monotonic()
        self.heard_ns = 0
        self.ticked_ns = self.due_ns = 0
        """When `Hub.tick` has something to do, of the clock of the samples: at once, for the first one."""
        self.is_started = self.is_checked = False
        self.check = FormatCheck(
            lambda route, payload: hub.link.publish(remote, route, payload),
            lambda ros_type: hub.evaluate(self, ros_type),
        )
        self.calls = Calls(remote, hub.link)
        self.lost = 0

    @property
    def is_ready(self) -> bool:
        """Whether the vehicle has opened all its routes: the service is the last one, and samples come after it."""
        is_settled = bool(self.routes) and time.monotonic() - self.opened_at > SETTLED_S
        return bool(self.heard_ns or self.services or is_settled)

    def firmware(self) -> Firmware:
        """Return the firmware, as far as it is known."""
        routes, check = tuple(self.routes.values()), self.check
        return identify(routes, dict(check.hashes), self.remote.namespace, is_complete=check.is_complete)

    def hash_of(self, ros_type: str) -> int | None:
        """Return the vehicle's hash of a type, or None if it is not known.

        A release that answers no requests has the hashes of the embedded one, if it has its endpoints.
        """
        found = self.check.hashes.get(ros_type)
        if found is None and self.check.is_complete and not self.check.hashes:
            firmware = self.firmware()
            if firmware.release and not (firmware.differing or firmware.missing or firmware.further):
                known = releases()[firmware.release].values()
                message = ros_type.rpartition("/")[2]
                return next((row.message_hash for row in known if row.message == message), None)
        return found


class Member:
    """A Vehicle's part of a hub: the vehicle that it stands for, and its subscriptions.

    The hub knows members only, so that a forgotten Vehicle can be collected.
    """

    def __init__(self, selection: Selection, packages: Packages) -> None:
        self.selection = selection
        self.packages = packages
        self.entry: Entry | None = None
        self.last: Remote | None = None
        self.feeds: tuple[Feed, ...] = ()
        self.watches: tuple[Watch, ...] = ()
        self.reason = ""
        self.is_closed = False
        self.has_told_of_another = False
        self.told: set[int] = set()
        """The identities of the feeds that were told to have no route."""

    def accepts(self, remote: Remote) -> bool:
        """Whether to take a vehicle that connects. After the first one, only that vehicle is taken again."""
        return self.selection.accepts(remote) and (self.last is None or is_same(self.last, remote))


class Hub:
    """The listener of a link."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.changed = threading.Condition(threading.RLock())
        """Guards everything except `table` of an entry, which is replaced as a whole."""
        self.entries: dict[int, Entry] = {}
        self.members: tuple[Member, ...] = ()
        self.thread: int | None = None
        self.failure = ""
        """The error that has ended the link."""
        self.closed = threading.Event()
        """Set when the link was closed after the last member has left."""

    # the thread of the link

    def connected(self, remote: Remote) -> None:
        """Give a vehicle to the members that wait for it."""
        known = self.link.hashes(remote) if isinstance(self.link, Remembering) else {}
        with self.changed:
            self.thread = threading.get_ident()
            entry = self.entries[remote.number] = Entry(remote, self)
            entry.check.recall(known)
            for member in self.members:
                self._offer(member, entry)
            self.changed.notify_all()

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Connect a route with the subscriptions of it."""
        with self.changed:
            entry = self.entries.get(remote.number)
            if entry is None:
                return
            entry.opened_at = time.monotonic()
            if isinstance(route, Service):
                entry.services[route.request_type] = route
            else:
                entry.routes[route.name] = route
                self._connect(entry, route)
                if entry.is_started:
                    entry.check.add([route], remote.namespace)
                    entry.due_ns = min(entry.due_ns, entry.heard_ns + RETRY_NS)
            self.changed.notify_all()

    def disconnected(self, remote: Remote, reason: str) -> None:
        """Take a vehicle away, and give its members another session of it if there is one."""
        with self.changed:
            entry = self.entries.pop(remote.number, None)
            if entry is None:
                return
            entry.calls.fail(reason)
            for member in self.members:
                if member.entry is entry:
                    member.entry, member.reason = None, reason
                    LOGGER.info("%s disconnected: %s", shown(remote), reason)
                    for other in reversed(tuple(self.entries.values())):
                        self._offer(member, other)
            self.changed.notify_all()

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Give a sample to the subscriptions."""
        entry = self.entries.get(remote.number)
        if entry is None:
            return
        entry.heard_ns = time
        for push, decoding in entry.table.get(route.name, ()):
            push(payload, time, decoding)
        if not entry.ticked_ns <= time < entry.due_ns:  # also if the clock was set back
            self.tick(entry, time)

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:  # noqa: ARG002
        """Give a reply to the call that waits for it."""
        entry = self.entries.get(remote.number)
        if entry is not None:
            entry.calls.replied(number, payload)

    def lost(self, remote: Remote, missing: int) -> None:
        """Count lost samples."""
        entry = self.entries.get(remote.number)
        if entry is not None:
            entry.lost += missing

    def warned(self, text: str) -> None:
        """Tell the user."""
        LOGGER.warning("%s", text)

    def failed(self, reason: str) -> None:
        """Tell everybody who waits that nothing follows."""
        LOGGER.error("%s; close the Vehicle, and make a new one", reason)
        with self.changed:
            self.failure = reason
            for member in self.members:
                for feed in member.feeds:
                    feed.close(reason)
            self.changed.notify_all()

    def tick(self, entry: Entry, now: int) -> None:
        """Do what is due: ask for definitions, and tell of topics that the vehicle does not have.

        The samples of the vehicle drive this, so no timer is needed. `now` is the time of a sample.
        """
        with self.changed:
            self.thread = threading.get_ident()
            if not entry.is_started:
                entry.is_started = True
                feeds = [feed for member in self.members if member.entry is entry for feed in member.feeds]
                first = [feed.topic.message.__msg__.ros_type for feed in feeds]
                entry.check.add(entry.routes.values(), entry.remote.namespace, first)
            entry.check.ask()
            entry.ticked_ns, entry.due_ns = now, now + RETRY_NS
            if not entry.check.is_complete:
                entry.is_checked = False
            elif not entry.is_checked:
                entry.is_checked = True
                if isinstance(self.link, Remembering):
                    self.link.remember(entry.remote, dict(entry.check.hashes))
                entry.due_ns = now + _MISSING_NS
                self.evaluate(entry, None)
            else:
                entry.ticked_ns, entry.due_ns = 0, _IDLE
                for member in self.members:
                    if member.entry is entry:
                        self._tell_missing(member, entry)

    def _answered(self, entry: Entry, payload: bytes, now: int) -> None:
        """Take an answer about a definition, and ask for the next one."""
        if entry.is_started and entry.check.receive(payload):
            self.tick(entry, now)

    def _tell_missing(self, member: Member, entry: Entry) -> None:
        for feed in member.feeds:
            has_route = any(self._is_route_of(feed.topic, route) for route in entry.routes.values())
            if not has_route and id(feed) not in member.told:
                member.told.add(id(feed))
                why = why_missing(entry.remote, feed.topic.namespace)
                LOGGER.warning("%s has no topic '%s': %s", shown(entry.remote), feed.topic.name, why)

    # any thread

    def join(self, member: Member) -> None:
        """Add a member, and give it a vehicle that is connected already."""
        with self.changed:
            self.members = (*self.members, member)
            for entry in tuple(self.entries.values()):
                self._offer(member, entry)

    def leave(self, member: Member) -> None:
        """Remove a member, and end its subscriptions."""
        with self.changed:
            self.members = tuple(each for each in self.members if each is not member)
            feeds, member.feeds, member.watches, member.is_closed = member.feeds, (), (), True
            entry, member.entry = member.entry, None
            if entry is not None:
                self._rebuild(entry)
            self.changed.notify_all()
        for feed in feeds:
            feed.close()

    def attach(self, member: Member, feed: Feed) -> None:
        """Begin a subscription, which ends at once if the member has left or the link has failed."""
        with self.changed:
            if member.is_closed or self.failure:
                feed.close(self.failure)
                return
            member.feeds = (*member.feeds, feed)
            entry = member.entry
            if entry is None:
                return
            entry.check.prefer(feed.topic.message.__msg__.ros_type)
            for route in tuple(entry.routes.values()):
                if self._is_route_of(feed.topic, route):
                    self._connect(entry, route)
            if entry.due_ns == _IDLE:
                entry.due_ns = entry.heard_ns + _MISSING_NS

    def detach(self, member: Member, feed: Feed) -> None:
        """End a subscription. Can be repeated."""
        with self.changed:
            member.feeds = tuple(each for each in member.feeds if each is not feed)
            member.told.discard(id(feed))
            if member.entry is not None:
                self._rebuild(member.entry)

    def add_watch(self, member: Member, watch: Watch) -> None:
        """Give all samples to a watch."""
        with self.changed:
            member.watches = (*member.watches, watch)
            if member.entry is not None:
                self.evaluate(member.entry, None)

    def remove_watch(self, member: Member, watch: Watch) -> None:
        """End a watch. Can be repeated."""
        with self.changed:
            member.watches = tuple(each for each in member.watches if each is not watch)
            if member.entry is not None:
                self._rebuild(member.entry)

    def evaluate(self, entry: Entry, ros_type: str | None) -> None:
        """Connect the routes of a type, or of all if it is None, again: the vehicle's definition is now known."""
        with self.changed:
            for route in tuple(entry.routes.values()):
                if ros_type in (None, route.ros_type):
                    self._connect(entry, route)
            self.changed.notify_all()

    def wait(self, predicate: Callable[[], bool], timeout: float | None, interval: float = 0.2) -> bool:
        """Wait until `predicate` is true, which is called with the lock held. Return whether it is, at the end."""
        check_outside_callback()
        deadline = None if timeout is None else time.monotonic() + timeout
        with self.changed:
            while not predicate():
                rest = interval if deadline is None else min(interval, deadline - time.monotonic())
                if rest <= 0:
                    return False
                self.changed.wait(rest)
            return True

    # with the lock held

    def _offer(self, member: Member, entry: Entry) -> None:
        """Give a vehicle to a member if it waits for such a one, or tell it of another vehicle."""
        remote = entry.remote
        if member.entry is None and member.accepts(remote):
            member.entry, member.last = entry, remote
            LOGGER.info("%s connected", shown(remote))
            for feed in member.feeds:
                feed.error = None
            for route in tuple(entry.routes.values()):
                self._connect(entry, route)
        elif member.entry is not entry:
            self._tell_of_another(member, remote)

    def _tell_of_another(self, member: Member, remote: Remote) -> None:
        selection, own = member.selection, member.last
        is_taken = any(other.selection.accepts(remote) for other in self.members if not other.selection.is_any)
        if member.has_told_of_another or is_taken:
            return
        if selection.is_any and own is not None and not is_same(own, remote):
            member.has_told_of_another = True
            text = (
                "%s connected too and is ignored, as this Vehicle has %s: select one by its key, namespace or address"
            )
            LOGGER.warning(text, shown(remote), shown(own))
        elif is_unnamed(remote) and not selection.accepts(remote):
            member.has_told_of_another = True
            text = "%s continues an earlier session, so its key and namespace are not known: select it by its address"
            LOGGER.warning(text, shown(remote))

    def _is_route_of(self, topic: NamedTopic, route: Route) -> bool:
        return route.direction == "out" and is_topic(route.name, topic.stem, topic.namespace)

    def _connect(self, entry: Entry, route: Route) -> None:
        """Decide for each subscription of a route how its samples are decoded, or that it fails."""
        rows: list[Row] = []
        if route.direction == "out" and stem_of(route.name).endswith(RESPONSE):
            rows.append((lambda payload, now, _: self._answered(entry, payload, now), _NOT_DECODED))
        for member in self.members:
            if member.entry is not entry:
                continue
            for feed in member.feeds:
                if self._is_route_of(feed.topic, route):
                    decoding = self._decoding(member, feed, entry, route)
                    if decoding is not None:
                        rows.append((feed.push, decoding))
            if route.direction == "out":
                rows += [(watch.of(route), _NOT_DECODED) for watch in member.watches]
        entry.table = {**entry.table, route.name: tuple(rows)}

    def _decoding(self, member: Member, feed: Feed, entry: Entry, route: Route) -> Decoding | None:
        if feed.error is not None:
            return None
        if feed.options.is_raw:
            return Decoding(feed.topic.message, bytes)
        known = entry.hash_of(route.ros_type)
        try:
            is_converted = feed.options.is_converted
            return decoding_of(feed.topic, route.name, member.packages, known, is_converted=is_converted)
        except UnknownFormatError as error:
            feed.fail(FormatError(f"{error}: {_cure(feed.topic.package.__name__, route, entry.firmware())}"))
        except FormatError as error:
            feed.fail(error)
        return None

    def _rebuild(self, entry: Entry) -> None:
        for route in tuple(entry.routes.values()):
            if entry.table.get(route.name):
                self._connect(entry, route)


_NOT_DECODED = Decoding(object, bytes)  # type: ignore[arg-type]


def _cure(own: str, route: Route, firmware: Firmware) -> str:
    """Return how to get types with the vehicle's definition of a route."""
    if not firmware.release or route.ros_type.rpartition("/")[2] in firmware.differing:
        return "build types of the vehicle's own firmware, msggen build --px4 PX4-Autopilot"
    types = f"types=({own}, package_of('{firmware.release}'))"
    return f"give types of its release too, {types}, with package_of from msggen.generate.cache"
