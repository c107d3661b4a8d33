"""The formats of recordings: how their files are named, how they begin, and what reads them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Format(NamedTuple):
    """A format of files. The module of `msggen.recordings.files` that is called as its key reads them."""

    name: str
    """For people, in a list."""
    noun: str
    """For people, in a sentence."""
    suffix: str
    """Of the names of its files, in lower case."""
    front: bytes
    """The first bytes of its files."""
    reader: str
    """The class in the module, a `Source` that is made of the path of a file."""
    storage: str = ""
    """What a folder of rosbag2 calls it, "" if no such folder has files of it."""


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "mcap": Format("MCAP", "an MCAP file", ".mcap", b"\x89MCAP0\r\n", "McapFile", "mcap"),
        "ulog": Format("ULog", "a ULog", ".ulg", b"ULog\x01\x12\x35", "UlogFile"),
        "db3": Format("rosbag2 database", "a database of rosbag2", ".db3", b"SQLite format 3\0", "Db3File", "sqlite3"),
    }
)
"""The formats by their names in programs, `Log.kind`."""

MCAP = FORMATS["mcap"].suffix
"""The suffix of the recordings that msggen writes."""


class Packing(NamedTuple):
    """A way in which files are compressed."""

    name: str
    front: bytes
    """The first bytes of such files."""


ZSTD = Packing("zstd", b"\x28\xb5\x2f\xfd")
PACKED: Mapping[str, Packing] = MappingProxyType(
    {
        ".zstd": ZSTD,
        ".zst": ZSTD,
        ".gz": Packing("gzip", b"\x1f\x8b"),
        ".xz": Packing("xz", b"\xfd7zXZ\0"),
        ".bz2": Packing("bzip2", b"BZh"),
    }
)
"""The suffixes of compressed files, behind that of their format. rosbag2 writes the first one."""


def unpacked(name: str) -> str:
    """Return the name of a file without the suffix of a compressed one: `flight.mcap` for `flight.mcap.zstd`."""
    found = next((each for each in PACKED if name.lower().endswith(each)), "")
    return name[: len(name) - len(found)]


def packing_of(front: bytes) -> Packing | None:
    """Return how a file is compressed by its first bytes, None if it is not."""
    return next((each for each in PACKED.values() if front.startswith(each.front)), None)


def format_named(name: str) -> Format | None:
    """Return the format that the name or the path of a file tells, also of a compressed one. None if it tells none."""
    plain = unpacked(name).lower()
    return next((each for each in FORMATS.values() if plain.endswith(each.suffix)), None)
