"""Compression, as recordings use it: chunks of zstd and lz4, and files of zstd, gzip, xz and bzip2."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

from msggen.base.recording_formats import packing_of

if TYPE_CHECKING:
    from bz2 import BZ2Decompressor
    from lzma import LZMADecompressor

    Member: TypeAlias = BZ2Decompressor | LZMADecompressor

ZSTD = b"\x28\xb5\x2f\xfd"
"""The first bytes of a frame of zstd."""
LARGEST = 1 << 30
"""The largest block that is decompressed, in bytes. rosbag2 writes chunks of 768 KiB, Foxglove's tools of 4 MiB."""
MAX_CONTENT = "MSGGEN_MAX_CONTENT"
"""The environment variable with the most bytes that a file may have without its compression."""
_MOST = 100
"""How many times its size a file may have without its compression. The topics of PX4 are compressed 2 to 50 times."""
_LEAST_LIMIT = 1 << 27
"""The bytes that every file may have. Black pictures of a simulator are compressed thousands of times."""
_STEP = 1 << 16
_FILE_STEP = 1 << 14
"""The bytes of a file that are read, or made, at a time: those of a step with an error are lost."""
_NO_END = "the compressed content has no end"


class CompressionError(ValueError):
    """A block that cannot be decompressed. `spent` is how many bytes were made of it in vain."""

    def __init__(self, text: str, spent: int = 0) -> None:
        super().__init__(text)
        self.spent = spent


Data = Any
"""Bytes: a memoryview, or an array of numpy."""


def limit_of(size: int) -> int:
    """Return how many bytes a file of a size may have without its compression."""
    told = told_limit()
    return max(_MOST * size, _LEAST_LIMIT) if told is None else told


def told_limit() -> int | None:
    """Return the limit in bytes that the user has set, None if there is none."""
    told = os.environ.get(MAX_CONTENT, "")
    return int(told) if told.isdecimal() else None


class Room:
    """How many bytes a file of a size may still have without its compression.

    A file of a folder takes from the room of the folder, too: many small files would have a large content together.
    """

    def __init__(self, size: int, folder: Room | None = None) -> None:
        self.limit = limit_of(size)
        self._left = self.limit
        self._folder = folder

    @property
    def left(self) -> int:
        """The bytes that are left."""
        return self._left if self._folder is None else min(self._left, self._folder.left)

    def take(self, size: int) -> None:
        """Leave less room."""
        self._left = max(self._left - size, 0)
        if self._folder is not None:
            self._folder.take(size)

    def excess(self) -> str:
        """Return what is wrong if a content has no room."""
        if self._folder is None or self._left <= self._folder.left:
            text = f"the file has more than {self.limit} bytes without its compression"
        else:
            text = f"the files have more than {self._folder.limit} bytes without their compression"
        return f"{text}; {MAX_CONTENT} sets another limit"


def decompress_into(kind: str, data: Data, target: memoryview) -> None:
    """Write a block without its compression, `zstd`, `lz4` or "", to memory of its size. Raises CompressionError."""
    if kind == "zstd":
        count = _zstd(data, target)
    elif kind in ("lz4", ""):
        found = _lz4(data, len(target)) if kind else memoryview(data)
        count = len(found)
        if count == len(target):
            target[:] = found
    else:
        raise CompressionError(f"unknown compression '{kind}', expected zstd or lz4")
    if count != len(target):
        raise CompressionError(f"expected {len(target)} bytes, got {count}")


def prefix_of(kind: str, data: Data, limit: int) -> bytes | bytearray:
    """Return the first bytes of a damaged block, as many as can be decompressed, up to `limit`."""
    if not kind:
        return bytes(memoryview(data)[:limit])
    found = bytearray()
    try:
        decompress = _DECOMPRESSORS[kind]()
    except KeyError:
        return b""
    with suppress(*_errors()):
        for start in range(0, len(data), _PIECE):
            found += decompress(bytes(data[start : start + _PIECE]))
            if len(found) >= limit:
                break
    del found[limit:]
    return found


def _errors() -> tuple[type[Exception], ...]:
    from zstandard import ZstdError

    of_zstd: type[Exception] = ZstdError
    return of_zstd, RuntimeError, EOFError, MemoryError, ValueError


def _zstd_steps() -> Callable[[bytes], bytes]:
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj(write_size=_STEP).decompress


def _lz4_steps() -> Callable[[bytes], bytes]:
    import lz4.frame

    decompress: Callable[[bytes], bytes] = lz4.frame.LZ4FrameDecompressor().decompress
    return decompress


_DECOMPRESSORS = {"zstd": _zstd_steps, "lz4": _lz4_steps}
_PIECE = 1 << 10
"""The bytes that are decompressed at a time: those of a piece with an error are lost."""


def _zstd(data: Data, target: memoryview) -> int:
    """Return how many bytes were written, one more than `target` has if there are further ones."""
    import zstandard

    try:
        reader = zstandard.ZstdDecompressor().stream_reader(data, read_size=max(len(data), 1), read_across_frames=True)
        count = 0
        while count < len(target) and (step := reader.readinto(target[count:])):
            count += step
        return count + len(reader.read(1))
    except (zstandard.ZstdError, MemoryError) as error:
        raise CompressionError(str(error)) from None


