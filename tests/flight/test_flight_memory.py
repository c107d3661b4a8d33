"""Tests of the ids that a program leaves for the next one, and whether the vehicle is still in the same boot."""

from __future__ import annotations

import errno
import json
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight import RegistrationError
from msggen.flight.registration import Ids
from msggen.flight.resuming import FRESH, Memory, _is_same_boot

IDS = Ids("Square", 2, 24, 1)
VEHICLE = "udp 8888 0 1"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "msggen" / "flights"


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The monotonic clock, which moves when a test moves it."""
    now = SimpleNamespace(seconds=5000.0)
    monkeypatch.setattr(time, "monotonic", lambda: now.seconds)
    monkeypatch.setattr(time, "monotonic_ns", lambda: int(now.seconds * 1e9))
    return now


def status(seconds: float, armed: int = 0, mode: int = 0) -> Any:
    return SimpleNamespace(timestamp=int(seconds * 1e6), armed_time=armed, nav_state_timestamp=mode)


def left(content: Any, vehicle: str = VEHICLE) -> Memory:
    """Return the memory of a program that has been killed."""
    memory = Memory(vehicle)
    assert memory.claim(IDS.name) is None
    memory.write(IDS, content)
    memory.release(IDS.name)
    return memory


def test_the_next_program_finds_what_one_has_left(clock: Any) -> None:
    left(status(100.0, 5, 6))
    clock.seconds += 3.0
    found = Memory(VEHICLE).claim(IDS.name)
    assert found is not None
    assert (found.ids, found.armed_time, found.mode_time, found.is_over) == (IDS, 5, 6, False)
    assert found.age == pytest.approx(3.0)
    assert found.booted == pytest.approx(4900.0)
    assert Memory("udp 8889 0 1").claim(IDS.name) is None, "another vehicle"
    assert Memory(VEHICLE).claim("Circle") is None


def test_only_a_program_that_left_modes_of_this_vehicle_makes_the_next_one_hurry(clock: Any) -> None:
    memory = left(status(100.0))
    clock.seconds += 1.0
    assert Memory(VEHICLE).is_interrupted(FRESH)
    assert not Memory("udp 8889 0 1").is_interrupted(FRESH), "another vehicle"
    memory.write(IDS, status(101.0), is_over=True)
    assert not Memory(VEHICLE).is_interrupted(FRESH), "it has ended its mode"
    memory.write(IDS, status(102.0))
    clock.seconds += FRESH
    assert not Memory(VEHICLE).is_interrupted(FRESH), "it ended too long ago"


@pytest.mark.parametrize("data", [b"", b"[]", b'{"vehicle": "udp 8888 0 1"}', b'{"vehicle": 1, "is_over": 0}'])
def test_damaged_ids_make_nobody_hurry(data: bytes, folder: Path) -> None:
    memory = left(status(100.0))
    for path in folder.glob("*.json"):
        path.write_bytes(data)
    assert not memory.is_interrupted(math.inf)


def test_a_mode_that_a_program_flies_is_locked() -> None:
    first = Memory(VEHICLE)
    first.claim(IDS.name)
    with pytest.raises(RegistrationError, match=f"process {os.getpid()} flies mode 'Square'"):
        Memory(VEHICLE).claim(IDS.name)
    first.release(IDS.name)
    Memory(VEHICLE).claim(IDS.name)


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.ENOSPC, errno.EMFILE])
def test_a_file_that_cannot_be_read_now_stays_and_its_reason_is_told(
    number: int, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    left(status(100.0))

    def read(path: str, **_: Any) -> bytes:
        raise OSError(number, os.strerror(number), path)

    with monkeypatch.context() as patched:
        patched.setattr("msggen.flight.resuming.read_bytes", read)
        memory = Memory(VEHICLE)
        assert memory.claim(IDS.name) is None
        memory.release(IDS.name)
    (path,) = folder.glob("*.json")
    assert f"of mode 'Square' from an earlier program cannot be read: {path}: " in caplog.text
    assert os.strerror(number) in caplog.text
    assert memory.claim(IDS.name) is not None


@pytest.mark.parametrize("kind", ["pipe", "folder", "link"])
def test_what_is_no_file_is_set_aside(kind: str, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    left(status(100.0))
    (path,) = folder.glob("*.json")
    path.unlink()
    {"pipe": os.mkfifo, "folder": os.mkdir, "link": lambda name: os.symlink("/dev/null", name)}[kind](path)
    assert Memory(VEHICLE).claim(IDS.name) is None
    assert "were damaged and set aside" in caplog.text
    assert not os.path.lexists(path)


@pytest.mark.parametrize("damage", [b"", b"{", b"[]", b'{"version": 2}', b"\xff" * 40, b"[" * 70_000])
def test_a_damaged_file_is_told_and_not_used(damage: bytes, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    left(status(100.0))
    (path,) = folder.glob("*.json")
    path.write_bytes(damage)
    assert Memory(VEHICLE).claim(IDS.name) is None
    assert "were damaged and set aside" in caplog.text
    assert [each.name for each in folder.glob("*") if each.suffix != ".lock"] == [f"{path.stem}.damaged"]
    caplog.clear()
    assert Memory("another").claim(IDS.name) is None
    assert not caplog.text


def test_a_file_of_another_version_is_not_used(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    left(status(100.0))
    (path,) = folder.glob("*.json")
    path.write_text(json.dumps({**json.loads(path.read_text()), "version": 1}))
    assert Memory(VEHICLE).claim(IDS.name) is None
    assert not caplog.text


def test_a_folder_that_cannot_be_used_is_told_once(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.parent.mkdir(parents=True)
    folder.write_text("a file")
    memory = Memory(VEHICLE)
    assert memory.claim(IDS.name) is None
    memory.write(IDS, status(100.0))
    assert len(caplog.records) == 1


@pytest.mark.parametrize(
    ("before", "after", "pause", "is_same"),
    [
        (status(100.0), status(130.0), 30.0, True),
        (status(100.0), status(130.4), 30.0, True),
        (status(100.0), status(20.0), 30.0, False),
        (status(100.0), status(0.5), FRESH - 0.5, True),
        (status(100.0, armed=7), status(130.0, armed=7), 30.0, True),
        (status(100.0, armed=7), status(130.0, armed=8), 30.0, False),
        (status(1.8e9, mode=9), status(1.8e9 + 30, mode=9), 30.0, True),
        (status(1.8e9, mode=9), status(1.8e9 + 30, mode=3), 30.0, False),
        (status(1.8e9), status(1.8e9 + 30), 30.0, False),
    ],
    ids=[
        "boot goes on",
        "a late message",
        "restarted",
        "too soon for a restart",
        "armed since then",
        "armed later",
        "UTC, in the same mode",
        "UTC, in an earlier mode",
        "UTC, nothing known",
    ],
)
def test_a_boot_is_recognized(before: Any, after: Any, pause: float, *, is_same: bool, clock: Any) -> None:
    left(before)
    clock.seconds += pause
    found = Memory(VEHICLE).claim(IDS.name)
    assert found is not None
    assert _is_same_boot(found, after) == is_same
