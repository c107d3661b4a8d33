"""The checksums of MCAP: CRC-32 of the records of a chunk, of an attachment, and of the summary."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any

from msggen.recordings.source.source import Verification

if TYPE_CHECKING:
    from collections.abc import Callable

    from msggen.recordings.files.mcap.records import Chunk


def _crc_function() -> Callable[..., int]:
    """Return the function of zlib-ng, which is eight times as fast as that of zlib, or else that of zlib."""
    with suppress(ImportError):
        fast: Callable[..., int] = import_module("zlib_ng.zlib_ng").crc32
        return fast
    from zlib import crc32

    return crc32


crc32 = _crc_function()
"""Returns the CRC-32 of bytes. They can follow others, whose CRC-32 is the second argument.

It releases the lock of Python for all but few bytes.
"""


class Checks:
    """Which chunks of a file match their CRCs. Each is compared once, however often it is read."""

    def __init__(self, verification: Verification) -> None:
        self._verification = verification
        self._known: dict[int, str] = {}
        """What is wrong with chunks, by their offsets, "" for those that match."""

    @property
    def leaves_out(self) -> bool:
        """Whether chunks and attachments that do not match are left out."""
        return self._verification.is_on and not self._verification.keeps_damaged

    def passes(self, chunk: Chunk, crc: int, data: Any) -> bool:
        """Whether the records of a chunk match its CRC, as far as that has one and is to be compared."""
        return not (self._verification.is_on and crc) or self.compare(chunk, crc, data)

    def compare(self, chunk: Chunk, crc: int, data: Any) -> bool:
        """Compare the records of a chunk with its CRC, and return whether they match."""
        if chunk.start not in self._known:
            self._known[chunk.start] = "" if crc32(data) == crc else "does not match its CRC"
        return not self._known[chunk.start]

    def is_compared(self, chunk: Chunk) -> bool:
        """Whether a chunk was compared, or cannot be decompressed."""
        return chunk.start in self._known

    def fail(self, chunk: Chunk, error: Exception) -> None:
        """Note that a chunk cannot be decompressed."""
        self._known[chunk.start] = f"cannot be decompressed ({error})"

    def error_of(self, chunk: Chunk) -> str:
        """Return what is wrong with a chunk, "" if nothing is, or it was not compared."""
        return self._known.get(chunk.start, "")

    def is_left_out(self, chunk: Chunk) -> bool:
        """Whether a chunk is known to be damaged, and left out."""
        return self.leaves_out and bool(self.error_of(chunk))

    def accepts(self, content: memoryview, crc: int) -> bool:
        """Whether bytes match their CRC, as far as they have one and it is to be compared."""
        return not (self._verification.is_on and crc) or crc32(content) == crc
