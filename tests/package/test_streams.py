"""Tests of messages with strings, sequences or no fields: they have the API of all other messages and clear errors.

test_peers.py tests their bytes, and test_hostile_lengths.py tests hostile samples.
"""

from __future__ import annotations

import copy
import dataclasses
import importlib
import pickle
import sys
from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package, write_definitions

DEFINITIONS = {
    "msg/Time.msg": "int32 sec\nuint32 nanosec\n",
    "msg/Header.msg": "Time stamp\nstring frame_id\n",
    "msg/Point.msg": "float64 x\nfloat64 y\n",
    "msg/Empty.msg": "",
    "msg/Scan.msg": "Header header\nfloat32 angle_min\nfloat32[] ranges\nPoint[<=2] corners\nstring<=4[] labels\n",
    "msg/JointState.msg": "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    "msg/Status.msg": 'uint8 OK = 0\nuint8 level\nstring<=8 name "none"\nwstring title\nuint8[<=3] raw [1, 2]\n'
    "bool[] flags [true, false]\nint16[] counts [-1, 7]\nstring[2] pair ['a', \"b\"]\n",
    "msg/Marked.msg": "uint32 number\nEmpty mark\nEmpty[2] marks\nstring after\n",
    "srv/Trigger.srv": "---\nbool success\nstring message\n",
}


