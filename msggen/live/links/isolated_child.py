"""The process of an isolated link: runs the link, and passes all on to its parent."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import IO, Any

from msggen.live.link import Link, LinkError, Remote, Route, Service, Statistics
from msggen.live.links.address import parse_address
from msggen.live.links.opening import open_link
from msggen.live.links.pipe import CALL, EVENT, HEADER, SAMPLE, KnownVehicle, Record, record_of, records_of

BACKLOG = 16 << 20
"""The size in bytes of what may wait for the parent. Samples and replies that exceed it are dropped and counted."""

LIMIT = 2 * BACKLOG
"""The size at which the process ends: somebody sends events without an end, and the parent does not read. It is started
again when the parent reads on."""

TOLD = 100
"""The number of different errors that the parent is told."""

_BEAT_S = 0.2
"""The time between two reports of the counters, in s."""


class Child:
    """The listener in the child process: a bounded queue of records for the parent."""

    def __init__(self) -> None:
        self._vehicles: dict[int, KnownVehicle] = {}
        self._queue: list[bytes] = []
        self._size = 0
        self._lock = threading.Lock()
        self._filled = threading.Event()
        self._dropped = 0
        self._lost: dict[int, int] = {}
        """Counts of lost samples that the parent was not told yet, by vehicle."""
        self._told: set[str] = set()
        self._reported: Statistics | None = None
        self._is_ended = False
        self.has_failed = False

    def connected(self, remote: Remote) -> None:
        """Pass on."""
        self._vehicles[remote.number] = KnownVehicle(remote, [], [], {})
        self.tell(connected=remote)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Pass on, and give the route an index."""
        vehicle = self._vehicles[remote.number]
        if isinstance(route, Service):
            vehicle.services.append(route)
            self.tell(remote=remote.number, service=route)
        else:
            vehicle.indexes[route.name] = len(vehicle.routes)
            vehicle.routes.append(route)
            self.tell(remote=remote.number, route=route)

    def disconnected(self, remote: Remote, reason: str) -> None:
        """Pass on."""
        self._tell_lost()
        self._vehicles.pop(remote.number, None)
        self.tell(remote=remote.number, disconnected=reason)

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Pass on, unless too much waits for the parent."""
        if self._is_full():
            return
        index = self._vehicles[remote.number].indexes[route.name]
        self._put(HEADER.pack(SAMPLE, remote.number, index, time, len(payload)) + payload)

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:
        """Pass on, unless too much waits for the parent."""
        if self._is_full():
            return
        index = self._vehicles[remote.number].services.index(service)
        self._put(record_of(CALL, payload, remote.number, index, number))

    def lost(self, remote: Remote, missing: int) -> None:
        """Pass on the sum with the next records: a sender can leave out any number of sequence numbers."""
        with self._lock:
            self._lost[remote.number] = self._lost.get(remote.number, 0) + missing

    def _tell_lost(self) -> None:
        with self._lock:
            lost, self._lost = self._lost, {}
        for number, count in lost.items():
            self.tell(remote=number, lost=count)

    def _is_full(self) -> bool:
        """Whether too much waits for the parent for another sample, which is then counted."""
        if self._size <= BACKLOG:
            return False
        self._dropped += 1
        return True

    def warned(self, text: str) -> None:
        """Pass on."""
        self.tell(warned=text)

    def failed(self, reason: str) -> None:
        """Pass on, and end the process. The parent starts another one."""
        self.warned(reason)
        self.has_failed = True
        self._end()

    def _end(self) -> None:
        self._is_ended = True
        self._filled.set()

    def tell(self, **event: object) -> None:
        """Send an event to the parent."""
        self._put(record_of(EVENT, json.dumps(event).encode()))

    def _put(self, record: bytes) -> None:
        with self._lock:
            self._queue.append(record)
            self._size += len(record)
        if self._size > LIMIT:
            os._exit(1)  # the main thread waits for the pipe
        self._filled.set()

    def obey(self, link: Link, records: Iterator[Record]) -> None:
        """Do what the parent asks for, until it closes its end of the pipe."""
        try:
            for record in records:
                self._obey(link, record)
        finally:
            self._end()

    def _obey(self, link: Link, record: Record) -> None:
        kind, number, index, when, body = record
        problem = ""
        try:
            vehicle = self._vehicles[number]
            if kind == SAMPLE:
                link.publish(vehicle.remote, vehicle.routes[index], body)
            elif kind == CALL:
                link.call(vehicle.remote, vehicle.services[index], when, body)
        except LookupError:  # the parent will be told
            problem = "the vehicle has just disconnected: wait until it is connected again"
        except LinkError as error:
            problem = str(error)
        if kind == CALL:
            self.tell(called=(number, when), error=problem)
        elif problem and number in self._vehicles and problem not in self._told and len(self._told) < TOLD:
            self._told.add(problem)
            self.warned(problem)

    def send(self, link: Link, output: IO[bytes]) -> None:
        """Write records until the parent has closed the other pipe, and the counters of the link now and then."""
        while not self._is_ended:
            self._filled.wait(_BEAT_S)
            self._filled.clear()
            self._report(link)
            self._tell_lost()
            self.flush(output)

    def _report(self, link: Link) -> None:
        """Tell the counters of the link, if they have changed."""
        counters = link.statistics()
        counters = counters._replace(dropped=counters.dropped + self._dropped)
        if counters != self._reported:
            self._reported = counters
            self.tell(statistics=counters)

    def finish(self, link: Link, output: IO[bytes]) -> None:
        """Write what the closed link has told last, and its last counters."""
        self._report(link)
        self.flush(output)

    def flush(self, output: IO[bytes]) -> None:
        """Write the records that wait."""
        with self._lock:
            queue, self._queue, self._size = self._queue, [], 0
        output.write(b"".join(queue))
        output.flush()


def main() -> None:
    """Run a link for the parent process, until it closes its end of the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches both, and the parent decides
    with os.fdopen(os.dup(1), "wb") as output, suppress(BrokenPipeError):
        os.dup2(2, 1)  # what somebody prints is no record
        records = records_of(sys.stdin.buffer)
        _serve(json.loads(next(records)[4]), records, output)


def _serve(setup: Mapping[str, Any], records: Iterator[Record], output: IO[bytes]) -> None:
    child = Child()
    known = [Route(*row) for row in setup["known"]]
    try:
        link = open_link(parse_address(setup["address"]), setup["allow"], known)
        child.tell(opened=True)
        link.start(child)
    except LinkError as error:
        output.write(record_of(EVENT, json.dumps({"failed": str(error)}).encode()))
        return
    thread = threading.Thread(target=child.obey, args=(link, records), name="msggen-parent", daemon=True)
    thread.start()
    try:
        child.send(link, output)
    finally:
        link.close()
    child.finish(link, output)
    if child.has_failed:
        sys.exit(1)
