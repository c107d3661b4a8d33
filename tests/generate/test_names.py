"""Tests of names that Python or the generated class reserves: only the Python name gets an underscore."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import keyword
import pickle
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen.base.diagnostics import InputError
from msggen.definitions.identity import message_hash, type_hash
from msggen.definitions.layout import is_static
from msggen.definitions.model import Catalog, Message
from msggen.definitions.parse.definition import parse_message, parse_service
from msggen.generate.python.names import attribute_names, class_name, member_names, module_name
from msggen.generate.python.package import list_package, render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from support.catalogs import catalog_of, import_package, write_definitions
from support.random_definitions import values_of
from support.reference import HEADERS, class_of, deserialize, serialize, to_object, to_values
from support.unusual_names import WORDS, write_sources

STAMP = "uint64 timestamp\n"
CLASSES = {
    "Odd": "Odd",
    "esc_report": "EscReport",
    "None": "None_",
    "DecodeError": "DecodeError_",
    "GPS": "GPS",
    "foo": "Foo",
    "foo_bar": "FooBar",
    "FOO": "FOO",
}


@pytest.fixture(scope="module")
def catalog(tmp_path_factory: pytest.TempPathFactory) -> Catalog:
    """The catalog of FILES, and of OTHER as the package `other_msgs`."""
    return write_sources(tmp_path_factory.mktemp("names"))


@pytest.fixture(scope="module")
def package(catalog: Catalog, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The package generated from the catalog."""
    made = import_package(catalog, tmp_path_factory.mktemp("package"))
    importlib.import_module(f"{made.__name__}.other_msgs.msg")
    return made


def home_of(package: Any, catalog: Catalog, message: Message) -> Any:
    return package.msg if message.package == catalog.package else package.other_msgs.msg


def every(package: Any, catalog: Catalog) -> list[tuple[Message, Any]]:
    """Return all messages with their classes."""
    found = catalog.messages.values()
    return [(message, class_of(home_of(package, catalog, message), message)) for message in found]


# Rules


def message_of(text: str, name: str = "Foo") -> Message:
    return parse_message(text, f"{name}.msg", name, "px4_msgs")[0]


@pytest.mark.parametrize("word", [*WORDS, *keyword.kwlist])
def test_a_name_that_is_taken_gets_an_underscore(word: str) -> None:
    message = message_of(f"uint8 {word}\nuint8 x\n")
    assert attribute_names(message) == {word: f"{word}_", "x": "x"}


def test_a_name_that_stands_in_the_definition_is_never_given_to_another() -> None:
    message = message_of("uint8 decode\nuint8 decode_\nuint8 decode__\nuint8 from\nuint8 from_ = 1\n")
    expected = {"decode": "decode___", "decode_": "decode_", "decode__": "decode__", "from": "from__", "from_": "from_"}
    assert attribute_names(message) == expected


def test_the_order_of_fields_does_not_matter() -> None:
    one, other = message_of("uint8 from\nuint8 from_\n"), message_of("uint8 from_\nuint8 from\n")
    assert attribute_names(one) == attribute_names(other) == {"from": "from__", "from_": "from_"}


def test_a_constant_that_is_called_like_a_class_gets_an_underscore() -> None:
    assert attribute_names(message_of("uint8 GPS = 1\nuint8 a\n"), ("GPS", "A")) == {"GPS": "GPS_", "a": "a"}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("EscReport", "EscReport"),
        ("esc_report", "EscReport"),
        ("Esc_Report", "EscReport"),
        ("foo", "Foo"),
        ("FOO", "FOO"),
        ("None", "None_"),
        ("none", "None_"),
        ("True", "True_"),
        ("DecodeError", "DecodeError_"),
        ("encode_error", "EncodeError_"),
    ],
)
def test_classes_are_camel_case_and_no_keywords(name: str, expected: str) -> None:
    assert class_name(message_of(STAMP, name)) == expected


def test_halves_of_services_keep_their_names() -> None:
    service, _ = parse_service("---\n", "None.srv", "None", "px4_msgs")
    assert [class_name(each) for each in (service, service.request)] == ["None_", "None_Request"]


def test_members_of_the_enum_are_free_of_what_enums_have() -> None:
    topics = ["mro", "mro_", "name", "real", "from", "_x_", "_y", "odd"]
    names = ["mro__", "mro_", "name_", "real_", "from_", "_x__", "_y", "odd"]
    assert list(member_names(topics).values()) == names


