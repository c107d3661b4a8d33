"""A slow, simple comparison of two folders of definitions, used to test the fast one.

It shares no code with msggen: it reads `.msg` files with a regular expression, expands a message into one row for each
value as `(path, offset, type)`, and treats two messages as equal if their rows and types are equal. RENAMED lists the
fields that were only renamed, for all pairs of releases; it was written by hand.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from pathlib import Path
from typing import NamedTuple

SIZES = {
    **dict.fromkeys(("bool", "byte", "char", "int8", "uint8"), 1),
    **dict.fromkeys(("int16", "uint16"), 2),
    **dict.fromkeys(("int32", "uint32", "float32"), 4),
    **dict.fromkeys(("int64", "uint64", "float64"), 8),
}
FIELD = re.compile(r"^\s*(\w+)(?:\[(\d+)\])?\s+([a-z]\w*)\s*(?:#.*)?$", re.MULTILINE)
CONSTANT = re.compile(r"^\s*(\w+)\s+([A-Z][A-Z0-9_]*)\s*=\s*([^#\n]*?)\s*(?:#.*)?$", re.MULTILINE)


Names = dict[tuple[str, str], str]
"""One name for each field that has several, by message and other name."""

RENAMED: Names = {
    ("ActuatorArmed", "manual_lockdown"): "kill",
    ("EstimatorStatusFlags", "cs_gps"): "cs_gnss_pos",
    ("EstimatorStatusFlags", "cs_gps_yaw"): "cs_gnss_yaw",
    ("EstimatorStatusFlags", "cs_gps_yaw_fault"): "cs_gnss_yaw_fault",
    ("FailsafeFlags", "primary_geofence_breached"): "geofence_breached",
    ("GimbalDeviceInformation", "gimbal_device_compid"): "gimbal_device_id",
    ("Mission", "dataman_id"): "mission_dataman_id",
}
"""The renames between any two releases, decided by hand. Any other field in the place of another one replaced it."""


class Definition(NamedTuple):
    """A message read from its text: fields as (type, length or None, name), constants as type and value by name."""

    fields: tuple[tuple[str, int | None, str], ...]
    constants: dict[str, tuple[str, str]]


class Row(NamedTuple):
    """One value: its path, offset and type; char and byte count as uint8."""

    path: str
    offset: int
    type: str


def read(folder: Path) -> dict[str, Definition]:
    """Return the messages of a release by name."""
    paths = [*(folder / "msg").glob("*.msg"), *(folder / "msg" / "versioned").glob("*.msg")]
    return {path.stem: definition(path.read_text()) for path in paths}


def definition(text: str) -> Definition:
    """Return the definition in a text."""
    fields = tuple((type_, int(length) if length else None, name) for type_, length, name in FIELD.findall(text))
    return Definition(fields, {name: (type_, value) for type_, name, value in CONSTANT.findall(text)})


def rows(messages: dict[str, Definition], name: str, names: Names | None = None) -> list[Row]:
    """Return every value of a message in XCDR1, with the elements of arrays as separate rows.

    `names` gives other names for some fields.
    """
    return list(_unfold(messages, names or {}, name, "", 0))


def misread(before: dict[str, Definition], after: dict[str, Definition], name: str, names: Names) -> set[str]:
    """Return the readers that decode wrong values without an error: "old" for new samples, "new" for old samples.

    The set is empty if the rounded sizes differ. A reader takes the bytes at the offset in its own definition; one
    value and an array of one are the same.
    """
    if -(-size(before, name) // 4) != -(-size(after, name) // 4):
        return set()
    old, new = (
        {row._replace(path=row.path.replace("[0]", "")) for row in rows(side, name, names)} for side in (before, after)
    )
    return {reader for reader, surplus in (("old", old - new), ("new", new - old)) if surplus}


def renames(before: dict[str, Definition], after: dict[str, Definition], name: str) -> set[tuple[str, str]]:
    """Return the fields that were only renamed: old name and new name, of the same type in the same bytes."""
    old, new = (
        {(row.path.partition(".")[0].partition("[")[0]) for row in rows(side, name)} for side in (before, after)
    )
    found = set()
    for one in old - new:
        for other in new - old:
            called = {RENAMED.get((name, field), field) for field in (one, other)}
            places = [
                [row[1:] for row in rows(side, name) if re.match(rf"{field}\b", row.path)]
                for side, field in ((before, one), (after, other))
            ]
            if len(called) == 1 and places[0] == places[1]:
                found.add((one, other))
    return found


def differ(before: dict[str, Definition], after: dict[str, Definition], name: str) -> bool:
    """Whether the bytes or the names of a message differ between the two sides."""
    same_rows = rows(before, name) == rows(after, name)
    return not (same_rows and spelling(before, name) == spelling(after, name))


def size(messages: dict[str, Definition], name: str) -> int:
    """Return the size of a sample in bytes, without its header."""
    last = rows(messages, name)[-1]
    return last.offset + SIZES[last.type]


def spelling(messages: dict[str, Definition], name: str) -> list[str]:
    """Return the lines that the firmware hashes."""
    lines = []
    for type_, length, field in messages[name].fields:
        lines.append(f"{type_}[{length}] {field}" if length else f"{type_} {field}")
        lines += spelling(messages, type_) if type_ not in SIZES else []
    return lines


def _unfold(
    messages: dict[str, Definition], names: Names, name: str, prefix: str, offset: int
) -> Generator[Row, None, int]:
    """Yield the rows of a message that starts at `offset` bytes; return the offset of its end."""
    for type_, length, field in messages[name].fields:
        called = names.get((name, field), field)
        for index in range(length or 1):
            path = f"{prefix}{called}[{index}]" if length else f"{prefix}{called}"
            if type_ in SIZES:
                offset = -(-offset // SIZES[type_]) * SIZES[type_]
                yield Row(path, offset, "uint8" if type_ in ("byte", "char") else type_)
                offset += SIZES[type_]
            else:
                offset = yield from _unfold(messages, names, type_, f"{path}.", offset)
    return offset
