"""Tests of small recordings that stand for a lot: nested definitions, long arrays, many values."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

from fuzz.runner import limited
from msggen.nesting import MAX_TOTAL, MAX_VALUES
from msggen.recordings.convert import tables
from msggen.recordings.convert.selection import Selection
from msggen.recordings.decode.decoder import Decoder
from msggen.recordings.decode.layouts import layout_of
from msggen.recordings.decode.schemas import SchemaError, read_schema
from msggen.recordings.files import open_log
from msggen.recordings.source import Channel, RecordingError
from support.commands import run
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
        with open_log(path) as log:
            assert log.load() == {}
            assert [problem.text.startswith(f"/t0 is not decoded: {error}") for problem in log.problems] == [True]


def test_definitions_within_the_limits_are_read() -> None:
    for text in (nested(64), nested(16, fields=2), nested(4, "[40]"), "bool[65535] x\n"):
        with limited():
            found = layout_of("mine/msg/T0", text)
        assert found is not None
        assert found.positions.size == found.size - 4


def test_a_long_array_takes_no_memory_before_there_are_samples(tmp_path: Path) -> None:
    size = 1 << 23
    text = f"uint8 first\nfloat32[{size // 4}] x\n"
    many = [text.replace("x", f"x{number}") for number in range(100)]
    path = write_mcap(tmp_path / "a.mcap", many, b"\0\7\0\0\0")
    with limited(), open_log(path) as log:
        assert not any(map(len, log.load().values()))
    values = np.arange(size // 4, dtype=np.float32)
    for order, code in ((b"\0\1", "<f4"), (b"\0\0", ">f4")):
        payload = order + b"\0\0\5\0\0\0" + values.astype(code).tobytes()
        with open_log(write_mcap(tmp_path / "b.mcap", [text], payload)) as log:
            np.testing.assert_array_equal(log["/t0"]["x"][0], values)
            with pytest.raises(RecordingError, match="2097153 columns, up to 131070 can be made"):
                log.columns("/t0")


def test_a_topic_with_too_many_columns_is_left_out_of_tables(tmp_path: Path) -> None:
    wide = f"uint8[{MAX_TOTAL}] x\n"
    path = write_mcap(tmp_path / "a.mcap", [wide, "uint8 x\n"], b"\0\1\0\0" + bytes(MAX_TOTAL))
    with open_log(write_mcap(path, ["uint8 x\n", wide], b"\0\1\0\0\5")) as log:
        made = tables.write_tables(log, str(tmp_path / "made"), "parquet", ALL, lambda _: None)
    assert (len(made.files), made.rows) == (1, 1)
    (problem,) = made.problems
    assert (problem.topic, problem.samples) == ("/t1", 1)
    assert problem.text == "/t1 is left out: 131070 columns, tables have up to 131070 together"


def test_all_definitions_of_a_recording_have_a_limit_together(tmp_path: Path) -> None:
    many = [nested(3, "[240]").replace(" x", f" x{number}") for number in range(100)]
    path = write_mcap(tmp_path / "a.mcap", many)
    with limited(), open_log(path) as log:
        assert len(log.chosen(None)) == MAX_TOTAL // 240**2 == 2
        left_out = [problem for problem in log.problems if "left out" in problem.text]
        assert len(left_out) == 98
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
    with open_log(path) as log:
        assert len({id(topic.definition) for topic in log.topics}) == 1


def test_bools_are_found_in_linear_time() -> None:
    with limited():
        decoder = Decoder(Channel(0, "/a", "mine/msg/T0", f"bool[{MAX_VALUES}] x\n"))
    assert decoder.layout is not None
    places = [place for bools in decoder.layout.bools for place in bools.places]
    assert places == list(range(4, 4 + MAX_VALUES))


def test_the_formats_of_a_ulog_have_a_limit_together(tmp_path: Path) -> None:
    writer = UlogWriter()
    for number in range(60):
        writer.format(f"topic_{number}", "uint64_t timestamp;bool[60000] x")
    for number in range(60):
        writer.subscribe(number, f"topic_{number}")
    with limited(), open_log(writer.write(tmp_path / "a.ulg")) as log:
        assert len(log.topics) == (2 << 20) // 60050