def test_modules_keep_apart_what_the_firmware_does() -> None:
    assert [module_name(name) for name in ("Foo", "FOO", "foo_bar", "None")] == ["_foo", "_f_o_o", "_foo_bar", "_none"]


# Package


def test_every_message_has_its_class(package: Any, catalog: Catalog) -> None:
    for message in catalog.uorb_messages:
        cls = getattr(package, CLASSES[message.name])
        assert cls is getattr(package.msg, CLASSES[message.name])
        assert (cls.__name__, cls.__msg__.name) == (CLASSES[message.name], message.name)
        assert cls.__msg__.ros_type == f"px4_msgs/msg/{message.name}"
        assert cls.__msg__.message_hash == message_hash(catalog, message)
        assert cls.__msg__.type_hash == type_hash(catalog, message)
    assert package.DecodeError is not package.DecodeError_
    assert issubclass(package.DecodeError, ValueError)


def test_fields_say_their_name_and_their_attribute(package: Any) -> None:
    fields = package.Odd.__msg__.fields
    assert [field.name for field in fields] == ["timestamp", *WORDS, "decode_", "bands"]
    assert [field.attribute for field in fields] == [
        "timestamp",
        *[f"{word}_" if word != "decode" else "decode__" for word in WORDS],
        "decode_",
        "bands",
    ]
    assert package.Odd.__match_args__ == package.Odd.__slots__ == tuple(field.attribute for field in fields)


def test_constants_and_fields_are_told_apart(package: Any) -> None:
    odd = package.Odd(bands=7)
    assert (odd.BANDS, odd.bands, odd.None_, odd.fast, odd.list) == (3, 7, 4, 5, 6)
    assert (package.GPS.GPS_, package.Foo.GPS_, package.Foo().x) == (1, 2, package.GPS())


@pytest.mark.slow
def test_every_message_equals_the_reference(package: Any, catalog: Catalog) -> None:
    for message, cls in every(package, catalog):
        for seed in range(20):
            values = values_of(catalog, message, Random(seed))  # noqa: S311 - not used for security
            made = to_object(package, catalog, message, values)
            expected = serialize(catalog, message, values, "little", 1)
            assert made.encode() == expected
            for encoding in HEADERS:
                decoded = cls.decode(serialize(catalog, message, values, *encoding))
                assert decoded == made
                assert repr(to_values(catalog, message, decoded)) == repr(values)
            assert repr(deserialize(catalog, message, made.encode())) == repr(values)


def test_views_and_batches_read_the_same(package: Any, catalog: Catalog) -> None:
    for message, cls in every(package, catalog):
        if not is_static(catalog, message):
            continue
        drawn = [values_of(catalog, message, Random(seed)) for seed in range(5)]  # noqa: S311 - not used for security
        samples = [serialize(catalog, message, values, "little", 1) for values in drawn]
        views = [cls.lazy(sample) for sample in samples]
        assert [repr(to_values(catalog, message, view)) for view in views] == [repr(values) for values in drawn]
        array = cls.decode_batch(samples)
        assert array.dtype.names == tuple(field.name for field in message.fields)
        assert cls.encode_batch(array) == samples
        assert [cls.from_row(row) for row in array] == [cls.decode(sample) for sample in samples]


def test_batches_have_the_names_of_the_definition(package: Any) -> None:
    batch = importlib.import_module(f"{package.__name__}.batch")
    array = package.DecodeError_.decode_batch([package.DecodeError_(pass_=(1.0, 2.0)).encode()])
    assert array.dtype.names == ("timestamp", "none", "def", "gps", "pass")
    columns = batch.columns(array)
    assert columns["pass[1]"] == np.array([2.0])
    assert {"def[1].in.is", "none.esc_report[2].global[19]"} <= columns.keys()


