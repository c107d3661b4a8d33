"""Tests of the grammar of `.msg` and `.srv` files: types, values, comments, PX4's tags, TOPICS lines and services.

They also test the line and column of every node.
"""

from __future__ import annotations

import math

import pytest

from msggen.base.diagnostics import Diagnostic, Level
from msggen.base.location import Location
from msggen.definitions.model import (
    ArrayKind,
    Catalog,
    Comment,
    Constant,
    Field,
    FieldType,
    Message,
    Service,
    Value,
)
from msggen.definitions.parse.comment import parse_comment
from msggen.definitions.parse.definition import parse_message, parse_service
from msggen.definitions.parse.text import decode_text
from msggen.definitions.primitives import INTEGERS, PRIMITIVES
from support.repository import DEFINITIONS


def read(text: str) -> Message:
    """Return the message that `text` defines without errors."""
    message, errors = parse_message(text, "Foo.msg", "Foo", "px4_msgs")
    assert errors == []
    return message


def read_service(text: str) -> Service:
    """Return the service that `text` defines without errors."""
    service, errors = parse_service(text, "Foo.srv", "Foo", "px4_msgs")
    assert errors == []
    return service


def errors_of(text: str) -> list[str]:
    """Return the codes of all errors in `text`."""
    return [error.code for error in parse_message(text, "Foo.msg", "Foo", "px4_msgs")[1]]


def only_field(text: str) -> Field:
    (field,) = read(text).fields
    return field


def only_constant(text: str) -> Constant:
    (constant,) = read(text).constants
    return constant


# Types


@pytest.mark.parametrize(
    ("spelling", "expected"),
    [
        ("float32[3]", FieldType("float32", None, ArrayKind.FIXED, 3)),
        ("uint8[1]", FieldType("uint8", None, ArrayKind.FIXED, 1)),
        ("char[65535]", FieldType("char", None, ArrayKind.FIXED, 65535)),
        ("uint8[]", FieldType("uint8", None, ArrayKind.UNBOUNDED)),
        ("uint8[<=8]", FieldType("uint8", None, ArrayKind.BOUNDED, 8)),
        ("string<=10", FieldType("string", None, string_bound=10)),
        ("wstring<=10[2]", FieldType("wstring", None, ArrayKind.FIXED, 2, 10)),
        ("string<=10[<=5]", FieldType("string", None, ArrayKind.BOUNDED, 5, 10)),
        ("string<=10[]", FieldType("string", None, ArrayKind.UNBOUNDED, 0, 10)),
        ("EscReport", FieldType("EscReport")),
        ("EscReport[12]", FieldType("EscReport", None, ArrayKind.FIXED, 12)),
        ("std_msgs/Header", FieldType("Header", "std_msgs")),
        ("geometry_msgs/Point32[<=4]", FieldType("Point32", "geometry_msgs", ArrayKind.BOUNDED, 4)),
    ],
)
def test_a_type_is_read_and_spelled_back(spelling: str, expected: FieldType) -> None:
    type_ = only_field(f"{spelling} x").type
    assert type_ == expected
    assert str(type_) == spelling


def test_a_message_of_another_package_is_no_primitive_whatever_its_name() -> None:
    assert not only_field("std_msgs/String x").type.is_primitive


# Constants


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("uint8 A = 3", 3),
        ("uint8 A=3", 3),
        ("uint8 A= 3", 3),
        ("uint8 A =3", 3),
        ("uint8\tA\t=\t3\t", 3),
        ("int32 A = -7", -7),
        ("int32 A = +7", 7),
        ("uint32 A = 0xFF", 255),
        ("int8 A = -0x80", -128),
        ("uint8 A = 0b101", 5),
        ("uint8 A = 0o17", 15),
        ("uint8 A = 010", 10),  # ROS 2 ignores leading zeros, as rosidl_adapter does
        ("char A = 65", 65),
        ("byte A = 255", 255),
        ("float32 A = 1", 1.0),
        ("float32 A = -1.5e-3", -0.0015),
        ("float64 A = .5", 0.5),
        ("float32 A = inf", math.inf),
        ("float64 A = -inf", -math.inf),
        ("bool A = true", True),
        ("bool A = False", False),
        ("bool A = 1", True),
        ("bool A = 0", False),
        ("bool A = 2", True),
        ("bool A = 0x0", False),
        ("float32 A = 3.4028235e38", 3.4028235e38),
        ("string A = plain words", "plain words"),
        ('string A = " kept "', " kept "),
        ("string A = 'single'", "single"),
        (r'string A = "say \"hi\""', 'say "hi"'),
        ('string A = "a # b"', "a # b"),
        ('string A = ""', ""),
        ("wstring A = größer", "größer"),
        ("string<=4 A = four", "four"),
        (r'string A = "C:\new"', r"C:\new"),  # only a quote can be escaped: any other backslash is literal
    ],
)
def test_a_constant_is_read_in_every_notation(line: str, value: Value) -> None:
    found = only_constant(line).value
    assert found == value
    assert type(found) is type(value)


