"""The pages of mapped files that are in memory."""

from __future__ import annotations

import mmap
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Octets = NDArray[np.uint8]
    Places = NDArray[np.int64]
    """Offsets in a buffer."""

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


_LARGE_PAGE = 2 << 20
"""The size of a large page in bytes, on most systems."""


def large_empty(size: int) -> Octets:
    """Return `size` bytes of new memory. If they fill several large pages, they begin at the start of one.

    A system gives large pages only where whole ones fit. Writing to new memory for the first time takes several times
    as long with small pages.
    """
    if size < 2 * _LARGE_PAGE:  # numpy asks for large pages from here on
        return np.empty(size, np.uint8)
    memory = np.empty(size + _LARGE_PAGE, np.uint8)
    begin = -memory.ctypes.data % _LARGE_PAGE
    return memory[begin : begin + size]
