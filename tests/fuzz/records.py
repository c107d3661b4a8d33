"""Damaged and hostile files of sessions and flights, which the next program reads.

Each is used or set aside, told once, and no value of it is beyond its range. The link and the flight start in any case.
"""

from __future__ import annotations

import importlib
import json
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from ipaddress import IPv4Address
from pathlib import Path
from random import Random
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple
from unittest.mock import patch

from fuzz.sessions import SETTINGS
from msggen.flight import resuming
from msggen.flight.registration import Ids
from msggen.flight.resuming import Memory, Remembered, _is_same_boot
from msggen.link import session_files
from msggen.link.link import Opened
from msggen.link.session_files import Records, pack
from msggen.link.xrce import wire
from msggen.link.xrce.agent import Agent
from msggen.link.xrce.record import Record
from msggen.vehicle.owned.records import event_of
from support.creations import creations
from support.fake_link import routes_of
from support.scratch import scratch_folder

COUNT = 300

LINK = "udp://127.0.0.1:8888"
ADDRESS = ("127.0.0.1", 40123)
VEHICLE, NAME = "udp 8888 0 1", "Square"
ODD: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 7, 70_000, 1 << 31, 1 << 32, 1 << 63, 1 << 64, -(1 << 70), 0.5, 1e300, float("inf")),
    *(float("-inf"), float("nan"), "", "a", "::1", "localhost", "127.0.0.1", "256.1.1.1", "\ud800", "\0", "x" * 70_000),
    *([], [[]], {}, {"a": 1}, ["127.0.0.1"], ["127.0.0.1", 70_000], ["::1", 8888, 0, 0], ["127.0.0.1", 1, 2], [1, 2]),
    *("/dev/null", ["/dev/null", 1], ["127.0.0.1", 0], ["127.0.0.1", "1"], ["localhost", 8888]),
)
"""What a value is replaced with."""
KINDS = ("value", "value", "value", "value", "missing", "bytes", "cut", "fifo", "folder", "link")


class Case(NamedTuple):
    """A file, and what has become of it."""

    is_flight: bool
    kind: str
    seed: int
    is_signed: bool
    """Whether the digest of a session is that of the changed content."""


def case(chance: Random) -> Case:
    return Case(chance.random() < 0.4, chance.choice(KINDS), chance.randrange(1 << 32), chance.random() < 0.9)


def check(case: Case) -> None:
    with scratch_folder() as made, patch.dict(os.environ, {"XDG_STATE_HOME": str(made)}):
        folder = str(made)
        (_check_flight if case.is_flight else _check_session)(case, folder)


def _check_session(case: Case, folder: str) -> None:
    px4_types = importlib.import_module("px4_types")
    told: list[str] = []
    routes = routes_of(px4_types)
    samples = {routes[0].name: (b"\0\1\0\0" + bytes(40), 5)}
    parts = tuple(creations("", routes))
    maps: tuple[Mapping[str, int], Mapping[str, tuple[bytes, int]]]
    maps = MappingProxyType({"px4_msgs/msg/A": 7}), MappingProxyType(samples)
    record = Record(ADDRESS, SETTINGS.key, 0x81, 508, 71, parts, *maps)
    Records(folder, LINK, told.append).write([(ADDRESS, record)])
    (path,) = Path(folder).iterdir()
    _damage(path, case, lambda content: _signed(content) if case.is_signed else content)
    records = Records(folder, LINK, told.append).load()
    agent = Agent(0.0)
    agent.resume(records)
    agent.tick(0.1)
    for each in records:
        assert pack(LINK, each, "")
        host, port = str(each.address[0]), int(each.address[1])
        assert str(IPv4Address(host)) == host
        assert 0 < port < 1 << 16
        agent.receive(
            wire.HEADER.pack(each.session_id, wire.NO_STREAM, 0) + wire.GetInfo(b"\0\1").pack(), each.address, 1
        )
    agent.tick(0.2)
    assert {address for _, address in agent.take_outgoing()} <= {each.address for each in records}
    for event in agent.take_events():
        if isinstance(event, Opened):
            assert event_of("opened", list(event.route)).decode().encode()
            agent.samples(event.remote.number)
    agent.take_records()
    assert len(told) == (0 if records or path.exists() or not _is_aside(path) else 1)
    again: list[str] = []
    Records(folder, LINK, again.append).load()
    assert not again


def _check_flight(case: Case, folder: str) -> None:
    status = SimpleNamespace(timestamp=5_000_000, armed_time=7, nav_state_timestamp=9)
    first = Memory(VEHICLE)
    first.claim(NAME)
    first.write(Ids(NAME, 2, 24, 1), status)
    first.release(NAME)
    (path,) = Path(folder, "msggen", "flights").glob("*.json")
    _damage(path, case, lambda content: content)
    with _warnings() as warnings:
        found = Memory(VEHICLE)
        ids = found.claim(NAME)
        found.release(NAME)
        found.claim(NAME)
        found.release(NAME)
    assert len(warnings) == (1 if _is_aside(path) else 0)
    if ids is not None:
        _check_remembered(ids, status)


def _check_remembered(found: Remembered, status: Any) -> None:
    assert isinstance(_is_same_boot(found, status), bool)
    assert 0 <= 1 << found.ids.check < 1 << 32
    assert found.ids.mode == -1 or 23 <= found.ids.mode <= 30
    assert -128 <= found.ids.executor < 128
    assert found.age >= 0.0
    assert 0 <= found.armed_time < 1 << 64
    assert 0 <= found.mode_time < 1 << 64


def _is_aside(path: Path) -> bool:
    return path.with_suffix(".damaged").exists() or path.with_suffix(".damaged").is_symlink()


def _damage(path: Path, case: Case, signed: Callable[[Any], Any]) -> None:
    chance = Random(case.seed)  # noqa: S311 - not used for security
    data = path.read_bytes()
    stamp = path.stat().st_mtime_ns
    if case.kind in {"fifo", "folder", "link"}:
        path.unlink()
        {"fifo": os.mkfifo, "folder": os.mkdir, "link": lambda at: os.symlink("/dev/zero", at)}[case.kind](path)
        return
    if case.kind == "cut":
        path.write_bytes(data[: chance.randrange(len(data))])
    elif case.kind == "bytes":
        changed = bytearray(data)
        for _ in range(chance.randrange(1, 4)):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        path.write_bytes(changed)
    else:
        content = json.loads(data)
        places = [*_places(content)]
        holder, key = chance.choice(places[1:] if len(places) > 1 else places)
        if case.kind == "missing":
            del holder[key]
        else:
            holder[key] = chance.choice(ODD)
        path.write_text(json.dumps(signed(content)))
    os.utime(path, ns=(stamp, stamp))


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield all places of values in JSON."""
    if isinstance(value, (dict, list)):
        for key in [*value] if isinstance(value, dict) else range(len(value)):
            yield value, key
            yield from _places(value[key])


def _signed(content: Any) -> Any:
    if isinstance(content, dict) and "record" in content:
        content["digest"] = session_files._digest(session_files._canonical(content["record"]))
    return content


class _warnings(logging.Handler):  # noqa: N801 - used as a function
    """The warnings of a block."""

    def __enter__(self) -> list[logging.LogRecord]:
        self.records: list[logging.LogRecord] = []
        self.was = resuming.LOGGER.propagate
        resuming.LOGGER.addHandler(self)
        resuming.LOGGER.propagate = False
        return self.records

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)

    def __exit__(self, *_: object) -> None:
        resuming.LOGGER.removeHandler(self)
        resuming.LOGGER.propagate = self.was