def test_a_constant_may_be_not_a_number() -> None:
    value = only_constant("float32 A = nan").value
    assert isinstance(value, float)
    assert math.isnan(value)


@pytest.mark.parametrize("name", INTEGERS)
def test_an_integer_takes_its_whole_range_and_no_more(name: str) -> None:
    low, high = PRIMITIVES[name].integer_range
    assert [constant.value for constant in read(f"{name} A = {low}\n{name} B = {high}").constants] == [low, high]
    for lower, higher in ((low - 1, high + 1), (f"-{'9' * 5000}", "9" * 5000)):
        assert errors_of(f"{name} A = {lower}\n{name} B = {higher}\n{name} c {higher}") == ["M305"] * 3


@pytest.mark.parametrize(
    "line",
    [
        "float32 A = 3.5e38",
        "float64 A = 1e309",
        "float32 A = 0x10",
        "float32 A = 1,5",
        "uint8 A = 1.0",
        "uint8 A = 'a'",
        "uint8 A =",
        "bool A = yes",
        "bool A = 1.0",
        "string<=3 A = four",
        "uint8[2] A = 1",
        "EscReport A = 1",
        "uint8 a 256",
        "uint8[3] a [1, 2]",
        "uint8[<=1] a [1, 2]",
        "uint8[2] a 1",
        "uint8[2] a [1, x]",
        "EscReport a 1",
    ],
)
def test_a_value_that_its_type_cannot_hold_is_an_error(line: str) -> None:
    assert errors_of(line) == ["M305"]


def test_an_apostrophe_in_the_comment_of_a_plain_string_stays_in_the_comment() -> None:
    constant = only_constant("string A = it's  # isn't it")
    assert (constant.value, constant.comment.text) == ("it's", "isn't it")


# Defaults


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("uint8 a", None),
        ("uint8 a 5", 5),
        ("int16 a   -5", -5),
        ("float32 a 0.5", 0.5),
        ("bool a true", True),
        ('string a "x y"', "x y"),
        ("uint8[3] a [1, 2, 3]", (1, 2, 3)),
        ("uint8[3] a [1,2,3]", (1, 2, 3)),
        ("float32[] a [1, 2.5]", (1.0, 2.5)),
        ("uint8[] a []", ()),
        ("uint8[<=3] a [1, 2]", (1, 2)),
        ("bool[2] a [true, 0]", (True, False)),
        ("string[] a ['x, y', \"z]\"]", ("x, y", "z]")),
        ("string[2] a [x, y]", ("x", "y")),
    ],
)
def test_a_field_has_the_default_it_is_given(line: str, value: Value | None) -> None:
    assert only_field(line).default == value


# Names


@pytest.mark.parametrize("name", ["a", "a1", "a_1", "vibration_metric_2", "x" * 60])
def test_a_field_may_have_any_name_of_the_grammar(name: str) -> None:
    assert only_field(f"uint8 {name}").name == name


NO_NAMES = ["a/b", "a.b", 'a"b', "a'b", "a\\b", "{{a}}", "a;b", "a;", "a(", "a,b", "a-b", "ä", "1a", "_a", "__a__"]


@pytest.mark.parametrize("name", ["A", "aB", "a:int", *NO_NAMES, *(f"{name.upper()} = 1" for name in NO_NAMES)])
def test_a_field_or_a_constant_may_have_no_other_name(name: str) -> None:
    assert errors_of(f"uint8 {name}") == ["M201"]


