"""The contestants: how each one declares, decodes and encodes a message.

A peer is the text of a program that its users would write, made from msggen's model of the message. The same
program runs in process for timing, and in a fresh interpreter to measure start-up.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import ClassVar

from messages import GENERATED, Sample, fields_text
from msggen.definitions.model import ArrayKind, Message


class CannotError(Exception):
    """A peer cannot declare a message."""


class Peer:
    """A package. Its statements use the names that `program` defines, `data` and `message`."""

    name: ClassVar[str]
    decode: ClassVar[str] = "decode(data)"
    encode: ClassVar[str] = "encode(message)"
    prepare: ClassVar[str] = "message"
    """The input of encoding, made from the decoded message."""
    notes: ClassVar[Mapping[str, str]] = {}
    """Notes below the tables "decode" and "encode"."""
    signed_char: ClassVar[bool] = False
    """Whether the package reads `char` as a signed number. Comparisons take this into account."""

    def program(self, sample: Sample) -> str:
        """Return the program that defines the names in `decode` and `encode`.

        Raises CannotError if the package has no types for the message.
        """
        raise NotImplementedError

    @classmethod
    def version(cls) -> str:
        """Return the installed version, or "" if the package is not installed."""
        try:
            return version(cls.name)
        except PackageNotFoundError:
            return ""


class Msggen(Peer):
    """The generated package."""

    name = "msggen"
    decode = "Type.decode(data)"
    encode = "message.encode()"

    def program(self, sample: Sample) -> str:
        """Return an import from the committed package."""
        return f"import sys\nsys.path.insert(0, {str(GENERATED)!r})\nfrom px4_types import {sample.name} as Type\n"


class Floor(Peer):
    """Only `struct` with the message's own format: the least work of decoding and encoding in Python."""

    name = "unpack floor"
    decode = "unpack_from(data)"
    encode = "pack(*message)"

    def program(self, sample: Sample) -> str:
        """Return the program of msggen, and the two functions of `struct`."""
        codec = "import struct\ncodec = struct.Struct('<H2x' + Type.__layout__.xcdr1)\n"
        return f"{Msggen().program(sample)}{codec}unpack_from, pack = codec.unpack_from, codec.pack\n"


class Rosbags(Peer):
    """Generates numpy-based classes from definitions at run time."""

    name = "rosbags"
    decode = "store.deserialize_cdr(data, NAME)"
    encode = "store.serialize_cdr(message, NAME)"

    def program(self, sample: Sample) -> str:
        """Return a type store with the message and its nested messages."""
        registered = "".join(
            f"store.register(get_types_from_msg({fields_text(message)!r}, {message.ros_type!r}))\n"
            for message in (*sample.nested, sample.message)
        )
        return (
            "from rosbags.typesys import Stores, get_types_from_msg, get_typestore\n"
            f"NAME = {sample.message.ros_type!r}\n"
            "store = get_typestore(Stores.EMPTY)\n"
            f"{registered}"
        )


class McapRos2(Peer):
    """The decoder of the MCAP project. Its encoders, which its writer uses, have no public name."""

    name = "mcap-ros2-support"
    notes: ClassVar[Mapping[str, str]] = {
        "decode": "reads `char` as a signed number; the values are compared as unsigned"
    }
    signed_char = True

    def program(self, sample: Sample) -> str:
        """Return functions for a schema, as a recording has it."""
        name, text = sample.message.ros_type, sample.definition()
        return (
            "from mcap.records import Schema\n"
            "from mcap_ros2._dynamic import serialize_dynamic\n"
            "from mcap_ros2.decoder import DecoderFactory\n"
            f"schema = Schema(id=1, name={name!r}, encoding='ros2msg', data={text.encode()!r})\n"
            "decode = DecoderFactory().decoder_for('cdr', schema)\n"
            f"encode = serialize_dynamic({name!r}, {text!r})[{name!r}]\n"
        )


