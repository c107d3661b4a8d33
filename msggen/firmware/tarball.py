"""Archives, read without unpacking: tar with any compression, and zip."""

from __future__ import annotations

import lzma
import os
import posixpath
import stat
import struct
import tarfile
import zipfile
import zlib

from msggen.diagnostics import input_error
from msggen.firmware.tree import Snapshot, Wanted, is_wanted

SUFFIXES = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz", ".zip")
"""The suffixes of archives."""

_DAMAGED = (tarfile.TarError, zipfile.BadZipFile, lzma.LZMAError, zlib.error, struct.error)
_TAR_BLOCK = 512
_CHUNK = 2**20
_MAX_SIZE = 2**24
"""Maximum number of bytes read of one file. No definition is nearly as large."""


def read_archive(path: str) -> Snapshot:
    """Return the files of an archive. Raises InputError.

    If a single folder contains all of them, their names are relative to it.
    """
    read = _read_zip if path.lower().endswith(".zip") else _read_tar
    try:
        files, links = read(path, is_wanted)
    except (*_DAMAGED, EOFError, LookupError, OSError, RuntimeError, ValueError) as error:
        reason = str(error).partition("\n")[0].rstrip(":") or type(error).__name__
        raise input_error(path, "S109", f"cannot be read as an archive: {reason}", 0) from None
    tops = {name.split("/")[0] for name in (*files, *links)}
    top = tops.pop() if len(tops) == 1 else ""
    is_wrapped = top and top not in ("msg", "srv", "src") and not any("/" not in name for name in (*files, *links))

    def more(wanted: Wanted) -> dict[str, bytes]:
        return {name: data for name, data in read(path, wanted)[0].items() if wanted(name)}

    return Snapshot(path, files, links=links, base=f"{top}/" if is_wrapped else "", more=more)


def _inside(name: str) -> str:
    """Return the normalised name of a member, "" for one outside of the archive or in macOS's `__MACOSX`."""
    name = posixpath.normpath(name)
    return "" if name.startswith(("/", "..")) or name.split("/")[0] in (".", "__MACOSX") else name


def _read_tar(path: str, wanted: Wanted) -> tuple[dict[str, bytes], dict[str, str]]:
    files: dict[str, bytes] = {}
    links: dict[str, str] = {}
    with tarfile.open(path) as archive:
        for member in archive:
            name = _inside(member.name)
            if not name:
                continue
            if member.issym():
                links[name] = member.linkname
            elif member.islnk():
                links[name] = posixpath.relpath(posixpath.normpath(member.linkname), posixpath.dirname(name) or ".")
            elif member.isfile():
                stream = archive.extractfile(member) if wanted(name) else None
                files[name] = stream.read(_MAX_SIZE) if stream else b""
        _check_end(archive)
    return files, links


def _check_end(archive: tarfile.TarFile) -> None:
    """Raise EOFError unless a block of zeros ends the archive, because tarfile accepts a truncated archive.

    Read on to the end of the stream, so that the checksum of a compressed archive is verified.
    """
    stream = archive.fileobj
    if stream is None:
        return
    stream.seek(archive.offset)
    if stream.read(_TAR_BLOCK) != bytes(_TAR_BLOCK):
        raise EOFError("it is truncated or damaged")
    while stream.read(_CHUNK):
        pass


def _read_zip(path: str, wanted: Wanted) -> tuple[dict[str, bytes], dict[str, str]]:
    files: dict[str, bytes] = {}
    links: dict[str, str] = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            name = _inside(member.filename)
            is_link = stat.S_ISLNK(member.external_attr >> 16)
            if member.is_dir() or not name:
                continue
            data = b""
            if is_link or wanted(name):
                with archive.open(member) as stream:
                    data = stream.read(_MAX_SIZE)
            if is_link:
                links[name] = os.fsdecode(data)
            else:
                files[name] = data
    return files, links
