"""Tests of what is copied as it is: attachments, metadata, and channels whose schemas are not those of ROS 2."""

from __future__ import annotations

import io
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest
import yaml
import zstandard
from mcap.reader import make_reader
from mcap.writer import IndexType
from mcap.writer import Writer as McapWriter

from msggen import recordings
from msggen.cli import main
from msggen.exports.convert import convert, join
from support.recordings import START

DEFINITION = "uint64 timestamp\nfloat32 x\n"
SCHEMAS = {
    "/ros": ("demo/msg/Demo", "ros2msg", DEFINITION.encode(), "cdr"),
    "/idl": ("demo/msg/Demo", "ros2idl", b"module demo { struct Demo { float x; }; };", "cdr"),
    "/protobuf": ("foxglove.PoseInFrame", "protobuf", bytes(range(256)), "protobuf"),
    "/json": ("a.b.C", "jsonschema", b'{"type": "object"}', "json"),
    "/bare": (None, "", b"", "json"),
    "/undefined": ("demo/msg/Unknown", "", b"", "cdr"),
    "/named": ("only/a/name", "", b"", "custom"),
}
"""Name, format and text of the schema of each topic, and the encoding of its samples."""
WAYS: dict[str, dict[str, Any]] = {
    "indexed": {},
    "without-index": {"index_types": IndexType.NONE},
    "without-chunks": {"use_chunking": False},
}


class Content(NamedTuple):
    """What a file has, as the package mcap reads it."""

    samples: dict[tuple[str, str, str, bytes, str], list[tuple[int, bytes]]]
    """The samples by topic, schema and encoding."""
    metadata: list[tuple[str, dict[str, str]]]
    attachments: list[tuple[str, str, int, int, bytes]]
    keys: dict[str, dict[str, str]]
    """The metadata of the channels."""


def content_of(path: Path) -> Content:
    samples: dict[Any, list[tuple[int, bytes]]] = {}
    keys = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            named = (schema.name, schema.encoding, schema.data) if schema else (None, "", b"")
            samples.setdefault((channel.topic, *named, channel.message_encoding), []).append(
                (message.log_time, message.data)
            )
            keys[channel.topic] = dict(channel.metadata)
        metadata = sorted((each.name, dict(each.metadata)) for each in reader.iter_metadata() if each.name != "rosbag2")
        attachments = sorted(
            (each.name, each.media_type, each.log_time, each.create_time, each.data)
            for each in reader.iter_attachments()
        )
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        if summary.metadata_indexes or summary.attachment_indexes:
            assert summary.statistics.attachment_count == len(summary.attachment_indexes) == len(attachments)
            assert summary.statistics.metadata_count == len(summary.metadata_indexes)
    return Content(samples, metadata, attachments, keys)


def write(path: Path, seed: int = 1, attached: str = "cal", **options: Any) -> Path:
    """Write a file with samples of all topics, two attachments, and metadata."""
    chance = Random(seed)  # noqa: S311 - no secret
    file = io.BytesIO()
    writer = McapWriter(file, chunk_size=300, **options)
    writer.start("ros2")
    writer.add_metadata("rosbag2", {"serialized_metadata": "x"})
    writer.add_metadata("flight", {"pilot": "me", "empty": ""})
    channels = {}
    for topic, (name, encoding, data, messages) in SCHEMAS.items():
        schema = 0 if name is None else writer.register_schema(name, encoding, data)
        channels[topic] = writer.register_channel(topic, messages, schema, {"key": topic, "other": ""})
    writer.add_attachment(5, 6, f"{attached}.yaml", "text/yaml", b"x: 1")
    for index in range(60):
        topic = chance.choice(list(channels))
        payload = b"\0\1\0\0" + chance.randbytes(12) if SCHEMAS[topic][3] == "cdr" else chance.randbytes(index)
        # a frame of zstd in a topic of another encoding is no compressed sample of rosbag2
        payload = zstandard.compress(payload) if topic == "/named" else payload
        writer.add_message(channels[topic], START + index * 1000, payload, START)
    writer.add_attachment(7, 8, "empty.bin", "", b"")
    writer.finish()
    path.write_bytes(file.getvalue())
    return path


