"""A recording on the disk: the format of each of its files, by its first bytes, which can be compressed."""

from __future__ import annotations

import os
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from msggen.base.diagnostics import either
from msggen.base.disk.urls import is_address
from msggen.base.recording_formats import FORMATS, foreign, packing_of, unpacked
from msggen.recordings.files.compression import CompressionError, Room, decompress_file
from msggen.recordings.source.source import VERIFIED, Problem, RecordingError, Source, Verification

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def open_sources(path: str, verification: Verification = VERIFIED) -> list[Source]:
    """Return the files of a recording, by their contents. Raises RecordingError, and OSError.

    `path` can be the address of an object in a store, which raises ModuleNotFoundError without the extra.
    """
    if is_address(path):
        from msggen.recordings.files.stored import open_stored

        return open_stored(path, lambda local: open_sources(local, verification))
    open_file = partial(_open_file, verification=verification)
    if os.path.isdir(path):
        from msggen.recordings.files.rosbag2.bag import open_folder

        return open_folder(path, open_file)
    if os.path.exists(path) and not os.path.isfile(path):
        cure = "open it, and pass the file object; `msggen log` reads - from stdin"
        raise RecordingError(f"{path} is not a recording: this is a pipe or a device: {cure}")
    return [open_file(path)]


def _open_file(
    path: str, folder_room: Room | None = None, *, verification: Verification, is_by_sample: bool = False
) -> Source:
    """Return a file, which can be compressed. `folder_room` is for all files of a folder.

    Samples are decompressed if `is_by_sample`, or if they are zstd frames. Raises RecordingError, and OSError.
    """
    size = os.path.getsize(path)
    room = Room(size, folder_room)
    open_plain = partial(_open_plain, room=room, verification=verification, is_by_sample=is_by_sample)
    with open(path, "rb") as file:
        is_compressed = packing_of(file.read(16)) is not None
    source = _open_compressed(path, room, open_plain) if is_compressed else open_plain(path)
    source.size = size
    return source


def _open_compressed(path: str, room: Room, open_plain: Callable[[str], Source]) -> Source:
    """Return a compressed file, which is decompressed to a folder. Raises RecordingError, and OSError."""
    with temporary_copy(path, unpacked(os.path.basename(path))) as (copy, remove):
        try:
            cut = decompress_file(path, copy, room)
        except CompressionError as error:
            raise RecordingError(f"{path} cannot be decompressed: {error}") from None
        source = open_plain(copy)
    if cut:
        source.problems.insert(0, Problem(f"the compressed file is damaged or cut off: {cut}"))
    source.path = path
    source.close_with(remove)
    return source


@contextmanager
def temporary_copy(shown: str, name: str) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield the path for a copy of a recording in a folder of its own, and what removes it.

    It is removed here if it cannot be opened. A RecordingError has `shown` in the place of the path.
    """
    import tempfile

    folder = tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True)
    path = os.path.join(folder.name, name)
    try:
        yield path, folder.cleanup
    except RecordingError as error:
        folder.cleanup()
        raise RecordingError(str(error).replace(path, shown)) from None
    except BaseException:
        folder.cleanup()
        raise


def _open_plain(path: str, *, room: Room, verification: Verification, is_by_sample: bool) -> Source:
    """Return a file that is not compressed, with the room for its content. Raises RecordingError, and OSError."""
    with open(path, "rb") as file:
        name = _format_of(path, file.read(16))
    module = import_module(f"msggen.recordings.files.{FORMATS[name].folder}.reader")
    reader: Callable[..., Source] = getattr(module, FORMATS[name].reader)
    return reader(path, room, verification, is_by_sample=is_by_sample)


def check_front(path: str, front: bytes) -> None:
    """Raise RecordingError if a file does not begin as a recording does, compressed or not."""
    if packing_of(front) is None:
        _format_of(path, front)


def _format_of(path: str, front: bytes) -> str:
    """Return the key of the format of a file by its first bytes. Raises RecordingError."""
    for name, each in FORMATS.items():
        if front.startswith(each.front):
            return name
    if not front:
        raise RecordingError(f"{path} is empty")
    other = foreign(path, front)
    if other:
        raise RecordingError(f"{path} is {other}")
    expected = either([each.noun for each in FORMATS.values()])
    raise RecordingError(f"{path} is not a recording: expected {expected}")
