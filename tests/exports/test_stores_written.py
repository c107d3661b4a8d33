"""Tests of recordings that are written to a store: whole, or not at all."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from random import Random
from typing import Any

import pytest
from pyarrow import parquet

from msggen import recordings
from msggen.base.missing import installing
from msggen.exports.convert import Converted, convert, join
from msggen.exports.fleet import files, update
from msggen.recordings.source.source import RecordingError
from msggen.recordings.stores import limits
from msggen.recordings.stores import store as stores
from msggen.recordings.stores.errors import MissingError, StoreError
from msggen.recordings.stores.store import Store
from support.commands import run
from support.fleet_logs import write_logs
from support.fleet_recordings import parquet_in, rows_of
from support.fleet_stores import FLEET, Bucket, both, change
from support.object_server import hasten, object_server, set_credentials
from support.random_mcap import WAYS, recording
from support.ulog import write_ulog

pytest_plugins = ["support.fleet_fixtures"]


@pytest.fixture
def source(px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a recording in the current folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "flight.mcap"
    path.write_bytes(recording(px4_types, 200, 5, 1500))
    return path


def payloads(path: str | Path) -> list[tuple[str, int, bytes]]:
    with recordings.open(path) as log:
        return [(topic, time, bytes(payload)) for topic, time, payload in log.payloads()]


def converted(source: Path, target: str, format_: str) -> Converted:
    with recordings.open(source) as log:
        return convert(log, target, format=format_)


def test_a_bucket_is_a_folder(bucket: Bucket, source: Path) -> None:
    for address in ("s3://bucket", "s3://bucket/"):
        with pytest.raises(MissingError, match="there is no such folder"):
            recordings.open(address)
    bucket.server.files["/bucket/flight.mcap"] = source.read_bytes()
    assert payloads("s3://bucket") == payloads("s3://bucket/") == payloads(source)


@pytest.mark.usefixtures("bucket", "source")
def test_the_files_of_a_folder_are_counted() -> None:
    local = run(["log", "convert", "flight.mcap", "-o", "tables"]).stdout
    assert re.match(r"tables: [\d,]+ samples in \d+ files \(\.parquet\), ", local)
    assert run(["log", "convert", "flight.mcap", "-o", "s3://bucket/tables"]).stdout == f"s3://bucket/{local}"


def test_a_file_is_put_and_read_again(bucket: Bucket, source: Path) -> None:
    done = converted(source, "s3://bucket/logs/flight.mcap", "mcap")
    assert (done.files, bucket.names()) == (["s3://bucket/logs/flight.mcap"], ["logs/flight.mcap"])
    assert done.size == len(bucket.server.files["/bucket/logs/flight.mcap"])
    assert payloads("s3://bucket/logs/flight.mcap") == payloads(source)
    assert os.listdir() == ["flight.mcap"]


def test_tables_are_put_as_those_of_a_folder(bucket: Bucket, source: Path) -> None:
    local = converted(source, "tables", "parquet")
    done = converted(source, "s3://bucket/a/tables/", "parquet")
    names = sorted(os.listdir("tables"))
    assert bucket.names() == [f"a/tables/{name}" for name in names]
    assert done.files == [f"s3://bucket/a/tables/{name}" for name in names]
    assert (done.rows, done.size) == (local.rows, local.size)
    for name in names:
        body = bucket.server.files[f"/bucket/a/tables/{name}"]
        Path("copy").write_bytes(body)
        assert parquet.read_table("copy").equals(parquet.read_table(f"tables/{name}"))


def test_a_folder_of_rosbag2_is_put_and_read_again(bucket: Bucket, source: Path) -> None:
    converted(source, "s3://bucket/a/bag", "rosbag2")
    assert bucket.names() == ["a/bag/bag_0.mcap", "a/bag/metadata.yaml"]
    for address in ("s3://bucket/a/bag", "s3://bucket/a/bag/"):
        assert payloads(address) == payloads(source)
        with recordings.open(address) as log:
            assert log.kind == "mcap"
            assert [each.text for each in log.problems] == []
    del bucket.server.files["/bucket/a/bag/metadata.yaml"]
    with recordings.open("s3://bucket/a/bag") as log:
        assert [each.text.partition(":")[0] for each in log.problems] == ["metadata.yaml is missing"]


def test_several_recordings_in_a_folder_are_an_error(bucket: Bucket, source: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        bucket.server.files[f"/bucket/logs/{name}"] = source.read_bytes()
    expected = r"^s3://bucket/logs has several recordings and no metadata\.yaml: name one of 'a\.mcap', 'b\.mcap'$"
    with pytest.raises(RecordingError, match=expected):
        recordings.open("s3://bucket/logs")


@pytest.mark.parametrize("target", ["s3://bucket/a.mcap", "s3://bucket/a", "s3://bucket/a/"])
def test_what_is_there_is_not_replaced(bucket: Bucket, source: Path, target: str) -> None:
    bucket.server.files["/bucket/a.mcap"] = b"old"
    bucket.server.files["/bucket/a/old.parquet"] = b"old"
    format_ = "mcap" if target.endswith("mcap") else "parquet"
    with pytest.raises(FileExistsError):
        converted(source, target, format_)
    assert bucket.names() == ["a.mcap", "a/old.parquet"]
    assert bucket.server.files["/bucket/a.mcap"] == b"old"


@pytest.mark.night  # by day, the server of the tests does it all
def test_motos_server_does_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Objects of one part and of several, which are not replaced, and a fleet."""
    from botocore.session import Session
    from moto.server import ThreadedMotoServer

    caplog.set_level("ERROR")
    monkeypatch.setattr(stores, "_ATOMIC", 6 << 20)
    limit = limits.LIMITS._replace(read=10)  # a request that is repeated too early is one too many
    monkeypatch.setattr(limits, "LIMITS", limit)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    try:
        url = "http://{}:{}".format(*server.get_host_and_port())
        set_credentials(monkeypatch, url)
        Session().create_client("s3", region_name="us-east-1", endpoint_url=url).create_bucket(Bucket="bucket")
        check_puts(tmp_path)
        logs = write_logs(tmp_path / "logs")
        for step in range(2):
            both(str(logs))
            update(str(logs), str(tmp_path / "fleet"))
            store, copy = Store(FLEET), tmp_path / f"copy-{step}"
            for each in list(store.below(FLEET)):
                place = copy / each.address.removeprefix(f"{FLEET}/")
                place.parent.mkdir(parents=True, exist_ok=True)
                store.fetch(each.address, str(place))
            assert rows_of(copy) == rows_of(tmp_path / "fleet")
            assert files(FLEET) == [f"{FLEET}/{name}" for name in parquet_in(copy)]
            change(logs)
        with pytest.raises(MissingError, match=r"^s3://nobucket/a: there is no such bucket$"):
            Store("s3://nobucket").put(str(tmp_path / "a"), "s3://nobucket/a")
    finally:
        server.stop()