@pytest.fixture(scope="module")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The package of DEFINITIONS."""
    folder = tmp_path_factory.mktemp("ros")
    source = write_definitions(folder / "in", DEFINITIONS)
    package = import_package(read_catalog(find_sources(None, (f"my_msgs={source}",))), folder)
    return package.my_msgs


@pytest.fixture
def msg(ros: Any) -> Any:
    """The messages of the package."""
    return ros.msg


@pytest.fixture
def cdr(msg: Any) -> Any:
    """The module with the errors."""
    return sys.modules[msg.Header.__mro__[1].__module__]


@pytest.fixture
def encode_as(cdr: Any) -> Any:
    """The function that encodes samples with other encapsulations."""
    return importlib.import_module(f"{cdr.__package__}.encapsulation").encode_as


@pytest.fixture
def scan(msg: Any) -> Any:
    """A message with a value in every field."""
    header = msg.Header(msg.Time(1, 2), "laser")
    return msg.Scan(header, -1.5, [1.0, 2.5], [msg.Point(1.0, 2.0)], ["left", "", "é"])


SAMPLE = bytes.fromhex(
    "00010000"
    "01000000 02000000"  # header.stamp
    "06000000 6c6173657200"  # header.frame_id: five characters and a NUL
    "0000 0000c0bf"  # padding, angle_min
    "02000000 0000803f 00002040"  # ranges
    "01000000 000000000000f03f 0000000000000040"  # corners: one element, already aligned to 8
    "03000000 05000000 6c65667400"  # labels
    "000000 01000000 00"
    "000000 03000000 c3a900"
)


def test_a_sample_is_what_the_standard_says(scan: Any) -> None:
    assert scan.encode() == SAMPLE


@pytest.mark.parametrize("encapsulation", [b"\0\0", b"\0\1", b"\0\6", b"\0\7"])
def test_every_encapsulation_is_read_back(scan: Any, encode_as: Any, encapsulation: bytes) -> None:
    sample = encode_as(scan, encapsulation)
    assert sample[:4] == encapsulation + b"\0\0"
    assert type(scan).decode(sample) == scan
    assert type(scan).decode(memoryview(bytearray(sample))) == scan


@pytest.mark.parametrize("wrong", [b"\0\2", "xcdr2", b"\0\7\0\0"])
def test_an_encapsulation_that_is_none_is_told(scan: Any, cdr: Any, encode_as: Any, wrong: Any) -> None:
    with pytest.raises(cdr.EncodeError, match=r"Scan: expected the encapsulation b'.*, got"):
        encode_as(scan, wrong)


def test_values_come_as_the_documentation_says(scan: Any, msg: Any) -> None:
    decoded = msg.Scan.decode(scan.encode())
    assert decoded.ranges == array("f", [1.0, 2.5])
    assert decoded.corners == (msg.Point(1.0, 2.0),)
    assert decoded.labels == ("left", "", "é")
    assert decoded.header.frame_id == "laser"


def test_defaults_are_those_of_the_definition(msg: Any) -> None:
    status = msg.Status()
    assert (status.level, status.name, status.title, status.raw) == (0, "none", "", b"\1\2")
    assert (status.flags, status.counts, status.pair) == ((True, False), array("h", [-1, 7]), ("a", "b"))
    assert (msg.Scan().ranges, msg.Scan().corners, msg.Scan().header) == (array("f"), (), msg.Header())
    assert msg.Scan().ranges is not msg.Scan().ranges


def test_it_can_be_copied_pickled_replaced_and_matched(scan: Any) -> None:
    assert pickle.loads(pickle.dumps(scan)) == scan == copy.deepcopy(scan)  # noqa: S301 - our own
    assert dataclasses.replace(scan, labels=["a"]).labels == ["a"]
    assert [field.name for field in dataclasses.fields(scan)] == list(scan.__match_args__)
    assert dataclasses.asdict(scan)["header"]["frame_id"] == "laser"
    assert repr(scan).startswith("Scan(header=Header(stamp=Time(sec=1, nanosec=2), frame_id='laser'), angle_min=-1.5")


def test_lists_and_tuples_and_arrays_are_equal_when_their_values_are(scan: Any) -> None:
    other = dataclasses.replace(scan, ranges=array("f", [1.0, 2.5]), labels=("left", "", "é"))
    assert other == scan
    assert dataclasses.replace(scan, labels=["left"]) != scan


def test_a_subclass_decodes_to_itself(msg: Any, scan: Any) -> None:
    class Mine(msg.Scan):  # type: ignore[misc]
        __slots__ = ()

    assert type(Mine.decode(scan.encode())) is Mine


def test_its_description_knows_what_differs_by_sample(msg: Any) -> None:
    info = msg.Scan.__msg__
    assert (info.name, info.ros_type, info.cdr_size, info.struct_size, info.topics) == (
        "Scan",
        "my_msgs/msg/Scan",
        None,
        None,
        (),
    )
    fields = {field.name: field for field in info.fields}
    assert (fields["header"].offset, fields["ranges"].offset, fields["ranges"].size) == (None, None, None)
    assert (msg.Status.__msg__.fields[0].offset, msg.Status.__msg__.fields[0].size) == (0, 1)
    assert (fields["ranges"].is_sequence, fields["ranges"].length, fields["ranges"].base) == (True, None, "float32")
    assert (fields["corners"].most, fields["labels"].base) == (2, "string<=4")


def test_messages_without_fields_take_a_byte(ros: Any) -> None:
    empty = ros.msg.Empty()
    assert empty.encode() == b"\0\1\0\0\0"
    assert ros.msg.Empty.decode(b"\0\1\0\0\xff") == empty
    assert ros.srv.Trigger.Request().encode() == b"\0\1\0\0\0"
    assert ros.srv.Trigger.Response(success=True, message="ok").encode() == b"\0\1\0\0\1\0\0\0\3\0\0\0ok\0"
    marked = ros.msg.Marked(7, after="x")
    assert marked.encode() == b"\0\1\0\0\7\0\0\0\0\0\0\0\2\0\0\0x\0"
    assert ros.msg.Marked.decode(marked.encode()) == marked


@pytest.mark.parametrize("name", ["dtype", "decode_batch", "lazy"])
def test_there_are_no_views_and_batches(msg: Any, scan: Any, name: str) -> None:
    with pytest.raises(TypeError, match="Scan has no views and no batches"):
        getattr(msg.Scan, name)(*([] if name == "dtype" else [scan.encode()]))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"labels": ["apples"]}, "Scan.labels[0]: expected up to 4 characters, got 6"),
        ({"labels": "left"}, "Scan.labels: expected values, got one: 'left'"),
        ({"labels": [1]}, "Scan.labels[0]: expected a str, got 1"),
        ({"labels": ["\ud83d"]}, "Scan.labels[0]: expected text, got an unpaired surrogate at index 0"),
        ({"ranges": 1.0}, "Scan.ranges: expected values, got one: 1.0"),
        ({"ranges": [1e300]}, "Scan.ranges[0]: expected float32, up to 3.4028235677973366e+38, got 1e+300"),
        ({"corners": [None]}, "Scan.corners[0]: expected Point, got None"),
        ({"header": 5}, "Scan.header: expected Header, got 5"),
        ({"corners": [5]}, "Scan.corners[0]: expected Point, got 5"),
        ({"corners": ""}, "Scan.corners: expected up to 2 values, got one: ''"),
        ({"ranges": b"abc"}, "Scan.ranges: expected values, got one: a bytes of 3"),
        ({"ranges": {}}, "Scan.ranges: expected values, got one: {}"),
        ({"ranges": np.ones((2, 1))}, "Scan.ranges: expected values, got an array of 2 dimensions"),
    ],
)
def test_a_value_that_cannot_be_is_named(scan: Any, cdr: Any, changes: dict[str, Any], text: str) -> None:
    with pytest.raises(cdr.EncodeError) as raised:
        dataclasses.replace(scan, **changes).encode()
    assert str(raised.value) == text


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"raw": b"four"}, "Status.raw: expected up to 3 bytes, got 4"),
        ({"raw": [1]}, "Status.raw: expected up to 3 bytes, got a list of 1: use bytes([...])"),
        ({"flags": iter([True])}, None),
        ({"flags": [1.0]}, "Status.flags[0]: expected a bool, got 1.0"),
        ({"name": Ellipsis}, "Status.name: expected a str, got Ellipsis"),
        ({"counts": np.ones((2, 1), int)}, "Status.counts: expected values, got an array of 2 dimensions"),
        ({"raw": array("H", [1])}, "Status.raw: expected up to 3 bytes, got an array of 1: use bytes(values.tolist())"),
        ({"flags": [2]}, "Status.flags[0]: expected a bool, got 2"),
        ({"counts": [1.5]}, "Status.counts[0]: expected an integer, got the float 1.5"),
        ({"counts": [40000]}, "Status.counts[0]: expected int16, -32768 to 32767, got 40000"),
        ({"pair": ["one"]}, "Status.pair: expected 2 values, got 1"),
        ({"title": None}, "Status.title: expected a str, got None"),
        ({"level": 256}, "Status.level: expected uint8, 0 to 255, got 256"),
    ],
)
def test_nothing_is_cut_or_converted_to_fit(msg: Any, cdr: Any, changes: dict[str, Any], text: str | None) -> None:
    with pytest.raises(cdr.EncodeError) as raised:
        msg.Status(**changes).encode()
    assert text is None or str(raised.value) == text


def test_a_message_is_no_text_and_nothing_is_a_message_without_fields(msg: Any, cdr: Any) -> None:
    for wrong in (msg.Status(name=msg.Point()), msg.Status(pair=(msg.Point(), "")), msg.Status(title=msg.Point())):
        with pytest.raises(cdr.EncodeError, match="expected a str"):
            wrong.encode()
    for marked in (msg.Marked(mark=5), msg.Marked(marks=(msg.Empty(), None)), msg.Marked(marks="ab")):
        with pytest.raises(cdr.EncodeError, match=r"Marked\.marks?"):
            marked.encode()


def test_bytes_may_be_anything_that_has_them_in_memory(msg: Any) -> None:
    for value in (bytearray(b"abc"), memoryview(b"abc"), array("B", b"abc"), np.frombuffer(b"abc", np.uint8)):
        assert msg.Status.decode(msg.Status(raw=value).encode()).raw == b"abc"
    for flags in ([True, False], (1, 0), np.array([True, False])):
        assert msg.Status.decode(msg.Status(flags=flags).encode()).flags == (True, False)


def test_an_error_is_named_from_the_outermost_message(msg: Any, cdr: Any, scan: Any) -> None:
    sample = scan.encode()
    with pytest.raises(cdr.DecodeError) as raised:
        msg.Scan.decode(sample[: 4 + 50])
    assert str(raised.value) == "Scan.corners[0].x to y: expected 16 bytes at byte 40, got 10"


def test_too_many_elements_are_refused_both_ways(scan: Any, msg: Any, cdr: Any) -> None:
    many = dataclasses.replace(scan, corners=[msg.Point()] * 3)
    with pytest.raises(cdr.EncodeError, match=r"Scan.corners: expected up to 2 values, got 3"):
        many.encode()
    sample = bytearray(scan.encode())
    sample[4 + 36] = 3
    with pytest.raises(cdr.DecodeError, match=r"Scan.corners: expected up to 2 values, got 3"):
        msg.Scan.decode(sample)


@pytest.mark.parametrize(
    ("offset", "byte", "text"),
    [
        (8, 200, "Scan.header.frame_id: expected 200 bytes at byte 12, got 75"),
        (8, 3, "Scan.header.frame_id: expected a NUL at the end of the text, got b'las'"),
        (13, 0xFF, "Scan.header.frame_id: expected UTF-8, got b'l\\xffser\\x00'"),
        (27, 1, "Scan.ranges: expected 16777218 values, got 14"),
        (59, 1, "Scan.labels: expected 16777219 values, got 6"),
    ],
)
def test_a_sample_that_cannot_be_is_told_where(scan: Any, cdr: Any, offset: int, byte: int, text: str) -> None:
    sample = bytearray(scan.encode())
    sample[4 + offset] = byte
    with pytest.raises(cdr.DecodeError) as raised:
        type(scan).decode(sample)
    assert str(raised.value) == text


def test_more_than_three_bytes_behind_the_last_value_are_another_definition(scan: Any, cdr: Any) -> None:
    sample = scan.encode()
    assert type(scan).decode(sample + bytes(3)) == scan
    with pytest.raises(cdr.DecodeError, match="another definition"):
        type(scan).decode(sample + bytes(4))
    assert type(scan).decode(sample + bytes(400), allow_surplus=True) == scan


def test_what_serialize_message_of_ros_2_leaves_behind_is_accepted(msg: Any, cdr: Any) -> None:
    """In size computations, ROS 2 aligns empty sequences of 8-byte numbers and adds an end to each wstring."""
    empty, full = msg.JointState(), msg.JointState(position=[1.0], velocity=[1.0], effort=[1.0])
    assert msg.JointState.decode(empty.encode() + bytes(3 + 3 * 8)) == empty
    assert msg.Status.decode(msg.Status().encode() + bytes(3 + 8)) == msg.Status()
    for message, surplus in ((empty, 3 + 3 * 8 + 1), (full, 4), (msg.Status(), 3 + 8 + 1)):
        with pytest.raises(cdr.DecodeError, match="another definition"):
            type(message).decode(message.encode() + bytes(surplus))


def test_a_text_of_no_bytes_is_an_empty_text(msg: Any) -> None:
    """Older writers omit the NUL."""
    assert msg.Header.decode(b"\0\1\0\0" + bytes(12)) == msg.Header()


def test_a_delimiter_header_that_lies_is_told(scan: Any, cdr: Any, encode_as: Any) -> None:
    sample = bytearray(encode_as(scan, b"\0\7"))
    place = sample.index((20).to_bytes(4, "little"))  # the delimiter header of corners: a count and two numbers
    sample[place] = 24
    with pytest.raises(cdr.DecodeError, match=r"Scan.corners: expected a delimiter header of 20 at byte \d+, got 24"):
        type(scan).decode(sample)


def test_a_package_without_such_messages_does_not_have_the_module(px4_types: Any) -> None:
    assert not (Path(px4_types.__file__).parent / "stream.py").exists()
