"""Tests of recordings that are not files: file objects of all kinds, and stdin."""

from __future__ import annotations

import gzip
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import pytest

from msggen import recordings
from msggen.recordings import RecordingError
from support.commands import run
from support.databases import Stored, write_database
from support.flights import write_flight
from support.recordings import START
from support.repository import ROOT
from support.ulog import write_ulog

FORMATS = ("ulog", "mcap", "db3")


class Pipe(io.RawIOBase):
    """A stream that cannot seek, and gives few bytes at a time."""

    def __init__(self, data: bytes, step: int = 7) -> None:
        self._data, self._step = io.BytesIO(data), step

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        data = self._data.read(min(len(buffer), self._step))
        buffer[: len(data)] = data
        return len(data)


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files, which is empty."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture(params=FORMATS)
def path(request: pytest.FixtureRequest, tmp_path: Path, px4_types: Any) -> Path:
    if request.param == "ulog":
        return write_ulog(tmp_path / "flight.ulg")
    if request.param == "mcap":
        return write_flight(tmp_path / "flight.mcap", px4_types, 20)
    topic = Stored(1, "/wind", "px4_msgs/msg/Wind", "float32 speed\n")
    return write_database(tmp_path / "flight.db3", [topic], [(1, START, b"\0\1\0\0\0\0\x80?")])


def zipped(data: bytes, folder: Path) -> IO[bytes]:
    with zipfile.ZipFile(folder / "x.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("flight", data)
    return zipfile.ZipFile(folder / "x.zip").open("flight")


OBJECTS: dict[str, Callable[[bytes, Path], Any]] = {
    "bytes": lambda data, _: io.BytesIO(data),
    "pipe": lambda data, _: Pipe(data),
    "buffered pipe": lambda data, _: io.BufferedReader(Pipe(data)),
    "zip": zipped,
    "compressed": lambda data, _: io.BytesIO(gzip.compress(data)),
    "compressed pipe": lambda data, _: Pipe(gzip.compress(data), 1000),
}


@pytest.mark.parametrize("kind", OBJECTS)
def test_every_file_object_is_read_as_its_file(kind: str, path: Path, temporary: Path) -> None:
    file = OBJECTS[kind](path.read_bytes(), temporary.parent)
    with recordings.open(path) as expected, recordings.open(file) as log:
        assert (log.kind, log.keys(), log.start, log.end) == (
            expected.kind,
            expected.keys(),
            expected.start,
            expected.end,
        )
        assert set(log.load()) == set(expected.load())
        for key, samples in expected.load().items():
            assert repr(log[key].tolist()) == repr(samples.array.tolist())
        assert os.listdir(temporary)
    assert os.listdir(temporary) == []
    assert not file.closed


def test_a_file_that_was_just_opened_is_not_copied(path: Path, temporary: Path) -> None:
    for buffering in (-1, 0):
        with open(path, "rb", buffering) as file, recordings.open(file) as log:
            assert os.listdir(temporary) == []
            assert log.path == str(path)
            assert log.load()


def test_the_rest_of_a_file_is_read(path: Path, temporary: Path) -> None:
    behind = path.with_name("behind")
    behind.write_bytes(b"front" + path.read_bytes())
    with open(behind, "rb") as file:
        file.seek(5)
        with recordings.open(file) as log, recordings.open(path) as expected:
            assert log.keys() == expected.keys()
            assert os.listdir(temporary)
    with open(behind, "rb") as file, pytest.raises(RecordingError, match=r"behind is not a recording"):
        recordings.open(file)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "<stream> is empty"),
        (b"x", "<stream> is not a recording"),
        (b"no recording" * 100_000, "<stream> is not a recording"),
        (b"PAR1", "<stream> is a table in Parquet"),
        (gzip.compress(b"no recording", mtime=0), "<stream> is not a recording"),
        (gzip.compress(b"", mtime=0)[:7], "<stream> cannot be decompressed"),
    ],
)
def test_other_content_is_refused_without_reading_all(data: bytes, expected: str, temporary: Path) -> None:
    file = io.BytesIO(data)
    with pytest.raises(RecordingError, match=expected):
        recordings.open(file)
    assert file.tell() <= 2 << 20
    assert os.listdir(temporary) == []


