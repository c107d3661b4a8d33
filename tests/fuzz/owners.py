"""Commands whose link a hostile or broken process owns: each record that it sends, and each answer, can be anything.

A command ends with 0, 1 or 2, without a trace, and within its time.
"""

from __future__ import annotations

import importlib
import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple
from unittest.mock import patch

from fuzz.records import ODD, _places
from msggen.base.version import __version__
from msggen.link.link import Client, Publisher, Remote, Statistics
from msggen.vehicle.owned.records import EVENT, LAST, SAMPLE, RecordReader, event_in, event_of, record_of
from support.commands import Outcome, check_outcome, run
from support.fake_link import SERVICE, routes_of
from support.repository import ROOT
from support.scratch import scratch_folder

COUNT = 40

_TYPES = ("--types", str(ROOT / "generated" / "px4_types"), "--wait", "1")
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("topic", "info", "vehicle_status", *_TYPES),
    ("topic", "list", "-v", "--window", "0.3", *_TYPES),
    ("topic", "echo", "vehicle_status", "--once", *_TYPES),
    ("topic", "hz", "vehicle_status", "--for", "0.3", *_TYPES),
    ("doctor", "--for", "0.3", "--wait", "1"),
    ("record", "--for", "0.3", "-o", "recording.mcap", *_TYPES),
    ("command", "arm", *_TYPES),
    ("view", "--for", "0.3", "--port", "0", *_TYPES),
    ("top", "--once", "--window", "0.3", *_TYPES),
    ("link", "list"),
    ("link", "list", "--json"),
)
TOLD = ("welcome", "connected", "opened", "identified", "warned", "sample", "last", "lost", "bytes")
ANSWERS = ("statistics", "state", "clients", "refusals", "publishers", "settled", "warnings")
EVENTS = ("refused", "leaving", "failed", "unsent", "disconnected", "answer", "identified", "nothing", "")


class Case(NamedTuple):
    """A command, and what is wrong of which record."""

    command: tuple[str, ...]
    wrong: str
    seed: int


def case(chance: Random) -> Case:
    wrong = chance.choice(chance.choice((TOLD, ANSWERS, EVENTS)))
    return Case(chance.choice(COMMANDS), wrong, chance.randrange(1 << 32))


def check(case: Case) -> None:
    begin = time.monotonic()
    check_outcome(outcome_of(case))
    assert time.monotonic() - begin < 25.0


def outcome_of(case: Case) -> Outcome:
    with scratch_folder() as folder, _moved(folder), _owner(folder / "udp-8888.socket", Told(case)):
        link = () if case.command[0] == "link" else ("--link", f"unix://{folder}/udp-8888.socket")
        return run([*case.command, *link])


@contextmanager
def _moved(folder: Path) -> Iterator[None]:
    before = os.getcwd()
    os.chmod(folder, 0o700)
    os.chdir(folder)
    try:
        with patch.dict(os.environ, {"MSGGEN_RUNTIME": str(folder), "MSGGEN_DIRECT": ""}):
            yield
    finally:
        os.chdir(before)


@contextmanager
def _owner(path: Path, told: Told) -> Iterator[None]:
    is_over = threading.Event()
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen(64)
        listening.settimeout(0.1)

        def serve() -> None:
            while not is_over.is_set():
                with suppress(OSError):
                    own, _ = listening.accept()
                    threading.Thread(target=_serve, args=(own, told, is_over), daemon=True).start()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            is_over.set()
            thread.join()


def _serve(own: socket.socket, told: Told, is_over: threading.Event) -> None:
    reader, has_begun, next_at = RecordReader(), False, 0.0
    own.settimeout(0.02)
    with own, suppress(OSError, ValueError):
        while not is_over.is_set():
            try:
                chunk = own.recv(1 << 16)
                if not chunk:
                    return
                for kind, number, index, _, body in reader.add(chunk):
                    if kind == LAST:
                        own.sendall(told.sample("last", LAST, number, index))
                    elif kind == EVENT:
                        name, values = event_in(body)
                        if name == "hello":
                            has_begun = True
                            own.sendall(b"".join(told.beginning()))
                        elif name == "ask":
                            own.sendall(told.answer(*values))
            except TimeoutError:
                pass
            if has_begun and time.monotonic() >= next_at:
                next_at = time.monotonic() + 0.05
                own.sendall(told.sample("sample", SAMPLE, 1, 0))