@pytest.mark.parametrize(
    "line", ["uint8 a_", "uint8 a__b", "uint8 a = 1", "uint8 aB = 1", "uint8 A_ = 1", "uint8 A__B = 1"]
)
def test_a_name_that_only_px4_takes_is_a_warning(line: str) -> None:
    assert errors_of(line) == ["M205"]
    assert parse_message(line, "Foo.msg", "Foo", "my_msgs", of_uorb=False)[1][0].code == "M201"


@pytest.mark.parametrize("line", ["uint8 class", "int16 new", "bool not"])
def test_a_name_that_cpp_needs_is_a_warning(line: str) -> None:
    assert errors_of(line) == ["M205"]
    assert parse_message(line, "Foo.msg", "Foo", "my_msgs", of_uorb=False)[1] == []


@pytest.mark.parametrize("name", ["lambda", "from", "async", "encode", "decode", "self"])
def test_names_that_python_or_the_class_needs_are_as_good_as_others(name: str) -> None:
    assert errors_of(f"uint8 {name}") == []
    assert only_field(f"uint8 {name}").name == name


def test_a_field_and_a_constant_may_differ_in_case_alone() -> None:
    message = read("uint8 BANDS = 1\nuint8 bands")
    assert (message.constants[0].name, message.fields[0].name) == ("BANDS", "bands")
    assert errors_of("uint8 BANDS = 1\nuint8 BANDS = 1") == ["M203"]


@pytest.mark.parametrize("name", ["foo", "esc_report", "Esc_Report"])
def test_a_file_name_that_only_px4_takes_is_a_warning(name: str) -> None:
    found = parse_message("uint64 timestamp", f"{name}.msg", name, "px4_msgs")[1]
    assert [(each.code, each.level) for each in found] == [("M205", Level.WARNING)]
    assert parse_message("uint64 timestamp", f"{name}.msg", name, "my_msgs", of_uorb=False)[1][0].code == "M201"
    assert only_field(f"{name}[3] x").type == FieldType(name, None, ArrayKind.FIXED, 3)


# Locations


def test_every_node_knows_its_line_and_columns() -> None:
    message = read("# TOPICS one two\n\nuint64 timestamp\n  float32[3]   gyro\nuint8 NONE = 0\n\tuint8  SOME\t= 1\n")
    places = [(node.name, node.location.line, node.location.column, node.name_column) for node in message.fields]
    assert places == [("timestamp", 3, 1, 8), ("gyro", 4, 3, 16)]
    places = [(node.name, node.location.line, node.location.column, node.name_column) for node in message.constants]
    assert places == [("NONE", 5, 1, 7), ("SOME", 6, 2, 9)]
    assert [(topic.name, str(topic.location)) for topic in message.topics] == [
        ("one", "Foo.msg:1:10"),
        ("two", "Foo.msg:1:14"),
    ]
    assert message.location == Location("Foo.msg", 1, 1)


def test_every_node_of_the_embedded_set_stands_where_it_says(embedded: Catalog) -> None:
    for message in embedded.messages.values():
        with open(message.location.path, encoding="utf-8") as stream:
            lines = stream.read().split("\n")
        nodes: list[Field | Constant] = [*message.fields, *message.constants]
        for node in nodes:
            line = lines[node.location.line - 1]
            assert line[node.location.column - 1 :].startswith(f"{node.type} ")
            assert line[node.name_column - 1 :].startswith(node.name)
        for topic in message.topics:
            assert lines[topic.location.line - 1][topic.location.column - 1 :].split(" ")[0] == topic.name


def test_columns_count_characters_not_bytes() -> None:
    text, errors = decode_text('string a "äöü"; '.encode() + b"\xff", "Foo.msg")
    assert [(error.location.column, error.code) for error in errors] == [(17, "M102")]
    assert text.startswith('string a "äöü"; ')


# Comments


