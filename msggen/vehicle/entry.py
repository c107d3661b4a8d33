"""A vehicle that is connected, and a Vehicle object's part of it."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from msggen.link.link import FormatError, Kept, Link, Remote, Route, Service
from msggen.messages.firmware import Firmware, FormatCheck, identify, releases
from msggen.messages.names import is_topic
from msggen.messages.packages import Decoding, NamedTopic, Packages, UnknownFormatError, decoding_of
from msggen.vehicle.calls import Calls
from msggen.vehicle.feed import Feed
from msggen.vehicle.selection import Selection, is_same
from msggen.vehicle.watch import Watch

PERIOD_NS: Final = 1_000_000_000
"""The time between two looks for samples to remember."""
_STAMP: Final = struct.Struct("<4xQ")
"""The header of a sample, and its `timestamp`."""
_YEARS_NS: Final = 10**18
"""A time since 1970: a vehicle that has started before it has no times since boot."""
_RARE_NS: Final = 3_000_000_000
"""The time without a further sample after which a sample is remembered. What PX4 repeats, it repeats every 1 s."""


class Memory:
    """Which of the last samples of a vehicle its link remembers: those that are not followed by others soon.

    PX4 publishes some topics on change only.
    """

    def __init__(self) -> None:
        self._kept: dict[str, Kept] = {}
        self.looked_ns = self.due_ns = 0
        """When the last look was, and the next one is due, of the clock of the samples."""

    def recall(self, samples: Mapping[str, Kept]) -> None:
        """Take what is remembered already."""
        self._kept.update(samples)

    def look(self, last: Mapping[str, Kept], now: int) -> Mapping[str, Kept] | None:
        """Return the samples to remember, of the last ones by route, or None if they have not changed."""
        self.looked_ns, self.due_ns = now, now + PERIOD_NS
        found = {name: sample for name, sample in last.items() if self._is_rare(name, sample, now)}
        if found == self._kept:
            return None
        self._kept = found
        return dict(found)

    def _is_rare(self, name: str, sample: Kept, now: int) -> bool:
        before = self._kept.get(name)
        if before is not None and before[1] != sample[1]:
            return sample[1] - before[1] >= _RARE_NS
        return before is not None or now - sample[1] >= _RARE_NS


class _Boot:
    """When a vehicle has started, by the `timestamp` of its samples: their first field, in us."""

    def __init__(self) -> None:
        self.looked_ns = self.found_ns = 0

    def look(self, last: Sequence[Kept], now: int) -> None:
        """Take the last samples. Those that arrive soonest after they were made tell it best."""
        recent = [each for each in last if 0 <= now - each[1] < _RARE_NS and len(each[0]) >= _STAMP.size]
        starts = [time - _STAMP.unpack_from(payload)[0] * 1000 for payload, time in recent]
        since_boot = [start for start in starts if start > _YEARS_NS]
        if starts:
            self.looked_ns = now
            self.found_ns = min(since_boot) if len(since_boot) * 2 > len(starts) else 0


SETTLED_S = 1.0
"""A vehicle with routes, but without a service and samples, has all of them if none was opened for this time, in s."""

Row = tuple[Callable[[bytes, int, Decoding], None], Decoding]


class Entry:
    """A connected vehicle: its routes, and where the samples of each go."""

    def __init__(self, remote: Remote, link: Link, told: Callable[[Entry, str], None]) -> None:
        """Make an entry without routes. `told` is called when the vehicle has told its definition of a type."""
        self.remote = remote
        self.routes: dict[str, Route] = {}
        self.services: dict[str, Service] = {}
        self.table: dict[str, tuple[Row, ...]] = {}
        self.followed: set[str] = set()
        """The routes whose samples cross to this process, also if another one owns the link."""
        self.last: dict[str, Kept] = {}
        """The last sample of each route that crosses to this process, by name."""
        self.memory = Memory()
        self.opened_at = time.monotonic()
        self.heard_ns = 0
        self.ticked_ns = self.due_ns = 0
        """When `Entries` has something to do, of the clock of the samples: at once, for the first one."""
        self.is_started = self.is_checked = False
        self.answers: frozenset[str] = frozenset()
        """The routes with answers to requests for definitions, if this process asks."""
        self.check = FormatCheck(
            lambda route, payload: link.publish(remote, route, payload),
            lambda ros_type: told(self, ros_type),
        )
        self.calls = Calls(remote, link)
        self.lost = 0
        self._boot = _Boot()

    @property
    def is_ready(self) -> bool:
        """Whether the vehicle has opened all its routes: the service is the last one, and samples come after it.

        Over Zenoh, samples come between the routes, and the link tells when it has all of them.
        """
        is_heard = bool(self.heard_ns) and not self.is_on_zenoh
        is_settled = bool(self.routes) and time.monotonic() - self.opened_at > SETTLED_S
        return bool(is_heard or self.services or self.check.is_complete or is_settled)

    @property
    def is_on_zenoh(self) -> bool:
        """Whether its link is one over Zenoh, which tells definitions by their hashes, and has no services."""
        return any(route.type_hash for route in tuple(self.routes.values()))

    def boot_ns(self, now: int) -> int:
        """Return when the vehicle has started, in ns since 1970, 0 if its samples do not have times since boot."""
        if not 0 <= now - self._boot.looked_ns < PERIOD_NS:
            last = [sample for name, sample in tuple(self.last.items()) if self._is_out(name)]
            self._boot.look(last, now)
        return self._boot.found_ns

    def has(self, topic: NamedTopic, route: Route) -> bool:
        """Whether a topic, with or without a namespace in its name, is a route of this vehicle."""
        return is_topic(route.name, topic.stem, topic.namespace)

    def remember(self, link: Link, now: int) -> None:
        """Let the link remember the samples that are not followed by others soon, without those of programs."""
        last = {name: each for name, each in tuple(self.last.items()) if self._is_out(name)}
        changed = self.memory.look(last, now)
        if changed is not None:
            link.keep(self.remote, changed)

    def _is_out(self, name: str) -> bool:
        route = self.routes.get(name)
        return route is not None and route.direction == "out"

    def last_of(self, route: Route, link: Link) -> Kept | None:
        """Return the last sample of a route. Others have also those that do not cross to this process."""
        if not link.has_last(self.remote):
            return self.last.get(route.name)
        found = link.last(self.remote, route)
        if found is None:
            return None
        self.last.setdefault(route.name, (found.payload, found.time))
        return found.payload, found.time

    def decoding(self, feed: Feed, route: Route, packages: Packages) -> Decoding | None:
        """Return how the samples of a route become messages of a subscription. None if they do not: it fails then."""
        if feed.error is not None:
            return None
        if feed.options.is_raw:
            return Decoding(feed.topic.message, bytes)
        known = self.hash_of(route.ros_type)
        try:
            return decoding_of(feed.topic, route, packages, known, is_converted=feed.options.is_converted)
        except UnknownFormatError as error:
            feed.fail(FormatError(f"{error}: {_cure(feed.topic.package.__name__, route, self.firmware())}"))
        except FormatError as error:
            feed.fail(error)
        return None

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


def _cure(own: str, route: Route, firmware: Firmware) -> str:
    """Return how to get types with the vehicle's definition of a route."""
    if not firmware.release or route.ros_type.rpartition("/")[2] in firmware.differing:
        return "build types of the vehicle's own firmware, msggen build --px4 PX4-Autopilot"
    types = f"types=({own}, package_of('{firmware.release}'))"
    return f"give types of its release too, {types}, with package_of from msggen.generate.cache"


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

    def about_another(self, remote: Remote) -> str:
        """Return what the user should know of a vehicle that is not taken, or ""."""
        selection, own = self.selection, self.last
        if selection.is_any and own is not None and not is_same(own, remote):
            text = f"{remote} connected too and is ignored, as this Vehicle has {own}"
            return f"{text}: select one by key, namespace or address"
        return ""
