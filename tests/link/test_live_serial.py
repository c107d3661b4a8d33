"""Tests of the link over a serial line, with pseudo terminals: captures, damage, slow lines, devices that go."""

from __future__ import annotations

import builtins
import contextlib
import os
import random
import select
import struct
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from msggen.link import age, serial
from msggen.link.age import LONGEST_S, NEVER
from msggen.link.link import LinkError, Route, StaleError
from msggen.link.serial import LineQueue, SerialLink
from msggen.link.xrce.framing import CLIENT, Deframer, pack_frame
from support.link_records import PATIENCE, Records, nothing_is_left
from support.replay import DATA, INFO, STATUS_AGENT, creation, kind, sample, sent
from support.xrce_captures import expected

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs pseudo terminals")


TOPICS = 66
"""Those of the client of `session-udp`."""


class Vehicle:
    """The other end of a pseudo terminal, at a path that stays the same."""

    def __init__(self, folder: Path) -> None:
        self.path = str(folder / "ttyTest")
        self._fd = -1
        self.plug()

    def plug(self) -> None:
        self._fd, slave = os.openpty()
        os.set_blocking(self._fd, False)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.path)
        os.symlink(os.ttyname(slave), self.path)
        self._slave = slave  # kept: without an open slave, writing to the master fails

    def unplug(self) -> None:
        if self._fd >= 0:
            os.close(self._slave)
            os.close(self._fd)
            self._fd = -1

    def write(self, data: bytes) -> None:
        while data:
            select.select([], [self._fd], [], 20)
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(self._fd, data) :]

    def send(self, messages: Sequence[bytes]) -> None:
        for message in messages:
            self.write(pack_frame(message, source=1, destination=0))

    def discard(self) -> None:
        """Read what has arrived, which may end within a frame."""
        with contextlib.suppress(BlockingIOError):
            os.read(self._fd, 65536)

    def received(self, has_all: Callable[[list[bytes]], object], broken: int = 0) -> list[bytes]:
        """Return the messages that have arrived when all have. At most `broken` frames are damaged."""
        deframer, found = Deframer(CLIENT), list[bytes]()
        end = time.monotonic() + PATIENCE
        while True:
            is_end = has_all(found)
            if select.select([self._fd], [], [], 0.0 if is_end else 0.01)[0]:
                found += deframer.feed(os.read(self._fd, 65536))
            elif is_end:
                assert deframer.broken <= broken
                return found
            assert time.monotonic() < end


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    made = Vehicle(tmp_path)
    yield made
    made.unplug()


@contextlib.contextmanager
def reading(vehicle: Vehicle) -> Iterator[None]:
    """Read what the link sends, so that it does not wait, and throw it away."""
    ended = threading.Event()

    def read() -> None:
        while not ended.is_set():
            vehicle.discard()
            time.sleep(0.01)

    thread = threading.Thread(target=read)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextlib.contextmanager
def linked(
    vehicle: Vehicle, baud: int = 921600, records: Records | None = None
) -> Iterator[tuple[SerialLink, Records]]:
    link, records = SerialLink(vehicle.path, baud), records or Records()
    link.start(records)
    try:
        yield link, records
    finally:
        link.close()


def connect(vehicle: Vehicle, link: SerialLink, records: Records) -> list[bytes]:
    """Connect a client with all endpoints, and return the answers."""
    count, before = len(records.remotes), link.statistics().received
    messages = creation("session-udp")
    for message in messages:
        vehicle.send([message])

    def is_connected(_: object) -> bool:
        has_topics = len(records.remotes) > count and len(link.routes(records.remotes[-1])) >= TOPICS
        return has_topics and link.statistics().received - before == len(messages) and not link._queue.size

    return vehicle.received(is_connected)


def numbers(answers: Sequence[bytes]) -> list[int]:
    """Return the number at the beginning of each sample."""
    return [struct.unpack_from("<Q", data, 12)[0] for data in answers if kind(data) == DATA]


def test_a_captured_session_gives_its_samples(vehicle: Vehicle) -> None:
    with nothing_is_left(), linked(vehicle) as (link, records), reading(vehicle):
        for chunk in sent("session-serial"):
            vehicle.write(chunk)
        records.wait(lambda: records.gone)
        (remote,) = records.remotes
        assert (remote.address, remote.key) == (vehicle.path, 1)
        counts = expected()["other_files"]["session-serial"]["from_client"]
        assert Counter("rt" + found.route.name for found in records.samples) == counts
        assert records.warnings == []
        assert (link.statistics().dropped, link.statistics().lost) == (0, 0)
        assert link.statistics().received == 559


