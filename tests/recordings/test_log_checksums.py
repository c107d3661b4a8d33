"""Tests that damage within chunks, attachments and the summary of MCAP files is never silent."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random
from typing import Any

import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from msggen import recordings
from msggen.recordings.files.mcap import checksums
from support.examples import by_day, examples
from support.scratch import scratch_folder

START = 1_790_000_000_000_000_000
KINDS = (CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE)
COUNT = 200


def write(path: Path, kind: CompressionType, **options: Any) -> Path:
    """Write a file with two topics in several chunks, and an attachment."""
    chance = Random(1)  # noqa: S311 - no secret
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=1500, compression=kind, **options)
        writer.start("ros2")
        schema = writer.register_schema("a/msg/A", "ros2msg", b"uint64 number\nfloat64 value\n")
        channels = [writer.register_channel(name, "cdr", schema) for name in ("/a", "/b")]
        for number in range(COUNT):
            payload = b"\0\1\0\0" + struct.pack("<Qd", number, chance.choice((0.5, chance.random())))
            writer.add_message(channels[number % 2], START + number * 10**7, payload, START)
        writer.add_attachment(START, START, "calibration.yaml", "text/yaml", b"k: 1")
        writer.finish()
    return path


def stored_in(path: Path) -> list[tuple[int, int]]:
    """Return begin and end of what each chunk stores, as the package mcap tells it."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    ends = [each.chunk_start_offset + each.chunk_length for each in summary.chunk_indexes]
    return [(end - each.compressed_size, end) for end, each in zip(ends, summary.chunk_indexes, strict=True)]


def rows_of(path: Path, **options: Any) -> tuple[dict[Any, set[tuple[Any, ...]]], list[recordings.Problem]]:
    """Return the samples of all topics with their times, and the problems."""
    with recordings.open(path, **options) as log:
        loaded = {
            key: {(*row, time) for row, time in zip(each.array.tolist(), each.log_times.tolist(), strict=True)}
            for key, each in log.load().items()
        }
        return loaded, log.problems


def flipped(path: Path, place: int, bit: int = 0) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


@settings(max_examples=examples(150, by_day=10))
@given(st.sampled_from(KINDS), st.randoms(use_true_random=False), st.sampled_from([{}, {"use_statistics": False}]))
def test_a_flipped_bit_in_a_chunk_gives_no_other_values(
    kind: CompressionType, chance: Random, options: dict[str, Any]
) -> None:
    with scratch_folder() as folder:
        path = write(folder / "flight.mcap", kind, **options)
        whole, problems = rows_of(path)
        assert not problems
        begin, end = chance.choice(stored_in(path))
        flipped(path, chance.randrange(begin, end), chance.randrange(8))
        found, problems = rows_of(path)
    assert all(found[key] <= whole[key] for key in whole)
    if found != whole:
        assert "left out" in problems[0].text
        lost = COUNT - sum(map(len, found.values()))
        assert problems[0].samples in ({lost} if not options else {0, lost})  # a chunk can be without its index
        assert len(problems) == 1


@by_day("kind", (CompressionType.LZ4, CompressionType.ZSTD, CompressionType.NONE), 2)
def test_each_way_to_read_a_damaged_chunk(kind: CompressionType, tmp_path: Path) -> None:
    path = write(tmp_path / "flight.mcap", kind)
    whole, _ = rows_of(path)
    begin, end = stored_in(path)[1]
    changed = next(place for place in range(end - 1, begin, -1) if _is_decompressed(path, place))
    found, (problem,) = rows_of(path)
    assert found != whole
    assert "does not match its CRC and is left out, with samples of /a, /b, from 0." in problem.text
    assert problem.offset is not None
    assert problem.offset < changed < problem.offset + problem.size
    assert problem.span is not None
    assert problem.span[0] < problem.span[1]
    kept, (problem,) = rows_of(path, keep_damaged=True)
    assert {key: len(rows) for key, rows in kept.items()} == {key: len(rows) for key, rows in whole.items()}
    assert kept != whole
    assert "does not match its CRC and is read all the same" in problem.text
    assert (problem.size, problem.samples) == (0, 0)
    assert rows_of(path, verify=False) == (kept, [])
    with recordings.open(path, verify=False) as log:
        assert log.verify() == (len(stored_in(path)), 0)
        assert "does not match its CRC and is read all the same" in log.problems[0].text


def _is_decompressed(path: Path, place: int) -> bool:
    """Flip a bit, and return whether it changes only values. Otherwise, flip it back."""
    flipped(path, place)
    _, problems = rows_of(path)
    loaded, unseen = rows_of(path, verify=False)
    if problems and not unseen and sum(map(len, loaded.values())) == COUNT:
        return True
    flipped(path, place)
    return False


