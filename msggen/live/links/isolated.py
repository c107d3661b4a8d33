"""A link in a process of its own, for programs that hold Python's interpreter lock for long.

PX4's client waits for answers of its agent, and a program that computes for seconds does not answer. The child process
runs the link, and passes all on through two pipes. It ends when its parent does. If it is killed, it is started again.
"""

from __future__ import annotations

import json
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from msggen.base.interpreter import command_of
from msggen.live.link import LinkError, Listener, Remote, Route, Service, Statistics
from msggen.live.links.address import Address
from msggen.live.links.guard import guarded
from msggen.live.links.pipe import CALL, EVENT, SAMPLE, KnownVehicle, Record, record_of, records_of

_START_S = 60.0
_END_S = 5.0
_LOOK_S = 0.05
_ANSWER_S = 1.0
"""The longest wait in s for the process to tell whether it could send a request."""
_ATTEMPTS = 5
"""How often in a row a process is started again that has lived for less than `_STABLE_S`."""
_STABLE_S = 10.0
_CURE = ": its errors are above; without isolated=True, this process runs the link"

NOTHING = Statistics(0, 0, 0, 0, 0, 0)


class IsolatedLink:
    """The Link of an address, run by a process of its own."""

    def __init__(self, address: Address, allow: Sequence[str | int] = (), known: Sequence[Route] = ()) -> None:
        self._setup = json.dumps({"address": str(address), "allow": list(allow), "known": list(known)}).encode()
        self._address = address
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        """Held while a record is written, so that records are whole."""
        self._vehicles: dict[int, KnownVehicle] = {}
        self._offset = self._last = 0
        """The number of the last vehicle of the child processes before this one."""
        self._answers: dict[tuple[int, int], SimpleQueue[str]] = {}
        """Why requests could not be sent, or "", by the numbers of the vehicle and of the call."""
        self._is_closing = False
        self._statistics = self._earlier = NOTHING

    def start(self, listener: Listener) -> None:
        """Start the process and its link. Raises LinkError."""
        first = self._launch()
        self._thread = threading.Thread(
            target=self._run, args=(guarded(listener), first), name="msggen-isolated", daemon=True
        )
        self._thread.start()

    def publish(self, remote: Remote, route: Route, payload: bytes) -> None:
        """Send a sample. From any thread. Raises LinkError."""
        number, vehicle = self._find(remote)
        self._write(record_of(SAMPLE, payload, number, vehicle.indexes[route.name]))

    def call(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:
        """Send a request. From any thread. Raises LinkError."""
        own, vehicle = self._find(remote)
        answers = self._answers[remote.number, number] = SimpleQueue()
        try:
            self._write(record_of(CALL, payload, own, vehicle.services.index(service), number))
            if threading.current_thread() is self._thread:  # which would take the answer
                return
            error = answers.get(timeout=_ANSWER_S)
        except Empty:  # the reply tells
            error = ""
        finally:
            del self._answers[remote.number, number]
        if error:
            raise LinkError(error)

    def routes(self, remote: Remote) -> Sequence[Route | Service]:
        """Return the routes and services of a connected vehicle, or none if it is not connected."""
        found = self._vehicles.get(remote.number)
        return (*found.routes, *found.services) if found else ()

    def statistics(self) -> Statistics:
        """Return the counters, of all processes. They are up to 0.2 s old."""
        *counts, buffer = self._statistics
        return Statistics._make([*map(sum, zip(counts, self._earlier[:-1], strict=True)), buffer])

    def close(self) -> None:
        """End the process, after the sessions of the vehicles. Can be repeated."""
        self._is_closing = True
        thread, deadline = self._thread, time.monotonic() + _END_S
        while thread is not None and thread.is_alive():
            process = self._process  # another one, if it has just been started again
            assert process is not None  # noqa: S101 - `start` has set it
            _end_input(process, self._lock)
            if thread is threading.current_thread():
                return
            if time.monotonic() > deadline:
                process.kill()
            thread.join(_LOOK_S)

    # the child process

    def _launch(self) -> Iterator[Record]:
        """Start a process, and return its records after the first one, which tells that its link is open."""
        command = command_of("msggen.live.links.isolated_child")
        if not command[0]:
            raise LinkError("the program of Python is not known: use the link without isolated=True")
        try:
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603
        except OSError as error:
            raise LinkError(f"the process of the link cannot be started: {error}") from error
        self._process = process
        assert process.stdout is not None  # noqa: S101 - it is a pipe
        timer = threading.Timer(_START_S, process.kill)
        timer.daemon = True
        timer.start()
        try:
            self._write(record_of(EVENT, self._setup))
            records = records_of(process.stdout)
            first = next(records, None)
        except LinkError:
            first = None
        finally:
            timer.cancel()
        answer = json.loads(first[4]) if first else {"failed": f"the process of the link ended at its start{_CURE}"}
        if "failed" in answer:
            _end(process)
            raise LinkError(answer["failed"])
        return records

    def _run(self, listener: Listener, records: Iterator[Record]) -> None:
        try:
            failure = self._serve(listener, records)
        except Exception as error:  # noqa: BLE001 - told to the user, who would wait forever
            failure = f"the link failed: {type(error).__name__}: {error}"
            process = self._process
            assert process is not None  # noqa: S101 - `start` has set it
            process.kill()
            _end(process)
            self._forget(listener, failure)
        if failure:
            listener.failed(failure)

    def _serve(self, listener: Listener, records: Iterator[Record]) -> str:
        """Deliver records until the link is closed. Return why it cannot go on, or "" if the user has closed it."""
        attempts = 0
        while True:
            started = time.monotonic()
            for kind, number, index, when, body in records:
                self._deliver(listener, kind, self._offset + number, index, when, body)
            process = self._process
            assert process is not None  # noqa: S101 - `start` has set it
            _end(process)
            reason = (
                "the link was closed" if self._is_closing else f"the process of the link ended ({_status(process)})"
            )
            self._forget(listener, reason)
            if self._is_closing:
                return ""
            attempts = 0 if time.monotonic() - started > _STABLE_S else attempts + 1
            restarted = self._restarted(listener, reason, attempts)
            if isinstance(restarted, str):
                return restarted
            records = restarted

    def _restarted(self, listener: Listener, reason: str, attempts: int) -> Iterator[Record] | str:
        """Start the process again. Return its records, or as `_serve`."""
        problem = reason
        for attempt in range(attempts, _ATTEMPTS):
            listener.warned(f"{problem}, and is started again")
            time.sleep(0.05 * 2**attempt)
            if self._is_closing:
                return ""
            try:
                return self._launch()
            except LinkError as error:
                problem = str(error)
        return f"{problem}: the link to {self._address} stays closed"

    def _deliver(self, listener: Listener, kind: int, number: int, index: int, when: int, body: bytes) -> None:  # noqa: PLR0913, PLR0917
        """Tell the listener of a record."""
        if kind == EVENT:
            self._deliver_event(listener, json.loads(body))
            return
        vehicle = self._vehicles.get(number)
        if vehicle is None:
            return
        if kind == SAMPLE:
            listener.sample(vehicle.remote, vehicle.routes[index], body, when)
        else:
            listener.replied(vehicle.remote, vehicle.services[index], when, body)

    def _deliver_event(self, listener: Listener, event: Mapping[str, Any]) -> None:
        if "statistics" in event:
            self._statistics = Statistics(*event["statistics"])
        elif "warned" in event:
            listener.warned(event["warned"])
        elif "called" in event:
            vehicle, call = event["called"]
            answers = self._answers.get((self._offset + vehicle, call))
            if answers is not None:
                answers.put(event["error"])
        elif "connected" in event:
            number, *others = event["connected"]
            self._last = self._offset + number
            remote = Remote(self._last, *others)
            self._vehicles[remote.number] = KnownVehicle(remote, [], [], {})
            listener.connected(remote)
        else:
            number = self._offset + event["remote"]
            if number not in self._vehicles:
                return  # samples of a vehicle that has disconnected were lost
            remote, routes, services, indexes = self._vehicles[number]
            if "route" in event:
                route = Route(*event["route"])
                indexes[route.name] = len(routes)
                routes.append(route)
                listener.opened(remote, route)
            elif "service" in event:
                services.append(Service(*event["service"]))
                listener.opened(remote, services[-1])
            elif "lost" in event:
                listener.lost(remote, event["lost"])
            else:
                del self._vehicles[number]
                listener.disconnected(remote, event["disconnected"])

    def _forget(self, listener: Listener, reason: str) -> None:
        """Tell the listener that all vehicles are gone with the process."""
        for number, vehicle in tuple(self._vehicles.items()):
            del self._vehicles[number]
            listener.disconnected(vehicle.remote, reason)
        for answers in tuple(self._answers.values()):
            answers.put(f"{reason}: wait until the vehicle is connected again")
        self._offset = self._last
        self._earlier, self._statistics = self.statistics(), NOTHING

    def _find(self, remote: Remote) -> tuple[int, KnownVehicle]:
        found = self._vehicles.get(remote.number)
        if found is None:
            raise LinkError(f"the vehicle at {remote.address} is no longer connected: wait until it is connected again")
        return remote.number - self._offset, found

    def _write(self, record: bytes) -> None:
        process = self._process
        if process is None or process.stdin is None:
            raise LinkError("the link is not started")
        try:
            with self._lock:
                process.stdin.write(record)
                process.stdin.flush()
        except (OSError, ValueError):
            raise LinkError("the process of the link has ended: wait until the vehicle is connected again") from None


def _end_input(process: subprocess.Popen[bytes], lock: threading.Lock) -> None:
    """Close the input of the process, which then closes its link and ends."""
    if process.stdin is not None and lock.acquire(timeout=_END_S):  # a writer may wait for a stopped process
        try:
            with suppress(OSError):
                process.stdin.close()
        finally:
            lock.release()


def _end(process: subprocess.Popen[bytes]) -> None:
    """Wait for the end of the process, or kill it, and close its pipes."""
    try:
        process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


def _status(process: subprocess.Popen[bytes]) -> str:
    code = process.returncode
    return f"killed by signal {-code}" if code < 0 else f"exit code {code}"
