"""zstd and lz4, as recordings use them."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any

LARGEST = 1 << 30
"""The largest block that is decompressed, in bytes. rosbag2 writes chunks of 768 KiB, Foxglove's tools of 4 MiB."""
MAX_CONTENT = "MSGGEN_MAX_CONTENT"
"""The environment variable with the most bytes that a file may have without its compression."""
_MOST = 100
"""How many times its size a file may have without its compression. The topics of PX4 are compressed 2 to 50 times."""
_LEAST_LIMIT = 1 << 27
"""The bytes that every file may have. Black pictures of a simulator are compressed thousands of times."""
_STEP = 1 << 16


class CompressionError(ValueError):
    """A block that cannot be decompressed."""


Data = Any
"""Bytes: a memoryview, or an array of numpy."""


def limit_of(size: int) -> int:
    """Return how many bytes a file of a size may have without its compression."""
    told = os.environ.get(MAX_CONTENT, "")
    return int(told) if told.isdecimal() else max(_MOST * size, _LEAST_LIMIT)


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


# files and samples of rosbag2


_FRAME_HEADER = 18


def decompress_file(path: str, target: str) -> str:
    """Decompress a file of zstd to another file, as much of it as can be. Return what is wrong with the rest, or "".

    Raises CompressionError if nothing can be decompressed or the content is too large to be a recording, and OSError.
    """
    import zstandard

    limit = limit_of(os.path.getsize(path))
    written = 0
    with open(path, "rb") as source, open(target, "wb") as file:
        try:
            promised = zstandard.frame_content_size(source.read(_FRAME_HEADER))
        except zstandard.ZstdError as error:
            raise CompressionError(str(error)) from None
        source.seek(0)
        reader = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
        problem = ""
        while not problem:
            try:
                data = reader.read(1 << 20)
            except (zstandard.ZstdError, MemoryError) as error:
                problem = str(error)
                continue
            if not data:
                break
            written += len(data)
            if written > limit:
                raise CompressionError(f"the content has more than {limit} bytes; {MAX_CONTENT} sets another limit")
            file.write(data)
    if not problem and written < promised:  # the reader ends without an error
        problem = f"expected {promised} bytes, got {written}"
    if problem and not written:
        raise CompressionError(problem)
    return problem


def decompress_frame(data: bytes, limit: int) -> bytes:
    """Return the content of a frame of zstd, of up to `limit` bytes. Raises CompressionError."""
    import zstandard

    try:
        size = zstandard.frame_content_size(data)
        if size > limit:
            raise CompressionError(f"a sample of {size} bytes")
        if size >= 0:
            return zstandard.ZstdDecompressor().decompress(data)
        reader = zstandard.ZstdDecompressor().stream_reader(data)
        found = reader.read(limit + 1)
    except (zstandard.ZstdError, MemoryError) as error:
        raise CompressionError(str(error)) from None
    if len(found) > limit:
        raise CompressionError(f"a sample of more than {limit} bytes")
    return found
