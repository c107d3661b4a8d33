"""Tests of the recorder: nothing is lost uncounted, limits, files, and definitions that become known late."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from msggen.exports import recorder as module
from msggen.exports.recorder import Limits, Recorder, publish_time
from msggen.exports.writer import Channel
from msggen.link.link import Route
from support.recordings import START, Found, channel_of, check_read, read_mcap, read_ours, route_of

PAYLOAD = b"\0\1\0\0" + bytes(60)


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "flight.mcap")


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write chunks as often as possible."""
    monkeypatch.setattr(module, "FLUSH", 0.0)
    monkeypatch.setattr(module, "_PAUSE", 0.001)


@pytest.fixture
def describe(px4_types: Any) -> Callable[[Route], Channel]:
    return lambda route: channel_of(px4_types, route)


@pytest.fixture
def routes(px4_types: Any) -> list[Route]:
    return [route_of(px4_types, topic) for topic in ("vehicle_status", "sensor_combined", "wind")]


def give(recorder: Recorder, routes: list[Route], times: Iterator[int] | range) -> list[Found]:
    """Give samples to a recorder, and return them."""
    given = []
    for number, arrival in enumerate(times):
        payload = b"\0\1\0\0" + number.to_bytes(8, "little") + bytes(number % 50)
        given.append(Found(routes[number % len(routes)].name, arrival, payload))
        recorder.take(routes[number % len(routes)], payload, arrival)
    return given


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def wait_for_samples(recorder: Recorder, count: int) -> None:
    """Wait until all samples are in the files. A reader may meet the moment in which a chunk is written: ours stops."""
    wait_until(lambda: sum(len(read_ours(each)) for each in recorder.counts().files) == count)


def test_every_sample_is_in_the_file(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe)
    given = give(recorder, routes, range(START, START + 5000))
    recorder.close()
    recorder.close()
    check_read(path, given)
    counts = recorder.counts()
    assert sum(counts.samples.values()) == 5000
    assert (counts.dropped, counts.files, counts.unknown, recorder.error) == (0, (path,), frozenset(), None)
    assert counts.size == os.path.getsize(path)


def test_samples_are_in_the_file_before_its_end(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe)
    given = give(recorder, routes, range(START, START + 100))
    wait_for_samples(recorder, 100)
    check_read(path, given)
    recorder.close()


def test_topics_that_are_not_chosen_are_not_recorded(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe, takes=lambda route: route is not routes[1])
    given = give(recorder, routes, range(START, START + 90))
    recorder.close()
    check_read(path, [each for each in given if each.topic != routes[1].name])


def test_what_the_disk_is_too_slow_for_is_counted(
    path: str, describe: Any, routes: list[Route], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "QUEUE", 100 * (len(PAYLOAD) + module._OVERHEAD))
    is_ready = threading.Event()
    recorder = Recorder(path, describe, is_ready=is_ready.is_set)
    for number in range(150):
        recorder.take(routes[0], PAYLOAD, START + number)
    assert recorder.counts().dropped == 50
    is_ready.set()
    wait_until(lambda: bool(recorder.counts().samples) and recorder.counts().samples[routes[0].name] == 100)
    recorder.take(routes[0], PAYLOAD, START + 150)
    recorder.close()
    check_read(path, [Found(routes[0].name, START + number, PAYLOAD) for number in [*range(100), 150]])
    assert recorder.counts().dropped == 50


def test_samples_wait_until_the_definitions_are_known(path: str, px4_types: Any, routes: list[Route]) -> None:
    known = threading.Event()

    def describe(route: Route) -> Channel:
        channel = channel_of(px4_types, route)
        return channel if known.is_set() else channel._replace(definition="", type_hash="")

    recorder = Recorder(path, describe, is_ready=known.is_set)
    given = give(recorder, routes, range(START, START + 30))
    time.sleep(0.05)
    assert recorder.counts().samples == {}
    known.set()
    recorder.close()
    check_read(path, given)
    assert recorder.counts().unknown == frozenset()


def test_samples_without_a_definition_are_recorded_and_told(path: str, px4_types: Any, routes: list[Route]) -> None:
    def describe(route: Route) -> Channel:
        return Channel(route.name, route.ros_type, "", "") if route is routes[1] else channel_of(px4_types, route)

    recorder = Recorder(path, describe, is_ready=lambda: False)
    given = give(recorder, routes, range(START, START + 30))
    recorder.close()  # does not wait for definitions
    check_read(path, given)
    assert recorder.counts().unknown == {routes[1].name}


