"""The formats in a ULog: what they say of the samples of a topic, and the same as a definition of ROS 2."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.recordings.files.ulog.names import MESSAGES
from msggen.recordings.source.rows import Layout, bools_at
from msggen.recordings.source.source import SEPARATOR, RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping

FRONT = 3
"""The size of what is before the content of a message: its size and its kind."""
PAYLOAD = 5
"""The offset of a sample in its message, behind the number of its subscription."""
NUMBERS = 1 << 16
"""How many numbers a topic can have, and how many sizes a message."""
_NUMBERS = {
    "int8_t": ("i1", "int8"),
    "uint8_t": ("u1", "uint8"),
    "int16_t": ("<i2", "int16"),
    "uint16_t": ("<u2", "uint16"),
    "int32_t": ("<i4", "int32"),
    "uint32_t": ("<u4", "uint32"),
    "int64_t": ("<i8", "int64"),
    "uint64_t": ("<u8", "uint64"),
    "float": ("<f4", "float32"),
    "double": ("<f8", "float64"),
    "bool": ("?", "bool"),
    "char": ("u1", "char"),
}
"""The code in numpy and the name in ROS 2 of each type (https://docs.px4.io/main/en/dev_log/ulog_file_format.html)."""
_FIELD = re.compile(r"([^\s\[\]:\x00-\x1f]+)(?:\[(\d{1,5})\])? ([^\s\[\].:]+)")
FORMAT = re.compile(rb"[^:]+:(?:[^\s\[\]:;\x00-\x1f]+(?:\[\d{1,5}\])? [^\s\[\].:;]+;?)+")
"""The text of a whole format: two messages are none."""
_ROS_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_PADDING = "_padding"
_VALUE, _BOOL, _FILL = b"\1", b"\2", b"\0"
_RUN = re.compile(rb"[^\0]+")
_LARGEST = (1 << 16) - 1 - 2
"""The size of the largest sample: a message has 65,535 bytes, two of them for its number."""
_DEEPEST = 32
_LARGEST_SUM = 2 << 20
"""The most bytes of the samples and the definitions of all topics of a log. Those of PX4 have some 100 kB."""
LONGEST_RUN = 1 << 17
"""The most bytes of all formats of a log that are kept. Those of PX4 have some 20 kB."""
_MOST_RUNS = 16
"""Of how many logs all formats are kept: those of one firmware have the same ones."""


class FormatError(RecordingError):
    """A format that cannot be read."""


class _Field(NamedTuple):
    """A field of a format."""

    type: str
    length: int | None
    """The length of an array, None for a single value."""
    name: str
    is_padding: bool


class _Block(NamedTuple):
    """The bytes of a format."""

    names: list[str]
    formats: list[Any]
    offsets: list[int]
    marks: bytes
    """A byte for each: a value, a bool, or padding."""
    end: int
    """The offset behind the last field that is not padding."""

    def dtype(self, size: int) -> np.dtype[Any]:
        return np.dtype({"names": self.names, "formats": self.formats, "offsets": self.offsets, "itemsize": size})


class Described(NamedTuple):
    """What the format of a topic says, with those that it nests."""

    ros_type: str
    """The type in ROS 2."""
    definition: str
    layout: Layout
    clock: int | None
    """The offset of the time in samples, None if they have none."""


class Formats:
    """The formats of a ULog by their names."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._twins: dict[str, dict[int, set[str]]] = {}
        """The names of formats by their fields, then by their length."""
        self._known: dict[str, Described] = {}
        """What was asked for so far."""
        self._is_shared = False
        """Whether other logs have the same texts, names and answers."""
        self._fields: dict[str, tuple[_Field, ...]] = {}
        self._blocks: dict[str, _Block] = {}
        self._sum = 0
        """The bytes of the samples and the definitions of all topics so far."""

    def __contains__(self, name: str) -> bool:
        """Whether there is a format."""
        return name in self._texts

    @property
    def shared(self) -> Mapping[str, Any]:
        """What other logs that begin with the same formats can have, too."""
        return {"_texts": self._texts, "_twins": self._twins, "_known": self._known, "_is_shared": True}

    @property
    def is_empty(self) -> bool:
        """Whether there are no formats yet."""
        return not self._texts

    def begin(self, run: bytes) -> bool:
        """Take the messages with the first formats of a log. Return False if that has to be done one by one."""
        found = None if self._texts or not 0 < len(run) <= LONGEST_RUN else _formats_in(run)
        if found is None:
            return False
        self.__dict__.update(found.shared)
        return True

    def add(self, text: str) -> None:
        """Take the text of a format, such as `esc_status:uint64_t timestamp;esc_report[8] esc;`.

        A text that cannot be read matters only to the topics that need it.
        """
        if self._is_shared:
            self._texts = dict(self._texts)
            self._twins = {fields: {n: set(names) for n, names in own.items()} for fields, own in self._twins.items()}
            self._is_shared = False
        self._known = {}
        name, _, fields = text.partition(":")
        if name in self._texts:
            self._sum += sum(len(self._texts[each]) for each in self._fields)  # they are read again
            self._fields, self._blocks = {}, {}
            self._twins[self._texts[name]][len(name)].discard(name)
        self._texts[name] = text = fields.strip(";")
        self._twins.setdefault(text, {}).setdefault(len(name), set()).add(name)

    def described(self, name: str) -> Described:
        """Return what the format of a topic says. Other logs can have the same dtype. Raises FormatError."""
        self._count(0)
        found = self._known.get(name)
        if found is None:
            layout = self.layout(name)
            found = Described(self.ros_type(name), self.definition(name), layout, timestamp_of(layout))
            self._known[name] = found
        else:
            self._count(len(found.definition) + found.layout.size + found.layout.surplus)
        return found

    def layout(self, name: str) -> Layout:
        """Return the layout of the samples of a topic. Padding at their end can be missing. Raises FormatError."""
        block = self._block(name, ())
        size = block.end
        self._count(len(block.marks))
        marks = np.frombuffer(block.marks[:size], np.uint8)
        return Layout(
            dtype=block.dtype(size),
            runs=tuple(run.span() for run in _RUN.finditer(block.marks, 0, size)),
            bools=tuple(bools_at(np.flatnonzero(marks == _BOOL[0]).tolist(), size)),
            size=size,
            surplus=len(block.marks) - size,
            in_place=True,
        )

    def ros_type(self, name: str) -> str:
        """Return the type in ROS 2 of a topic, or of a format that others nest."""
        return f"px4_msgs/msg/{self._message(name)}"

    def definition(self, name: str) -> str:
        """Return the definition of a format and of those that it nests, without padding.

        Names are in lower case. It is "" if ROS 2 does not allow one. The fields are in the order of the samples.
        """
        nested = [name]
        seen = {name}
        parts: list[str] = []
        for each in nested:
            fields = self._visible(each)
            names = [field.name.lower() for field in fields]
            if not all(map(_ROS_NAME.fullmatch, [each, *names])) or len({*names}) < len(names):
                return ""
            text = "".join(map(self._declaration, fields))
            parts.append(f"{SEPARATOR}\nMSG: px4_msgs/{self._message(each)}\n{text}" if parts else text)
            others = dict.fromkeys(field.type for field in fields if field.type not in _NUMBERS)
            nested += [other for other in others if other not in seen]
            seen.update(others)
        self._count(sum(map(len, parts)))
        return "".join(parts)

    def _count(self, size: int) -> None:
        """Raise FormatError if the formats of the topics are too large together: short texts can have long ones."""
        self._sum += size
        if self._sum > _LARGEST_SUM:
            raise FormatError(f"the formats of the topics have more than {_LARGEST_SUM} bytes together")

    def _declaration(self, field: _Field) -> str:
        type_ = _NUMBERS[field.type][1] if field.type in _NUMBERS else self._message(field.type)
        name = field.name.lower()
        return f"{type_} {name}\n" if field.length is None else f"{type_}[{field.length}] {name}\n"

    def _visible(self, name: str) -> list[_Field]:
        return [field for field in self._fields_of(name) if not field.is_padding]

    def _fields_of(self, name: str) -> tuple[_Field, ...]:
        """Return the fields of a format. Raises FormatError."""
        if name not in self._fields:
            if name not in self._texts:
                raise FormatError(f"there is no format '{name}'")
            self._fields[name] = parse_fields(self._texts[name])
        return self._fields[name]

    def _message(self, name: str) -> str:
        """Return the name of a message for a topic.

        The format of a topic has the name of the topic. The table knows what message it is, or another format with
        the same fields and the front of the name: actuator_controls for actuator_controls_0.
        """
        if name in MESSAGES:
            return MESSAGES[name]
        twins = self._twins.get(self._texts.get(name, ""), {})
        ends = (each.start() for each in re.finditer("_", name))
        fronts = (name[:end] for end in ends if end in twins)
        name = next((front for front in fronts if front in twins[len(front)]), name)
        return "".join(part[:1].upper() + part[1:] for part in name.split("_"))

    def _block(self, name: str, outer: tuple[str, ...]) -> _Block:
        """Return the bytes of a format. Raises FormatError."""
        if name in self._blocks:
            return self._blocks[name]
        if name in outer or len(outer) > _DEEPEST:
            raise FormatError(f"format '{name}' nests itself")
        names: list[str] = []
        formats: list[Any] = []
        offsets: list[int] = []
        marks: list[bytes] = []
        place = end = 0
        for field in self._fields_of(name):
            type_, mark = self._element(field, (*outer, name))
            length = 1 if field.length is None else field.length
            if not mark or not length:
                raise FormatError(f"{name}.{field.name} has no bytes")
            if place + len(mark) * length > _LARGEST:
                raise FormatError(f"format '{name}' is larger than a message")
            mark *= length
            if not field.is_padding:
                if field.name in names:
                    raise FormatError(f"{name}.{field.name} is there twice")
                names.append(field.name)
                formats.append(type_ if field.length is None else (type_, (field.length,)))
                offsets.append(place)
                end = place + len(mark)
            marks.append(mark)
            place += len(mark)
        if not end:
            raise FormatError(f"format '{name}' has no fields")
        block = self._blocks[name] = _Block(names, formats, offsets, b"".join(marks), end)
        return block

    def _element(self, field: _Field, outer: tuple[str, ...]) -> tuple[Any, bytes]:
        """Return the dtype and the marks of a value of a field."""
        if field.type not in _NUMBERS:
            block = self._block(field.type, outer)
            size = len(block.marks)
            return block.dtype(size), _FILL * size if field.is_padding else block.marks
        code = np.dtype(_NUMBERS[field.type][0])
        mark = _FILL if field.is_padding else _BOOL if field.type == "bool" else _VALUE
        return code, mark * code.itemsize


@lru_cache(_MOST_RUNS)
def _formats_in(run: bytes) -> Formats | None:
    """Return the formats in messages that follow one another, None if one of them is damaged."""
    found = Formats()
    start = 0
    while start < len(run):
        stop = start + FRONT + int.from_bytes(run[start : start + 2], "little")
        content = run[start + FRONT : stop]
        try:
            text = content.decode()
        except UnicodeDecodeError:
            return None
        if not is_format(content):
            return None
        found.add(text)
        start = stop
    return found


def is_format(data: bytes) -> bool:
    """Whether this is the text of a whole format."""
    return FORMAT.fullmatch(data) is not None


def parse_fields(text: str) -> tuple[_Field, ...]:
    """Return the fields of a format: `uint64_t timestamp;esc_report[8] esc`. Raises FormatError."""
    fields = []
    for each in text.split(";"):
        if not each.strip():
            continue
        found = _FIELD.fullmatch(each.strip())
        if found is None:
            raise FormatError(f"{each[:80]!r} is not a field")
        type_, length, name = found.groups()
        fields.append(_Field(type_, None if length is None else int(length), name, name.startswith(_PADDING)))
    return tuple(fields)


def timestamp_of(layout: Layout) -> int | None:
    """Return the offset of `timestamp` in samples, None if they have none. It counts microseconds in 64 bits."""
    fields = layout.dtype.fields
    if fields is None or "timestamp" not in fields:
        return None
    type_, offset, *_ = fields["timestamp"]
    return offset if type_ == np.dtype("<u8") else None