def test_messages_are_copied_pickled_and_taken_apart(package: Any) -> None:
    odd = package.Odd(1, *range(1, 10), decode_=10, bands=11)
    assert (odd.from_, odd.decode__, odd.decode_) == (1, 5, 10)
    assert odd == copy.deepcopy(odd) == dataclasses.replace(odd)
    assert odd == pickle.loads(pickle.dumps(odd))  # noqa: S301 - our own bytes
    assert dataclasses.replace(odd, self_=0.5).self_ == 0.5
    assert dataclasses.asdict(odd)["lambda_"] == 2
    assert [field.name for field in dataclasses.fields(odd)] == [*package.Odd.__match_args__]
    assert "from_=1" in repr(odd)
    assert eval(repr(odd), {"Odd": package.Odd}) == odd  # noqa: S307 - our own text
    match odd:
        case package.Odd(lambda_=found, bands=11):
            assert found == 2
        case _:
            pytest.fail("no match")


def test_errors_name_the_field_as_the_definition_does(package: Any) -> None:
    with pytest.raises(package.EncodeError, match=r"^None\.in\.is: expected uint8, 0 to 255, got 256$"):
        package.None_(in_=package.EscReport(is_=256)).encode()
    with pytest.raises(package.EncodeError, match=r"^Odd\.from: expected float32, got 'x'$"):
        package.Odd(from_="x").encode()
    with pytest.raises(
        package.EncodeError, match=r"^None\.esc_report\[0\]: expected esc_report, got px4_msgs/msg/GPS$"
    ):
        package.None_(esc_report=(package.GPS(),) * 3).encode()


def test_documentation_says_what_the_definition_calls_it(package: Any) -> None:
    source = Path(importlib.import_module(package.Odd.__module__).__file__ or "").read_text()
    assert '    from_: builtins.float\n    """`from` in the definition, float32 [m] A length."""\n' in source


def test_topics_and_endpoints_lead_to_the_class(package: Any) -> None:
    topics = importlib.import_module(f"{package.__name__}.topics")
    assert {"mro_", "name_", "from_", "real_", "odd"} <= set(topics.ORB_ID.__members__)
    assert topics.ORB_ID.mro_ == topics.UORB["mro"].orb_id
    assert topics.UORB["mro"].message is package.Odd
    assert topics.UORB["esc_report"].message is package.EscReport
    endpoint = topics.endpoint("/fmu/out/foo")
    assert (endpoint.message, endpoint.message_name) == (package.Foo, "Foo")


def test_a_service_may_have_a_keyword_for_a_name(package: Any) -> None:
    srv = importlib.import_module(f"{package.__name__}.srv")
    assert srv.None_.Request is srv.None_Request
    assert srv.None_.Request.decode(srv.None_.Request(from_=3).encode()).from_ == 3
    assert srv.None_.Response().raise_ == package.EscReport()


def test_the_list_of_files_is_that_of_what_is_made(catalog: Catalog) -> None:
    assert list(list_package(catalog)) == [*render_package(catalog, "any")]


def test_versions_are_converted_by_the_names_of_the_definition(tmp_path: Path) -> None:
    files = {
        "msg/versioned/lamp.msg": f"uint32 MESSAGE_VERSION = 1\n{STAMP}float64 from\nuint8 lambda\nuint16 new\n",
        "msg/px4_msgs_old/msg/LampV0.msg": f"uint32 MESSAGE_VERSION = 0\n{STAMP}float32 from\nuint8 lambda\nuint8 is\n",
        "msg/versioned/Lamp2.msg": STAMP,
    }
    files["msg/versioned/Lamp.msg"] = files.pop("msg/versioned/lamp.msg")
    source = write_definitions(tmp_path / "in", files)
    package = import_package(read_catalog(with_archived(find_sources(str(source)))), tmp_path)
    converted = package.LampV0(from_=0.5, lambda_=3, is_=4).upgrade()
    assert converted.message == package.Lamp(from_=0.5, lambda_=3)
    assert (converted.dropped, converted.defaulted) == (("is",), ("new",))
    assert converted.message.downgrade().message == package.LampV0(from_=0.5, lambda_=3)


# Remaining errors


def test_two_messages_that_would_be_one_class_are_refused(tmp_path: Path) -> None:
    catalog = catalog_of(tmp_path, {"msg/A_1.msg": STAMP, "msg/A1.msg": STAMP})
    for make in (list_package, lambda catalog: render_package(catalog, "any")):
        with pytest.raises(InputError) as caught:
            make(catalog)
        (found,) = caught.value.diagnostics
        assert str(found) == (
            f"{tmp_path}/msg/A_1.msg:1:1: M202 "
            f"the class of 'A_1' would be 'A1', the same as that of {tmp_path}/msg/A1.msg"
        )