@pytest.mark.parametrize("way", WAYS)
def test_a_copy_has_everything(way: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", **WAYS[way])
    expected = content_of(write(tmp_path / "whole.mcap"))
    assert len(expected.samples) == len(SCHEMAS)
    assert (len(expected.metadata), len(expected.attachments)) == (1, 2)
    with recordings.open(path) as log:
        converted = join([log], str(tmp_path / "copy.mcap"))
        assert [each.text for each in converted.problems] == [
            "/undefined has no definition as ros2msg, and is written without one"
        ]
        assert converted.notes == []
    found = content_of(tmp_path / "copy.mcap")
    assert found.samples == expected.samples
    assert (found.metadata, found.attachments) == (expected.metadata, expected.attachments)
    for topic, keys in expected.keys.items():
        qos = {"offered_qos_profiles": ""} if SCHEMAS[topic][3] == "cdr" else {}
        assert found.keys[topic] == {**keys, **qos}


def test_commands_copy_what_is_attached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    first, second = write(tmp_path / "a.mcap"), write(tmp_path / "b.mcap", 2, "other")
    expected, others = content_of(first), content_of(second)
    (tmp_path / "cut-off.mcap").write_bytes(first.read_bytes()[:-60])
    (tmp_path / "packed.mcap.zstd").write_bytes(zstandard.compress(first.read_bytes()))
    assert main(["log", "cut", "a.mcap", "/protobuf", "--start", "1e-5", "-o", "cut.mcap"]) == 0
    assert main(["log", "repair", "cut-off.mcap", "-o", "repaired.mcap"]) == 0
    # a topic in CDR without a definition is told
    assert main(["log", "merge", "a.mcap", "b.mcap", "-o", "merged.mcap"]) == 1
    assert main(["log", "convert", "packed.mcap.zstd", "-o", "unpacked.mcap"]) == 1
    assert main(["log", "convert", "a.mcap", "--format", "rosbag2", "-o", "bag"]) == 1
    for name in ("cut.mcap", "repaired.mcap", "unpacked.mcap", "bag/bag_0.mcap"):
        found = content_of(tmp_path / name)
        assert (found.metadata, found.attachments) == (expected.metadata, expected.attachments)
        if name != "cut.mcap":
            assert found.samples == expected.samples
    cut = content_of(tmp_path / "cut.mcap").samples
    assert {(topic, encoding) for topic, _, encoding, *_ in cut} == {("/protobuf", "protobuf")}
    found = content_of(tmp_path / "merged.mcap")
    assert found.attachments == sorted({*expected.attachments, *others.attachments})
    assert found.metadata == expected.metadata  # the same in both
    for key, samples in found.samples.items():
        assert samples == sorted(expected.samples[key] + others.samples[key], key=lambda each: each[0])
    (folder,) = yaml.safe_load((tmp_path / "bag/metadata.yaml").read_text()).values()
    types = {each["topic_metadata"]["name"]: each["topic_metadata"] for each in folder["topics_with_message_count"]}
    assert types["/protobuf"]["type"] == "foxglove.PoseInFrame"
    assert types["/bare"]["type"] == ""


def test_topics_with_one_name_and_several_schemas_stay_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        for number, (name, encoding, data, messages) in enumerate(filter(lambda each: each[0], SCHEMAS.values())):
            assert name is not None
            channel = writer.register_channel("/a", messages, writer.register_schema(name, encoding, data))
            writer.add_message(channel, number, b"\0\1\0\0" + bytes(12), number)
        writer.finish()
    with recordings.open(path) as log:
        assert [topic.count for topic in log.topics] == [1] * (len(SCHEMAS) - 1)
        convert(log, str(tmp_path / "copy.mcap"), format="mcap")
    assert content_of(tmp_path / "copy.mcap").samples == content_of(path).samples


@pytest.mark.parametrize(
    ("place", "value", "text"),
    [
        (b"\x08\0\0\0cal.yaml", 200, "an attachment is damaged"),  # the length of the name
        (b"cal.yaml", 255, "an attachment is damaged"),  # not UTF-8
        (b"\x04\0\0\0\0\0\0\0x: 1", 5, "an attachment is damaged"),  # the length of the data
        (b"x: 1", 0, "an attachment does not match its CRC and is left out"),
        (b"pilot", 255, "a metadata record is damaged"),
        (b"\x02\0\0\0me", 1, "a metadata record is damaged"),
        (b"\x05\0\0\0empty\0\0\0\0", 9, "a metadata record is damaged"),  # a key without a value
    ],
)
def test_what_other_readers_would_refuse_is_told_and_left_out(
    place: bytes, value: int, text: str, tmp_path: Path
) -> None:
    data = bytearray(write(tmp_path / "a.mcap").read_bytes())
    data[data.index(place)] = value
    (tmp_path / "a.mcap").write_bytes(data)
    with recordings.open(tmp_path / "a.mcap") as log:
        assert not log.problems
        converted = convert(log, str(tmp_path / "copy.mcap"), format="mcap")
        problem, undefined = converted.problems
        assert problem.text == text
        assert problem.offset
        assert undefined.topic == "/undefined"
    found = content_of(tmp_path / "copy.mcap")
    assert len(found.attachments) + len(found.metadata) == 2
