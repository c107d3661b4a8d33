"""The pages of mapped files that are in memory."""

from __future__ import annotations

import mmap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msggen.recordings.gather import Octets

LARGE = 64 << 20
"""The size in bytes from which on the pages of a file are dropped."""
_DROP = getattr(mmap, "MADV_DONTNEED", None)
"""Windows has no such call."""


def drop_pages(file: Octets | memoryview) -> None:
    """Drop the pages of a large mapped file from the memory of this process. Readers call this after some MB.

    Otherwise, all that was read of a file counts as memory of the process, and on many systems 2 MB around each byte.
    Arrays of the file stay valid: what they need is read again, mostly from the cache of the system. Anything but a
    mapped file stays as it is.
    """
    if file.nbytes < LARGE or _DROP is None:
        return
    owner: object = file
    while owner is not None and not isinstance(owner, mmap.mmap):
        owner = owner.obj if isinstance(owner, memoryview) else getattr(owner, "base", None)
    if owner is not None:
        owner.madvise(_DROP)
