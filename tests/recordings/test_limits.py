"""Tests of small recordings that stand for a lot: nested definitions, long arrays, many values."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from random import Random

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter

from fuzz.runner import limited
from msggen.definitions.nesting import MAX_TOTAL, MAX_VALUES
from msggen.exports.convert import tables
from msggen.exports.convert.selection import Selection
from msggen.recordings.decode.decoder import Decoder
from msggen.recordings.decode.layouts import layout_of
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.files import compression, frames
from msggen.recordings.files.compression import CompressionError
from msggen.recordings.files.mcap import reader as mcap
from msggen.recordings.files.mcap.records import Chunk
from msggen.recordings.log import opening
from msggen.recordings.source.source import Channel, RecordingError, SchemaError
from support.commands import run
from support.databases import Stored, write_database
from support.examples import by_day
from support.recordings import START
from support.ulog import UlogWriter

SEPARATOR = "=" * 80
ALL = Selection(None, None, None, None)


def nested(count: int, array: str = "", fields: int = 1, last: str = "uint8 x\n") -> str:
    """Return a definition of `count` messages, each of which nests the next one in some fields."""

    def body(number: int) -> str:
        if number == count - 1:
            return last
        return "".join(f"T{number + 1}{array} f{field}\n" for field in range(fields))

    others = (f"{SEPARATOR}\nMSG: mine/T{number}\n{body(number)}" for number in range(1, count))
    return body(0) + "".join(others)


def write_mcap(path: Path, definitions: Sequence[str], payload: bytes = b"", name: str = "M") -> Path:
    """Write a file with a topic for each definition. Each has a sample if there is a payload."""
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        for number, text in enumerate(definitions):
            schema = writer.register_schema(f"mine/msg/{name}{number}", "ros2msg", text.encode())
            channel = writer.register_channel(f"/t{number}", "cdr", schema)
            if payload:
                writer.add_message(channel, 1000, payload, 1000)
        writer.finish()
    return path


TOO_LARGE = {
    "each nests two": (nested(40, fields=2), "'T0' has 549755813888 bytes, msggen accepts up to 16777216"),
    "arrays": (nested(8, "[64]"), "'T0' has 4398046511104 bytes"),
    "arrays of empty messages": (nested(3, "[4096]", last=""), "'T0' has 16777216 values, msggen accepts up to 65535"),
    "bools": ("bool[65536] x\n", "'T0' has 65536 values"),
    "a chain": (nested(3000), "'T0' nests messages more than 64 levels deep"),
    "itself": ("T0 x\n", "messages nest each other: T0 > T0"),
    "each other": (nested(3, last="T0 x\n"), "messages nest each other: T0 > T1 > T2 > T0"),
}


@pytest.mark.parametrize(("text", "error"), TOO_LARGE.values(), ids=TOO_LARGE)
def test_a_definition_has_the_limits_of_those_of_a_firmware(text: str, error: str, tmp_path: Path) -> None:
    with limited(), pytest.raises(SchemaError) as raised:
        read_schema("mine/msg/T0", text)
    assert str(raised.value).startswith(error)
    path = write_mcap(tmp_path / "a.mcap", [text], b"\0\1\0\0\0", "T")
    with limited():
        assert run(["log", "info", str(path)]).code == 0
        with opening.open(path) as log:
            assert log.load() == {}
            assert [problem.text.startswith(f"/t0 is not decoded: {error}") for problem in log.problems] == [True]


WITHIN = {
    "a chain": nested(64),
    "each nests two": nested(16, fields=2),
    "bools": "bool[65535] x\n",
    "arrays": nested(4, "[40]"),
}


@by_day("text", WITHIN.values(), 2, ids=WITHIN)
def test_definitions_within_the_limits_are_read(text: str) -> None:
    with limited():
        found = layout_of("mine/msg/T0", text)
    assert found is not None
    assert found.positions.size == found.size - 4


@pytest.mark.night  # large files, for a bound of memory
def test_a_long_array_takes_no_memory_before_there_are_samples(tmp_path: Path) -> None:
    size = 1 << 23
    text = f"uint8 first\nfloat32[{size // 4}] x\n"
    many = [text.replace("x", f"x{number}") for number in range(100)]
    path = write_mcap(tmp_path / "a.mcap", many, b"\0\7\0\0\0")
    with limited(), opening.open(path) as log:
        assert not any(map(len, log.load().values()))
    values = np.arange(size // 4, dtype=np.float32)
    for order, code in ((b"\0\1", "<f4"), (b"\0\0", ">f4")):
        payload = order + b"\0\0\5\0\0\0" + values.astype(code).tobytes()
        with opening.open(write_mcap(tmp_path / "b.mcap", [text], payload)) as log:
            np.testing.assert_array_equal(log["/t0"]["x"][0], values)
            with pytest.raises(RecordingError, match="2097153 columns, up to 131070 can be made"):
                log.columns("/t0")


def test_a_topic_with_too_many_columns_is_left_out_of_tables(tmp_path: Path) -> None:
    wide = f"uint8[{MAX_TOTAL}] x\n"
    path = write_mcap(tmp_path / "a.mcap", [wide, "uint8 x\n"], b"\0\1\0\0" + bytes(MAX_TOTAL))
    with opening.open(write_mcap(path, ["uint8 x\n", wide], b"\0\1\0\0\5")) as log:
        made = tables.write_tables(log, str(tmp_path / "made"), tables.Format("parquet"), ALL, lambda _: None)
    assert (len(made.files), made.rows) == (1, 1)
    (problem,) = made.problems
    assert (problem.topic, problem.samples) == ("/t1", 1)
    assert problem.text == "/t1 is left out: 131070 columns, tables have up to 131070 together"


@pytest.mark.night  # a bound of memory
def test_a_wide_table_in_csv_takes_little_memory(tmp_path: Path) -> None:
    count = 65_000
    path = write_mcap(tmp_path / "a.mcap", [f"uint8[{count}] x\n"], b"\0\1\0\0" + bytes(count))
    with limited(1 << 28), opening.open(path) as log:
        made = tables.write_tables(log, str(tmp_path / "made"), tables.Format("csv"), ALL, lambda _: None)
    (written,) = made.files
    head, row = Path(written).read_text(encoding="utf-8").splitlines()
    assert head.count(",") == row.count(",") == count + 1


def test_all_definitions_of_a_recording_have_a_limit_together(tmp_path: Path) -> None:
    many = [nested(3, "[240]").replace(" x", f" x{number}") for number in range(6)]
    path = write_mcap(tmp_path / "a.mcap", many)
    with limited(), opening.open(path) as log:
        assert len(log.chosen(None)) == MAX_TOTAL // 240**2 == 2
        left_out = [problem for problem in log.problems if "left out" in problem.text]
        assert len(left_out) == 4
        assert left_out[0].text == "a definition is left out: all have more than 131070 values together"
        assert left_out[0].topic == "/t2"


def test_channels_share_the_text_of_their_definition(tmp_path: Path) -> None:
    text = "".join(f"uint8 x{number}\n" for number in range(2000))
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("mine/msg/T0", "ros2msg", text.encode())
        for number in range(100):
            writer.register_channel(f"/t{number}", "cdr", schema)
        writer.finish()
    with opening.open(path) as log:
        assert len({id(topic.definition) for topic in log.topics}) == 1


def test_bools_are_found_in_linear_time() -> None:
    with limited():
        decoder = Decoder(Channel(0, "/a", "mine/msg/T0", f"bool[{MAX_VALUES}] x\n"))
    assert decoder.layout is not None
    places = [
        bools.offset + place for bools in decoder.layout.bools for place in np.flatnonzero(bools.largest == 1).tolist()
    ]
    assert places == list(range(4, 4 + MAX_VALUES))


@pytest.mark.night  # by day, the definitions of an MCAP file have a limit together
def test_the_formats_of_a_ulog_have_a_limit_together(tmp_path: Path) -> None:
    writer = UlogWriter()
    for number in range(40):
        writer.format(f"topic_{number}", "uint64_t timestamp;bool[60000] x")
    for number in range(40):
        writer.subscribe(number, f"topic_{number}")
    with limited(), opening.open(writer.write(tmp_path / "a.ulg")) as log:
        assert len(log.topics) == (2 << 20) // 60050


def record(opcode: int, content: bytes) -> bytes:
    """Return a record of MCAP."""
    return struct.pack("<BQ", opcode, len(content)) + content


def chunks_of(path: Path, data: bytes, size: int, kind: str, count: int) -> Path:
    """Write a file with chunks that have a size without their compression, behind a whole one with one message."""
    message = struct.pack("<HIQQ", 1, 0, 5, 5) + b"\0\1\0\0\7"
    with path.open("wb") as file:
        writer = McapWriter(file, index_types=IndexType.NONE, use_summary_offsets=False, use_statistics=False)
        writer.start()
        schema = writer.register_schema("mine/msg/M", "ros2msg", b"uint8 x\n")
        writer.add_message(writer.register_channel("/t", "cdr", schema), 5, message[-5:], 5)
        writer.finish()
    whole = path.read_bytes()
    text = struct.pack("<I", len(kind)) + kind.encode()
    chunk = struct.pack("<QQQI", 5, 5, size, 0) + text + struct.pack("<Q", len(data)) + data
    end = whole.index(record(15, b"")[:1] + struct.pack("<Q", 4))
    path.write_bytes(whole[:end] + record(6, chunk) * count + whole[end:])
    return path


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
@pytest.mark.parametrize(("count", "declared"), [(1, 1 << 34), (40, 1 << 30)])
def test_a_file_has_a_limit_without_its_compression(
    kind: str, count: int, declared: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compression, "_LEAST_LIMIT", 8 << 20)
    pack = zstandard.compress if kind == "zstd" else lz4.frame.compress
    data = pack(bytes(20 << 20))
    path = chunks_of(tmp_path / "a.mcap", data, declared, kind, count)
    limit = max(8 << 20, 100 * path.stat().st_size)
    with limited(), opening.open(path) as log:
        assert log["/t"]["x"].tolist() == [7]
        texts = [problem.text for problem in log.problems]
    text = f"the file has more than {limit} bytes without its compression; MSGGEN_MAX_CONTENT sets another limit"
    assert any(each.startswith(text) for each in texts)
    monkeypatch.setenv("MSGGEN_MAX_CONTENT", str(1 << 60))
    with opening.open(chunks_of(path, pack(bytes(9 << 20)), 9 << 20, kind, 2)) as log:
        assert not any("without its compression" in problem.text for problem in log.problems)


def test_a_damaged_size_of_a_chunk_takes_no_room_of_the_others(tmp_path: Path) -> None:
    chance = Random(1)  # noqa: S311 - no secret
    samples = [chance.randbytes(1000) for _ in range(3000)]
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=100_000)
        writer.start()
        schema = writer.register_schema("mine/msg/M", "ros2msg", b"uint8[1000] x\n")
        channel = writer.register_channel("/t", "cdr", schema)
        for number, sample in enumerate(samples):
            writer.add_message(channel, number, b"\0\1\0\0" + sample, number)
        writer.finish()
    data = bytearray(path.read_bytes())
    place = data.index(struct.pack("<I", 4) + b"zstd") - 12
    data[place + 6] = 1  # the size is 2 ** 48 now
    path.write_bytes(data)
    with limited(), opening.open(path) as log:
        assert [bytes(row) for row in log["/t"]["x"]] == samples


def test_samples_with_compression_have_a_limit_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compression, "_LEAST_LIMIT", 1 << 20)
    payload = zstandard.compress(b"\0\1\0\0" + bytes(400_000))
    topics = [Stored(1, "/t", "mine/msg/M", "uint8[400000] x\n")]
    path = write_database(tmp_path / "a.db3", topics, [(1, START + number, payload) for number in range(50)])
    limit = max(1 << 20, 100 * path.stat().st_size)
    with opening.open(path) as log:
        assert len(log["/t"]) == limit // 400_004
        (problem,) = log.problems
        assert (problem.topic, problem.samples) == ("/t", 50 - limit // 400_004)


@pytest.mark.parametrize("how", ["with its size", "without its size"])
def test_samples_with_wrong_checksums_take_their_room(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compression, "_LEAST_LIMIT", 1 << 20)
    size = 400_000
    topics = [Stored(number, f"/t{number}", "mine/msg/M", f"uint8[{size - 4}] x\n") for number in range(1, 4)]
    packer = zstandard.ZstdCompressor(write_checksum=True, write_content_size=how == "with its size")
    frame = packer.compress(bytes(size))[:-4] + b"wron"
    rows = [(1 + number % 3, START + number, frame) for number in range(30)]
    path = write_database(tmp_path / "a.db3", topics, rows)
    made = 0
    decompress = compression.decompress_frame

    def counting(data: bytes, limit: int) -> bytes:
        nonlocal made
        try:
            return decompress(data, limit)
        except CompressionError as error:
            made += error.spent
            raise

    monkeypatch.setattr(frames, "decompress_frame", counting)
    for _ in range(2):  # nor does reading them again, topic by topic
        made = 0
        with opening.open(path) as log:
            for topic in topics:
                assert len(log[topic.name]) == 0
            assert sum(problem.samples for problem in log.problems) == 30
        assert size <= made <= 100 * path.stat().st_size


def packed_files(folder: Path, count: int, size: int) -> Path:
    """Write a folder with compressed files of a message each."""
    folder.mkdir()
    for number in range(count):
        path = folder / f"{folder.name}_{number}.mcap"
        with path.open("wb") as file:
            writer = McapWriter(file, compression=CompressionType.NONE)
            writer.start()
            schema = writer.register_schema("mine/msg/M", "ros2msg", f"uint8[{size}] x\n".encode())
            channel = writer.register_channel("/t", "cdr", schema)
            writer.add_message(channel, number, b"\0\1\0\0" + bytes(size), number)
            writer.finish()
        zstd_of(path)
    return folder


def zstd_of(path: Path) -> Path:
    """Compress a file as rosbag2 does."""
    target = path.with_name(f"{path.name}.zstd")
    target.write_bytes(zstandard.compress(path.read_bytes()))
    path.unlink()
    return target


def test_a_folder_has_a_limit_without_its_compression(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compression, "_LEAST_LIMIT", 3 << 20)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    folder = packed_files(tmp_path / "bag", 30, 1 << 20)
    with opening.open(folder) as log:
        written = sum(path.stat().st_size for path in tmp_path.glob("msggen-*/*"))
        assert len(log["/t"]) == 2
        assert written <= 3 << 20
        texts = [problem.text for problem in log.problems if "left out" in problem.text]
        assert len(texts) == 28
        assert "the files have more than 3145728 bytes without their compression; MSGGEN_MAX_CONTENT sets" in texts[-1]
    monkeypatch.setenv("MSGGEN_MAX_CONTENT", str(31 << 20))
    with opening.open(folder) as log:
        assert len(log["/t"]) == 30
        assert not any("left out" in problem.text for problem in log.problems)


def test_chunks_of_a_compressed_file_share_its_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compression, "_LEAST_LIMIT", 3 << 20)
    data = zstandard.compress(bytes(2 << 20))
    path = zstd_of(chunks_of(tmp_path / "a.mcap", data + bytes(1 << 20), 2 << 20, "zstd", 1))
    with opening.open(path) as log:
        assert any("the file has more than 3145728 bytes without its" in problem.text for problem in log.problems)


def test_messages_that_overlap_are_not_read_by_their_index(tmp_path: Path) -> None:
    """Messages within the payloads of others would have many times the bytes of the file."""
    size, count = 50_000, 300
    content = bytearray(size * 2)
    for number in range(count):
        struct.pack_into("<BQHIQQBB", content, number * 35, 5, size + 22 + 4, 1, 0, number, number, 0, 1)
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("mine/msg/M", "ros2msg", f"uint8[{size}] x\n".encode())
        channel = writer.register_channel("/t", "cdr", schema)
        for number in range(count):
            writer.add_message(channel, number, b"\0\1\0\0" + bytes(200), number)
        writer.finish()
    data = bytearray(path.read_bytes())
    (chunk,) = (each for each in mcap.McapFile(str(path))._regions if isinstance(each, Chunk))
    first = data.index(struct.pack("<BQ", 5, 226), chunk.records)
    stop = chunk.records + chunk.stored
    data[first:stop] = content[: stop - first]
    offset = first - chunk.records
    entries = b"".join(struct.pack("<QQ", number, offset + number * 35) for number in range(count))
    place = chunk.indexes[1] + 15
    data[place : place + len(entries)] = entries
    path.write_bytes(data)
    with limited(), opening.open(path) as log:
        assert len(log["/t"]) <= 2
        assert log.problems


@pytest.mark.parametrize("key", ["version", "storage_identifier", "compression_format", "message_count", "<<"])
def test_aliases_of_yaml_are_not_expanded(key: str, tmp_path: Path) -> None:
    bomb = "a0: &a0 {k0: x}\n"
    bomb += "".join(f"a{n}: &a{n} {{k{n}: x, <<: [{', '.join([f'*a{n - 1}'] * 9)}]}}\n" for n in range(1, 12))
    lists = bomb.replace("<<", "list")
    front = bomb if key == "<<" else lists
    (tmp_path / "metadata.yaml").write_text(
        f"{front}rosbag2_bagfile_information:\n  relative_file_paths: [a.mcap]\n  {key}: *a11\n", encoding="utf-8"
    )
    write_mcap(tmp_path / "a.mcap", ["uint8 x\n"], b"\0\1\0\0\7")
    with limited(), opening.open(tmp_path) as log:
        assert log["/t0"]["x"].tolist() == [7]
        assert "metadata.yaml" in log.problems[0].text


def test_an_array_of_a_nested_format_is_not_made_before_its_size_is_checked(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("inner", "uint8_t[65000] x")
    writer.format("outer", "uint64_t timestamp;inner[65535] x")
    writer.subscribe(0, "outer")
    writer.sample(0, bytes(8))
    with limited(), opening.open(writer.write(tmp_path / "a.ulg")) as log:
        assert [problem.text for problem in log.problems] == [
            "outer is not read: format 'outer' is larger than a message"
        ]


def test_a_definition_that_cannot_be_read_is_read_once() -> None:
    text = "".join(f"uint8 x{number}\n" for number in range(20_000)) + "wrong\n"
    with limited():
        for _ in range(200):
            with pytest.raises(SchemaError, match="line 20001"):
                read_schema("mine/msg/M", text)