@pytest.mark.parametrize(
    ("text", "of_message", "of_a", "of_b"),
    [
        pytest.param("uint8 a # one\nuint8 b # two", "", "one", "two", id="behind the code"),
        pytest.param("uint8 a\n# two\nuint8 b", "", "", "two", id="above"),
        pytest.param("uint8 a\n# two\n# more\nuint8 b", "", "", "two\nmore", id="above on two lines"),
        pytest.param("uint8 a # one\n  # more\nuint8 b", "", "one\nmore", "", id="indented below goes on"),
        pytest.param("uint8 a # one\n\t# more\n# two\nuint8 b", "", "one\nmore", "two", id="indented, then above"),
        pytest.param("uint8 a\n\n# heading\n\nuint8 b", "", "", "", id="between blank lines belongs to none"),
        pytest.param("# what\n# for\n\nuint8 a\nuint8 b", "what\nfor", "", "", id="top of the file"),
        pytest.param("# what\nuint8 a\nuint8 b", "what", "", "", id="top of the file without a blank line"),
        pytest.param("\n# what\n\nuint8 a\nuint8 b", "what", "", "", id="top after a blank line"),
        pytest.param("# what\n\n# one\nuint8 a\nuint8 b", "what", "one", "", id="first field after the top"),
        pytest.param("uint8 a ## one\nuint8 b #two", "", "one", "two", id="any number of hashes"),
        pytest.param("uint8 a # one # more\nuint8 b", "", "one # more", "", id="a hash in the comment"),
        pytest.param("# what\n\n# one\nuint8 a # more\nuint8 b", "what", "one\nmore", "", id="above and behind"),
        pytest.param("uint8 a\nuint8 b\n# end", "", "", "", id="below the last"),
    ],
)
def test_a_comment_attaches_to_its_node(text: str, of_message: str, of_a: str, of_b: str) -> None:
    message = read(text)
    assert message.comment == of_message
    assert [field.comment.text for field in message.fields] == [of_a, of_b]


def test_a_constant_has_its_comment_too() -> None:
    message = read("uint8 a # one\nuint8 NONE = 0 # nothing\n# all\nuint8 ALL = 1\nuint8 b # two")
    assert [constant.comment.text for constant in message.constants] == ["nothing", "all"]
    assert [field.comment.text for field in message.fields] == ["one", "two"]


def test_fields_and_constants_keep_their_order() -> None:
    message = read("uint8 b\nuint8 Z = 1\nuint8 a\nuint8 Y = 2")
    assert [field.name for field in message.fields] == ["b", "a"]
    assert [constant.name for constant in message.constants] == ["Z", "Y"]


# PX4's tags


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("[m/s] Speed.", Comment("Speed.", unit="m/s")),
        ("[-] Ratio.", Comment("Ratio.", unit="-")),
        ("[rad]", Comment(unit="rad")),
        ("[@range 0, 100] Percent.", Comment("Percent.", tags=(("range", "0, 100"),))),
        ("[@range -1 (Left), 1 (Right)]", Comment(tags=(("range", "-1 (Left), 1 (Right)"),))),
        ("[@enum NAVIGATION_STATE]", Comment(tags=(("enum", "NAVIGATION_STATE"),))),
        ("[@invalid NaN if unknown] Height.", Comment("Height.", tags=(("invalid", "NaN if unknown"),))),
        ("[@frame NED] North.", Comment("North.", tags=(("frame", "NED"),))),
        (
            "[m] [@range 0, 9] [@enum A] [@invalid 0] [@frame FRD] All.",
            Comment("All.", "m", (("range", "0, 9"), ("enum", "A"), ("invalid", "0"), ("frame", "FRD"))),
        ),
        ("[m][@frame NED]Close.", Comment("Close.", "m", tags=(("frame", "NED"),))),
        ("Height [@frame NED] of it.", Comment("Height of it.", tags=(("frame", "NED"),))),
        ("Height [m]", Comment("Height [m]")),
        ("[-pi, pi] Heading.", Comment("Heading.", tags=(("range", "-pi, pi"),))),
        ("[-PI..PI]", Comment(tags=(("range", "-PI..PI"),))),
        ("[0, 2*pi)", Comment("[0, 2*pi)")),
        ("[0, inf] Speed.", Comment("Speed.", tags=(("range", "0, inf"),))),
        ("[-1, 1] Stick.", Comment("Stick.", tags=(("range", "-1, 1"),))),
        ("[1-99] Percent.", Comment("Percent.", tags=(("range", "1-99"),))),
        ("[rad] [-pi/2, pi/2] Pitch.", Comment("Pitch.", unit="rad", tags=(("range", "-pi/2, pi/2"),))),
        ("[0, 1] [@range 0, 2] Tagged.", Comment("[0, 1] Tagged.", tags=(("range", "0, 2"),))),
        ("Heading [-pi, pi]", Comment("Heading [-pi, pi]")),
        ("[0] Zero.", Comment("[0] Zero.")),
        ("[pi] Half a turn.", Comment("Half a turn.", unit="pi")),
        ("[@unknown 5] Text.", Comment("Text.", tags=(("unknown", "5"),))),
        ("[@uncontrolled NaN] [@new] Text.", Comment("Text.", tags=(("uncontrolled", "NaN"), ("new", "")))),
        ("[@text 1] [@extra 2] Text.", Comment("Text.", tags=(("text", "1"), ("extra", "2")))),
        ("[] Text.", Comment("[] Text.")),
        ("[m Text.", Comment("[m Text.")),
        ("[more words than a unit has] Text.", Comment("[more words than a unit has] Text.")),
        ("", Comment()),
    ],
)
def test_tags_are_taken_out_of_the_text(line: str, expected: Comment) -> None:
    assert parse_comment((line,)) == expected


