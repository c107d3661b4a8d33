"""Recordings that are not files: what a program holds, a pipe, a download. A temporary file holds a copy."""

from __future__ import annotations

import errno
import io
import os
import stat
from typing import TYPE_CHECKING, Any, Protocol

from msggen.recordings.files.compression import MAX_CONTENT, told_limit
from msggen.recordings.files.opening import check_front, open_sources, temporary_copy
from msggen.recordings.source.source import VERIFIED, RecordingError, Source, Verification

if TYPE_CHECKING:
    from collections.abc import Iterator

_STEP = 1 << 20
_LONGEST_FRONT = 64
"""At least the bytes that tell the format of a recording."""
_UNNAMED = "<stream>"


class Readable(Protocol):
    """A file object in binary mode: of `open`, `io.BytesIO`, a pipe, a download, a member of an archive."""

    def read(self, size: int, /) -> bytes | None:
        """Return up to `size` bytes, none at the end."""


def name_of(file: Readable) -> str:
    """Return the name of a file object for people: its own, or `<stream>`."""
    name = getattr(file, "name", None)
    return name if isinstance(name, str) and name else _UNNAMED


def path_of(file: Readable) -> str | None:
    """Return the path of a file on the disk that was opened and not read yet, None for other objects."""
    if not isinstance(file, (io.BufferedReader, io.FileIO)):
        return None
    raw: Any = file.raw if isinstance(file, io.BufferedReader) else file
    name: Any = getattr(file, "name", None)
    if not isinstance(raw, io.FileIO) or not isinstance(name, str):
        return None
    try:
        own, there = os.fstat(file.fileno()), os.stat(name)
        is_same = stat.S_ISREG(own.st_mode) and os.path.samestat(own, there) and file.tell() == 0
    except (OSError, ValueError):
        return None
    return name if is_same else None


def open_stream(file: Readable, name: str, verification: Verification = VERIFIED) -> list[Source]:
    """Copy the rest of a file object to a temporary file, and open that. The file object stays open.

    Raises RecordingError, TypeError for a file in text mode, and OSError.
    """
    if isinstance(file, io.TextIOBase):  # its read() fails on most recordings, as they are not UTF-8
        raise _in_text_mode(name, "str")
    with temporary_copy(name, "recording") as (copy, remove):
        with open(copy, "xb") as target:
            target.writelines(_pieces(file, name))
        sources = open_sources(copy, verification)
    sources[0].close_with(remove)
    return sources


def _pieces(file: Readable, name: str) -> Iterator[bytes]:
    """Yield what is left of a file object, if it begins as a recording does and is not too large."""
    limit, size = told_limit(), 0
    data = b""
    while len(data) < _LONGEST_FRONT and (step := _read(file, name)):  # a pipe can give few bytes at a time
        data += step
    check_front(name, data)
    while data:
        size += len(data)
        if limit is not None and size > limit:
            raise RecordingError(f"{name} has more than {limit} bytes; {MAX_CONTENT} sets another limit")
        yield data
        data = _read(file, name)


def _read(file: Readable, name: str) -> bytes:
    found: Any = file.read(_STEP)
    if found is None:
        raise BlockingIOError(errno.EAGAIN, "it has no data yet, and does not wait for it", name)
    if not isinstance(found, (bytes, bytearray, memoryview)):
        raise _in_text_mode(name, type(found).__name__)
    return bytes(found)


def _in_text_mode(name: str, got: str) -> TypeError:
    return TypeError(f"{name}: expected a file in binary mode, whose read() returns bytes, got {got}")
