"""Tests of what a recording needs: the class of a recorded type, and the definition that MCAP stores as `ros2msg`."""

from __future__ import annotations

import importlib
import io
import re
from pathlib import Path
from random import Random
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msggen.cli import main
from msggen.definitions.identity import message_hash, type_hash
from msggen.definitions.model import ArrayKind, Field, Message
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from support.catalogs import catalog_of, import_package, write_definitions
from support.examples import by_day
from support.other_codecs import Rosbags, everything, generated
from support.random_definitions import PACKAGES, TOLERATED, random_catalog
from support.repository import ROOT, shared

SEPARATOR = "=" * 80 + "\nMSG: "


def test_every_type_is_found_by_its_names(px4_types: Any) -> None:
    classes = [getattr(px4_types.msg, name) for name in px4_types.msg.__all__]
    classes += [px4_types.srv.VehicleCommand.Request, px4_types.srv.VehicleCommand.Response]
    for cls in classes:
        assert px4_types.by_type(cls.__msg__.ros_type) is cls
        assert px4_types.by_type(cls.__msg__.dds_type) is cls
    assert px4_types.by_type("px4_msgs/EscStatus") is px4_types.EscStatus


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("px4_msgs/msg/EscStatu", "no message type 'px4_msgs/msg/EscStatu', did you mean 'px4_msgs/msg/EscStatus'?"),
        ("std_msgs/msg/Header", "no message type 'std_msgs/msg/Header': the package has the types of px4_msgs"),
        ("px4_msgs/srv/VehicleCommand", "did you mean 'px4_msgs/srv/VehicleCommand_Request'?"),
        ("px4_msgs/msg/__dict__", "no message type 'px4_msgs/msg/__dict__'"),
        ("px4_msgs/os/path", "no message type 'px4_msgs/os/path'"),
        ("EscStatus", "no message type 'EscStatus'"),
        ("", "no message type ''"),
    ],
)
def test_an_unknown_type_is_named(name: str, text: str, px4_types: Any) -> None:
    with pytest.raises(KeyError) as raised:
        px4_types.by_type(name)
    assert text in str(raised.value)


def test_types_with_unusual_names_are_found(tmp_path: Path) -> None:
    files = {"msg/esc_report.msg": "uint8 a\n", "msg/None.msg": "uint8 b\n"}
    package: Any = import_package(catalog_of(tmp_path / "in", files, TOLERATED), tmp_path)
    assert package.by_type("px4_msgs/msg/esc_report") is package.EscReport
    assert package.by_type("px4_msgs/msg/None") is package.None_


@by_day("seed", range(3), 3)
def test_rosbags_reads_the_definitions(seed: int, tmp_path: Path) -> None:
    """Strings, sequences, bounds, defaults and constants: rosbags decodes the same bytes to the same values."""
    chance = Random(seed)  # noqa: S311 - not used for security
    catalog = random_catalog(tmp_path, chance, 40, 0, ("string",))
    peer = Rosbags(catalog)
    with generated(catalog, tmp_path) as ours:
        store = get_typestore(Stores.EMPTY)
        for message in everything(catalog):
            info = ours.cls(message).__msg__
            store.register(get_types_from_msg(info.definition, info.ros_type))
        assert {name: store.fielddefs[name][1] for name in store.fielddefs} == {
            name: peer.store.fielddefs[name][1] for name in store.fielddefs
        }


@by_day("release", ["v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03"], 6)
@pytest.mark.slow
def test_definitions_have_the_hashes_of_their_message(release: str, tmp_path: Path) -> None:
    """All definitions of a release, taken from the package, are read as a release with the same hashes."""
    catalog = read_catalog(find_sources(str(shared(f"firmware/{release}"))), tolerated=TOLERATED)
    package: Any = import_package(catalog, tmp_path / "package")
    files = {}
    for message in catalog.messages.values():
        text = package.by_type(message.ros_type).__msg__.definition
        files[f"msg/{message.name}.msg"] = text.partition(SEPARATOR)[0]
    again = catalog_of(tmp_path / "again", files, TOLERATED)
    for key, message in catalog.messages.items():
        assert message_hash(again, again.messages[key]) == message_hash(catalog, message)
        assert type_hash(again, again.messages[key]) == type_hash(catalog, message)
        constants = [(one.name, one.type, one.value) for one in message.constants]
        assert [(one.name, one.type, one.value) for one in again.messages[key].constants] == constants