class Told:
    """What an owner tells, of which one thing is wrong."""

    def __init__(self, case: Case) -> None:
        package = importlib.import_module("px4_types")
        self._wrong, self._chance = case.wrong, Random(case.seed)  # noqa: S311 - not used for security
        self._routes = routes_of(package)
        status = next(each for each in self._routes if "out/vehicle_status" in each.name)
        self._routes = (status, *[each for each in self._routes if each != status])
        self._payload = package.VehicleStatus(timestamp=1_000_000).encode()
        self._hash = package.VehicleStatus.__msg__.message_hash

    def beginning(self) -> Iterator[bytes]:
        yield self._event("welcome", "udp://127.0.0.1:8888", os.getpid())
        yield self._event("connected", [*Remote(1, "127.0.0.1:40000", 1, "", continued=False)])
        for each in (*self._routes, SERVICE):
            yield self._event("opened", 1, type(each).__name__, [*each], is_rare=True)
        yield self._event("identified", 1, {"px4_msgs/msg/VehicleStatus": self._hash}, True)  # noqa: FBT003 - as an owner
        yield self._event("warned", "something")
        yield self._event("lost", 1, 3)
        if self._wrong in EVENTS:
            values = [self._chance.choice(ODD) for _ in range(self._chance.randrange(4))]
            yield event_of(self._wrong, *values)
        if self._wrong == "bytes":
            yield self._chance.randbytes(100)

    def answer(self, number: int, what: str) -> bytes:
        vehicle = {"number": 1, "address": "a", "key": 1, "namespace": "", "continued": False}
        answers: dict[str, Any] = {
            "statistics": [*Statistics(0, 1, 2, 3, 4, 5, 6, 7)],
            "state": {
                "address": "udp://127.0.0.1:8888",
                "version": __version__,
                "pid": 1,
                "age": 1.5,
                "rate": 2.5,
                "vehicles": [{**vehicle, "release": "v1.18", "lost": 0, "samples": 3}],
                "programs": [{"name": "a", "pid": 2, "age": 1.0, "unread": 0, "unsent": 0}],
            },
            "clients": [[*Client("127.0.0.1:40000", 1, 1, 2.0, 0.1, 3)]],
            "refusals": {"a": 1},
            "publishers": {"1": [[*Publisher(self._routes[0].name, "a", 2, 3, 4)]]},
            "settled": True,
            "warnings": ["a"],
        }
        return event_of("answer", number, self._changed(what, [answers[what]])[0])

    def sample(self, name: str, kind: int, number: int, index: int) -> bytes:
        payload, when = self._payload, time.time_ns()
        if name == self._wrong:
            payload = self._chance.choice((b"", payload[:9], self._chance.randbytes(90), payload))
            when = self._chance.choice((-1, -(1 << 63), (1 << 63) - 1, 0, when))
            index = self._chance.choice((index, 1, 60, 65535))
        return record_of(kind, payload, number, index, when)

    def _event(self, name: str, *values: object, is_rare: bool = False) -> bytes:
        if is_rare and self._chance.random() > 0.05:
            return event_of(name, *values)
        return event_of(name, *self._changed(name, [*values]))

    def _changed(self, name: str, values: list[Any]) -> list[Any]:
        if name != self._wrong:
            return values
        content = json.loads(json.dumps(values))
        holder, key = self._chance.choice([*_places(content)])
        if self._chance.random() < 0.2 and holder is not content:
            del holder[key]
        else:
            holder[key] = self._chance.choice(ODD)
        return content if isinstance(content, list) else values
