"""Tests that recordings of many files can be read with few descriptors, and files that change while they are open."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from msggen import recordings
from msggen.recordings.files.mapped import MappedFile
from msggen.recordings.source.source import RecordingError
from support.databases import Stored, write_database
from support.log_files import Written, write_log
from support.ulog import UlogWriter

DEFINITION = "uint64 timestamp\nuint32 number\n"
on_unix = pytest.mark.skipif(sys.platform == "win32", reason="Windows does not let files change that are mapped")
COUNT = 20
"""The samples of a file."""


def payload(number: int) -> bytes:
    return b"\0\1\0\0" + struct.pack("<QI", number, number)


def write_mcap(path: Path, first: int = 0) -> Path:
    rows = [(number, number, payload(number)) for number in range(first, first + COUNT)]
    return write_log(path.with_suffix(".mcap"), [Written("/a", "demo/msg/Demo", DEFINITION, rows)])


def write_db3(path: Path, first: int = 0) -> Path:
    rows = [(1, number, payload(number)) for number in range(first, first + COUNT)]
    topics = [Stored(1, "/a", "demo/msg/Demo", DEFINITION)]
    return write_database(path.with_suffix(".db3"), topics, rows, page_size=512)


def write_ulog(path: Path, first: int = 0) -> Path:
    writer = UlogWriter()
    writer.format("a", "uint64_t timestamp;uint32_t number")
    writer.subscribe(0, "a")
    for number in range(first, first + COUNT):
        writer.sample(0, struct.pack("<QI", number, number))
    return Path(writer.write(path.with_suffix(".ulg")))


WRITERS = (write_mcap, write_db3, write_ulog)


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lists descriptors")
@pytest.mark.parametrize("write", WRITERS[:2])
def test_a_recording_of_many_files_needs_few_descriptors(
    write: Callable[[Path, int], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("msggen.recordings.files.mapped._MOST", 3)
    files, folder = 12, tmp_path / "flight"
    folder.mkdir()
    for number in range(files):
        write(folder / f"flight_{number}", number * COUNT)
    before = descriptors()
    with recordings.open(folder) as log:
        assert descriptors() <= before + 3
        for _ in range(2):
            assert log["a"]["number"].tolist() == list(range(files * COUNT))
            assert [sample.time for sample in log.payloads()] == list(range(files * COUNT))
            assert log.topic("a").first == 0
            assert descriptors() <= before + 3
        # a file of which a part is in use is not mapped again in the middle of it
        assert sum(len(part.starts) for _, part in log.undecoded()) == files * COUNT
        start, stop = (5 * COUNT) / 1e9, (6 * COUNT) / 1e9
        assert log.samples("a", start=start, stop=stop).array["number"].tolist() == list(range(5 * COUNT, 6 * COUNT))
    assert descriptors() <= before


@on_unix
@pytest.mark.parametrize("write", WRITERS)
def test_a_file_that_is_cut_off_while_it_is_open_is_an_error(write: Callable[[Path], Path], tmp_path: Path) -> None:
    path = write(tmp_path / "flight")
    with recordings.open(path) as log:
        assert len(log["a"]) == COUNT
        # not more than a page: what is behind the end can be read as zeros
        os.truncate(path, path.stat().st_size - 100)
        with pytest.raises(RecordingError, match="was cut off while it was open"):
            log.load()


@on_unix
@pytest.mark.parametrize("write", WRITERS)
def test_a_file_that_grows_is_read_as_it_was(write: Callable[[Path], Path], tmp_path: Path) -> None:
    path = write(tmp_path / "flight")
    with recordings.open(path) as log, path.open("ab") as file:
        file.write(b"\0" * 5000)
        file.flush()
        assert len(log["a"]) == COUNT


@on_unix
def test_a_file_is_mapped_again_only_if_it_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.recordings.files.mapped._MOST", 1)
    path, other = tmp_path / "a", tmp_path / "b"
    path.write_bytes(b"12345678")
    other.write_bytes(b"abcdefgh")
    monkeypatch.chdir(tmp_path)
    file, second = MappedFile("a"), MappedFile("b")
    monkeypatch.chdir("/")
    octets = file.octets
    assert bytes(second.octets) == b"abcdefgh"
    assert bytes(octets) == b"12345678"  # the map that was given up is there as long as it is used
    assert file.octets is not octets
    file.check()
    second.map  # noqa: B018 - it replaces the other map
    path.write_bytes(b"123456789")  # longer
    assert bytes(file.octets) == b"12345678"
    second.map  # noqa: B018
    path.write_bytes(b"1")
    with pytest.raises(RecordingError, match=r"^a was cut off while it was open"):
        file.map  # noqa: B018
    path.unlink()
    with pytest.raises(FileNotFoundError):
        file.map  # noqa: B018
    (tmp_path / "c").write_bytes(b"x" * 8)
    os.utime(tmp_path / "c", ns=(5, 5))
    other.replace(tmp_path / "d")
    (tmp_path / "c").rename(other)
    file = MappedFile(str(tmp_path / "d"))
    file.map  # noqa: B018
    with pytest.raises(RecordingError, match=r"^b was replaced while it was open"):
        second.map  # noqa: B018
    file.close()
    file.close()
    with pytest.raises(RecordingError, match="is closed"):
        file.check()
