"""Tests of folders of rosbag2, written by rosbags and put together by hand."""

from __future__ import annotations

import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml
import zstandard
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from msggen import recordings
from msggen.recordings.decode.schemas import type_hash_of
from msggen.recordings.files.compression import CompressionError, Room, decompress_file, decompress_frame
from msggen.recordings.files.opening import open_sources
from msggen.recordings.files.paths import is_bag
from msggen.recordings.source.source import RecordingError
from support.databases import Sample, Stored, expected_of, samples_of, write_database
from support.recordings import START
from support.ulog import write_ulog

DEFINITION = "uint64 timestamp\nfloat32[3] xyz\nbool valid\n"
TOPICS = tuple(Stored(number, f"/fmu/out/{name}", "demo/msg/Demo", DEFINITION) for number, name in enumerate("abc", 1))
STORAGES = (StoragePlugin.SQLITE3, StoragePlugin.MCAP)
Row = tuple[int, int, bytes]


def rows_of(count: int, seed: int = 1) -> list[Row]:
    """Return samples of TOPICS, 1 ms apart."""
    chance = Random(seed)  # noqa: S311 - no secret
    return [
        (chance.randint(1, 3), START + index * 1_000_000, b"\0\1\0\0" + chance.randbytes(20) + b"\1")
        for index in range(count)
    ]


def write_bag(folder: Path, rows: Iterable[Row], storage: StoragePlugin, mode: CompressionMode | None = None) -> Path:
    """Write a folder with rosbags."""
    writer = Writer(folder, version=9, storage_plugin=storage)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {
            each.number: writer.add_connection(
                each.name, each.ros_type, msgdef=each.definition, rihs01=type_hash_of(each.ros_type, each.definition)
            )
            for each in TOPICS
        }
        for number, time, payload in rows:
            writer.write(connections[number], time, payload)
    return folder


def read(folder: Path) -> tuple[dict[str, list[Sample]], list[str]]:
    """Return the samples of a recording, and its problems."""
    found: dict[str, list[Sample]] = defaultdict(list)
    sources = open_sources(str(folder))
    for source in sources:
        for topic, samples in samples_of(source).items():
            found[topic] += samples
    problems = [problem.text for source in sources for problem in source.problems]
    for source in sources:
        source.close()
    return dict(found), problems


def read_rosbags(folder: Path) -> dict[str, list[Sample]]:
    """Read a folder with rosbags."""
    found: dict[str, list[Sample]] = defaultdict(list)
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages():
            found[connection.topic].append((time, bytes(data)))
    return dict(found)


def write_split(folder: Path, count: int = 3, size: int = 100) -> list[Row]:
    """Write a folder with split databases and a metadata.yaml as rosbag2 has it. Return the rows."""
    folder.mkdir()
    rows = rows_of(count * size)
    files = []
    for number in range(count):
        of_file = rows[number * size : (number + 1) * size]
        name = f"{folder.name}_{number}.db3"
        write_database(folder / name, TOPICS, of_file)
        files.append({"path": name, "message_count": size})
    write_metadata(folder, [each["path"] for each in files], files=files, message_count=len(rows))
    return rows


def write_metadata(folder: Path, paths: list[Any], **content: Any) -> None:
    """Write a metadata.yaml."""
    information = {
        "version": 5,
        "storage_identifier": "sqlite3",
        "relative_file_paths": paths,
        "compression_format": "",
        "compression_mode": "",
        **content,
    }
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))