def test_tags_may_stand_on_any_line_of_a_comment() -> None:
    comment = parse_comment(("Height above home.", "[m] [@frame NED] Down is positive."))
    assert comment == Comment("Height above home.\nDown is positive.", unit="m", tags=(("frame", "NED"),))


def test_a_comment_is_spelled_back_with_its_tags_in_front() -> None:
    assert str(parse_comment(("Speed. [@range 0, 9]",))) == "[@range 0, 9] Speed."


# Topics


@pytest.mark.parametrize(
    ("text", "topics"),
    [
        ("uint64 timestamp", ("foo",)),
        ("# TOPICS one\nuint64 timestamp", ("one",)),
        ("uint64 timestamp\n# TOPICS one two three", ("one", "two", "three")),
        ("# TOPICS one\nuint64 timestamp\n# TOPICS two", ("one", "two")),
        ("# TOPICS fooBar\nuint64 timestamp", ("foo_bar",)),
        ("# TOPICS_OF another word\nuint64 timestamp", ("foo",)),
        ("uint64 timestamp # TOPICS one", ("foo",)),
    ],
)
def test_the_topics_of_a_message(text: str, topics: tuple[str, ...]) -> None:
    assert read(text).topic_names == topics


@pytest.mark.parametrize(
    ("name", "topic"),
    [("SensorCombined", "sensor_combined"), ("TrajectorySetpoint6dof", "trajectory_setpoint6dof"), ("A", "a")],
)
def test_a_message_without_topics_line_is_its_own_topic(name: str, topic: str) -> None:
    message, _ = parse_message("uint64 timestamp", f"{name}.msg", name, "px4_msgs")
    assert message.topic_names == (topic,)


def test_a_topics_line_is_no_comment() -> None:
    message = read("# TOPICS one\n# what\n\nuint8 a\n\n# above\n# TOPICS two\nuint8 b")
    assert message.comment == "what"
    assert [field.comment.text for field in message.fields] == ["", "above"]


@pytest.mark.parametrize(
    "line",
    [
        "# TOPICS one  two",
        "# TOPICS  one",
        "# TOPICS ",
        "# TOPICS a-b",
        "# TOPICS 1a",
    ],
)
def test_a_topics_line_that_the_firmware_would_misread_is_an_error(line: str) -> None:
    assert errors_of(f"uint64 timestamp\n{line}") == ["M402"]


@pytest.mark.parametrize("line", ["# TOPICS", "#TOPICS one", " # TOPICS one", "# TOPIC one"])
def test_a_topics_line_that_the_firmware_ignores_is_a_warning(line: str) -> None:
    assert errors_of(f"uint64 timestamp\n{line}") == ["M406"]
    assert parse_message(f"uint64 timestamp\n{line}", "Foo.msg", "Foo", "px4_msgs")[0].topic_names == ("foo",)