def test_a_stream_without_end_has_a_limit(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Endless(io.RawIOBase):
        def read(self, size: int = -1) -> bytes:
            return (b"ULog\x01\x12\x35" + bytes(1 << 20))[:size]

    monkeypatch.setenv("MSGGEN_MAX_CONTENT", "5000000")
    with pytest.raises(RecordingError, match="has more than 5000000 bytes; MSGGEN_MAX_CONTENT sets another"):
        recordings.open(Endless())
    assert os.listdir(temporary) == []


def test_text_and_nothing_yet_are_errors(temporary: Path) -> None:
    with pytest.raises(TypeError, match="expected a file in binary mode, whose read"):
        recordings.open(io.StringIO("text"))  # type: ignore[arg-type]
    path = write_ulog(temporary.parent / "flight.ulg")
    with path.open(encoding="utf-8") as file, pytest.raises(TypeError, match=r"flight\.ulg: expected a file in binary"):
        recordings.open(file)  # type: ignore[arg-type]

    class NoneYet(io.RawIOBase):
        def read(self, size: int = -1) -> None:
            del size

    with pytest.raises(BlockingIOError):
        recordings.open(NoneYet())
    with pytest.raises(TypeError):
        recordings.open(7)  # type: ignore[arg-type]
    assert os.listdir(temporary) == []


# --- stdin


def piped(words: list[str], data: bytes, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run `msggen log` with a recording on stdin, and a folder of its own for temporary files, which stays empty."""
    own = folder / "own"
    own.mkdir(exist_ok=True)
    found = subprocess.run(
        [sys.executable, "-m", "msggen", "log", *words],
        input=data,
        capture_output=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(own)},
        check=False,
        timeout=120,
    )
    assert os.listdir(own) == []
    return subprocess.CompletedProcess(words, found.returncode, found.stdout.decode(), found.stderr.decode())


@pytest.mark.skipif(os.name == "nt", reason="needs TMPDIR")
def test_commands_read_stdin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = write_ulog(tmp_path / "flight.ulg").read_bytes()
    own = run(["log", "show", str(tmp_path / "flight.ulg"), "sensor_gps", "-n", "2"])
    assert piped(["show", "-", "sensor_gps", "-n", "2"], data, tmp_path).stdout == own.stdout
    assert piped(["show", "-", "sensor_gps", "-n", "2"], gzip.compress(data), tmp_path).stdout == own.stdout
    info = piped(["info", "-"], data, tmp_path).stdout.splitlines()
    assert info[0].startswith("file        <stdin>, ULog, ")
    assert info[1:] == run(["log", "info", str(tmp_path / "flight.ulg")]).stdout.splitlines()[1:]
    code = piped(["convert", "-", "-o", "a.mcap"], data, tmp_path).returncode
    assert code == run(["log", "convert", str(tmp_path / "flight.ulg"), "-o", str(tmp_path / "b.mcap")]).code
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    for words in (["convert", "-"], ["repair", "-"], ["report", "-"], ["cut", "-", "--stop", "1"]):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        refused = run(["log", *words])
        assert refused.code == 2
        assert "argument -o/--output: needed, because a recording from stdin has no name" in refused.stderr
    done = piped(["info", "-"], b"no recording", tmp_path)
    assert (done.returncode, done.stderr.splitlines()[0]) == (
        2,
        "-: R102 is not a recording: expected an MCAP file, a ULog or a database of rosbag2",
    )


@pytest.mark.skipif(os.name == "nt", reason="needs SIGINT and TMPDIR")
def test_an_interrupt_removes_the_copy(tmp_path: Path) -> None:
    data = write_ulog(tmp_path / "flight.ulg").read_bytes()
    own = tmp_path / "own"
    own.mkdir()
    command = [sys.executable, "-m", "msggen", "log", "info", "-"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(own)}
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, env=environment
    ) as process:
        assert process.stdin is not None
        process.stdin.write(data)
        process.stdin.flush()
        while not [*own.rglob("recording")]:  # the copy has begun, and waits for the rest
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"interrupted" in told
    assert os.listdir(own) == []
