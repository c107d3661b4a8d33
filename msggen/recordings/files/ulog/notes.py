"""Information, parameters, texts and dropouts in a ULog."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from msggen.recordings.files.ulog.formats import FRONT
from msggen.recordings.source.facts import LEVELS, Dropout, Facts, Text
from msggen.recordings.source.gather import at

if TYPE_CHECKING:
    from collections.abc import Mapping

    from msggen.recordings.source.memory import Octets

_Kind = TypeVar("_Kind")
LARGEST_TIME = ((1 << 62) - 1) // 1000
"""The largest time in us that is believed."""
_CODES = {
    "int8_t": "b",
    "uint8_t": "B",
    "int16_t": "h",
    "uint16_t": "H",
    "int32_t": "i",
    "uint32_t": "I",
    "int64_t": "q",
    "uint64_t": "Q",
    "float": "f",
    "double": "d",
    "bool": "?",
}
_NEAR = 60 * 10**9
"""How far in ns the time of a text is from that of the samples before it."""
_CONTROLS = frozenset("\t\n\r\x1b")
_MOST_UNREAD = 1 << 20
"""The most bytes of parameters that are read later. Those of PX4 have some 40 kB."""
_REACH = 1 << 16
"""The bytes in which usual parameters are looked for at a time."""
_PARAMETER = ord("P")
_INTEGER, _FLOAT = int.from_bytes(b"int32_t ", "little"), int.from_bytes(b"float ", "little")
_SIX_BYTES = (1 << 48) - 1
_ASCII = 0x80
_VALUE = 4
"""The size of the value of a usual parameter."""
_MOST = 1 << 20
"""The number of texts, and of everything else, that is kept."""


class Notes:
    """The messages of a ULog that are not samples, as they are read one after the other.

    The methods raise ValueError and struct.error for messages that cannot be read.
    """

    def __init__(self) -> None:
        self._parameters: dict[str, int | float] = {}
        self._unread: list[tuple[bytes, list[int]]] = []
        """Messages with parameters that nobody asked for so far, and the offset of each."""
        self._unread_size = 0
        self._changed: list[tuple[int, str, int | float]] = []
        self._system: dict[str, int | float] = {}
        self._setup: dict[str, int | float] = {}
        self._information: dict[str, object] = {}
        self._texts: list[Text] = []
        self._dropouts: list[Dropout] = []
        self.left_out = 0
        """How many messages were left out because there are too many."""

    @property
    def information(self) -> Mapping[str, object]:
        """The information about the vehicle."""
        return self._information

    @property
    def facts(self) -> Facts:
        """All that was read."""
        self._read_parameters()
        return Facts(
            parameters=self._parameters,
            changed_parameters=self._changed,
            default_parameters=self._system,
            airframe_defaults=self._setup,
            information=self._information,
            texts=self._texts,
            dropouts=self._dropouts,
        )

    def take(self, kind: str, data: bytes, time: int | None) -> None:
        """Take a message. `time` is that of the samples before it in ns, None among the definitions."""
        if kind == "I":
            key, value = key_and_value(data)
            self._information[key] = value
        elif kind == "M":
            self._take_part(data)
        elif kind == "P":
            self._take_parameter(data, time)
        elif kind == "Q":
            key, number = _parameter(data[1:])
            if data[0] & 1:
                self._system[key] = number
            if data[0] & 2:
                self._setup[key] = number
        elif kind == "L":
            level, since = struct.unpack_from("<BQ", data)
            self._add_text(level, since, data[9:], None, time)
        elif kind == "C":
            level, tag, since = struct.unpack_from("<BHQ", data)
            self._add_text(level, since, data[11:], tag, time)
        elif kind == "O":
            (duration,) = struct.unpack_from("<H", data)
            self._add(self._dropouts, Dropout(time or 0, duration * 1_000_000))

    def keep(self, run: bytes, starts: list[int]) -> None:
        """Take messages with usual parameters before the first sample, and read them when they are asked for."""
        self._unread.append((run, starts))
        self._unread_size += len(run)
        if self._unread_size > _MOST_UNREAD:
            self._read_parameters()

    def _read_parameters(self) -> None:
        for run, starts in self._unread:
            for start, stop in zip(starts, [*starts[1:], len(run)], strict=True):
                key, number = _parameter(run[start + FRONT : stop])
                self._parameters[key] = number
        self._unread.clear()
        self._unread_size = 0

    def _take_parameter(self, data: bytes, time: int | None) -> None:
        key, number = _parameter(data)
        if time is None:
            self._read_parameters()
            self._parameters[key] = number
        else:
            self._add(self._changed, (time, key, number))

    def _take_part(self, data: bytes) -> None:
        key, value = key_and_value(data[1:])
        found = self._information.setdefault(key, [])
        if not isinstance(found, list):
            raise ValueError(key)  # noqa: TRY004 - the file is wrong, not the program
        if data[0] and found:
            self._add(found[-1], value)
        else:
            self._add(found, [value])

    def _add_text(self, level: int, since: int, text: bytes, tag: int | None, before: int | None) -> None:
        """Add a text. `before` is the time of the samples before it in ns, None or 0 without any."""
        number = level - ord("0")
        is_known = 0 <= number < len(LEVELS)
        time = min(since, LARGEST_TIME) * 1000
        if not _is_printable(text) and (not is_known or (before and abs(time - before) > _NEAR)):
            raise ValueError(text)  # a sample whose kind is damaged seems to be a text
        name = LEVELS[number] if is_known else "unknown"
        # PX4 puts a tab behind texts that it also sends as events
        line = text.decode(errors="replace")
        self._add(self._texts, Text(time, name, line.removesuffix("\t"), tag, line.endswith("\t")))

    def _add(self, found: list[_Kind], each: _Kind) -> None:
        if len(found) < _MOST:
            found.append(each)
        else:
            self.left_out += 1


def _is_printable(text: bytes) -> bool:
    try:
        decoded = text.decode()
    except UnicodeDecodeError:
        return False
    return decoded.isprintable() or all(each.isprintable() or each in _CONTROLS for each in decoded)


class _Key(NamedTuple):
    """What is before the value of an information or a parameter: `float MPC_XY_P`, `char[3] sys_name`."""

    name: str
    type: str
    number: struct.Struct | None
    """How a single number is read, None for an array."""


@lru_cache(4096)
def _key_of(text: bytes) -> _Key:
    """Return a key. Many logs have the same ones. Raises ValueError."""
    type_, _, name = text.decode().partition(" ")
    if not name:
        raise ValueError(type_)
    if "[" not in type_:
        return _Key(name, type_, struct.Struct(f"<{_code(type_)}"))
    return _Key(name, type_.partition("[")[0], None)


def key_and_value(data: bytes) -> tuple[str, object]:
    """Return the name and the value of an information or a parameter. Raises ValueError, and struct.error."""
    end = 1 + data[0] if data else 0
    name, type_, number = _key_of(data[1:end])
    value = data[end:]
    if number is not None:
        return name, number.unpack(value)[0]
    if type_ == "char":
        return name, value.decode(errors="replace")
    if type_ == "uint8_t":
        return name, value
    return name, tuple(np.frombuffer(value, f"<{_code(type_)}").tolist())


def _code(type_: str) -> str:
    if type_ not in _CODES:
        raise ValueError(type_)
    return _CODES[type_]


def _parameter(data: bytes) -> tuple[str, int | float]:
    key, value = key_and_value(data)
    if not isinstance(value, (int, float)):
        raise ValueError(key)  # noqa: TRY004 - the file is wrong, not the program
    return key, value


def usual_parameters(file: Octets, start: int, stop: int) -> list[int]:
    """Return where the parameters begin that follow one another from an offset on, and the last one ends.

    They are parameters as PX4 writes them: numbers of four bytes, with names in ASCII. There may be further ones.
    """
    front = file[start : min(start + _REACH, stop)]
    kinds = np.flatnonzero(front[2 : max(front.size - 9, 2)] == _PARAMETER) + 2
    types = at(front, "<u8", 2)[kinds]
    sizes, name_sizes = at(front, "<u2")[kinds - 2], front[kinds + 1].astype(np.uint16)
    is_integer, is_float = types == _INTEGER, types & np.uint64(_SIX_BYTES) == _FLOAT
    is_usual = (is_integer & (name_sizes > len("int32_t "))) | (is_float & (name_sizes > len("float ")))
    is_usual &= sizes == name_sizes + 1 + _VALUE
    starts = kinds[is_usual] - 2
    ends = starts + sizes[is_usual] + FRONT
    follows = np.append(starts[:1] == 0, starts[1:] == ends[:-1]) & (ends <= front.size)
    wrong = np.flatnonzero(~follows)
    count = int(wrong[0]) if len(wrong) else len(starts)
    letters = np.flatnonzero(front[: ends[count - 1]] >= _ASCII) if count else starts[:0]
    owners = np.searchsorted(ends[:count], letters, "right")
    in_names = owners[letters < ends[owners] - _VALUE]
    count = int(in_names[0]) if len(in_names) else count
    return [start, *(start + ends[:count]).tolist()]
