"""The formats of recordings: how their files are named, how they begin, and what reads them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from types import MappingProxyType
from typing import NamedTuple


class Format(NamedTuple):
    """A format of files. A module `reader` in a folder of `msggen.recordings.files` reads them."""

    name: str
    """For people, in a list."""
    noun: str
    """For people, in a sentence."""
    suffix: str
    """Of the names of its files, in lower case."""
    front: bytes
    """The first bytes of its files."""
    folder: str
    """The folder in `msggen.recordings.files`."""
    reader: str
    """The class in its module `reader`, a `Source` that is made of the path of a file."""
    storage: str = ""
    """What a folder of rosbag2 calls it, "" if no such folder has files of it."""
    is_of_vehicle: bool = False
    """Whether the vehicle itself writes it: in the layout of uORB, with times since its start."""


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "mcap": Format("MCAP", "an MCAP file", ".mcap", b"\x89MCAP0\r\n", "mcap", "McapFile", "mcap"),
        "ulog": Format("ULog", "a ULog", ".ulg", b"ULog\x01\x12\x35", "ulog", "UlogFile", is_of_vehicle=True),
        "db3": Format(
            "rosbag2 database", "a database of rosbag2", ".db3", b"SQLite format 3\0", "rosbag2", "Db3File", "sqlite3"
        ),
    }
)
"""The formats by their names in programs, `Log.kind`."""

STORAGES = tuple(each.storage for each in FORMATS.values() if each.storage)
"""The storages of rosbag2, the one that msggen writes by default first."""
MCAP = FORMATS["mcap"].suffix
"""The suffix of the recordings that msggen writes."""


_DECRYPT = (
    "decrypt it first with your private key, by PX4's decrypt_logs.py "
    "(https://docs.px4.io/main/en/dev_log/log_encryption)"
)
FOREIGN: Mapping[bytes, str] = MappingProxyType(
    {
        b"ULogEnc": f"an encrypted ULog: {_DECRYPT}",
        b"#ROSBAG V": "a bag of ROS 1: convert it first, rosbags-convert --src BAG --dst FOLDER (pip install rosbags)",
        b"\xa3\x95\x80": "a log of PX4 before ULog (sdlog2) or of ArduPilot: mavlogdump.py of pymavlink reads it",
        b"PAR1": "a table in Parquet, not a recording: pyarrow, DuckDB and Polars read it",
        b"ARROW1": "a table of Arrow, not a recording: pyarrow, DuckDB and Polars read it",
        b"PK\x03\x04": "a zip archive: unpack it first",
    }
)
"""What is wrong with other files that users may take for recordings, and what to do, by their first bytes."""
_WITHOUT_FRONT: Mapping[str, str] = MappingProxyType(
    {
        ".ulgc": f"an encrypted ULog of PX4 up to v1.15: {_DECRYPT}",
        ".ulgk": "the key of an encrypted ULog of PX4 up to v1.15, which is the file .ulgc beside it",
    }
)
"""The same by the suffixes of files whose first bytes tell nothing."""


class Packing(NamedTuple):
    """A way in which files are compressed."""

    name: str
    front: bytes
    """The first bytes of such files."""


_ZSTD = Packing("zstd", b"\x28\xb5\x2f\xfd")
PACKED: Mapping[str, Packing] = MappingProxyType(
    {
        ".zstd": _ZSTD,
        ".zst": _ZSTD,
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


def foreign(path: str, front: bytes) -> str:
    """Return what a file is that is no recording, and what to do, "" if that is not known."""
    known = (text for first, text in FOREIGN.items() if front.startswith(first))
    named = (text for suffix, text in _WITHOUT_FRONT.items() if path.lower().endswith(suffix))
    return next(chain(known, named), "")


def packing_of(front: bytes) -> Packing | None:
    """Return how a file is compressed by its first bytes, None if it is not."""
    return next((each for each in PACKED.values() if front.startswith(each.front)), None)


def format_named(name: str) -> Format | None:
    """Return the format that the name or the path of a file tells, also of a compressed one. None if it tells none."""
    plain = unpacked(name).lower()
    return next((each for each in FORMATS.values() if plain.endswith(each.suffix)), None)