@pytest.mark.parametrize("topic", ["class", "a__b", "_a"])
def test_a_topic_that_only_one_of_px4_and_ros_takes_is_a_warning(topic: str) -> None:
    assert errors_of(f"uint64 timestamp\n# TOPICS {topic}") == ["M205"]


# Constants with a special meaning


@pytest.mark.parametrize(
    ("lines", "expected"), [("uint32 MESSAGE_VERSION = 3\nuint8 ORB_QUEUE_LENGTH = 8\n", (3, 8)), ("", (0, 1))]
)
def test_version_and_queue_length_are_read_from_their_constants(lines: str, expected: tuple[int, int]) -> None:
    message = read(f"{lines}uint64 timestamp")
    assert (message.message_version, message.queue_length) == expected


@pytest.mark.parametrize(
    ("line", "version"),
    [("float32 MESSAGE_VERSION = 2.5", 2), ("bool MESSAGE_VERSION = 1", 1), ("int8 MESSAGE_VERSION = -1", 2**32 - 1)],
)
def test_a_version_of_an_unusual_type_is_a_warning_and_read_as_the_firmware_does(line: str, version: int) -> None:
    message, found = parse_message(line, "Foo.msg", "Foo", "px4_msgs")
    assert [each.code for each in found] == ["M405"]
    assert message.message_version == version


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_a_version_that_is_no_number_is_none(value: str) -> None:
    assert parse_message(f"float32 MESSAGE_VERSION = {value}", "Foo.msg", "Foo", "px4_msgs")[0].message_version == 0


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("ORB_QUEUE_LENGHT", "did you mean 'ORB_QUEUE_LENGTH'?"),
        ("MESSAGE_VERSOIN", "did you mean 'MESSAGE_VERSION'?"),
        ("MESAGE_VERSION", "did you mean 'MESSAGE_VERSION'?"),
        ("ORB_PRIORITY", "only MESSAGE_VERSION and ORB_QUEUE_LENGTH"),
    ],
)
def test_a_constant_like_one_with_a_meaning_is_a_warning(name: str, hint: str) -> None:
    _, (found,) = parse_message(f"uint64 timestamp\nuint8 {name} = 4", "Foo.msg", "Foo", "px4_msgs")
    assert str(found) == f"Foo.msg:2:1: M405 the firmware does not use '{name}', {hint}"


@pytest.mark.parametrize("name", ["LATEST_PROTOCOL_VERSION", "MESSAGE_TYPE_PARAM_SET", "ORBIT_YAW", "VERSION", "QUEUE"])
def test_other_constants_are_nothing_special(name: str) -> None:
    assert errors_of(f"uint64 timestamp\nuint8 {name} = 4") == []


# Tags


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("uint8 a  # [m] [@unti m] Text.", "2:16"),
        ("# [@unti m]\nuint8 a", "2:3"),
        ("# One.\n# [@range 0, 1] [@unti m]\n# Three.\nuint8 a", "3:17"),
        ("uint8 a  # One.\n    # [@unti m]", "3:7"),
        ("uint8 A = 1  # [@unti m]", "2:16"),
        ("uint8 a\n\n  # [@unti m] x", "4:5"),
        ("uint8 a  # One.\n\n  # Two.\n\n\n  # [@unti m] x\n\nuint8 b", "7:5"),
        ("# [@unti m] x\n# TOPICS foo\nuint8 a", "2:3"),
    ],
)
def test_a_tag_that_is_not_known_is_a_warning_in_its_place(text: str, place: str) -> None:
    _, (found,) = parse_message(f"uint64 timestamp\n{text}", "Foo.msg", "Foo", "px4_msgs")
    expected = "unknown tag '@unti': PX4 has @range, @enum, @invalid and @frame, and units such as '[m]'"
    assert str(found) == f"Foo.msg:{place}: M107 {expected}"


def test_a_tag_has_its_place_in_the_response_of_a_service_too() -> None:
    _, found = parse_service("uint8 a\n---\nuint8 b  # [@rnage 0]\n", "Foo.srv", "Foo", "px4_msgs")
    assert list(map(str, found)) == ["Foo.srv:3:12: M107 unknown tag '@rnage', did you mean '@range'?"]


