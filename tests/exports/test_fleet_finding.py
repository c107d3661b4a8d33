"""Tests of what a fleet finds below a folder."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.exports.fleet import finding, update
from msggen.exports.fleet.finding import Found, digest_of, find_recordings, state_of
from support.fleet_recordings import write_flight, write_folder
from support.scratch import deep_folder
from support.ulog import write_ulog


@pytest.fixture
def logs(tmp_path: Path, px4_types: Any) -> Path:
    return write_folder(tmp_path / "logs", px4_types)


def test_recordings_below_a_folder(tmp_path: Path) -> None:
    names = ["x/a.ulg", "x/y/B.MCAP", "x/c.db3", "c.mcap.zstd", "notes.txt", ".hidden.ulg", "bag/metadata.yaml",
             "bag/bag_0.db3", "bag/bag_1.db3", "fleet/old.mcap", "only/metadata.yaml"]  # fmt: skip
    for name in names:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    found = find_recordings(str(tmp_path), without=str(tmp_path / "fleet"))
    relative = [os.path.relpath(each.path, tmp_path).replace(os.sep, "/") for each in found]
    assert relative == ["bag", "c.mcap.zstd", "x/a.ulg", "x/c.db3", "x/y/B.MCAP"]
    bag = str(tmp_path / "bag")
    assert list(find_recordings(bag)) == [Found(bag)]
    before, digest = state_of(bag), digest_of(bag)
    (tmp_path / "bag" / "bag_1.db3").write_text("longer than before")
    assert state_of(bag).size > before.size
    assert digest_of(bag) != digest


def test_ulogs_in_a_folder_of_rosbag2_are_recordings_of_their_own(tmp_path: Path, px4_types: Any) -> None:
    bag = tmp_path / "logs" / "flight"
    (bag / "below").mkdir(parents=True)
    write_flight(bag / "flight_0.mcap", px4_types, 0)
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    for path in (bag / "beside.ulg", bag / "below" / "further.ulg"):
        write_ulog(path)
    found = [Found(str(path)) for path in (bag, bag / "below" / "further.ulg", bag / "beside.ulg")]
    assert list(find_recordings(str(tmp_path))) == found
    before = state_of(str(bag)), digest_of(str(bag))
    (bag / "beside.ulg").write_bytes(b"another one")
    assert (state_of(str(bag)), digest_of(str(bag))) == before


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights")
def test_what_cannot_be_read_is_reported(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "rosbag2_bagfile_information:\n  version: 8\n  relative_file_paths: [none_0.mcap]\n"
    (logs / "none").mkdir()
    (logs / "none" / "metadata.yaml").write_text(text)
    (logs / "other").mkdir()
    (logs / "other" / "metadata.yaml").write_text("title: a data set of another program\n")
    (logs / "private" / "below").mkdir(parents=True)
    (logs / "link.ulg").symlink_to(logs / "missing.ulg")
    (logs / "round.ulg").symlink_to(logs / "round.ulg")
    (logs / "notes.txt").symlink_to(logs / "missing.txt")
    listed = os.listdir

    def refuse(path: str) -> list[str]:
        if path.endswith("private"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return listed(path)

    def digest(path: str) -> str:
        if path.endswith("x.mcap"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return digest_of(path)

    monkeypatch.setattr("os.listdir", refuse)
    monkeypatch.setattr("msggen.exports.fleet.batch.digest_of", digest)
    for _ in range(2):
        summary = update(str(logs), str(tmp_path / "fleet"))
        assert [(os.path.relpath(each.path, logs), each.error.partition(": ")[2][:40]) for each in summary.failed] == [
            (os.path.join("b", "2024-05-06_x.mcap"), "Permission denied"),
            ("link.ulg", "this is a link to a missing file"),
            ("none", "none_0.mcap, which metadata.yaml names, "),
            ("private", "Permission denied"),
            ("round.ulg", os.strerror(errno.ELOOP)),
        ]
        assert (summary.found, len(summary.records)) == (7, 2)
    with pytest.raises(PermissionError):
        update(str(logs / "private"), str(tmp_path / "fleet"))


def test_a_bag_of_a_recorder_that_was_killed_is_one_recording(tmp_path: Path, px4_types: Any) -> None:
    bag, other = tmp_path / "logs" / "flight", tmp_path / "logs" / "others"
    for folder in (bag, other):
        folder.mkdir(parents=True)
        for number in range(2):
            write_flight(folder / f"flight_{number}.mcap", px4_types, len(folder.name) + number)
    assert list(find_recordings(str(tmp_path))) == [
        Found(str(path)) for path in (bag, other / "flight_0.mcap", other / "flight_1.mcap")
    ]
    summary = update(str(tmp_path / "logs"), str(tmp_path / "fleet"))
    assert sorted(record.samples for record in summary.records) == [100, 100, 200]


@pytest.mark.skipif(sys.platform == "win32", reason="paths are not as long")
def test_recordings_in_deep_folders_are_found(tmp_path: Path) -> None:
    depth = sys.getrecursionlimit()
    recording = Path(str(tmp_path) + f"{os.sep}a" * depth, "x.ulg")
    with deep_folder(tmp_path, depth):
        recording.write_bytes(b"")
        assert list(find_recordings(str(tmp_path))) == [Found(str(recording))]


@pytest.mark.skipif(sys.platform == "win32", reason="the disk allows no such path")
def test_a_folder_whose_path_is_too_long_is_reported(tmp_path: Path) -> None:
    (tmp_path / "x.ulg").write_bytes(b"")
    with deep_folder(tmp_path, 40, "a" * 200):
        too_long, last = find_recordings(str(tmp_path))
    assert len(too_long.path) >= os.pathconf(tmp_path, "PC_PATH_MAX")
    assert too_long.error == f"cannot be read: {os.strerror(errno.ENAMETOOLONG)}"
    assert last == Found(str(tmp_path / "x.ulg"))


def test_a_folder_that_contains_itself_is_searched_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As junctions of Windows and mounts do. A test cannot make these without rights."""
    names = ["x.ulg", "y/loop/x.ulg", "y/z.ulg"]
    for name in names:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    identity = finding._identity
    top = str(tmp_path)
    monkeypatch.setattr(finding, "_identity", lambda path: identity(top if path.endswith("loop") else path))
    assert [os.path.relpath(each.path, top) for each in find_recordings(top)] == ["x.ulg", os.path.join("y", "z.ulg")]
