"""Tests of recordings in stores and on servers: they are read as files of this computer are, and little is fetched."""

from __future__ import annotations

import gc
import os
import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from msggen import recordings
from msggen.exports.convert import convert
from msggen.recordings.files import stored
from msggen.recordings.files.mcap import chunks as mcap_chunks
from msggen.recordings.files.mcap import reader as mcap
from msggen.recordings.files.mcap import summary as mcap_summary
from msggen.recordings.log.log import Log
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores.errors import StoreError
from msggen.recordings.stores.store import Store
from support.databases import Stored, write_database
from support.examples import examples
from support.log_files import Written, write_log
from support.object_server import FAULTS, ObjectServer, hasten, object_server, set_credentials
from support.random_mcap import WAYS, recording
from support.recordings import START
from support.scratch import scratch_folder
from support.ulog import write_ulog


@pytest.fixture(scope="module")
def own_server() -> Iterator[ObjectServer]:
    with object_server() as has:
        yield has


@pytest.fixture
def server(own_server: ObjectServer, monkeypatch: pytest.MonkeyPatch) -> ObjectServer:
    hasten(monkeypatch)
    set_credentials(monkeypatch, own_server.url)
    own_server.__dict__.update(ObjectServer().__dict__, url=own_server.url)
    return own_server