def test_tags_of_other_packages_are_their_own() -> None:
    assert parse_message("uint8 a  # [@unti m]", "Foo.msg", "Foo", "my_msgs", of_uorb=False)[1] == []


# Services


def test_a_service_is_two_messages() -> None:
    service = read_service("# What it asks.\n\nuint8 FAST = 1\nuint8 kind 1\n---\n# What comes back.\n\nbool done\n")
    assert service.comment == "What it asks."
    assert service.response.comment == "What comes back."
    assert (service.request.ros_type, service.response.ros_type) == (
        "px4_msgs/srv/Foo_Request",
        "px4_msgs/srv/Foo_Response",
    )
    assert [constant.name for constant in service.request.constants] == ["FAST"]
    assert [field.name for field in service.request.fields] == ["kind"]
    assert [(field.name, field.location.line) for field in service.response.fields] == [("done", 8)]


@pytest.mark.parametrize(
    ("text", "request_fields", "response_fields"),
    [
        ("---", [], []),
        ("---\nuint8 a", [], ["a"]),
        ("uint8 a\n---", ["a"], []),
        ("uint8 a\n  ---  # answer\nuint8 b", ["a"], ["b"]),
        ("uint8 a  # ---\n---\nuint8 b", ["a"], ["b"]),
        ("uint8 a\n---\nuint8 a", ["a"], ["a"]),
    ],
)
def test_either_half_of_a_service_may_be_empty(
    text: str, request_fields: list[str], response_fields: list[str]
) -> None:
    service = read_service(text)
    assert [field.name for field in service.request.fields] == request_fields
    assert [field.name for field in service.response.fields] == response_fields


@pytest.mark.parametrize(
    ("text", "place"),
    [("uint8 a", 1), ("uint8 a\nuint8 b", 2), ("", 1), ("a\n---\n---", 3), ("---\n---\n---", 2)],
)
def test_a_service_has_exactly_one_separator(text: str, place: int) -> None:
    errors = [error for error in parse_service(text, "Foo.srv", "Foo", "px4_msgs")[1] if error.code == "M105"]
    assert [error.location.line for error in errors] == [place]


def test_a_second_separator_does_not_shift_the_places_below_it() -> None:
    _, errors = parse_service("uint8 a\n---\nuint8 b\n---\nuint8[0] c", "Foo.srv", "Foo", "px4_msgs")
    assert sorted((error.location.line, error.code) for error in errors) == [(4, "M105"), (5, "M303")]


# Whole files


def test_the_embedded_set_has_no_error() -> None:
    errors: list[Diagnostic] = []
    for path in DEFINITIONS:
        text, wrong = decode_text(path.read_bytes(), str(path))
        errors += wrong + parse_message(text, str(path), path.stem, "px4_msgs")[1]
    assert DEFINITIONS
    assert errors == []


def test_a_message_cannot_be_changed() -> None:
    message = read("uint64 timestamp")
    with pytest.raises(AttributeError):
        message.name = "Bar"  # type: ignore[misc]
    assert hash(message) == hash(read("uint64 timestamp"))


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("uint STATUS_OK = 0", "uint8"),
        ("int STATUS_OK = 0", "int32"),
        ("float LIMIT = 0.5", "float32"),
        ("double LIMIT = 0.5", "float64"),
        ("Float32 LIMIT = 0.5", "float32"),
        ("boolean ON = 1", "bool"),
        ("unsigned COUNT = 1", "uint32"),
        ("str NAME = one", "string"),
    ],
)
@pytest.mark.parametrize("of_uorb", [True, False])
def test_the_type_that_a_constant_should_have_is_told(line: str, meant: str, of_uorb: bool) -> None:  # noqa: FBT001
    _, errors = parse_message(f"uint64 timestamp\n{line}\n", "Foo.msg", "Foo", "px4_msgs", of_uorb=of_uorb)
    name = line.partition(" ")[0]
    assert [str(error) for error in errors] == [f"Foo.msg:2:1: M301 unknown type '{name}', did you mean '{meant}'?"]