def _lz4(data: Data, size: int) -> memoryview:
    """Return the bytes of a block, one more than `size` if there are more."""
    import lz4.frame

    try:
        return memoryview(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    except (RuntimeError, EOFError, MemoryError, ValueError) as error:
        raise CompressionError(str(error)) from None


# files


_FRAME_HEADER = 18
_LARGEST_DICTIONARY = 1 << 28
"""The most memory in bytes that a file of xz may ask for: `xz -9` takes a quarter of that."""


def decompress_file(path: str, target: str, room: Room) -> str:
    """Decompress a file to another one, as much of it as can be. Return what is wrong with the rest, or "".

    Its first bytes tell how it is compressed (`PACKED`). What is written takes from `room`. Raises CompressionError if
    nothing can be decompressed or there is too little room for the content, and OSError.
    """
    written = 0
    problem = ""
    with open(path, "rb") as source, open(target, "wb") as file:
        pieces = _pieces(source)
        while not problem:
            try:
                data = next(pieces, b"")
            except _errors_of_files() as error:
                if isinstance(error, OSError) and error.errno is not None:  # of the disk
                    raise
                problem = str(error)
                continue
            if not data:
                break
            written += len(data)
            if len(data) > room.left:
                raise CompressionError(room.excess())
            room.take(len(data))
            file.write(data)
    if problem and not written:
        raise CompressionError(problem)
    return problem


def _errors_of_files() -> tuple[type[Exception], ...]:
    """Return the errors of damaged files. That of bzip2 is an OSError without a number."""
    import lzma
    import zlib

    return *_errors(), lzma.LZMAError, zlib.error, OSError


def _pieces(source: BinaryIO) -> Iterator[bytes]:
    """Yield the content of a compressed file. Raises one of `_errors_of_files`."""
    front = source.read(_FRAME_HEADER)
    source.seek(0)
    packing = packing_of(front)
    if packing is None:
        raise ValueError("unknown compression")
    if packing.name == "zstd":
        return _pieces_of_zstd(source, front)
    return _pieces_of_gzip(source) if packing.name == "gzip" else _pieces_of_members(source, _MEMBERS[packing.name])


def _pieces_of_gzip(source: BinaryIO) -> Iterator[bytes]:
    import gzip

    reader = gzip.GzipFile(fileobj=source)
    try:
        while data := reader.read1(_FILE_STEP):
            yield data
    except EOFError:
        raise EOFError(_NO_END) from None


def _pieces_of_zstd(source: BinaryIO, front: bytes) -> Iterator[bytes]:
    import zstandard

    promised = zstandard.frame_content_size(front)
    reader = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
    written = 0
    while data := reader.read(_FILE_STEP):
        written += len(data)
        yield data
    if written < promised:  # the reader ends without an error
        raise EOFError(f"expected {promised} bytes, got {written}")


def _pieces_of_members(source: BinaryIO, make: Callable[[], Member]) -> Iterator[bytes]:
    """Yield the content of members behind each other, with zeros between them, as tools that work in parallel write."""
    member, data = make(), b""
    while True:
        found = member.decompress(data, _FILE_STEP)
        data = b""
        if found:
            yield found
        if member.eof:
            data = member.unused_data.lstrip(b"\0")
            while not data:
                step = source.read(_FILE_STEP)
                if not step:
                    return
                data = step.lstrip(b"\0")
            member = make()
        elif not found:
            data = source.read(_FILE_STEP)
            if not data:
                raise EOFError(_NO_END)


def _bzip2() -> Member:
    import bz2

    return bz2.BZ2Decompressor()


def _xz() -> Member:
    import lzma

    return lzma.LZMADecompressor(lzma.FORMAT_XZ, _LARGEST_DICTIONARY)


_MEMBERS: Mapping[str, Callable[[], Member]] = {"xz": _xz, "bzip2": _bzip2}
"""What decompresses members piece by piece, by the name of the packing."""


# samples of rosbag2


def decompress_frame(data: bytes, limit: int) -> bytes:
    """Return the content of a frame of zstd, of up to `limit` bytes. Raises CompressionError."""
    import zstandard

    size = 0
    try:
        size = zstandard.frame_content_size(data)
        if size < 0:
            return _unsized(data, limit)
        if size <= limit:
            return zstandard.ZstdDecompressor().decompress(data)
    except (zstandard.ZstdError, MemoryError) as error:  # a wrong checksum shows when all is decompressed
        raise CompressionError(str(error), size) from None
    raise CompressionError(f"a sample of {size} bytes, more than {limit}")


def _unsized(data: bytes, limit: int) -> bytes:
    """Return the content of a frame that does not tell its size."""
    import zstandard

    reader = zstandard.ZstdDecompressor().stream_reader(data)
    found = bytearray()
    try:
        while len(found) <= limit and (part := reader.read(min(_STEP, limit + 1 - len(found)))):
            found += part
    except (zstandard.ZstdError, MemoryError) as error:
        raise CompressionError(str(error), len(found)) from None
    if len(found) > limit:
        raise CompressionError(f"a sample of more than {limit} bytes", limit)
    return bytes(found)