def test_answers_and_samples_are_frames(vehicle: Vehicle) -> None:
    with linked(vehicle) as (link, records):
        answers = connect(vehicle, link, records)
        assert {kind(answer) for answer in answers} >= {INFO, STATUS_AGENT}
        route = records.route("/fmu/in/trajectory_setpoint")
        assert isinstance(route, Route)
        for number in range(20):
            link.publish(records.remotes[0], route, b"\0\1\0\0" + struct.pack("<Q", number) + b"\x7e\x7d" * 8)
        found = vehicle.received(lambda found: len(numbers(found)) >= 20)
        assert numbers(found) == list(range(20))


def test_damaged_frames_are_counted_and_the_rest_arrives(vehicle: Vehicle) -> None:
    chance = random.Random(3)  # noqa: S311
    with linked(vehicle) as (link, records):
        connect(vehicle, link, records)
        total = 500
        for number in range(total):
            frame = bytearray(pack_frame(sample(number, bytes(64)), source=1, destination=0))
            if chance.random() < 0.2 and number < total - 1:
                frame[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
            vehicle.write(bytes(frame))
        records.wait(lambda: len(records.samples) + sum(count for _, count in records.losses) >= total)
        assert len(records.samples) >= total * 0.6
        assert all(found.payload[4:] == bytes(64) for found in records.samples)
        statistics = link.statistics()
        assert statistics.dropped > 0
        assert statistics.lost == sum(count for _, count in records.losses)


def test_a_line_that_nobody_reads_does_not_grow_or_block(vehicle: Vehicle) -> None:
    with linked(vehicle, 57600) as (link, records):
        connect(vehicle, link, records)
        route = records.route("/fmu/in/trajectory_setpoint")
        assert isinstance(route, Route)
        told: list[str] = []
        for _ in range(2000):
            try:
                link.publish(records.remotes[0], route, b"\0\1\0\0" + bytes(100))
            except StaleError as error:
                told.append(str(error))
        assert len(told) > 1000
        assert {*told} == {f"{link.name()} is too slow for what is sent: a message of {route.name} was dropped"}
        records.wait(lambda: records.warnings)
        assert "too slow" in records.warnings[0]
        assert link._queue.size <= serial.LEAST_KEPT
        assert link.statistics().unsent > 0
        vehicle.received(lambda _: not link._queue.size, broken=1)  # the one that expired half-written
        link.publish(records.remotes[0], route, b"\0\1\0\0" + b"\5" * 40)
        vehicle.received(lambda found: any(data.endswith(b"\5" * 40) for data in found))
        assert len(records.warnings) == 1


def test_what_waited_for_a_line_is_not_written_later(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    with linked(vehicle) as (link, records):
        connect(vehicle, link, records)
        route = records.route("/fmu/in/trajectory_setpoint")
        assert isinstance(route, Route)
        before = link.unsent
        monkeypatch.setattr(os, "write", _refuse)
        for number in range(10):
            link.publish(records.remotes[0], route, b"\0\1\0\0" + struct.pack("<Q", number))
        assert link.unsent == before
        time.sleep(LONGEST_S + 0.1)
        monkeypatch.undo()
        link.publish(records.remotes[0], route, b"\0\1\0\0" + struct.pack("<Q", 99))
        assert numbers(vehicle.received(numbers)) == [99]
        assert link.unsent >= before + 10  # answers that the agent repeats have waited, too


def test_a_program_that_stood_still_is_not_taken_for_a_slow_line(vehicle: Vehicle) -> None:
    with linked(vehicle) as (link, records):
        connect(vehicle, link, records)
        route = records.route("/fmu/in/trajectory_setpoint")
        assert isinstance(route, Route)
        with pytest.raises(StaleError):
            link.publish(records.remotes[0], route, b"\0\1\0\0" + bytes(8), until=1)
        link.look(time.monotonic(), records)
        assert (link.statistics().unsent, records.warnings) == (1, [])


def test_a_request_that_is_sent_again_waits_no_longer_for_the_line(
    vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    with linked(vehicle) as (link, records):
        connect(vehicle, link, records)
        with reading(vehicle):
            while link._queue.size:
                time.sleep(0.01)
        with link.lock:
            soon = age.now() + 50_000_000
            monkeypatch.setattr(os, "write", _refuse)
            link.agent.outbox.send(bytes(20), vehicle.path, soon)
            link.settle()
            assert [frame.until for frame in link._queue._frames] == [soon]
            time.sleep(0.1)
            monkeypatch.undo()
            link._write()
        assert link.statistics().unsent == 1


def _refuse(*_: object) -> int:
    """Take nothing, as a device whose buffer is full."""
    raise BlockingIOError


def test_a_frame_that_expires_half_written_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system forgets what it has not sent, too: as a line that stands still."""
    time_now, buffer, forgotten = 0, bytearray(), list[int]()
    room = 30

    def write(_: int, data: bytes) -> int:
        count = min(len(data), room - len(buffer))
        buffer.extend(data[:count])
        return count or _refuse()

    monkeypatch.setattr(os, "write", write)
    monkeypatch.setattr(serial, "now_ns", lambda: time_now)
    monkeypatch.setattr(serial, "waiting_in", lambda _: len(buffer))
    monkeypatch.setattr(serial, "discard", forgotten.append)
    queue = LineQueue()
    for data in (b"a" * 20, b"b" * 20, b"c" * 20):
        queue.add(data, 1000)
    queue.add(b"d" * 20, NEVER)
    assert queue.write(7) == 0
    assert (bytes(buffer), queue.size) == (b"a" * 20 + b"b" * 10, 50)
    time_now = 1001
    buffer.clear()
    buffer.extend(b"b" * 5)
    assert queue.write(7) == 2, "b is half written, c has not begun"
    assert (bytes(buffer), queue.size, forgotten) == (b"b" * 5 + b"d" * 20, 0, [])
    queue.add(b"e" * 5, 2000)
    assert queue.write(7) == 0
    time_now = 2001
    assert queue.write(7) == 1
    assert forgotten == [7]


def test_bytes_without_frames_name_the_speed(vehicle: Vehicle) -> None:
    chance = random.Random(5)  # noqa: S311
    with linked(vehicle, 57600) as (_, records):
        for _ in range(10):
            vehicle.write(chance.randbytes(1000))
            time.sleep(0.01)
        records.wait(lambda: records.warnings)
        time.sleep(0.1)
        (warning,) = records.warnings
        assert vehicle.path in warning
        assert "57600 baud" in warning
        assert "SER_TEL2_BAUD" in warning
        assert records.remotes == []


def test_a_device_may_be_unplugged_and_plugged_in_again(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "RETRY", 0.1)
    with linked(vehicle) as (link, records):
        for number in (1, 2, 3):
            connect(vehicle, link, records)
            route = records.route("/fmu/in/trajectory_setpoint")
            assert isinstance(route, Route)
            vehicle.unplug()
            records.wait(lambda number=number: len(records.gone) == number)  # type: ignore[misc]
            with pytest.raises(LinkError):
                link.publish(records.remotes[-1], route, b"\0\1\0\0" + bytes(8))
            vehicle.plug()
            records.wait(lambda: link._fd >= 0)
        assert [reason for _, reason in records.gone] == [f"{vehicle.path} was unplugged"] * 3
        assert all("continues when it is there again" in text for text in records.warnings)


def test_closing_while_traffic_flows_leaves_nothing(vehicle: Vehicle) -> None:
    with nothing_is_left(), reading(vehicle):
        for _ in range(5):
            with linked(vehicle) as (link, records):
                vehicle.send(creation("session-udp"))
                records.wait(lambda: records.remotes)
                vehicle.send([sample(number, bytes(64)) for number in range(200)])
                link.close()
            assert records.gone
            with linked(vehicle) as (link, records):
                pass


# --- Errors


def test_a_device_that_is_in_use_is_an_error(vehicle: Vehicle) -> None:
    with linked(vehicle), nothing_is_left(), pytest.raises(LinkError, match=r"in use by another program.*fuser -v"):
        SerialLink(vehicle.path, 57600).start(Records())
    with linked(vehicle):
        pass


def test_a_missing_device_is_an_error(tmp_path: Path) -> None:
    with nothing_is_left(), pytest.raises(LinkError, match=r"there is no device .*/dev/serial/by-id"):
        SerialLink(str(tmp_path / "ttyUSB0"), 57600).start(Records())


def test_a_file_is_no_device(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with nothing_is_left(), pytest.raises(LinkError, match="is not a serial device"):
        SerialLink(str(tmp_path / "file"), 57600).start(Records())


def test_no_permission_names_the_group(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(LinkError, match="dialout"):
        SerialLink(vehicle.path, 57600).start(Records())


def test_a_speed_of_its_own_needs_pyserial(vehicle: Vehicle) -> None:
    pytest.importorskip("serial")
    with nothing_is_left(), linked(vehicle, 250000) as (link, records):
        connect(vehicle, link, records)
        vehicle.send([sample(0, b"\7" * 20)])
        records.wait(lambda: records.samples)


def test_without_pyserial_the_error_names_the_extra(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *args: Any) -> Any:
        if name == "serial":
            raise ImportError(name)
        return real(name, *args)

    monkeypatch.setattr(builtins, "__import__", missing)
    with nothing_is_left(), pytest.raises(LinkError, match=r"pip install -e '.*\[serial\]'\. .*57600, 115200"):
        SerialLink(vehicle.path, 250000).start(Records())


def test_an_impossible_speed_is_an_error(vehicle: Vehicle) -> None:
    pytest.importorskip("serial")
    with nothing_is_left(), pytest.raises(LinkError, match="cannot do -5 baud"):
        SerialLink(vehicle.path, -5).start(Records())