def test_every_reading_leaves_a_damaged_chunk_out(tmp_path: Path) -> None:
    path = write(tmp_path / "flight.mcap", CompressionType.NONE)
    begin, end = stored_in(path)[1]
    data = path.read_bytes()
    flipped(path, data.index(b"\0\1\0\0" + struct.pack("<Q", 40), begin, end) + 13)
    with recordings.open(path) as log:
        ways = [
            [row["number"] for each in log.batches(["/a"]) for row in each.array],
            log["/a"]["number"].tolist(),
            [struct.unpack_from("<Q", each.payload, 4)[0] for each in log.payloads(["/a"])],
            log.samples("/a", stop=9).array["number"].tolist(),
        ]
        assert all(way == ways[0] for way in ways)
        assert 40 not in ways[0]
        assert 0 in ways[0]
        assert len(log.problems) == 1
    packed = tmp_path / "flight.mcap.zstd"
    packed.write_bytes(zstandard.compress(path.read_bytes()))
    assert rows_of(packed) == rows_of(path)


def test_a_damaged_attachment_is_left_out_or_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "flight.mcap", CompressionType.NONE)
    flipped(path, path.read_bytes().index(b"k: 1"))
    cases: list[tuple[dict[str, Any], int, str]] = [
        ({}, 0, "an attachment does not match its CRC and is left out"),
        ({"keep_damaged": True}, 1, "an attachment does not match its CRC"),
        ({"verify": False}, 1, ""),
    ]
    for options, count, text in cases:
        with recordings.open(path, **options) as log:
            assert len(list(log.attached())) == count
            assert [each.text for each in log.problems] == ([text] if text else [])


def test_a_damaged_summary_is_not_used(tmp_path: Path) -> None:
    """A bit in the log time of a chunk index would hide its samples from a reading between two times."""
    path = write(tmp_path / "flight.mcap", CompressionType.ZSTD)
    whole, _ = rows_of(path)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    index = summary.chunk_indexes[2]
    times = struct.pack("<QQQ", index.message_start_time, index.message_end_time, index.chunk_start_offset)
    flipped(path, path.read_bytes().rindex(times) + 8, 4)
    found, problems = rows_of(path)
    assert found == whole
    assert ["the summary at the end is damaged" in each.text for each in problems] == [True]
    assert rows_of(path, verify=False) == (whole, [])


@pytest.mark.parametrize("kind", KINDS)
def test_verify_compares_what_no_chunk_has(kind: CompressionType, tmp_path: Path) -> None:
    """The data section as a whole, and the summary, also if reading does not compare them."""
    path = write(tmp_path / "flight.mcap", kind, enable_data_crcs=True)
    data = path.read_bytes()
    with recordings.open(path) as log:
        assert log.verify().missing == 0
        assert log.problems == []
    flipped(path, data.index(b"ros2"))  # in the header, which nothing else covers
    with recordings.open(path) as log:
        log.load()
        assert log.problems == []
        log.verify()
        assert [each.text for each in log.problems] == ["the data section does not match its CRC"]
    path.write_bytes(data)
    flipped(path, data.rindex(b"uint64 number"))  # of the schema in the summary
    with recordings.open(path, verify=False) as log:
        log.load()
        before = log.problems
        log.verify()
        assert [each.text for each in log.problems if each not in before] == [
            "the summary at the end does not match its CRC"
        ]


def test_a_data_section_without_the_magic_bytes_in_its_checksum_is_right(tmp_path: Path) -> None:
    """The specification has them outside of the section, and most programs count them."""
    path = write(tmp_path / "flight.mcap", CompressionType.NONE, enable_data_crcs=True)
    data = bytearray(path.read_bytes())
    (start_of_summary,) = struct.unpack_from("<Q", data, len(data) - 8 - 20)
    end = start_of_summary - 13
    assert data[end] == 15
    assert struct.unpack_from("<I", data, end + 9)[0] == checksums.crc32(data[:end])
    struct.pack_into("<I", data, end + 9, checksums.crc32(data[8:end]))
    path.write_bytes(data)
    with recordings.open(path) as log:
        log.verify()
        assert log.problems == []


@pytest.mark.parametrize("size", [0, 1, 63, 5000, 1 << 20])
def test_the_fast_function_is_that_of_zlib(size: int) -> None:
    import zlib

    data = Random(size).randbytes(size)  # noqa: S311 - no secret
    assert checksums.crc32(data) == zlib.crc32(data) == checksums.crc32(data[7:], checksums.crc32(data[:7]))
