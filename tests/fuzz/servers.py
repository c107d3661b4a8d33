"""Recordings on a hostile server of HTTP, for `msggen log`: it redirects, lies, drips and answers with garbage.

No request leaves for another server. A run ends in time with 0, 1, or 2 and a named error, and no output has a user, a
password or a signature of the address.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from functools import cache
from random import Random
from typing import Any, NamedTuple

import pytest

from fuzz.conversions import NAMED
from msggen import recordings
from msggen.exports.convert import convert
from msggen.recordings.files import stored
from msggen.recordings.stores import limits
from support.commands import check_outcome, run
from support.object_server import hasten, set_credentials
from support.raw_server import file_answer, range_of, raw_server, whole_answer
from support.scratch import scratch_folder
from support.ulog import write_ulog

COUNT = 120
MEMORY = 1 << 31
"""The server is in this process, and each of its threads reserves addresses."""
_MOST = 200
"""The most requests of a command: those of a recording of some kB, each sent twice, or redirected up to 10 times."""
_COMMANDS = (
    ["info"],
    ["info", "--verify"],
    ["show", "sensor_gps"],
    ["convert", "-o", "out.mcap"],
    ["convert", "-o", "out"],
)
_LOCATIONS = (
    "{path}x",
    "http://user:hidden@127.0.0.1:{port}{path}",
    "//127.0.0.1:{port}/b",
    "?hidden",
    "#",
    "a" * 60_000,
    "http://127.0.0.1:{other}/b",
    "//127.0.0.1:{other}/b",
    "http://user:hidden@127.0.0.1:{other}/b?hidden",
    "http://localhost:{port}/b",
    "http://127.0.0.1:{port}@127.0.0.1:{other}/b",
    "\\\\127.0.0.1:{other}\\b",
    "http://169.254.169.254/latest/meta-data/",
    "http://[fe80::1]/",
    "http://[::ffff:169.254.169.254]/",
    "http://2852039166/",
    "https://127.0.0.1:{port}/b",
    "https://127.0.0.1:{other}/b",
    "http://127.1:{other}/b",
    "http://127.0.0.1.:{other}/",
    "file:///etc/passwd",
    "ftp://a:hidden@b/c?hidden",
    "gopher://127.0.0.1:{other}/",
    "s3://bucket/hidden",
    "",
    "//",
    "http://[",
    "http://:hidden@[",
    "http://a:99999/",
    "http://127.0.0.1:{other}\t/",
    "\x1b[31m\x85",
    "ht\ttp://x",
)
_LINES = (
    b"",
    b"\r\n\r\n",
    b"\0" * 99,
    b"ICY 200 OK\r\n\r\n",
    b"HTTP/1.1\r\n\r\n",
    b"HTTP/1.1 abc\r\n\r\n",
    b"HTTP/9.9 206 a\r\n\r\n",
    b"HTTP/1.1 2061 a\r\n\r\n",
    b"HTTP/1.1 -206 a\r\n\r\n",
    b"HTTP/1.1 206" + b"a" * 99_999,
    b"HTTP/1.1 101 a\r\n\r\n",
    b"\xff\r\n\r\n",
)
_RANGES = (
    "bytes {start}-{last}/*",
    "bytes {start}-{last}/-1",
    "bytes {start}-{last}/999999999999999999999",
    "bytes 0-0/1",
    "a",
    "bytes {start}-{last}/9223372036854775807",
    "bytes {last}-{start}/{size}",
    "bytes {start}-99999999999/99999999999",
    "bytes {size}-{last}/{size}",
    "bytes {start}-{last}/{start}",
    "bytes */{size}",
    "bytes \xb2-{last}/{size}",
    "bytes 0-0/0",
)
_SIZES = ("-1", "-5", "0", "5", "05", "+5", "5;a=b", "0x5", "5_0", " 5 ", "", "g", "f" * 12, "5" * 70_000)
_FIELDS = (
    "Content-Length: -1",
    "Content-Length: 99999999999999999999",
    "Content-Length: 1, 2",
    "Content-Length: a",
    "Content-Length: 0",
    "Transfer-Encoding: chunked",
    "Content-Encoding: gzip",
    "Connection: close",
    "ETag: a\r\n b",
    "ETag: " + "a" * 60_000,
    "Last-Modified: a",
    "Last-Modified: Fri, 99 Nov 99999 99:99:99 GMT",
    "ETag: \x1b[31m",
    "Set-Cookie: a=b",
    ": a",
    "a",
)


class Case(NamedTuple):
    """What a server does after so many right answers, with which choices, and a command."""

    kind: str
    after: int
    seed: int
    words: list[str]


def case(chance: Random) -> Case:
    _data()  # before the time of a case begins
    return Case(
        chance.choice(tuple(_KINDS)),
        chance.choice((0, 0, 1, 2, 5)),
        chance.randrange(1 << 32),
        chance.choice(_COMMANDS),
    )


def check(case: Case) -> None:
    asked: set[tuple[object, object]] = set()
    look_up = socket.getaddrinfo

    def noted(host: Any, port: Any, *words: Any, **others: Any) -> Any:
        asked.add((host, port))
        return look_up("127.0.0.1", port if host == "127.0.0.1" else 1, *words, **others)

    with pytest.MonkeyPatch.context() as patch, scratch_folder():
        hasten(patch)
        set_credentials(patch, "http://127.0.0.1:1")
        patch.setattr(limits, "LIMITS", limits.LIMITS._replace(total=1))
        for name, value in (("_BLOCK", 64), ("_FRONT", 256)):
            patch.setattr(stored, name, value)
        patch.setattr(socket, "getaddrinfo", noted)
        with raw_server(lambda _: iter([whole_answer("404 a")])) as other:
            hostile = _Hostile(case, other.port)
            with raw_server(hostile.answer) as server:
                hostile.port = server.port
                address = f"http://user:hidden@127.0.0.1:{server.port}/flight.mcap?signature=hidden"
                outcome = run(["log", case.words[0], address, *case.words[1:]])
                heads = len(server.heads)
            assert asked <= {("127.0.0.1", server.port)}, f"a request left for {asked}"
            assert not other.heads
    check_outcome(outcome)
    assert "hidden" not in outcome.stdout + outcome.stderr, outcome
    assert outcome.code != 2 or NAMED.search(outcome.stderr), outcome
    assert (outcome.stdout + outcome.stderr).replace("\n", "").replace("\t", "").isprintable(), outcome
    assert len(outcome.stderr) < 20_000
    assert heads <= _MOST, f"{heads} requests"


class _Hostile:
    """A server that answers rightly for some requests."""

    def __init__(self, case: Case, other: int) -> None:
        self.port = 0
        self._case, self._other, self._count = case, other, 0

    def answer(self, head: str) -> Iterator[bytes]:
        self._count += 1
        if self._count <= self._case.after and "\r\nRange: " in head:
            yield file_answer(head, _data())
            return
        chance = Random(self._case.seed)  # noqa: S311 - no secret
        places = {"path": head.split(" ")[1], "port": self.port, "other": self._other}
        yield from _KINDS[self._case.kind](chance, head, places)


def _redirect(chance: Random, _: str, places: dict[str, object]) -> Iterator[bytes]:
    status = chance.choice((300, 301, 302, 303, 304, 305, 307, 308, 399))
    location = chance.choice(_LOCATIONS).format(**places)
    yield whole_answer(f"{status} a", f"Location: {location}\r\n", b"<a>" * chance.choice((0, 9, 9999)))


def _status(chance: Random, _: str, __: object) -> Iterator[bytes]:
    yield chance.choice(_LINES)
    raise ConnectionError


def _error(chance: Random, _: str, __: object) -> Iterator[bytes]:
    status = chance.choice((100, 200, 204, 206, 400, 401, 403, 404, 408, 412, 416, 429, 500, 503, 999))
    code = chance.choice(
        ("", "NoSuchBucket", "<Code>NoSuchUpload</Code>", "<Code>a\x1b[31m</Code>", "<Region>a</Region>")
    )
    yield whole_answer(f"{status} a", "", code.encode() * chance.choice((1, 9999)))


def _headers(chance: Random, head: str, _: object) -> Iterator[bytes]:
    line = chance.choice((b"a: b\r\n", b"a: " + b"b" * 60_000 + b"\r\n", b"a" * 99_999, b"HTTP/1.1 100 a\r\n\r\n"))
    yield b"" if line.startswith(b"HTTP") else b"HTTP/1.1 206 a\r\n"
    for _ in range(chance.choice((50, 2000))):
        yield line
    yield file_answer(head, _data()) if "\r\nRange: " in head else b"\r\n"


def _lie(chance: Random, head: str, _: object) -> Iterator[bytes]:
    """Answer with a range or a header that is wrong, with bytes that are none or too many."""
    data = _data()
    start, stop = range_of(head, len(data)) if "\r\nRange: " in head else (0, 0)
    told = f"bytes {start}-{stop - 1}/{len(data)}"
    if chance.random() < 0.5:
        told = chance.choice(_RANGES).format(start=start, last=stop - 1, size=len(data))
    fields = [f"Content-Range: {told}", *chance.sample(_FIELDS, chance.choice((0, 1, 2)))]
    yield "\r\n".join(["HTTP/1.1 206 a", *fields, "", ""]).encode("latin-1")
    pieces = (
        b"",
        data[start:stop],
        data[start : stop - 1],
        b"5\r\n12345\r\n",
        b"ffffffffffff\r\n",
        b"-5\r\n",
        b"0\r\n",
    )
    yield chance.choice(pieces)
    for _ in range(chance.choice((0, 0, 2000))):
        yield bytes(10_000)
    if chance.random() < 0.7:
        raise ConnectionError


def _chunks(chance: Random, head: str, _: object) -> Iterator[bytes]:
    """Answer in chunks, with sizes that are none, or wrong."""
    data = _data()
    start, stop = range_of(head, len(data)) if "\r\nRange: " in head else (0, 0)
    fields = f"Content-Range: bytes {start}-{stop - 1}/{len(data)}\r\nTransfer-Encoding: chunked"
    yield f"HTTP/1.1 206 a\r\n{fields}\r\n\r\n".encode()
    for size in chance.choices(_SIZES, k=chance.choice((1, 1, 3, 300))):
        yield f"{size}\r\n12345\r\n".encode()
    if chance.random() < 0.7:
        raise ConnectionError


def _damage(chance: Random, head: str, _: object) -> Iterator[bytes]:
    """Answer rightly, but for some bytes, most of them of the head."""
    whole = bytearray(file_answer(head, _data()) if "\r\nRange: " in head else whole_answer("200 a"))
    for _ in range(chance.choice((1, 3, 20))):
        whole[chance.randrange(min(len(whole), chance.choice((30, 200, 9999))))] = chance.choice(b"\0\r\n :0a\xff/-")
    yield bytes(whole[: chance.choice((len(whole), len(whole) // 2))])
    raise ConnectionError


def _drip(chance: Random, head: str, _: object) -> Iterator[bytes]:
    """Answer byte for byte, each before the client has waited too long."""
    whole = file_answer(head, _data()) if "\r\nRange: " in head else whole_answer("200 a")
    begin = chance.choice((0, 9, 99, whole.index(b"\r\n\r\n") + 4))
    yield whole[:begin]
    for each in whole[begin : begin + 100]:
        time.sleep(0.1)
        yield bytes([each])
    time.sleep(chance.choice((0, 9)))


_KINDS: dict[str, Callable[[Random, str, dict[str, object]], Iterator[bytes]]] = {
    "redirect": _redirect,
    "redirect more": _redirect,
    "status": _status,
    "error": _error,
    "headers": _headers,
    "lie": _lie,
    "chunks": _chunks,
    "damage": _damage,
    "drip": _drip,
}
"""What the server does."""


@cache
def _data() -> bytes:
    """Return an MCAP file with an index."""
    with scratch_folder() as folder:
        with recordings.open(write_ulog(folder / "flight.ulg")) as log:
            convert(log, "flight.mcap", format="mcap")
        return (folder / "flight.mcap").read_bytes()