def change_metadata(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change what a metadata.yaml says."""
    path = folder / "metadata.yaml"
    document = yaml.safe_load(path.read_text())
    change(document["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(document))


def compress(path: Path) -> Path:
    """Compress a file as rosbag2 does."""
    target = path.with_name(path.name + ".zstd")
    target.write_bytes(zstandard.compress(path.read_bytes()))
    path.unlink()
    return target


MODES = [
    (storage, mode)
    for storage in STORAGES
    for mode in (None, CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE)
    if (storage, mode) != (StoragePlugin.SQLITE3, CompressionMode.STORAGE)
]


@pytest.mark.parametrize(("storage", "mode"), MODES)
def test_folders_of_rosbags_are_read(storage: StoragePlugin, mode: CompressionMode | None, tmp_path: Path) -> None:
    rows = rows_of(300)
    folder = write_bag(tmp_path / "bag", rows, storage, mode)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    found, problems = read(folder)
    assert found == expected_of(TOPICS, rows)
    assert problems == []
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert found == read_rosbags(folder)
    with recordings.open(folder) as log:
        array = log["a"]
        assert array.dtype.names == ("timestamp", "xyz", "valid")
        assert len(array) == len(found["/fmu/out/a"])
        limited = log.samples("a", start=0.1, stop=0.2)
        assert 0 < len(limited) < 100
    for path in folder.iterdir():  # a file without its folder
        if path.name != "metadata.yaml":
            found, problems = read(path)
            assert found == expected_of(TOPICS, rows)
            assert problems == []


def test_split_files_are_joined(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag", 12)
    assert read(tmp_path / "bag") == (expected_of(TOPICS, rows), [])
    with recordings.open(tmp_path / "bag") as log:
        assert [topic.name for topic in log.topics] == [each.name for each in TOPICS]
        samples = log.samples("a")
        assert samples.log_times.tolist() == [time for number, time, _ in rows if number == 1]


def test_files_without_metadata_are_read_in_order(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag", 12)
    (tmp_path / "bag/metadata.yaml").unlink()
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problems == ["metadata.yaml is missing: the files are read in the order of their names"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "it has no 'rosbag2_bagfile_information'"),
        ("a: [", "while parsing"),
        ("rosbag2_bagfile_information: {version: 5}", "no list 'relative_file_paths'"),
        ("- " * 20_000 + "x", "metadata.yaml cannot be read"),
        ("\x00", "unacceptable character"),
    ],
)
def test_a_metadata_that_cannot_be_read_is_reported(text: str, problem: str, tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    (tmp_path / "bag/metadata.yaml").write_text(text)
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert len(problems) == 1
    assert problem in problems[0] or "metadata.yaml cannot be read" in problems[0]
    assert "\n" not in problems[0]


def test_files_that_metadata_does_not_name_are_read(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    change_metadata(tmp_path / "bag", lambda each: each["relative_file_paths"].pop())
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problems == ["bag_2.db3 is not in metadata.yaml, and is read too"]


def test_further_files_beside_a_complete_recording_are_not_read(tmp_path: Path) -> None:
    """Such as a part that was cut from it."""
    rows = write_split(tmp_path / "bag")
    folder = tmp_path / "bag"
    write_database(folder / "part.db3", TOPICS, rows[50:80])
    (folder / "broken.mcap").write_bytes(b"")
    assert read(folder) == (
        expected_of(TOPICS, rows),
        ["broken.mcap is not in metadata.yaml, and is not read", "part.db3 is not in metadata.yaml, and is not read"],
    )
    # without counts of files, that of all of them tells it
    change_metadata(folder, lambda each: (each.pop("files"), each.update(version=4)))
    assert read(folder)[0] == expected_of(TOPICS, rows)
    change_metadata(folder, lambda each: each.pop("message_count"))
    found, problems = read(folder)
    assert sum(map(len, found.values())) == len(rows) + 30
    assert problems[0].startswith("broken.mcap is not in metadata.yaml, and is read too")


def test_further_files_of_a_recorder_that_crashed_are_read(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    folder = tmp_path / "bag"
    for change in ({"message_count": 0}, {"message_count": 300, "relative_file_paths": ["bag_0.db3", "bag_1.db3"]}):
        change_metadata(folder, lambda each, new=change: each.update(new))  # type: ignore[misc]
        assert read(folder)[0] == expected_of(TOPICS, rows)
    change_metadata(folder, lambda each: each.update(message_count=200))
    assert read(folder)[0] == expected_of(TOPICS, rows[:200])
    (folder / "bag_1.db3").unlink()
    found, problems = read(folder)
    assert found == expected_of(TOPICS, rows[:100] + rows[200:])
    assert problems == [
        "bag_1.db3, which metadata.yaml names, is missing",
        "bag_2.db3 is not in metadata.yaml, and is read too",
    ]


def test_missing_files_are_reported(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    (tmp_path / "bag/bag_1.db3").unlink()
    sources = open_sources(str(tmp_path / "bag"))
    (problem,) = sources[0].problems
    assert problem.text == "bag_1.db3, which metadata.yaml names, is missing"
    assert problem.samples == 100
    assert read(tmp_path / "bag")[0] == expected_of(TOPICS, rows[:100] + rows[200:])


@pytest.mark.parametrize(
    "name",
    ["../x_0.db3", "sub/../../x_0.db3", "{}/x_0.db3", "..\\x_0.db3", "C:x_0.db3", "C:\\x_0.db3", "\\\\host\\x_0.db3"],
)
def test_files_outside_of_the_folder_are_not_read(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also those of other systems: on Linux, a backslash is a letter of a name."""
    rows = write_split(tmp_path / "bag")
    write_database(tmp_path / "x_0.db3", TOPICS, rows_of(7))
    (tmp_path / "bag" / "sub").mkdir()
    name = name.format(tmp_path)
    for each in ("..\\x_0.db3", "C:x_0.db3", "C:\\x_0.db3"):
        with suppress(OSError):  # Windows has no such names
            write_database(tmp_path / "bag" / each, TOPICS, rows_of(7))
    change_metadata(tmp_path / "bag", lambda each: each["relative_file_paths"].append(name))
    monkeypatch.setattr("msggen.recordings.files.rosbag2.bag.format_named", lambda each: each.startswith("bag_"))
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problems == [f"{name}, which metadata.yaml names, is not in the folder of the recording, and is not read"]


def test_a_path_of_another_computer_names_the_file_in_the_folder(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    paths = ["/home/me/bag/bag_0.db3", "C:\\bags\\bag\\bag_1.db3", "../bag/bag_2.db3"]
    change_metadata(tmp_path / "bag", lambda each: each.update(relative_file_paths=paths))
    assert read(tmp_path / "bag") == (expected_of(TOPICS, rows), [])


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights")
def test_links_to_files_are_followed_and_links_to_folders_are_not(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    (tmp_path / "bag" / "bag_0.db3").rename(tmp_path / "stored.db3")
    (tmp_path / "bag" / "bag_0.db3").symlink_to(tmp_path / "stored.db3")
    (tmp_path / "link").symlink_to(tmp_path / "bag")
    assert read(tmp_path / "link") == (expected_of(TOPICS, rows), [])
    (tmp_path / "bag" / "away").symlink_to(tmp_path)
    change_metadata(tmp_path / "bag", lambda each: each["relative_file_paths"].append("away/stored.db3"))
    problem = "away/stored.db3, which metadata.yaml names, is not in the folder of the recording, and is not read"
    assert read(tmp_path / "bag") == (expected_of(TOPICS, rows), [problem])


def test_a_ulog_that_is_named_as_a_file_of_rosbag2_is_left_out(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    path = tmp_path / "bag" / "bag_3.db3"
    write_ulog(path)
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problems[-1] == f"a file is left out: {path} is a ULog, which is a recording of its own"


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pipes in folders")
def test_pipes_are_not_waited_for(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    os.mkfifo(tmp_path / "bag" / "bag_3.db3")
    (tmp_path / "bag" / "bag_4.db3").mkdir()
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problems == [f"bag_{number}.db3 is left out: this is not a file" for number in (3, 4)]
    (tmp_path / "bag" / "metadata.yaml").unlink()
    os.mkfifo(tmp_path / "bag" / "metadata.yaml")
    found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problems[-1] == "metadata.yaml cannot be read: not a regular file"
    with pytest.raises(RecordingError, match="is not a recording: this is a pipe or a device"):
        open_sources(str(tmp_path / "bag" / "bag_3.db3"))
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "folder" / "metadata.yaml")
    assert not is_bag(str(tmp_path / "folder"))


LONG = f"&a [{', '.join(['x' * 1000] * 1000)}]"
"""A value whose text has a megabyte."""
MERGES = "".join(f"a{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}]}}\n" for n in range(1, 40))
ALIASES = "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 40))
VERSION = f"a: {LONG}, version: [*a, *a, *a, *a, *a, *a, *a, *a, *a]"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[" * 1_000_000, "nest"),  # newer versions of PyYAML refuse it themselves
        ("a0: &a0 {x: 1}\n" + MERGES, "for too much"),
        ("a0: &a0 [x]\n" + ALIASES, "for too much"),
        (f"rosbag2_bagfile_information: {{{VERSION}, relative_file_paths: [bag_0.db3]}}", "version list: 1 to 9 are"),
    ],
    ids=["deep", "merges", "aliases", "a long version"],
)
def test_a_small_metadata_takes_little_time_and_memory(text: str, problem: str, tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").write_text(text)
    with pytest.importorskip("fuzz.runner").limited():
        found, problems = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows)
    assert problem in problems[0]
    assert len(problems[0]) < 200


def test_damaged_files_are_left_out(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    (tmp_path / "bag/bag_1.db3").write_bytes(b"")
    found, (problem,) = read(tmp_path / "bag")
    assert found == expected_of(TOPICS, rows[:100] + rows[200:])
    assert "a file is left out" in problem


def test_problems_name_the_file(tmp_path: Path) -> None:
    write_split(tmp_path / "bag")
    path = tmp_path / "bag/bag_1.db3"
    path.write_bytes(path.read_bytes()[:-4096])
    with recordings.open(tmp_path / "bag") as log:
        log.load()
        assert any(problem.text.startswith("bag_1.db3: the file is cut off") for problem in log.problems)


def test_samples_that_a_damaged_file_has_lost_are_counted(tmp_path: Path) -> None:
    write_split(tmp_path / "bag", count=1)
    path = tmp_path / "bag/bag_0.db3"
    content = bytearray(path.read_bytes())
    content[4096:] = bytes(len(content) - 4096)  # all pages behind the first one
    path.write_bytes(content)
    samples, problems = read(tmp_path / "bag")
    assert not samples
    assert "bag_0.db3 has 0 messages, metadata.yaml says 100" in problems


def test_a_metadata_that_is_older_is_reported(tmp_path: Path) -> None:
    write_split(tmp_path / "bag")
    change_metadata(tmp_path / "bag", lambda each: each["files"][1].update(message_count=120))
    assert read(tmp_path / "bag")[1] == ["bag_1.db3 has 100 messages, metadata.yaml says 120"]
    change_metadata(tmp_path / "bag", lambda each: (each.pop("files"), each.update(message_count=7, version=4)))
    assert read(tmp_path / "bag")[1] == ["the files have 300 messages, metadata.yaml says 7"]


@pytest.mark.parametrize("version", range(1, 10))
def test_all_versions_of_metadata_are_read(version: int, tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    folder = tmp_path / "bag"

    def change(content: dict[str, Any]) -> None:
        content["version"] = version
        if version < 3:
            del content["compression_format"], content["compression_mode"]
        if version < 4:
            content["relative_file_paths"] = [f"bag/{path}" for path in content["relative_file_paths"]]
        if version < 5:
            del content["files"]

    change_metadata(folder, change)
    assert read(folder) == (expected_of(TOPICS, rows), [])
    folder.rename(tmp_path / "other")
    assert read(tmp_path / "other") == (expected_of(TOPICS, rows), [])


def test_a_newer_metadata_is_reported(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    change_metadata(tmp_path / "bag", lambda each: each.update(version=12))
    assert read(tmp_path / "bag") == (expected_of(TOPICS, rows), ["metadata.yaml has version 12: 1 to 9 are known"])


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({"storage_identifier": "rocks"}, "the storage 'rocks' is not known, expected mcap or sqlite3"),
        (
            {"compression_mode": "FILE", "compression_format": "lz5"},
            "the compression 'lz5' is not known, expected zstd",
        ),
    ],
)
def test_unknown_formats_are_errors(content: dict[str, str], text: str, tmp_path: Path) -> None:
    write_split(tmp_path / "bag")
    change_metadata(tmp_path / "bag", lambda each: each.update(content))
    with pytest.raises(RecordingError, match=text):
        open_sources(str(tmp_path / "bag"))


def test_a_folder_without_files_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"is not a recording: a folder without metadata\.yaml"):
        open_sources(str(tmp_path))
    for name in ("a.ulg", "b.ulg"):
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(RecordingError, match=r"has several recordings and no metadata\.yaml: name one of 'a\.ulg'"):
        open_sources(str(tmp_path))
    write_metadata(tmp_path, ["x_0.db3"])
    with pytest.raises(RecordingError, match=r"x_0\.db3, which metadata\.yaml names, is missing"):
        open_sources(str(tmp_path))


# compression


def test_compressed_files_are_read(tmp_path: Path) -> None:
    rows = write_split(tmp_path / "bag")
    folder = tmp_path / "bag"
    paths = [compress(folder / f"bag_{number}.db3").name for number in range(3)]
    write_metadata(folder, paths, compression_format="zstd", compression_mode="FILE")
    assert read(folder) == (expected_of(TOPICS, rows), [])
    # rosbag2 leaves files that it decompressed beside the others
    (folder / "bag_0.db3").write_bytes(zstandard.decompress((folder / "bag_0.db3.zstd").read_bytes()))
    assert read(folder) == (expected_of(TOPICS, rows), [])
    (folder / "bag_1.db3").write_bytes(zstandard.decompress((folder / "bag_1.db3.zstd").read_bytes()))
    (folder / "bag_1.db3.zstd").unlink()
    assert read(folder) == (expected_of(TOPICS, rows), [])


def test_cut_compressed_files_give_their_whole_messages(tmp_path: Path) -> None:
    rows = rows_of(5000)
    path = compress(write_database(tmp_path / "x.db3", TOPICS, rows))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 3 // 4])
    found, problems = read(path)
    expected = expected_of(TOPICS, rows)
    assert all(set(samples) <= set(expected[topic]) for topic, samples in found.items())
    assert sum(map(len, found.values())) > 1000
    assert "the compressed file is damaged or cut off" in problems[0]


def test_content_that_is_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.recordings.files.compression._LEAST_LIMIT", 1 << 20)
    path = tmp_path / "x.zstd"
    path.write_bytes(zstandard.compress(bytes(50 << 20)))
    with pytest.raises(CompressionError, match=r"more than 1048576 bytes .*; MSGGEN_MAX_CONTENT sets"):
        decompress_file(str(path), str(tmp_path / "x"), Room(path.stat().st_size))
    with pytest.raises(CompressionError, match="a sample of 52428800 bytes, more than 1048576"):
        decompress_frame(path.read_bytes(), 1 << 20)


def test_samples_that_cannot_be_decompressed_are_counted(tmp_path: Path) -> None:
    frames = [zstandard.compress(payload) for _, _, payload in rows_of(20)]
    frames[7] = frames[7][:-3]
    frames[9] = b"\0\1\0\0" + bytes(21)  # without compression
    rows = [(1, START + index, frame) for index, frame in enumerate(frames)]
    path = write_database(tmp_path / "x.db3", TOPICS, rows)
    (source,) = open_sources(str(path))
    for _ in range(2):
        assert len(samples_of(source)["/fmu/out/a"]) == 19
    (problem,) = source.problems
    assert problem.topic == "/fmu/out/a"
    assert problem.samples == 1


def test_temporary_files_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    path = compress(write_database(tmp_path / "x.db3", TOPICS, rows_of(30)))
    log = recordings.open(path)
    assert len(log["a"])
    assert os.listdir(tmp_path / "temporary")
    log.close()
    assert not os.listdir(tmp_path / "temporary")
    path.write_bytes(zstandard.compress(b"no recording"))
    with pytest.raises(RecordingError):
        recordings.open(path)
    assert not os.listdir(tmp_path / "temporary")