def test_a_package_is_built_from_a_recorded_schema(tmp_path: Path, monkeypatch: Any, px4_types: Any) -> None:
    """The code of docs/package.md writes definitions with the hash of the recorded message."""
    page = (ROOT / "docs" / "package.md").read_text(encoding="utf-8")
    (code,) = [block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "re.split" in block]
    (command,) = re.findall(r"^\$ msggen (build .* --package rec_types)$", page, re.MULTILINE)
    file = io.BytesIO()
    writer: Any = Writer(file)
    writer.start()
    info = px4_types.EscStatus.__msg__
    line = "=" * 80
    header = f"builtin_interfaces/Time stamp\n{line}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    for name, encoding, text in [
        (info.ros_type, "ros2msg", info.definition),
        ("std_msgs/msg/String", "ros2msg", "string data\n"),
        ("std_msgs/msg/Header", "ros2msg", header),
        ("else/Where", "protobuf", "\0"),
    ]:
        schema = writer.register_schema(name, encoding, text.encode())
        writer.register_channel(f"/{name}", "cdr", schema)
    writer.finish()
    monkeypatch.chdir(tmp_path)
    file.seek(0)
    exec(code, {"Path": Path, "re": re, "file": file, "make_reader": make_reader})  # noqa: S102 - our own text
    assert main([*command.split(), "-q", "-o", "."]) == 0
    monkeypatch.syspath_prepend(str(tmp_path))
    package = importlib.import_module("rec_types")
    assert package.EscStatus.__msg__.message_hash == info.message_hash
    others = ("--msg-dir", "std_msgs=rec/std_msgs", "--msg-dir", "builtin_interfaces=rec/builtin_interfaces")
    assert main([*command.split(), "-q", "-o", "more", *others]) == 0


RESPELT = {
    "with comments and spaces": (r"(?m)^(\S+) +(\w+)$", r"  \1 \t \2   # [m/s] x=1", True),
    "with blank lines": (r"(?m)^(\S+ \w+)$", "\\1\n\n# a comment", True),
    "of Windows": (r"\n", "\r\n", True),
    "with the package of nested types": (r"(?m)^EscReport", "px4_msgs/EscReport", True),
    "with other constants": (r"(?m)=(\d+)$", r" =  7\1", True),
    "with a field of another type": ("uint16 counter", "int16 counter", False),
    "with a field of another name": ("uint16 counter", "uint16 counted", False),
    "with a nested field of another name": ("int32 esc_rpm", "int32 rpm", False),
    "with another length": (r"EscReport\[12\]", "EscReport[8]", False),
    "without a field": ("uint16 counter\n", "", False),
    "with one more field": (r"uint16 counter\n", "uint16 counter\nuint8 more\n", False),
    "without its nested message": (r"(?s)={80}.*", "", False),
}


@pytest.mark.parametrize(("pattern", "new", "is_same"), RESPELT.values(), ids=RESPELT)
def test_a_recorded_schema_matches_if_it_has_the_same_fields(
    pattern: str, new: str, *, is_same: bool, px4_types: Any
) -> None:
    cls = px4_types.EscStatus
    schema, changes = re.subn(pattern, new, cls.__msg__.definition)
    assert changes
    for each in (schema, schema.encode()):
        assert px4_types.recordings.matches(cls, each) is is_same


def test_only_the_own_schema_matches(px4_types: Any) -> None:
    """Messages with the same fields, such as those of actuators, have the same hash."""
    hashes = {name: getattr(px4_types, name).__msg__ for name in px4_types.msg.__all__[::5]}
    for name, info in hashes.items():
        for other, schema in hashes.items():
            matches = px4_types.recordings.matches(getattr(px4_types, name), schema.definition)
            assert matches is (info.message_hash == schema.message_hash), (name, other)


