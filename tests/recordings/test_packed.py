"""Tests of compressed files: gzip, xz, bzip2 and zstd, whole, cut off, damaged, and much larger than they look."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from msggen import recordings
from msggen.exports.fleet.finding import find_recordings
from msggen.recordings.files.compression import CompressionError, Room, decompress_file
from support.examples import examples
from support.fleet_recordings import write_flight
from support.ulog import write_ulog

COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "zst": zstandard.compress,
    "gz": gzip.compress,
    "xz": lzma.compress,
    "bz2": bz2.compress,
}
"""What compresses, by suffix."""
PADDED = ("gz", "xz", "bz2")
"""The kinds with zeros between their members."""


def unpacked(path: Path, data: bytes) -> tuple[bytes, str]:
    """Return the content of a compressed file, and what is wrong with it."""
    path.write_bytes(data)
    problem = decompress_file(str(path), f"{path}.out", Room(len(data)))
    return Path(f"{path}.out").read_bytes(), problem


@pytest.mark.parametrize("kind", COMPRESS)
@given(parts=st.lists(st.binary(max_size=300), min_size=1, max_size=4), padding=st.sampled_from([0, 4, 512]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(40, by_day=8))
def test_members_follow_each_other(kind: str, parts: list[bytes], padding: int, tmp_path: Path) -> None:
    zeros = bytes(padding if kind in PADDED else 0)
    data = b"".join(COMPRESS[kind](part) + zeros for part in parts)
    assert unpacked(tmp_path / "x", data) == (b"".join(parts), "")


@pytest.mark.parametrize("step", [1, 7, 100_000])
@pytest.mark.parametrize("kind", COMPRESS)
def test_the_size_of_a_piece_does_not_matter(
    kind: str, step: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance = Random(1)  # noqa: S311 - no secret
    content = chance.randbytes(2000) + bytes(20_000) + chance.randbytes(50)
    monkeypatch.setattr("msggen.recordings.files.compression._FILE_STEP", step)
    assert unpacked(tmp_path / "x", COMPRESS[kind](content)) == (content, "")


@pytest.mark.parametrize("kind", COMPRESS)
def test_what_is_whole_of_a_file_that_is_cut_off_is_there(kind: str, tmp_path: Path) -> None:
    content = Random(2).randbytes(400_000)  # noqa: S311
    data = COMPRESS[kind](content)
    kept = 0
    for size in (len(data) - 1, len(data) * 3 // 4):
        try:
            found, problem = unpacked(tmp_path / "x", data[:size])
        except CompressionError:  # a single block, which needs its end
            continue
        assert problem
        assert content.startswith(found)
        kept += len(found)
    assert kept or kind == "bz2"
    with pytest.raises(CompressionError):
        unpacked(tmp_path / "x", data[:8])


@pytest.mark.parametrize("kind", COMPRESS)
def test_damage_is_told(kind: str, tmp_path: Path) -> None:
    chance = Random(3)  # noqa: S311
    content = bytes(chance.choices(range(9), k=3000))
    data = COMPRESS[kind](content)
    for _ in range(200):
        place = chance.randrange(8, len(data))
        damaged = bytearray(data)
        damaged[place] ^= 1 << chance.randrange(8)
        try:
            found, problem = unpacked(tmp_path / "x", bytes(damaged))
        except CompressionError:
            continue
        # zstandard writes no checksum by default; the others have one, and gzip's header has bytes without a meaning
        assert problem or found == content or kind == "zst"


@pytest.mark.parametrize("kind", ["gz", "xz", "zst"])
def test_what_is_before_the_damage_is_there(kind: str, tmp_path: Path) -> None:
    content = bytes(Random(4).choices(range(9), k=400_000))  # noqa: S311
    data = bytearray(COMPRESS[kind](content))
    data[len(data) * 9 // 10] ^= 1
    found, problem = unpacked(tmp_path / "x", bytes(data))
    assert problem or kind == "zst"
    assert found[:250_000] == content[:250_000]


@pytest.mark.parametrize("kind", PADDED)
def test_bytes_behind_the_content_are_told(kind: str, tmp_path: Path) -> None:
    found, problem = unpacked(tmp_path / "x", COMPRESS[kind](b"content") + b"behind it")
    assert found == b"content"
    assert problem


@pytest.mark.parametrize("kind", COMPRESS)
def test_a_content_that_is_too_large_is_refused(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.recordings.files.compression._LEAST_LIMIT", 1 << 20)
    data = COMPRESS[kind](bytes(12 << 20))
    with pytest.raises(CompressionError, match=r"more than \d+ bytes .*; MSGGEN_MAX_CONTENT sets"):
        unpacked(tmp_path / "x", data)
    assert (tmp_path / "x.out").stat().st_size <= max(1 << 20, 100 * len(data))
    path = tmp_path / f"x.ulg.{kind}"
    path.write_bytes(data)
    with pytest.raises(recordings.RecordingError, match=rf"x\.ulg\.{kind} cannot be decompressed"):
        recordings.open(path)


def test_xz_does_not_take_the_memory_that_a_file_asks_for(tmp_path: Path) -> None:
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 0, "dict_size": 1 << 20}]
    data = lzma.compress(bytes(100), filters=filters).replace(b"\x21\x01\x10", b"\x21\x01\x27", 1)
    head = bytearray(data)  # the checksum of the header of the block, behind its length
    size = (head[12] + 1) * 4
    head[12 + size - 4 : 12 + size] = zlib.crc32(bytes(head[12 : 12 + size - 4])).to_bytes(4, "little")
    with pytest.raises(CompressionError, match="Memory usage limit"):
        unpacked(tmp_path / "x", bytes(head))


@pytest.mark.parametrize("kind", COMPRESS)
def test_contents_tell_how_a_file_is_compressed_and_not_its_name(kind: str, tmp_path: Path) -> None:
    plain = write_ulog(tmp_path / "flight.ulg")
    path = tmp_path / "flight.bin"
    path.write_bytes(COMPRESS[kind](plain.read_bytes()))
    with recordings.open(plain) as one, recordings.open(path) as other:
        assert one.keys() == other.keys()
        assert all(one[key].tobytes() == other[key].tobytes() for key in one)


@pytest.mark.parametrize("kind", COMPRESS)
def test_fleets_find_compressed_recordings(kind: str, tmp_path: Path, px4_types: Any) -> None:
    plain = tmp_path / "plain.mcap"
    write_flight(plain, px4_types, 1)
    folder = tmp_path / "logs"
    folder.mkdir()
    path = folder / f"FLIGHT.mcap.{kind}"
    path.write_bytes(COMPRESS[kind](plain.read_bytes()))
    (folder / f"notes.txt.{kind}").write_bytes(COMPRESS[kind](b"notes"))
    assert [each.path for each in find_recordings(str(folder))] == [str(path)]
