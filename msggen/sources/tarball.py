"""Archives, read without unpacking: tar with any compression, and zip."""

from __future__ import annotations

import bz2
import gzip
import lzma
import os
import posixpath
import stat
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from typing import IO, cast

from msggen.base.diagnostics import input_error
from msggen.base.disk.reading import LARGEST, TOO_LARGE
from msggen.sources.tree import Amount, Snapshot, TooMuchError, Wanted, is_wanted

SUFFIXES = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz", ".zip")
"""The suffixes of archives."""

_DAMAGED = (
    tarfile.TarError,
    zipfile.BadZipFile,
    lzma.LZMAError,
    zlib.error,
    struct.error,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    ValueError,
)
"""The exceptions of tarfile, zipfile and their codecs for a damaged archive. A header may ask for a
dictionary of any size (MemoryError). RecursionError is a RuntimeError."""

_UNPACKERS: dict[bytes, Callable[[str], object]] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ": lzma.open}
"""The functions that open compressed files, by the first bytes of the files."""

_TAR_BLOCK = 512
_CHUNK = 2**20
_MOST_FILES = 1_000_000
_FREE = 2**26
_FACTOR = 100
"""A tar archive may unpack to `_FREE` bytes, and to `_FACTOR` times its size. Source code shrinks to a fifth or so."""


def read_archive(path: str) -> Snapshot:
    """Return the files of an archive. Raises InputError.

    If a single folder contains all of them, their names are relative to it.
    """
    files, links = _read(path, is_wanted)
    tops = {name.split("/")[0] for name in (*files, *links)}
    top = tops.pop() if len(tops) == 1 else ""
    is_wrapped = top and top not in ("msg", "srv", "src") and not any("/" not in name for name in (*files, *links))

    def more(wanted: Wanted) -> dict[str, bytes]:
        return {name: data for name, data in _read(path, wanted)[0].items() if wanted(name)}

    return Snapshot(path, files, links=links, base=f"{top}/" if is_wrapped else "", more=more)


def _read(path: str, wanted: Wanted) -> tuple[dict[str, bytes], dict[str, str]]:
    """Return the files and the symbolic links of an archive, with the contents of `wanted` files. Raises InputError."""
    read = _read_zip if path.lower().endswith(".zip") else _read_tar
    try:
        return read(path, wanted)
    except TooMuchError as error:
        raise input_error(path, "S109", str(error), 0) from None
    except _DAMAGED as error:
        reason = str(error).partition("\n")[0].rstrip(":") or type(error).__name__
        raise input_error(path, "S109", f"cannot be read as an archive: {reason}", 0) from None


def _inside(name: str) -> str:
    """Return the normalised name of a member, "" for one outside of the archive or in macOS's `__MACOSX`."""
    name = posixpath.normpath(name)
    return "" if name.startswith(("/", "..")) or name.split("/")[0] in (".", "__MACOSX") else name


def _read_tar(path: str, wanted: Wanted) -> tuple[dict[str, bytes], dict[str, str]]:
    files: dict[str, bytes] = {}
    links: dict[str, str] = {}
    amount = Amount()
    limit = _FREE + _FACTOR * os.path.getsize(path)
    with _unpacked(path) as unpacked:
        stream = _Bounded(unpacked, limit)
        archive = tarfile.TarFile(path, fileobj=cast("IO[bytes]", stream))
        for member in _members(archive):
            name = _inside(member.name)
            if not name:
                continue
            if member.issym():
                links[name] = member.linkname
            elif member.islnk():
                links[name] = posixpath.relpath(posixpath.normpath(member.linkname), posixpath.dirname(name) or ".")
            elif member.isfile():
                content = archive.extractfile(member) if wanted(name) else None
                files[name] = _contents(content, name, member.size, amount) if content else b""
        _check_end(stream, archive.offset)
    return files, links


def _unpacked(path: str) -> IO[bytes]:
    """Open the tar archive at `path`, which may be compressed."""
    with open(path, "rb") as file:
        head = file.read(max(map(len, _UNPACKERS)))
    opened = next((opener(path) for magic, opener in _UNPACKERS.items() if head.startswith(magic)), None)
    return cast("IO[bytes]", opened) if opened else open(path, "rb")


class _Bounded:
    """The unpacked bytes of a tar archive, with an error at their limit."""

    def __init__(self, stream: IO[bytes], limit: int) -> None:
        self._stream = stream
        self._limit = limit

    def read(self, size: int = -1, /) -> bytes:
        """Return the next bytes. Raises TooMuchError at the limit, and for more bytes than any file or header has."""
        if not 0 <= size <= LARGEST + _CHUNK:
            raise TooMuchError(f"a part of it is {TOO_LARGE}")
        data = self._stream.read(size)
        self._check(self._stream.tell())
        return data

    def seek(self, position: int, /) -> int:
        """Go to a position. Raises TooMuchError after the limit, before anything is unpacked."""
        self._check(position)
        return self._stream.seek(position)

    def tell(self) -> int:
        """Return the position."""
        return self._stream.tell()

    def _check(self, position: int) -> None:
        if position > self._limit:
            raise TooMuchError(f"it unpacks to more than {_FACTOR} times its size: expected an archive of source code")


def _members(archive: tarfile.TarFile) -> Iterator[tarfile.TarInfo]:
    """Yield the members of a tar archive. Raises EOFError unless each begins after the one before."""
    offset = 0
    for _ in range(_MOST_FILES):
        member = archive.next()
        if member is None:
            return
        if archive.offset <= offset:
            raise EOFError("it is damaged")
        offset = archive.offset
        archive.members = []  # type: ignore[attr-defined]  # tarfile would keep them all
        yield member
    raise TooMuchError(f"it has more than {_MOST_FILES} files")


def _contents(stream: IO[bytes], name: str, size: int, amount: Amount) -> bytes:
    """Return the contents of a member, which has up to `size` bytes. Raises TooMuchError."""
    amount.add(name, size)
    return stream.read(size)


def _check_end(stream: _Bounded, position: int) -> None:
    """Raise EOFError unless a block of zeros ends the archive, because tarfile accepts a truncated archive.

    Read on to the end of the stream, so that the checksum of a compressed archive is verified.
    """
    stream.seek(position)
    if stream.read(_TAR_BLOCK) != bytes(_TAR_BLOCK):
        raise EOFError("it is truncated or damaged")
    while stream.read(_CHUNK):
        pass


def _read_zip(path: str, wanted: Wanted) -> tuple[dict[str, bytes], dict[str, str]]:
    files: dict[str, bytes] = {}
    links: dict[str, str] = {}
    amount = Amount()
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            name = _inside(member.filename)
            is_link = stat.S_ISLNK(member.external_attr >> 16)
            if member.is_dir() or not name:
                continue
            data = b""
            if is_link or wanted(name):
                with archive.open(member) as stream:
                    data = _contents(stream, name, member.file_size, amount)
            if is_link:
                links[name] = os.fsdecode(data)
            else:
                files[name] = data
    return files, links