def check_puts(folder: Path) -> None:
    store, path = Store("s3://bucket/a"), folder / "a"
    for name, size in (("a/small", 100), ("a/large", 12 << 20)):
        data = Random(1).randbytes(size)  # noqa: S311 - no secret
        path.write_bytes(data)
        store.put(str(path), f"s3://bucket/{name}")
        path.write_bytes(b"other")
        with pytest.raises(FileExistsError):
            store.put(str(path), f"s3://bucket/{name}")
        (found,) = (each for each in store.folder("s3://bucket/a") if each.address.endswith(name))
        assert b"".join(part for _, part in sorted(store.read_all(found, [(0, size)]))) == data
    store.delete(["s3://bucket/a/small", "s3://bucket/a/large", "s3://bucket/a/none"])
    assert list(store.below("s3://bucket")) == []


def test_a_recording_without_samples_is_not_put(bucket: Bucket, source: Path) -> None:
    with recordings.open(source) as log:
        done = convert(log, "s3://bucket/a.mcap", format="mcap", start=1000)
    assert (done.files, done.rows, bucket.names()) == ([], 0, [])


def test_a_bucket_that_there_is_not_is_an_error(bucket: Bucket, source: Path) -> None:
    for target in ("s3://nobucket/a.mcap", "s3://nobucket/tables"):
        with pytest.raises(MissingError, match=rf"^{target}: there is no such bucket$"):
            converted(source, target, "mcap" if target.endswith("mcap") else "parquet")
    for address in ("s3://nobucket/a.mcap", "s3://nobucket/", "s3://bucket/a.mcap", "s3://bucket/a/"):
        with pytest.raises(MissingError, match=f"^{address}: there is no such (bucket|object|folder)$"):
            recordings.open(address)
    assert bucket.names() == []


