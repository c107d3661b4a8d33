"""The vehicles that are connected to a link. Their definitions are asked for, and some samples are remembered."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Final

from msggen.link.link import Link, Remote, Route, Service
from msggen.messages.firmware import RESPONSE, RETRY_NS
from msggen.messages.names import stem_of
from msggen.vehicle.entry import Entry

_IDLE: Final = 1 << 63
_MISSING_NS: Final = 2_000_000_000
"""How long after the first sample a subscribed topic must have a route before the user is told that it has none."""


class Entries(dict[int, Entry]):
    """The vehicles of a link by their numbers, for its listener, who passes on what happens.

    The samples of a vehicle drive the requests for its definitions, so no timer is needed. If another process owns the
    link, that one asks.
    """

    def __init__(
        self,
        link: Link,
        lock: AbstractContextManager[bool],
        told: Callable[[Entry, str | None], None],
        settled: Callable[[Entry], None] = lambda _: None,
    ) -> None:
        """Make them. `lock` is held while an entry changes, and can be taken again.

        `told` is called when the definition of a type is known, or all of them for None, and `settled` 2 s after that.
        """
        super().__init__()
        self._link, self._lock, self._told, self._settled = link, lock, told, settled

    def connected(self, remote: Remote) -> Entry:
        """Return the entry of a vehicle that has connected."""
        link = self._link
        entry = self[remote.number] = Entry(remote, link, self._told)
        entry.check.recall(link.hashes(remote))
        samples = link.samples(remote)
        entry.last.update(samples)
        entry.memory.recall(samples)
        return entry

    def opened(self, remote: Remote, route: Route | Service) -> Entry | None:
        """Take a route, and return the entry of its vehicle."""
        entry = self.get(remote.number)
        if entry is None:
            return None
        with self._lock:
            entry.opened_at = time.monotonic()
            if isinstance(route, Service):
                entry.services[route.request_type] = route
                return entry
            entry.routes[route.name] = route
            if route.message_hash:
                entry.check.recall({route.ros_type: route.message_hash})
            if not self._link.is_shared and route.direction == "out" and stem_of(route.name).endswith(RESPONSE):
                entry.answers |= {route.name}
            if entry.is_started and _is_asked_for(route):
                entry.check.add([route], remote.namespace)
                entry.due_ns = min(entry.due_ns, entry.heard_ns + RETRY_NS)
        return entry

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Give a sample to those who take it, and do what is due."""
        entry = self.get(remote.number)
        if entry is None:
            return
        name = route.name
        entry.heard_ns = time
        entry.last[name] = payload, time
        for push, decoding in entry.table.get(name, ()):
            push(payload, time, decoding)
        if name in entry.answers and entry.is_started and entry.check.receive(payload):
            self._tick(entry, time)
        if not entry.ticked_ns <= time < entry.due_ns:  # also if the clock was set back
            self._tick(entry, time)
        if not entry.memory.looked_ns <= time < entry.memory.due_ns:
            entry.remember(self._link, time)

    def lost(self, remote: Remote, missing: int) -> None:
        """Count lost samples."""
        entry = self.get(remote.number)
        if entry is not None:
            entry.lost += missing

    def identified(self, remote: Remote, hashes: Mapping[str, int], *, is_complete: bool) -> Entry | None:
        """Take definitions of a vehicle that the owner of the link knows, and return its entry."""
        entry = self.get(remote.number)
        if entry is not None:
            entry.check.learn(hashes, is_complete=is_complete)
            self._told(entry, next(iter(hashes)) if len(hashes) == 1 else None)
        return entry

    def settle_again(self, entry: Entry) -> None:
        """Call `settled` once more, if all that was due is done. The caller holds the lock."""
        if entry.due_ns == _IDLE:
            entry.due_ns = entry.heard_ns + _MISSING_NS

    def _tick(self, entry: Entry, now: int) -> None:
        """Do what is due: ask for definitions, and tell when they are known. `now` is the time of a sample."""
        with self._lock:
            if self._link.is_shared:  # its owner does all that
                entry.ticked_ns, entry.due_ns = 0, _IDLE
                return
            if not entry.is_started:
                entry.is_started = True
                entry.check.add(filter(_is_asked_for, entry.routes.values()), entry.remote.namespace)
            if not entry.is_on_zenoh:  # where the link tells when all is known
                entry.check.ask()
            entry.ticked_ns, entry.due_ns = now, now + RETRY_NS
            if not entry.check.is_complete:
                entry.is_checked = False
            elif not entry.is_checked:
                entry.is_checked = True
                self._link.remember(entry.remote, dict(entry.check.hashes))
                entry.due_ns = now + _MISSING_NS
                self._told(entry, None)
            else:
                entry.ticked_ns, entry.due_ns = 0, _IDLE
                self._settled(entry)


def _is_asked_for(route: Route) -> bool:
    """Whether the vehicle is asked for the definition of a route: its link does not tell it."""
    return not route.type_hash
