"""Archives: tar and zip with links, devices, hostile names and headers, damaged, truncated, or far larger unpacked.

msggen reads them into a catalog or reports an error. Memory stays bounded.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import stat
import struct
import tarfile
import zipfile
from collections.abc import Callable
from functools import cache
from random import Random
from typing import NamedTuple

from fuzz.definitions import check_text, use
from msggen.base.diagnostics import InputError
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from support.scratch import scratch_folder

COUNT = 800

RPM = b"uint64 timestamp\nfloat32 rpm\n"
NAMES = (
    *("msg/Rpm.msg", "msg/versioned/Wind.msg", "msg/px4_msgs_old/msg/WindV0.msg", "srv/Ask.srv", "package.xml"),
    *("README.md",),
    *("src/modules/uxrce_dds_client/dds_topics.yaml", "msg/CMakeLists.txt", "Kconfig", "msg/Rpm.msg", "msg", "msg/"),
    *("a/b",),
    *("../Evil.msg", "/etc/Evil.msg", "msg/../../Evil.msg", "./msg/Foo.msg", "msg//Foo.msg", "C:\\msg\\Foo.msg"),
    *("msg\\Foo.msg",),
    *("msg/F\nM.msg", "msg/\udcff.msg", "msg/" + "A" * 300 + ".msg", "", ".", "..", "/", "__MACOSX/msg/Rpm.msg"),
    *("msg/.msg", "\x1b[2J"),
)
TARGETS = (
    *("Rpm.msg", "../msg/Rpm.msg", "msg", ".", "..", "/etc/passwd", "../../../../etc/passwd", "Loop.msg"),
    *("versioned", ""),
    *("msg/Loop.msg", "a" * 5000, "/dev/zero", "\n", "../" * 50 + "msg"),
)
SUFFIXES = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tar.xz", ".zip")
BOMB = 2**24
BOMBS = 40
"""A bomb is that many members of as many zeros as a definition may have at most."""


class Case(NamedTuple):
    """An archive."""

    suffix: str
    data: bytes


def case(chance: Random) -> Case:
    suffix = chance.choice(SUFFIXES)
    if chance.random() < 0.005:
        return Case(suffix, _bomb(suffix))
    data = _zip(chance) if suffix == ".zip" else _tar(chance)
    is_packed = chance.random() < 0.5
    if not is_packed:
        data = _damaged(chance, data)
    data = _PACKERS.get(suffix, bytes)(data)
    return Case(suffix, _damaged(chance, data) if is_packed else data)


def _compressed_gzip(data: bytes) -> bytes:
    return gzip.compress(data, 1, mtime=0)


_PACKERS: dict[str, Callable[[bytes], bytes]] = {
    ".tar.gz": _compressed_gzip,
    ".tgz": _compressed_gzip,
    ".tar.bz2": bz2.compress,
    ".tar.xz": lambda data: lzma.compress(data, preset=0),
}


def _content(chance: Random) -> bytes:
    return chance.choice(
        (
            RPM,
            RPM,
            RPM,
            b"",
            b"uint8 a\n---\nuint8 b\n",
            b"<package><name>px4_msgs</name></package>",
            chance.randbytes(40),
        )
    )


def _tar(chance: Random) -> bytes:
    stream = io.BytesIO()
    kind = chance.choice((tarfile.PAX_FORMAT, tarfile.GNU_FORMAT, tarfile.USTAR_FORMAT))
    with tarfile.open(fileobj=stream, mode="w", format=kind, errors="surrogateescape") as archive:
        for _ in range(chance.randint(0, 8)):
            member = tarfile.TarInfo(chance.choice(("", "", "PX4-Autopilot/")) + chance.choice(NAMES))
            member.type = chance.choice((*(tarfile.REGTYPE,) * 8, *_TYPES))
            member.linkname = chance.choice(TARGETS)
            data = _content(chance) if member.isreg() else b""
            member.size = len(data)
            if chance.random() < 0.1:
                member.pax_headers = {
                    chance.choice(_PAX): chance.choice(("-1", "9" * 30, "a", "0", "1,2,3", "\n", "Rpm.msg"))
                }
            try:
                archive.addfile(member, io.BytesIO(data))
            except (ValueError, UnicodeError):
                continue  # this format cannot hold it
    return stream.getvalue()


_TYPES = (
    tarfile.LNKTYPE,
    tarfile.SYMTYPE,
    tarfile.DIRTYPE,
    tarfile.FIFOTYPE,
    tarfile.CHRTYPE,
    tarfile.BLKTYPE,
    tarfile.CONTTYPE,
)
_PAX = (
    "size",
    "path",
    "linkpath",
    "mtime",
    "GNU.sparse.major",
    "GNU.sparse.map",
    "GNU.sparse.size",
    "GNU.sparse.name",
    "hdrcharset",
)


def _zip(chance: Random) -> bytes:
    stream = io.BytesIO()
    method = chance.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name in dict.fromkeys(chance.choice(NAMES) for _ in range(chance.randint(0, 8))):
            member = zipfile.ZipInfo(name.encode(errors="replace").decode())
            member.compress_type = method
            is_link = chance.random() < 0.15
            member.external_attr = (stat.S_IFLNK if is_link else chance.choice((stat.S_IFREG, stat.S_IFIFO, 0))) << 16
            archive.writestr(member, chance.choice(TARGETS) if is_link else _content(chance))
    return stream.getvalue()


def _damaged(chance: Random, data: bytes) -> bytes:
    """Return an archive that is truncated, or in which bytes, a header or a size differ."""
    for _ in range(chance.choice((0, 0, 1, 1, 2, 5))):
        if not data:
            break
        at = chance.randrange(len(data))
        kind = chance.random()
        if kind < 0.15:
            data = data[:at]
        elif kind < 0.3:
            data = data[:at] + data[at + chance.randint(1, 600) :]
        elif kind < 0.5:
            number = struct.pack("<I", chance.choice((0, 1, 2**16, 2**31 - 1, 2**32 - 1)))
            data = data[:at] + number + data[at + 4 :]
        elif kind < 0.7 and len(data) > 512:
            data = _with_size(chance, data)
        else:
            data = data[:at] + chance.randbytes(chance.randint(1, 4)) + data[at + 1 :]
    return data


def _with_size(chance: Random, data: bytes) -> bytes:
    """Return a tar archive with another size or type in a header, whose checksum is right."""
    at = chance.randrange(len(data) // 512) * 512
    header = bytearray(data[at : at + 512])
    size = chance.choice(
        (b"77777777777\0", b"-0000000001\0", b"\x80" + b"\xff" * 11, b"\xff" * 12, b"00000001000\0", b"junk        ")
    )
    header[124:136] = size
    if chance.random() < 0.3:
        header[156:157] = chance.choice((b"S", b"L", b"K", b"x", b"g", b"V", b"M", b"1", b"2", b"5"))
    header[148:156] = b" " * 8
    header[148:156] = b"%06o\0 " % sum(header)
    return data[:at] + bytes(header) + data[at + 512 :]


@cache
def _bomb(suffix: str) -> bytes:
    """Return an archive of zeros, which is some thousand times larger unpacked."""
    zeros = bytes(BOMB)
    names = [f"msg/Bomb{number}.msg" for number in range(BOMBS)]
    stream = io.BytesIO()
    if suffix == ".zip":
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name in names:
                archive.writestr(name, zeros)
        return stream.getvalue()
    pack = _PACKERS.get(suffix, _compressed_gzip)  # a .tar may be compressed too
    packed = pack(zeros)
    for name in names:
        member = tarfile.TarInfo(name)
        member.size = BOMB
        stream.write(pack(member.tobuf()) + packed)
    return stream.getvalue() + pack(bytes(1024))


def check(case: Case) -> None:
    with scratch_folder() as folder:
        path = folder / f"firmware{case.suffix}"
        path.write_bytes(case.data)
        try:
            sources = find_sources(path.name)
            use(read_catalog(sources))
            with_archived(sources)
        except InputError as error:
            for found in (*error.diagnostics, *error.notices):
                check_text(found)
        assert list(folder.iterdir()) == [path]
