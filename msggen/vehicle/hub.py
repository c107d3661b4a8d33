"""A link that several vehicles of this process share: which vehicle belongs to whom, and where its samples go."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from logging import getLogger

from msggen.base.diagnostics import counted
from msggen.link.age import LATE
from msggen.link.link import Link, Listener, Publisher, Remote, Route, Service, StaleError
from msggen.messages.packages import Decoding, NamedTopic, size_of
from msggen.vehicle.entries import Entries
from msggen.vehicle.entry import Entry, Member, Row
from msggen.vehicle.feed import Feed, Item, check_outside_callback
from msggen.vehicle.selection import order, why_missing
from msggen.vehicle.watch import Watch

LOGGER = getLogger("msggen.live")
OTHERS = "msggen.live.others"
"""The logger that warns of further vehicles, which a program of several vehicles does not need."""


class Hub(Listener):
    """The listener of a link."""

    def __init__(self, link: Link, allow: frozenset[str | int] = frozenset()) -> None:
        """Make it. `allow` are the addresses and keys of those who may connect."""
        self.link, self.allow = link, allow
        self.changed = threading.Condition(threading.RLock())
        """Guards everything except `table` of an entry, which is replaced as a whole."""
        self.entries = Entries(link, self.changed, self.evaluate, self._tell_all_missing)
        self.sample = self.entries.sample  # type: ignore[method-assign]
        """Gives a sample to the subscriptions. It is no method, for speed."""
        self.members: tuple[Member, ...] = ()
        self.thread: int | None = None
        self.failure = ""
        """The error that has ended the link."""
        self.delivery = Delivery(link)
        self.closed = threading.Event()
        """Set when the link was closed after the last member has left."""

    # the thread of the link

    def connected(self, remote: Remote) -> None:
        """Give a vehicle to the members that wait for it."""
        with self.changed:
            self.thread = threading.get_ident()
            entry = self.entries.connected(remote)
            for member in self.members:
                self._offer(member, entry)
            self.changed.notify_all()

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Connect a route with the subscriptions of it."""
        with self.changed:
            entry = self.entries.opened(remote, route)
            if entry is not None and isinstance(route, Route):
                self._connect(entry, route)
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
                    LOGGER.info("%s disconnected: %s", remote, reason)
                    for other in reversed(tuple(self.entries.values())):
                        self._offer(member, other)
            self.changed.notify_all()

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:  # noqa: ARG002
        """Give a reply to the call that waits for it."""
        entry = self.entries.get(remote.number)
        if entry is not None:
            entry.calls.replied(number, payload)

    def refused(self, remote: Remote, number: int, problem: str) -> None:
        """End the call that was not sent."""
        entry = self.entries.get(remote.number)
        if entry is not None:
            entry.calls.refused(number, problem)

    def lost(self, remote: Remote, missing: int) -> None:
        """Count lost samples."""
        self.entries.lost(remote, missing)

    def identified(self, remote: Remote, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        """Take definitions of a vehicle that the owner of the link knows."""
        with self.changed:
            entry = self.entries.identified(remote, hashes, is_complete=is_complete)
            if entry is not None and is_complete:
                self._tell_all_missing(entry)

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

    def _tell_all_missing(self, entry: Entry) -> None:
        for member in self.members:
            if member.entry is entry:
                self._tell_missing(member, entry)

    def _tell_missing(self, member: Member, entry: Entry) -> None:
        for feed in member.feeds:
            has_route = any(self._is_route_of(feed.topic, route, entry) for route in entry.routes.values())
            if not has_route and id(feed) not in member.told:
                member.told.add(id(feed))
                why = why_missing(entry.remote, feed.topic.namespace)
                LOGGER.warning("%s has no topic '%s': %s", entry.remote, feed.topic.name, why)

    # any thread

    def join(self, member: Member) -> None:
        """Add a member, and give it a vehicle that is connected already."""
        with self.changed:
            self.members = (*self.members, member)
            for entry in sorted(self.entries.values(), key=lambda each: order(each.remote)):
                self._offer(member, entry)

    def leave(self, member: Member) -> None:
        """Remove a member, and end its subscriptions."""
        with self.changed:
            self.members = tuple(each for each in self.members if each is not member)
            feeds, member.feeds, member.watches, member.is_closed = member.feeds, (), (), True
            self._release(member)
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
                if self._is_route_of(feed.topic, route, entry):
                    self._connect(entry, route)
            if self.link.is_shared and entry.check.is_complete:
                self._tell_missing(member, entry)
            else:
                self.entries.settle_again(entry)

    def last(self, member: Member, feed: Feed) -> Item | None:
        """Return the last sample of a topic, also one from before the subscription or the program, if it is known."""
        entry = member.entry
        if entry is None:
            return None
        for route in tuple(entry.routes.values()):
            if self._is_route_of(feed.topic, route, entry):
                rows = [decoding for push, decoding in entry.table.get(route.name, ()) if push == feed.push]
                sample = entry.last_of(route, self.link) if rows else None
                if sample is not None:
                    return *sample, rows[0]
        return None

    def others(self, member: Member) -> Sequence[Remote]:
        """Return the further vehicles on the link that a member without a selection could have, in their order."""
        own = member.entry
        if not member.selection.is_any:
            return ()
        return sorted((each.remote for each in tuple(self.entries.values()) if each is not own), key=order)

    def is_settled(self, member: Member) -> bool:
        """Whether no further vehicle that a member without a selection could have is about to connect."""
        return not member.selection.is_any or self.link.is_settled()

    def publishers(self, member: Member) -> Sequence[Publisher]:
        """Return the programs that publish to the vehicle of a member."""
        entry = member.entry
        found = self.link.publishers(entry.remote) if entry is not None else ()
        return [each for each in found if entry is not None and each.topic in entry.routes]

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
            self._take(member, entry)
        elif member.entry is not entry:
            self._tell_of_another(member, remote)

    def _take(self, member: Member, entry: Entry) -> None:
        member.entry, member.last = entry, entry.remote
        LOGGER.info("%s connected", entry.remote)
        for feed in member.feeds:
            feed.error = None
            entry.check.prefer(feed.topic.message.__msg__.ros_type)
        for route in tuple(entry.routes.values()):
            self._connect(entry, route)

    def _release(self, member: Member) -> None:
        entry, member.entry = member.entry, None
        if entry is not None:
            self._rebuild(entry)

    def _tell_of_another(self, member: Member, remote: Remote) -> None:
        is_taken = any(other.selection.accepts(remote) for other in self.members if not other.selection.is_any)
        text = "" if member.has_told_of_another or is_taken else member.about_another(remote)
        if text:
            member.has_told_of_another = True
            getLogger(OTHERS).warning("%s", text)

    def _is_route_of(self, topic: NamedTopic, route: Route, entry: Entry) -> bool:
        return route.direction == topic.direction and entry.has(topic, route)

    def _connect(self, entry: Entry, route: Route) -> None:
        """Decide for each subscription of a route how its samples are decoded, or that it fails."""
        rows: list[Row] = []
        for member in self.members:
            if member.entry is not entry:
                continue
            for feed in member.feeds:
                if self._is_route_of(feed.topic, route, entry):
                    decoding = entry.decoding(feed, route, member.packages)
                    if decoding is not None:
                        rows.append((feed.push, decoding))
            size = size_of(route, member.packages)
            rows += [(watch.of(route, size), _NOT_DECODED) for watch in member.watches if watch.takes(route)]
        entry.table = {**entry.table, route.name: tuple(rows)}
        if (route.name in entry.followed) != bool(rows):
            (entry.followed.add if rows else entry.followed.remove)(route.name)
            self.link.follow(entry.remote, route, is_followed=bool(rows))

    def _rebuild(self, entry: Entry) -> None:
        for route in tuple(entry.routes.values()):
            if entry.table.get(route.name):
                self._connect(entry, route)


_NOT_DECODED = Decoding(object, bytes)  # type: ignore[arg-type]


# Messages to vehicles: whether they get through, and what the user is told of it


class Delivery:
    """Publishes on a link. Tells when messages begin not to get through, and when they get through again."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._late = 0
        """Messages that the link has dropped at once."""
        self._problem = ""
        self._dropped = 0

    def publish(self, remote: Remote, route: Route, payload: bytes, until: int) -> None:
        """Send a sample to a vehicle until a time. Raises LinkError, but not StaleError: that is told."""
        problem = ""
        try:
            self._link.publish(remote, route, payload, until)
        except StaleError as error:
            problem = str(error)
            self._late += 1
        self.take(problem or self._link.problem(), self._late + self._link.late())

    def take(self, problem: str, dropped: int) -> None:
        """Take why messages do not get through, "" if they do, and how many were dropped so far."""
        if problem and not self._problem:
            LOGGER.warning("messages to the vehicle do not get through: %s", problem)
        elif not problem and dropped > self._dropped:
            LOGGER.warning("%s to the vehicle %s", counted(dropped - self._dropped, "message"), LATE)
        if not problem:
            self._dropped = dropped
        self._problem = problem