@pytest.mark.parametrize("fault", ["500", "403"])
def test_files_that_cannot_be_put_leave_nothing(source: Path, fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    hasten(monkeypatch)
    with object_server() as server:
        set_credentials(monkeypatch, server.url)
        deleted: list[str] = []
        monkeypatch.setattr(Store, "delete", lambda _, addresses: deleted.extend(addresses))
        server.fault, server.after = fault, 4  # two questions and two files
        with pytest.raises(StoreError, match=rf"\({fault}\)") as error:
            converted(source, "s3://bucket/tables", "parquet")
        assert str(error.value.filename).startswith("s3://bucket/tables/")
        assert [f"s3:/{path}" for path in server.files] == deleted
        assert len(deleted) == 2
        server.fault, server.after = fault, len(server.requests) + 2
        server.files.clear()
        with pytest.raises(StoreError):
            converted(source, "s3://bucket/a.mcap", "mcap")
        assert not server.files


def test_who_may_only_write_writes(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hasten(monkeypatch)
    with object_server() as server:
        set_credentials(monkeypatch, server.url)
        server.fails = lambda number, _: "403" if number < 2 else ""
        converted(source, "s3://bucket/a.mcap", "mcap")
        assert list(server.files) == ["/bucket/a.mcap"]
        with pytest.raises(FileExistsError):
            converted(source, "s3://bucket/a.mcap", "mcap")


def test_objects_are_listed_and_deleted(bucket: Bucket) -> None:
    for key in ("logs/a.mcap", "logs/b/c.mcap", "logsx/d.mcap"):
        bucket.server.files[f"/bucket/{key}"] = b"12"
    store = Store("s3://bucket")
    assert [each.address for each in store.below("s3://bucket/logs")] == [
        "s3://bucket/logs/a.mcap",
        "s3://bucket/logs/b/c.mcap",
    ]
    (found,) = store.folder("s3://bucket/logs/")
    assert (found.address, found.size, store.read(found, 0, 2)) == ("s3://bucket/logs/a.mcap", 2, b"12")
    assert (store.has("s3://bucket/logs/a.mcap"), store.has("s3://bucket/logs")) == (True, False)
    store.delete(["s3://bucket/logs/a.mcap", "s3://bucket/none"])
    assert bucket.names() == ["logs/b/c.mcap", "logsx/d.mcap"]


def test_recordings_in_a_store_are_merged_cut_and_compared(bucket: Bucket, source: Path, tmp_path: Path) -> None:
    write_ulog(tmp_path / "other.ulg")
    for path in (source, tmp_path / "other.ulg"):
        bucket.server.files[f"/bucket/{path.name}"] = path.read_bytes()
    addresses = [f"s3://bucket/{name}" for name in ("flight.mcap", "other.ulg")]
    with recordings.open(addresses[0]) as first, recordings.open(addresses[1]) as second:
        join([first, second], "s3://bucket/both.mcap")
    with recordings.open("flight.mcap") as first, recordings.open("other.ulg") as second:
        join([first, second], "both.mcap")
    assert payloads("s3://bucket/both.mcap") == payloads("both.mcap")


def test_a_killed_conversion_leaves_no_object(bucket: Bucket, source: Path, px4_types: Any) -> None:
    source.write_bytes(recording(px4_types, 3000, 5, 1500, **WAYS["none"]))
    code = (
        "import os; from msggen import recordings; from msggen.exports.convert import convert\n"
        "from msggen.recordings.stores.store import Store\n"
        "Store.put = lambda *_: os._exit(9)\n"
        "with recordings.open('flight.mcap') as log: convert(log, 's3://bucket/a.mcap', format='mcap')"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 9
    assert bucket.names() == []


def test_an_error_can_be_sent_to_another_process() -> None:
    import pickle

    error = pickle.loads(pickle.dumps(StoreError(5, "no", "s3://bucket/a")))  # noqa: S301 - our own
    assert (str(error), error.errno) == ("s3://bucket/a: no", 5)


@pytest.mark.parametrize("package", ["obstore", "botocore"])
@pytest.mark.usefixtures("source")
def test_without_the_extra_the_error_names_it(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [package, *(each for each in sys.modules if each.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    for words in (["info", "s3://b/a.mcap"], ["convert", "flight.mcap", "-o", "s3://b/a.mcap"]):
        outcome = run(["log", *words])
        assert outcome.code == 2
        assert f"this package is not installed: {installing('stores')}\n" in outcome.stderr
