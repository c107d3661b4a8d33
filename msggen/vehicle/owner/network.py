"""The vehicles of an owner on a network: one of its programs, which carries them to Zenoh in the form of rmw_zenoh.

What the owner tells, and what arrives from the network, waits in a queue for the thread of the network. Only samples of
vehicles are published at once, by the thread that receives them from the owner (docs/zenoh.md).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from logging import INFO, WARNING
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Final

from msggen.link.address import Address
from msggen.link.age import LONGEST_NS, expiry, now
from msggen.link.aside import Aside
from msggen.link.link import Link, LinkError, Listener, Remote, Route, Service
from msggen.link.rmw_zenoh.connection import Connection
from msggen.link.rmw_zenoh.names import (
    Attachment,
    beat_of,
    gid_of,
    is_since_1970,
    parse_attachment,
)
from msggen.link.waiting import Waiting
from msggen.messages.firmware import Firmware
from msggen.messages.packages import Packages
from msggen.vehicle.entries import Entries
from msggen.vehicle.entry import Entry
from msggen.vehicle.owned.unix import UnixLink
from msggen.vehicle.owner.namespaces import Namespaces, comes_first, taken
from msggen.vehicle.owner.network_topics import Flow, OnNetwork, Topic, domain_of_ros, topics_of
from msggen.vehicle.owner.owner import LOGGER
from msggen.vehicle.refusals import Refusals

if TYPE_CHECKING:
    from msggen.link.rmw_zenoh.session import Question, Session

_BEAT_S: Final = 0.1
"""The time between two beats: a program on the network sends nothing after 2 s without one."""
_MOST: Final = 1000
"""The samples that may wait for the thread of the network. Further ones are refused."""
_MOST_TOKENS: Final = 200_000
_RETRY_S: Final = 10.0
"""The time after which types are looked for again that were not found, because of an error."""


class Network(Listener):
    """Carries the vehicles of an owner to Zenoh, and back what is published to them there."""

    def __init__(self, address: Address, path: str, types: Callable[[Firmware], Packages]) -> None:
        """Make it. `address` is that of the router, and `path` that of the socket of the owner.

        `types` returns the packages with the definitions of a firmware, the first ones first.
        """
        self._name = str(address).replace(f"{address.scheme}://", f"{address.scheme} tcp/")
        self._link: Link = UnixLink(path, self._name)
        self._types = types
        self._domain = domain_of_ros()
        self._connection = Connection(address.host, address.port, address.config, self._begin)
        self._queue: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._samples: SimpleQueue[Callable[[], None]] = SimpleQueue()
        """The same for samples to vehicles, which do not wait for all tokens."""
        self._lock = threading.RLock()
        self._entries = Entries(self._link, self._lock, lambda entry, _: self._queue.put(lambda: self._update(entry)))
        self._vehicles: dict[int, OnNetwork] = {}
        """Those that are carried, by number."""
        self._flows: dict[tuple[int, str], Flow] = {}
        """By the number of the vehicle and the name of the route. Replaced as a whole."""
        self._namespaces = Namespaces(self._domain)
        self._waiting = Waiting()
        self.refusals = Refusals()
        self._aside = Aside("msggen-network-aside", _MOST, self._fail)
        """Finds types, and asks the owner for last samples: both can take a second."""
        self._answers = Aside("msggen-network-answers", _MOST, self._fail)
        """Answers what others ask, as often as they like."""
        self._told: set[str] = set()
        self._role = ""
        """What is told of this process on the network."""
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="msggen-network", daemon=True)

    def start(self) -> None:
        """Open the session, and join the owner soon. Raises LinkError."""
        self._connection.open()
        self._tell_role()
        self._thread.start()

    def close(self) -> None:
        """Leave the network and the owner. Can be repeated."""
        self._is_closing = True
        if self._thread.is_alive():
            self._thread.join()
        self._connection.close()
        self._aside.close(_BEAT_S)
        self._answers.close(_BEAT_S)

    # --- What happens at the owner: the listener of the link, in its thread

    def connected(self, remote: Remote) -> None:
        """Carry a vehicle soon."""
        with self._lock:
            self._entries.connected(remote)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Take a route."""
        entry = self._entries.opened(remote, route)
        if entry is not None and entry.check.is_complete:
            self._queue.put(lambda: self._update(entry))

    def disconnected(self, remote: Remote, reason: str) -> None:  # noqa: ARG002
        """Withdraw a vehicle soon."""
        with self._lock:
            self._entries.pop(remote.number, None)
        self._queue.put(lambda: self._end(remote.number))

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Publish a sample at once."""
        flow = self._flows.get((remote.number, route.name))
        if flow is not None:
            flow.put(payload, time)

    def identified(self, remote: Remote, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        """Take definitions."""
        self._entries.identified(remote, hashes, is_complete=is_complete)

    def failed(self, reason: str) -> None:
        """End with the owner."""
        if not self._is_closing:
            LOGGER.info("the network has ended: %s", reason)  # also at the end of the owner
        self._is_closing = True

    # --- What arrives from the network, in threads of Zenoh

    def _begin(self, session: Session) -> None:
        """Declare all anew in a session."""
        self._namespaces.begin(time.monotonic())
        session.tokens(partial(self._take_token, session))
        for vehicle in tuple(self._vehicles.values()):
            vehicle.declared.clear()  # it has ended with the session before
            self._declare(vehicle)

    def _take_token(self, session: Session, text: str, is_alive: bool) -> None:  # noqa: FBT001 - as Session calls it
        def note() -> None:
            if session is self._connection.session:  # nothing would tell that a token of one before is gone
                self._note(text, is_alive=is_alive)

        if self._queue.qsize() < _MOST_TOKENS:
            self._queue.put(note)

    def _take_sample(self, vehicle: OnNetwork, topic: Topic, _: str, payload: bytes, attachment: bytes | None) -> None:
        until, arrived = expiry(), time.time_ns()  # in this order: what stops between them makes it late
        if self._samples.qsize() >= _MOST:
            self.refusals.add(topic.key.name, f"more than {_MOST} samples wait")
            return
        self._samples.put(lambda: self._send(vehicle, topic, payload, attachment, arrived, until))
        if self._queue.empty():
            self._queue.put(lambda: None)  # so that the thread looks at once

    # --- The thread of the network

    def _run(self) -> None:
        try:
            self._link.start(self)
            beat = 0.0
            while not self._is_closing:
                self._do_next()
                if (moment := time.monotonic()) - beat >= _BEAT_S:
                    beat = moment
                    self._beat()
                    self._connection.look()
                    self._tell_role()
                    self._settle(moment)
                    self._look_again(moment)
        except LinkError as error:
            if not self._is_closing:
                LOGGER.error("the network has ended: %s", error)
        except Exception:  # noqa: BLE001 - told to the log: the link goes on without a network
            LOGGER.exception("the network has failed")
        finally:
            self._connection.close()  # its tokens go at once
            self._link.close()
            for topic, count in self.refusals.counts.items():
                LOGGER.info("%s: %d from the network were not carried", topic, count)

    def _beat(self) -> None:
        for vehicle in self._vehicles.values():
            if vehicle.beat is not None and vehicle.beat.publisher.is_heard:
                vehicle.beat.put(b"", now())

    def _do_next(self) -> None:
        """Wait for something to do, and send the samples that wait."""
        with suppress(Empty):
            self._queue.get(timeout=_BEAT_S)()
        for _ in range(self._samples.qsize()):
            self._samples.get()()

    def _tell_role(self) -> None:
        """Tell that the router is lost or back, or who it is now, once."""
        role = self._connection.role
        if role == self._role:
            return
        self._role = role
        warning = self._connection.warning("read all topics, and command the vehicles")
        if warning:
            LOGGER.warning("%s", warning)
        LOGGER.log(INFO if self._connection.has_router else WARNING, "%s: %s", self._name, role)

    def _note(self, text: str, *, is_alive: bool) -> None:
        """Take a token. Withdraw a vehicle whose namespace others have claimed, and rightly.

        A vehicle that is not declared yet comes second.
        """
        session = self._connection.session
        if session is None or not (found := self._namespaces.note(text, session, time.monotonic(), is_alive=is_alive)):
            return
        namespace, token = found
        for number, vehicle in tuple(self._vehicles.items()):
            if vehicle.entry.remote.namespace != namespace:
                continue
            if comes_first(token, session.zid) or not vehicle.declared:
                self._end(number)
            else:
                self._tell(taken(namespace, token.zid))

    def _settle(self, now: float) -> None:
        """Carry the vehicles of namespaces that others have left."""
        if self._namespaces.has_freed(now, has_router=self._connection.has_router):
            self._sort()

    def _update(self, entry: Entry) -> None:
        """Carry a vehicle whose definitions are known, or what it has got since."""
        number = entry.remote.number
        if not entry.check.is_complete or number not in self._entries:
            return
        vehicle = self._vehicles.get(number)
        if vehicle is None:
            self._sort()
        elif {*entry.routes} - vehicle.known:
            self._look_up(vehicle)

    def _sort(self) -> None:
        """Carry all vehicles whose key space nobody else has."""
        carried = [each.entry.remote for each in self._vehicles.values()]
        with self._lock:
            present = {each.remote: each for each in self._entries.values() if each.check.is_complete}
        found = self._namespaces.sort(carried, present)
        for _, reason in found.refused:
            self._tell(f"not carried: {reason}")
        for remote in found.new:
            vehicle = self._vehicles[remote.number] = OnNetwork(present[remote])
            self._look_up(vehicle)

    def _tell(self, text: str) -> None:
        if text not in self._told and len(self._told) < _MOST:
            self._told.add(text)
            LOGGER.warning("%s", text)

    def _look_up(self, vehicle: OnNetwork) -> None:
        """Carry a vehicle once its types are found: a package that is not in the cache is built."""
        entry = vehicle.entry
        vehicle.known, vehicle.looked_at = {*entry.routes}, time.monotonic()

        def find() -> None:
            try:
                packages = self._types(entry.firmware())
            except BaseException:
                vehicle.known = set()
                raise
            self._queue.put(lambda: self._carry(vehicle, packages))

        if not self._aside.do(find):
            vehicle.known = set()

    def _look_again(self, now: float) -> None:
        for vehicle in self._vehicles.values():
            if now - vehicle.looked_at > _RETRY_S and {*vehicle.entry.routes} - vehicle.known:
                self._look_up(vehicle)

    def _fail(self, error: Exception) -> None:
        self._tell(f"on the network: {error}")

    def _carry(self, vehicle: OnNetwork, packages: Packages) -> None:
        """Declare the topics of a vehicle whose definitions are known."""
        entry, missing, topics = vehicle.entry, list[str](), dict[str, Topic]()
        if self._vehicles.get(entry.remote.number) is not vehicle:
            return  # it has gone
        for route in tuple(entry.routes.values()):
            found = next(topics_of(route, entry, packages, self._domain), None)
            if found is None:
                missing.append(route.name)
            else:
                topics[route.name] = found
        self._withdraw(vehicle)
        vehicle.topics = topics
        self._declare(vehicle)
        LOGGER.info("%s is on the network, with %d topics", entry.remote, len(topics))
        if missing:
            names = ", ".join(sorted(missing))
            cure = "name the vehicle's firmware, --px4 PX4-Autopilot, or its package, --types"
            self._tell(f"not on the network, because no types have the vehicle's definitions: {names}: {cure}")

    def _declare(self, vehicle: OnNetwork) -> None:
        """Declare a vehicle in the session, if there is one: its node, then what it reads, then what it publishes."""
        session, remote = self._connection.session, vehicle.entry.remote
        if session is None:
            return
        node, flows = vehicle.node(self._domain, session.zid), dict(self._flows)
        with suppress(LinkError):  # the session has ended, and another one follows
            vehicle.declared.append(session.declare(str(node)))
            key = beat_of(session.zid, self._domain, remote.namespace)
            vehicle.beat = Flow(session.publisher(key, lambda _: None), gid_of(str(node)))
            vehicle.declared.append(vehicle.beat.publisher)
            for topic, token in vehicle.tokens(node):
                text = str(topic.key)
                if topic.route.direction == "in":
                    take = partial(self._take_sample, vehicle, topic)
                    vehicle.declared += [session.subscribe(text, take), session.declare(token)]
                else:
                    publisher = session.publisher(text, self._follower(remote, topic.route))
                    flows[remote.number, topic.route.name] = Flow(publisher, gid_of(token))
                    self._follow(remote, topic.route, is_followed=publisher.is_heard)
                    answered = session.answer(text, partial(self._answer, remote, topic))
                    vehicle.declared += [publisher, answered, session.declare(token)]
        self._flows = flows

    def _withdraw(self, vehicle: OnNetwork) -> None:
        number = vehicle.entry.remote.number
        self._flows = {place: flow for place, flow in self._flows.items() if place[0] != number}
        for each in reversed(vehicle.declared):
            each.withdraw()
        vehicle.declared.clear()
        vehicle.beat = None

    def _end(self, number: int) -> None:
        vehicle = self._vehicles.pop(number, None)
        if vehicle is not None:
            if vehicle.declared:
                LOGGER.info("%s is no longer on the network", vehicle.entry.remote)
            self._withdraw(vehicle)
        self._sort()

    def _follower(self, remote: Remote, route: Route) -> Callable[[bool], None]:
        """Return what to do when the first subscriber of a topic comes, and the last one goes."""
        return lambda is_heard: self._queue.put(lambda: self._follow(remote, route, is_followed=is_heard))

    def _follow(self, remote: Remote, route: Route, *, is_followed: bool) -> None:
        """Begin or end to follow a topic.

        What has arrived while its subscriber came is published then: an acknowledgement can be faster.
        """

        def catch_up() -> None:
            found, flow = self._link.last(remote, route), self._flows.get((remote.number, route.name))
            if found is not None and flow is not None:
                flow.put(found.payload, found.time, time.time_ns() - LONGEST_NS)

        self._link.follow(remote, route, is_followed=is_followed)
        if is_followed:
            self._aside.do(catch_up)

    def _answer(self, remote: Remote, topic: Topic, question: Question) -> None:
        """Tell the last sample of a topic soon, if not too many ask."""

        def tell() -> None:
            found, flow = self._link.last(remote, topic.route), self._flows.get((remote.number, topic.route.name))
            if found is not None and flow is not None:
                question.reply(found.payload, Attachment(flow.sequence, found.time, flow.gid).pack())
            question.close()

        if not self._answers.do(tell):
            question.close()

    def _send(  # noqa: PLR0913, PLR0917 - what is known of a sample
        self, vehicle: OnNetwork, topic: Topic, payload: bytes, attachment: bytes | None, arrived: int, until: int
    ) -> None:
        """Give a sample of the network to the vehicle, unless it is late or no sample of the topic.

        It is decoded and encoded, because PX4 takes one encapsulation only.
        """
        told, name = parse_attachment(attachment), topic.key.name
        if told is None:
            self.refusals.add(name, "it has no attachment of rmw_zenoh, which tells how old it is")
            return
        try:
            data = topic.message.decode(payload).encode()
            clock = arrived if is_since_1970(told.time) else until - LONGEST_NS  # the one that it tells
            waited = self._waiting.of((name, told.gid), clock - told.time, arrived, until - LONGEST_NS)
            self._link.publish(vehicle.entry.remote, topic.route, data, until - waited)
        except (LinkError, ValueError) as error:
            self.refusals.add(name, error)