def defaults_of(message: Message) -> dict[str, object]:
    """Return the defaults of fields, without zeros and empty sequences."""

    def is_zero(field: Field) -> bool:
        values = field.default if isinstance(field.default, tuple) else (field.default,)
        return not (len(values) if field.type.array in (ArrayKind.BOUNDED, ArrayKind.UNBOUNDED) else any(values))

    return {field.name: field.default for field in message.fields if field.default is not None and not is_zero(field)}


def test_definitions_of_strings_and_sequences_have_the_same_hashes(tmp_path: Path) -> None:
    chance = Random(3)  # noqa: S311 - not used for security
    catalog = random_catalog(tmp_path / "in", chance, 40, 0)
    folder = tmp_path / "again"
    with generated(catalog, tmp_path) as ours:
        for message in everything(catalog):
            text = ours.cls(message).__msg__.definition.partition(SEPARATOR)[0]
            write_definitions(folder / message.package, {f"msg/{message.name}.msg": text})
        own, other = PACKAGES
        sources = find_sources(str(folder / own), (f"{other}={folder / other}",))
        again = read_catalog(sources, tolerated=TOLERATED)
        for key, message in catalog.messages.items():
            assert type_hash(again, again.messages[key]) == type_hash(catalog, message)
            assert repr(defaults_of(again.messages[key])) == repr(defaults_of(message))


DEFAULTS = (
    'string A=\'it is "so"\'\nfloat32 B=-1.5\nbool C=true\nint8[3] a [1, 2, 3]\nstring s "x \\"y\\""\nbool b true\n'
    'string<=5[<=2] t ["a", "b"]\nwstring w\nfloat64 f 1e-09\nuint8[] r\nInner[] i\n'
)


def test_defaults_and_constants_are_spelled(tmp_path: Path) -> None:
    files = {"msg/Inner.msg": "uint8 a 7\n", "msg/Outer.msg": DEFAULTS}
    package: Any = import_package(catalog_of(tmp_path / "in", files, TOLERATED), tmp_path)
    definition = package.Outer.__msg__.definition
    own, nested = definition.split(SEPARATOR)
    assert nested == "px4_msgs/Inner\nuint8 a 7\n"
    again: Any = import_package(
        catalog_of(tmp_path / "again", {"msg/Inner.msg": "uint8 a 7\n", "msg/Outer.msg": own}, TOLERATED), tmp_path
    )
    assert repr(again.Outer()) == repr(package.Outer())
    assert [(one.name, one.value) for one in again.Outer.__msg__.constants] == [
        ("A", 'it is "so"'),
        ("B", -1.5),
        ("C", True),
    ]


def test_an_mcap_file_is_read_by_others(px4_types: Any) -> None:
    message = px4_types.EscStatus(timestamp=5, esc_count=2)
    message.esc[1].esc_rpm = 1234
    file = io.BytesIO()
    writer: Any = Writer(file)
    writer.start()
    info = message.__msg__
    schema = writer.register_schema(info.ros_type, "ros2msg", info.definition.encode())
    channel = writer.register_channel("/fmu/out/esc_status", "cdr", schema)
    writer.add_message(channel, log_time=0, data=message.encode(), publish_time=0)
    writer.finish()
    file.seek(0)
    ((found, _, _, decoded),) = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
    assert found is not None
    assert px4_types.by_type(found.name) is px4_types.EscStatus
    assert (decoded.timestamp, decoded.esc_count, decoded.esc[1].esc_rpm) == (5, 2, 1234)


def test_an_archived_version_has_the_definition_of_its_release(tmp_path: Path) -> None:
    files = {
        "msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\nbool lit\n",
        "msg/px4_msgs_old/msg/LampV0.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nuint8 lights\n",
    }
    catalog = read_catalog(with_archived(find_sources(str(write_definitions(tmp_path / "in", files)))))
    package: Any = import_package(catalog, tmp_path)
    assert package.LampV0.__msg__.definition.endswith("uint64 timestamp\nuint8 lights\n")
    assert package.by_type("px4_msgs/msg/Lamp") is package.Lamp
    assert package.by_type("px4_msgs/msg/LampV0") is package.LampV0