def test_a_definition_that_changes_begins_another_channel(path: str, describe: Any, routes: list[Route]) -> None:
    """As after an update of the firmware: samples keep the schema that they were sent with."""
    changed = threading.Event()

    def described(route: Route) -> Channel:
        channel: Channel = describe(route)
        return channel._replace(definition=f"{channel.definition}uint8 more\n") if changed.is_set() else channel

    recorder = Recorder(path, described)
    give(recorder, routes[:1], range(START, START + 10))
    wait_until(lambda: recorder.counts().samples == {routes[0].name: 10})
    changed.set()
    recorder.describe_again()
    give(recorder, routes[:1], range(START + 10, START + 25))
    recorder.close()
    with open(path, "rb") as file:
        schemas = [schema.data[-5:] for schema, _, _ in make_reader(file).iter_messages() if schema]
    assert [each == b"more\n" for each in schemas] == [False] * 10 + [True] * 15
    assert recorder.counts().samples == {routes[0].name: 25}


def test_files_are_split_by_time(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe, limits=Limits(split_seconds=2.0))
    given = give(recorder, routes, range(START, START + 10 * 10**9, 3 * 10**8))
    recorder.close()
    files = recorder.counts().files
    assert files == tuple(path.replace(".mcap", f"_{number}.mcap") for number in range(5))
    assert [found for each in files for found in read_mcap(each)] == given
    for each in files:
        found = read_mcap(each)
        assert found[-1].time - found[0].time < 2 * 10**9
        check_read(each, found)


def test_files_are_split_by_size(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe, compression="none", limits=Limits(split_size=20_000))
    given: list[Found] = []
    for start in range(10):
        given += give(recorder, routes, range(START + start * 1000, START + start * 1000 + 100))
        wait_for_samples(recorder, len(given))
    recorder.close()
    files = recorder.counts().files
    assert len(files) > 2
    assert [found for each in files for found in read_mcap(each)] == given
    assert all(os.path.getsize(each) > 20_000 for each in files[:-1])
    assert recorder.counts().size == sum(map(os.path.getsize, files))


def test_a_recording_ends_by_itself_at_a_size(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe, compression="none", limits=Limits(size=50_000))
    end = time.monotonic() + 30
    given: list[Found] = []
    while not recorder.ended.wait(0.002):
        given += give(recorder, routes, range(START + len(given), START + len(given) + 20))
        assert time.monotonic() < end
    recorder.take(routes[0], PAYLOAD, START)
    recorder.close()
    found = read_mcap(path)
    assert found == given[: len(found)]
    assert os.path.getsize(path) >= 50_000
    check_read(path, found)


def test_an_error_of_the_disk_ends_the_recording(
    path: str, describe: Any, routes: list[Route], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(path, describe)
    given = give(recorder, routes, range(START, START + 100))
    wait_for_samples(recorder, 100)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    give(recorder, routes, range(START + 100, START + 110))
    assert recorder.ended.wait(30)
    recorder.close()
    assert isinstance(recorder.error, OSError)
    monkeypatch.undo()
    found = read_mcap(path)
    check_read(path, [*given, *found[100:]])
    assert sum(recorder.counts().samples.values()) == len(found)


def test_a_file_that_exists_is_told_at_once(path: str, describe: Any) -> None:
    Path(path).touch()
    with pytest.raises(FileExistsError):
        Recorder(path, describe)


@given(st.integers(0, 2**64 - 1), st.integers(-(3600 * 10**6), 3600 * 10**6), st.binary(max_size=11))
def test_the_time_of_publication_is_the_timestamp_if_the_clocks_agree(
    stamp: int, difference: int, short: bytes
) -> None:
    arrival = START
    near = arrival // 1000 + difference
    assert publish_time(b"\0\1\0\0" + near.to_bytes(8, "little"), arrival) == near * 1000
    assert publish_time(b"\0\0\0\0" + near.to_bytes(8, "big"), arrival) == arrival
    if abs(stamp * 1000 - arrival) > 3600 * 10**9:
        assert publish_time(b"\0\1\0\0" + stamp.to_bytes(8, "little"), arrival) == arrival
    assert publish_time(short, arrival) == arrival


@pytest.mark.parametrize("number", [0, 1, 12])
def test_a_file_with_a_number_refuses_a_split_recording(path: str, describe: Any, number: int) -> None:
    other = path.replace(".mcap", f"_{number}.mcap")
    Path(other).write_bytes(b"other")
    Path(path).write_bytes(b"flight.mcap is no part")
    with pytest.raises(FileExistsError) as told:
        Recorder(path, describe, limits=Limits(split_seconds=1))
    assert told.value.filename == other
    assert sorted(os.listdir(os.path.dirname(path))) == sorted(map(os.path.basename, (path, other)))


def test_a_file_that_appears_in_flight_is_kept(path: str, describe: Any, routes: list[Route]) -> None:
    recorder = Recorder(path, describe, limits=Limits(split_seconds=1))
    other = Path(path.replace(".mcap", "_1.mcap"))
    other.write_bytes(b"other")
    given = give(recorder, routes, range(START, START + 3 * 10**9, 10**8))
    recorder.close()
    assert recorder.error is None
    names = [os.path.basename(each) for each in recorder.counts().files]
    assert names == ["flight_0.mcap", "flight_2.mcap", "flight_3.mcap"]
    assert [found for each in recorder.counts().files for found in read_mcap(each)] == given
    assert other.read_bytes() == b"other"