@pytest.fixture(autouse=True)
def garbage(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the bytes that were not fetched be random, so that one that is read is noticed, and blocks be small."""
    whole = stored.Copy.__init__

    def begin(self: stored.Copy, store: Any, each: Any, folder: Any, path: str) -> None:
        whole(self, store, each, folder, path)
        Path(path).write_bytes(Random(1).randbytes(each.size))  # noqa: S311 - no secret

    monkeypatch.setattr(stored.Copy, "__init__", begin)
    for module, name, value in (
        (stored, "_BLOCK", 64),
        (stored, "_FRONT", 256),
        (mcap_summary, "_TAIL", 64),
        (mcap_chunks, "_LARGEST_STEP", 4000),
        (mcap, "_GROUP", 3000),
    ):
        monkeypatch.setattr(module, name, value)


def contents(log: Log) -> dict[str, Any]:
    """Return all that a recording has."""
    found: dict[str, Any] = {"span": (log.start, log.end), "facts": log.facts, "notes": log.notes}
    found["missing"] = log.missing_checksums
    for topic in log.topics:
        own: list[object] = [topic.ros_type, topic.definition, topic.count, topic.times.tolist()]
        try:
            samples = log.samples(topic)
            own += [repr(samples.array.tolist()), samples.log_times.tobytes()]
            middle = (log.end - log.start) / 2e9
            own.append(log.samples(topic, start=middle, stop=middle + 1e-5).log_times.tobytes())
        except RecordingError as error:
            own.append(str(error))
        found[topic.label] = own
    found["undecoded"] = [
        (topic.name, bytes(part.buffer[start : start + size]))
        for topic, part in log.undecoded()
        for start, size in zip(part.starts.tolist(), part.sizes.tolist(), strict=True)
    ]
    found["attached"] = [(each.name, bytes(each.content)) for each in log.attached()]
    found["verified"] = log.verify()
    found["problems"] = log.problems
    return found


def read(path: str) -> tuple[dict[str, Any], str]:
    """Return what a recording has, and the error if it cannot be read."""
    try:
        with recordings.open(path) as log:
            return {key: repr(value) for key, value in contents(log).items()}, ""
    except RecordingError as error:
        return {}, str(error).replace(path, "PATH")


def both(server: ObjectServer, data: bytes, name: str = "flight.mcap") -> tuple[Any, Any]:
    """Return what is read of a file on this computer, and of the same one in a store."""
    server.files[f"/bucket/{name}"] = data
    with scratch_folder() as folder:
        (folder / name).write_bytes(data)
        return read(name), read(f"s3://bucket/{name}")


@settings(max_examples=examples(40, by_day=4))
@given(st.integers(0, 120), st.integers(0, 1000), st.sampled_from([300, 5000]), st.sampled_from(list(WAYS)))
def test_a_recording_is_the_same_in_a_store(px4_types: Any, count: int, seed: int, chunk: int, way: str) -> None:
    with pytest.MonkeyPatch.context() as patch, object_server() as server:
        set_credentials(patch, server.url)
        local, remote = both(server, recording(px4_types, count, seed, chunk, **WAYS[way]))
        assert local == remote
        assert local[0]


@settings(max_examples=examples(60, by_day=5))
@given(st.integers(0, 1 << 30), st.sampled_from(["zstd", "none", "without-chunks"]))
def test_a_damaged_recording_is_the_same_in_a_store(px4_types: Any, seed: int, way: str) -> None:
    chance = Random(seed)  # noqa: S311 - no secret
    data = bytearray(recording(px4_types, 80, seed % 7, 1500, **WAYS[way]))
    for _ in range(chance.randrange(3)):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    if chance.random() < 0.3:
        del data[chance.randrange(len(data)) :]
    with pytest.MonkeyPatch.context() as patch, object_server() as server:
        set_credentials(patch, server.url)
        local, remote = both(server, bytes(data))
    assert local == remote


def test_attachments_and_metadata_between_chunks_are_read(server: ObjectServer, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=500, compression=CompressionType.NONE)
        writer.start("ros2")
        schema = writer.register_schema("our_msgs/msg/Foo", "ros2msg", b"uint64 timestamp\n")
        channel = writer.register_channel("/a", "cdr", schema)
        for number in range(100):
            if number % 20 == 0:
                writer.add_attachment(START, START, f"{number}.bin", "application/octet-stream", bytes(3000))
                writer.add_metadata("more", {"number": str(number)})
            writer.add_message(channel, START + number, b"\0\1\0\0" + bytes(8), START)
        writer.finish()
    local, remote = both(server, path.read_bytes())
    assert local == remote
    assert local[0]["attached"].count(".bin") == 2 * 5


def test_a_message_index_that_reaches_beyond_its_chunk_is_the_same(server: ObjectServer, px4_types: Any) -> None:
    data = bytearray(recording(px4_types, 400, 5, 1500, **WAYS["none"]))
    with scratch_folder() as folder:
        (folder / "a.mcap").write_bytes(data)
        chunk = mcap.McapFile("a.mcap")._chunks[1]
    for number, place in chunk.indexes.items():
        opcode, length, channel, size = struct.unpack_from("<BQHI", data, place)
        assert (opcode, channel) == (7, number)
        struct.pack_into("<BQHI", data, place, opcode, length + 1600, channel, size + 1600)
    local, remote = both(server, bytes(data))
    assert local == remote
    assert local[0]


def test_a_file_made_of_a_ulog_is_the_same_in_a_store(server: ObjectServer, tmp_path: Path) -> None:
    write_ulog(tmp_path / "flight.ulg")
    with recordings.open(tmp_path / "flight.ulg") as log:
        convert(log, str(tmp_path / "flight.mcap"), format="mcap")
    local, remote = both(server, (tmp_path / "flight.mcap").read_bytes())
    assert local == remote
    assert "Facts(parameters={}," not in local[0]["facts"]


def test_a_size_that_no_object_has_is_an_error(server: ObjectServer, monkeypatch: pytest.MonkeyPatch) -> None:
    server.files["/bucket/a.mcap"] = bytes(1000)
    monkeypatch.setattr(stored, "_LARGEST", 999)
    with pytest.raises(StoreError, match="the object has 1000 bytes, more than 999"):
        recordings.open("s3://bucket/a.mcap")


def big(folder: Path, package: Any, count: int) -> bytes:
    """Return a file with so many samples, of about 200 kB a chunk."""
    topics = []
    for name in ("VehicleStatus", "SensorGps", "EscStatus"):
        info = getattr(package, name).__msg__
        payload = b"\0\1\0\0" + bytes(info.cdr_size)
        chance = Random(name)  # noqa: S311 - no secret
        samples = [
            (START + number * 10**7, START, payload[:12] + chance.randbytes(len(payload) - 12))
            for number in range(count)
        ]
        topics.append(Written(f"/fmu/out/{name}", info.ros_type, info.definition, samples))
    path = write_log(folder / "big.mcap", topics, chunk_size=200_000, compression=CompressionType.ZSTD)
    return path.read_bytes()


@pytest.fixture(scope="module")
def flight(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return big(tmp_path_factory.mktemp("big"), px4_types, 20_000)


def test_little_is_fetched_of_an_indexed_file(
    server: ObjectServer, flight: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    monkeypatch.setattr(mcap_summary, "_TAIL", 1000)  # so that the summary needs a request of its own
    set_credentials(monkeypatch, server.url)
    server.files["/bucket/big.mcap"] = flight
    with recordings.open("s3://bucket/big.mcap") as log:
        assert {topic.count for topic in log.topics} == {20_000}
        assert (log.duration, log.problems, log.missing_checksums) == (199.99, [], 0)
        opened = server.sent
        # the first and the last bytes, the rest of the summary, and the head of the last chunk
        assert opened <= 3 * 65536 + len(flight) // 1000
        assert len(server.requests) <= 4
        part = log.samples("/fmu/out/SensorGps", start=100, stop=101)
        assert len(part) == 100
    share = 1 / 200 * len(flight)
    assert server.sent - opened <= share + 2 * 250_000 + 2 * stored._BLOCK  # a chunk at both ends
    assert all(each.method == "GET" for each in server.requests)


def test_nothing_is_fetched_twice(server: ObjectServer, flight: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    set_credentials(monkeypatch, server.url)
    server.files["/bucket/big.mcap"] = flight
    with recordings.open("s3://bucket/big.mcap") as log:
        for _ in range(2):
            log.load()
            log.load(["/fmu/out/SensorGps"])
    front = 2 * stored._FRONT
    assert server.sent <= len(flight) + front
    assert len(server.requests) <= 4 + len(flight) // (1 << 20)


def test_a_ulog_is_the_same_in_a_store(server: ObjectServer, tmp_path: Path) -> None:
    data = write_ulog(tmp_path / "flight.ulg").read_bytes()
    local, remote = both(server, data, "flight.ulg")
    assert local == remote
    assert local[0]
    assert server.sent < len(data) + 512


def test_a_database_and_compressed_files_are_the_same_in_a_store(
    server: ObjectServer, px4_types: Any, tmp_path: Path
) -> None:
    import zstandard

    data = recording(px4_types, 80, 3, 1500)
    local, remote = both(server, zstandard.compress(data), "flight.mcap.zstd")
    assert local == remote
    assert local[0]
    topics = [Stored(1, "/a", "our_msgs/msg/Foo", "uint64 timestamp\n")]
    write_database(tmp_path / "flight.db3", topics, [(1, START + number, bytes(12)) for number in range(100)])
    local, remote = both(server, (tmp_path / "flight.db3").read_bytes(), "flight.db3")
    assert local == remote
    assert local[0]


@pytest.mark.parametrize("name", ["flight.db3", "flight"])
@pytest.mark.parametrize(("log", "journal"), [("-wal", "WAL"), ("-journal", "DELETE")])
def test_the_log_of_a_database_that_was_not_closed_is_read_in_a_store(
    server: ObjectServer, tmp_path: Path, log: str, journal: str, name: str
) -> None:
    rows = [(1, START + number, bytes(3000)) for number in range(100)]
    path = write_database(tmp_path / "flight_0.db3", [Stored(1, "/a", "a/msg/A")], rows, journal=journal)
    base = sqlite3.connect(path, isolation_level=None)
    base.execute("PRAGMA cache_size = 2")
    base.execute("BEGIN")
    base.execute("UPDATE messages SET timestamp = 7, data = zeroblob(2000)")
    if journal == "WAL":
        base.execute("COMMIT")
    place = f"/bucket/{name}" if name == "flight.db3" else "/bucket/flight/flight_0.db3"
    for suffix in ("", log):
        server.files[place + suffix] = (tmp_path / f"flight_0.db3{suffix}").read_bytes()
    base.close()
    with recordings.open(f"s3://bucket/{name}") as found:
        assert {int(each) for _, part in found.undecoded() for each in part.sizes} == {2000 if log == "-wal" else 3000}
        assert any("was not closed" in problem.text for problem in found.problems)


def test_a_server_of_http_is_read_in_ranges(server: ObjectServer, px4_types: Any, tmp_path: Path) -> None:
    data = recording(px4_types, 100, 5, 1500)
    path = tmp_path / "a b.mcap"
    path.write_bytes(data)
    server.files["/logs/a b.mcap"] = data
    server.tags = False
    with recordings.open(f"{server.url}/logs/a%20b.mcap?X-Signature=se%2Fcret") as log, recordings.open(path) as own:
        assert log.path == f"{server.url}/logs/a%20b.mcap"
        assert contents(log) == contents(own)
    assert {each.path for each in server.requests} == {"/logs/a%20b.mcap?X-Signature=se%2Fcret"}


def test_an_object_that_changes_while_it_is_open_is_an_error(server: ObjectServer, px4_types: Any) -> None:
    server.files["/bucket/a.mcap"] = recording(px4_types, 200, 5, 1500, **WAYS["none"])
    for server.tags in (True, False):
        with recordings.open("s3://bucket/a.mcap") as log:
            whole = server.files["/bucket/a.mcap"]
            server.files["/bucket/a.mcap"] = whole[:-1]
            with pytest.raises(StoreError, match=r"^s3://bucket/a.mcap: the object changed while it was open"):
                log.load()
            server.files["/bucket/a.mcap"] = whole


WHILE_READ = FAULTS | {
    "no range": "the server does not send parts of files (HTTP Range): copy the file to this computer first"
}


@pytest.mark.parametrize("fault", WHILE_READ)
@pytest.mark.parametrize("place", ["s3://bucket/a.mcap", "{url}/bucket/a.mcap"])
def test_a_store_that_fails_while_it_is_read_is_an_error(
    server: ObjectServer, px4_types: Any, fault: str, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hasten(monkeypatch, fault)
    server.files["/bucket/a.mcap"] = recording(px4_types, 200, 5, 1500, **WAYS["none"])
    address = place.format(url=server.url)
    server.fault = fault
    with pytest.raises(StoreError) as opening:
        recordings.open(address)
    server.fault = ""
    with recordings.open(address) as log:
        server.fault = fault
        with pytest.raises(StoreError) as reading:
            log.load()
        server.fault = ""
        assert len(log.load()) == 5  # what failed is read again
    for error in (opening.value, reading.value):
        assert (error.filename, error.strerror) == (address, WHILE_READ[fault])
        assert str(error) == f"{address}: {WHILE_READ[fault]}"


def test_a_range_that_is_not_the_one_asked_for_is_an_error(server: ObjectServer, px4_types: Any) -> None:
    server.files["/bucket/a.mcap"] = recording(px4_types, 200, 5, 1500)
    server.fault = "wrong range"
    with pytest.raises(StoreError):
        recordings.open("s3://bucket/a.mcap")


@pytest.mark.parametrize("name", ["a.mcap", "a.ulg", "a.txt"])
def test_an_empty_object_is_an_error(server: ObjectServer, name: str) -> None:
    server.files[f"/bucket/{name}"] = b""
    with pytest.raises(RecordingError, match=rf"^s3://bucket/{name} is empty$"):
        recordings.open(f"s3://bucket/{name}")


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("s3://", "expected s3://BUCKET/KEY"),
        ("https:///x", "expected https://SERVER/FILE"),
        ("http://[1/x", "this is no URL: Invalid IPv6 URL"),
        ("s3://bucket/a//b", "Could not parse path"),
        ("s3://bucket/../b", "Could not parse path"),
        ("http://127.0.0.1:1/x.mcap", "no connection to the server: Connection refused"),
    ],
)
def test_an_impossible_address_is_an_error(server: ObjectServer, address: str, reason: str) -> None:
    with pytest.raises(StoreError) as error:
        recordings.open(address)
    assert str(error.value.strerror).startswith(reason), (server.url, error.value.strerror)
    assert error.value.filename == address


def test_without_credentials_the_error_says_how_to_have_some(
    server: ObjectServer, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.files["/bucket/a.mcap"] = recording(px4_types, 10)
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    with pytest.raises(StoreError, match=r"^s3://bucket/a\.mcap: there are no credentials: set AWS_PROFILE, or"):
        recordings.open("s3://bucket/a.mcap")
    assert not server.requests
    monkeypatch.setenv("AWS_PROFILE", "nobody")
    with pytest.raises(StoreError, match="nobody"):
        recordings.open("s3://bucket/a.mcap")
    monkeypatch.delenv("AWS_PROFILE")
    monkeypatch.setenv("AWS_SKIP_SIGNATURE", "true")
    recordings.open("s3://bucket/a.mcap").close()


def test_a_profile_has_keys_a_region_and_an_endpoint(
    server: ObjectServer, px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.files["/bucket/a.mcap"] = recording(px4_types, 10)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_ENDPOINT_URL"):
        monkeypatch.delenv(name)
    (tmp_path / "config").write_text(f"[profile field]\nregion = eu-west-1\nendpoint_url = {server.url}\n")
    (tmp_path / "credentials").write_text("[field]\naws_access_key_id = A\naws_secret_access_key = B\n")
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "config"))
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "credentials"))
    monkeypatch.setenv("AWS_PROFILE", "field")
    recordings.open("s3://bucket/a.mcap").close()
    assert server.requests


def test_copies_are_removed(server: ObjectServer, px4_types: Any, tmp_path: Path) -> None:
    server.files["/bucket/a.mcap"] = recording(px4_types, 10)
    server.files["/bucket/b.mcap"] = b"nothing"
    folder = tmp_path / "tmp"
    folder.mkdir()
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        with recordings.open("s3://bucket/a.mcap") as log:
            array = log["/fmu/out/vehiclestatus"]
            assert os.listdir(folder)
        gc.collect()
        assert len(array)
        with pytest.raises(RecordingError, match=r"^s3://bucket/b\.mcap is not a recording: expected an MCAP file"):
            recordings.open("s3://bucket/b.mcap")
        gc.collect()
        assert os.listdir(folder) == []
    finally:
        tempfile.tempdir = before


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a disk that is full")
def test_a_disk_without_room_is_an_error(server: ObjectServer, px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    server.files["/bucket/a.mcap"] = recording(px4_types, 10)

    def opened(path: str, mode: str, **options: Any) -> Any:
        return open("/dev/full" if mode == "r+b" else path, mode, **options)

    monkeypatch.setattr(stored, "open", opened, raising=False)
    with pytest.raises(StoreError, match=r"cannot be kept in .*: No space left on device; TMPDIR names another folder"):
        recordings.open("s3://bucket/a.mcap")


def test_reads_of_one_store_do_not_disturb_each_other(server: ObjectServer) -> None:
    data = Random(3).randbytes(100_000)  # noqa: S311 - no secret
    server.files["/bucket/a"] = data
    store = Store("s3://bucket/a")
    found, front = store.look("s3://bucket/a", 10)
    assert (found.size, front) == (100_000, data[:10])
    taken = dict(store.read_all(found, [(0, 50_000), (60_000, 100_000)]))
    assert taken == {0: data[:50_000], 60_000: data[60_000:]}
    with pytest.raises(StoreError, match=r"this is not in s3://bucket$"):
        store.look("s3://other/a")
