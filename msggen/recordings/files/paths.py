"""Which files and folders are recordings, before one is opened."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection

from msggen.base.disk.urls import is_address, shown_address
from msggen.base.recording_formats import format_named, unpacked

METADATA = "metadata.yaml"
"""The file that rosbag2 writes into the folder of a recording when it ends."""
LOGS = {"-wal": 32, "-journal": 28}
"""What the names of a database's logs of transactions end in, and their sizes in bytes if they are empty."""
_MARK = b"rosbag2_bagfile_information"
_LARGEST = 1 << 16
"""The bytes that are read of a metadata.yaml, which begins with the mark."""
_NUMBERED = re.compile(r"(.*)_\d+")


def is_named_as_recording(name: str) -> bool:
    """Whether a file is named as recordings are: `10_02_11.ulg`, `flight.mcap.zstd`."""
    return format_named(name) is not None and not name.startswith(".")


def is_always_whole(name: str) -> bool:
    """Whether a file is named as a recording that is no part of a folder of rosbag2, as a ULog is."""
    found = format_named(name)
    return found is not None and not found.storage


def is_bag(folder: str) -> bool:
    """Whether a folder is one recording of rosbag2. Raises OSError if it cannot be read.

    It is if it has a metadata.yaml, and a file of a recording unless that is of rosbag2. A recorder that was killed
    leaves no metadata.yaml: its files are called after the folder, `flight/flight_0.mcap`. In any other folder, each
    file is a recording.
    """
    own = os.path.basename(os.path.abspath(folder))
    return is_bag_of(os.listdir(folder), own, lambda: _is_of_rosbag2(os.path.join(folder, METADATA)))


def is_bag_of(names: Collection[str], own: str, has_mark: Callable[[], bool]) -> bool:
    """Whether files are one recording, as `is_bag`, by their names, that of their folder, and their metadata.yaml."""
    files = [name for name in names if is_named_as_recording(name) and not is_always_whole(name)]
    if METADATA in names:
        return bool(files) or has_mark()
    found = [_NUMBERED.fullmatch(os.path.splitext(unpacked(name))[0]) for name in files]
    return bool(found) and all(each is not None and each[1] == own for each in found)


def stem_of(path: str) -> str:
    """Return the name of a recording without its suffixes: `flight` for `logs/flight.mcap.zstd`.

    The name of a folder is whole: `2026.11.22` has no suffix.
    """
    if is_address(path):
        name = shown_address(path).rstrip("/").rpartition("/")[2]
        return os.path.splitext(unpacked(name))[0] if format_named(name) else name
    name = os.path.basename(os.path.abspath(path))
    return name if os.path.isdir(path) else os.path.splitext(unpacked(name))[0]


def _is_of_rosbag2(path: str) -> bool:
    """Whether a metadata.yaml is that of a recording. Programs of other kinds write files of this name, too."""
    if not os.path.isfile(path):  # a link to nothing, a pipe
        return False
    with open(path, "rb") as file:
        return is_marked(file.read(_LARGEST))


def is_marked(metadata: bytes) -> bool:
    """Whether the contents of a metadata.yaml are those of rosbag2."""
    return _MARK in metadata[:_LARGEST]