class McapRos2Fast(Peer):
    """Generates decoders from definitions at run time; arrays are views into the payload."""

    name = "mcap-ros2-support-fast"
    prepare = "plain(message)"
    notes: ClassVar[Mapping[str, str]] = {
        "decode": "does not convert the bytes of arrays: its arrays are views into the payload",
        "encode": "does not accept its own decoded arrays, so it gets dictionaries, as in its documentation",
    }

    def program(self, sample: Sample) -> str:
        """Return functions for a schema, as a recording has it."""
        return (
            "from types import SimpleNamespace\n"
            "from mcap_ros2_support_fast import DecoderFactory, ROS2EncoderFactory\n"
            f"schema = SimpleNamespace(id=1, name={sample.message.ros_type!r}, encoding='ros2msg',\n"
            f"    data={sample.definition().encode()!r})\n"
            "decode = DecoderFactory().decoder_for('cdr', schema)\n"
            "encode = ROS2EncoderFactory().encoder_for(schema)\n"
            "def plain(value):\n"
            "    if isinstance(value, memoryview):\n"
            "        return value if value.format == 'B' else value.tolist()\n"
            "    if isinstance(value, list):\n"
            "        return [plain(item) for item in value]\n"
            "    names = getattr(value, '__slots__', ())\n"
            "    return {name: plain(getattr(value, name)) for name in names} if names else value\n"
        )


class Cyclone(Peer):
    """Classes of an IDL, serialized field by field. Creates no participant and opens no socket."""

    name = "cyclonedds"
    decode = "Type.deserialize(data)"
    encode = "message.serialize()"
    module: ClassVar[str] = "cyclonedds.idl"

    def program(self, sample: Sample) -> str:
        """Return data classes with annotations for every field."""
        classes = "".join(self._class(message) for message in _inside_out(sample))
        return (
            "from dataclasses import dataclass\n"
            f"from {self.module} import IdlStruct\n"
            f"from {self.module}.types import array, {_NUMBERS}\n"
            f"{classes}"
            f"Type = {sample.name}\n"
        )

    def _class(self, message: Message) -> str:
        typename = message.dds_type.replace("::", ".")
        fields = _annotated(message, "array[{item}, {length}]")
        return f'@dataclass\nclass {message.name}(IdlStruct, typename="{typename}"):\n{fields}'


class Pycdr2(Cyclone):
    """The serializer of cyclonedds as a separate package."""

    name = "pycdr2"
    module = "pycdr2"


class Cydr(Peer):
    """Compiles a codec for each message with Cython and a C compiler when it is first used."""

    name = "cydr"
    decode = "Type.deserialize(data)"
    encode = "message.serialize()"
    notes: ClassVar[Mapping[str, str]] = {
        "decode": "compiles each message once with Cython and a C compiler; this is not counted"
    }

    def program(self, sample: Sample) -> str:
        """Return structs with annotations for every field."""
        fields = [field for message in (*sample.nested, sample.message) for field in message.fields]
        if any(field.type.array is ArrayKind.FIXED and not field.type.is_primitive for field in fields):
            raise CannotError("has no arrays of messages")
        classes = "".join(self._class(message) for message in _inside_out(sample))
        return (
            "from cydr import XcdrStruct\n"
            "from cydr.types import boolean as bool\n"
            f"from cydr.types import NDArray, Shape, {_NUMBERS}\n"
            f"{classes}"
            f"Type = {sample.name}\n"
        )

    def _class(self, message: Message) -> str:
        fields = _annotated(message, 'NDArray[Shape["{length}"], {item}]')
        return f"class {message.name}(XcdrStruct):\n{fields}"


OURS = Msggen()
FLOOR = Floor()
PEERS: tuple[Peer, ...] = (Rosbags(), McapRos2(), McapRos2Fast(), Pycdr2(), Cyclone(), Cydr())
"""All peers, in the order of the tables."""

_NUMBERS = "float32, float64, int8, int16, int32, int64, uint8, uint16, uint32, uint64"
"""The number types that the packages with IDL names have in common."""


def _inside_out(sample: Sample) -> list[Message]:
    """Return the message and its nested messages at every depth, each after those that it nests."""
    return sorted((*sample.nested, sample.message), key=lambda message: len(sample.catalog.nested_all(message)))


def _annotated(message: Message, array: str) -> str:
    """Return the fields as annotations; `char` and `byte` are `uint8` on the wire."""
    lines = []
    for field in message.fields:
        item = {"char": "uint8", "byte": "uint8"}.get(field.type.name, field.type.name)
        is_array = field.type.array is ArrayKind.FIXED
        lines.append(f"    {field.name}: {array.format(item=item, length=field.type.length) if is_array else item}\n")
    return "".join(lines)
