"""Tests of recordings on servers of HTTP that are hostile, or redirect: no request leaves for another server."""

from __future__ import annotations

import ssl
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from msggen import recordings
from msggen.recordings.stores import connections, limits
from msggen.recordings.stores.connections import origin_of
from msggen.recordings.stores.errors import StoreError
from msggen.recordings.stores.store import Store
from support.certificates import write_certificate
from support.object_server import hasten, set_credentials
from support.random_mcap import recording
from support.raw_server import file_answer, raw_server, whole_answer

OTHER = "the server redirects to another one, {}: name the address there if you trust it"


@pytest.fixture(autouse=True)
def without_proxies(monkeypatch: pytest.MonkeyPatch) -> None:
    hasten(monkeypatch)
    set_credentials(monkeypatch, "http://127.0.0.1:1")


@pytest.fixture(scope="module")
def data(px4_types: Any) -> bytes:
    return recording(px4_types, 50, 5, 1500)


def opened(address: str) -> int:
    with recordings.open(address) as log:
        return len(log.load())


@pytest.mark.parametrize("status", ["301 a", "302 a", "303 a", "307 a", "308 a"])
@pytest.mark.parametrize(
    ("location", "place"),
    [
        ("http://127.0.0.1:{other}/b.mcap?hidden", "http://127.0.0.1:{other}"),
        ("http://user:hidden@localhost:{port}/b.mcap", "http://localhost:{port}"),
        ("//127.0.0.1.:{port}/b.mcap", "http://127.0.0.1.:{port}"),
        ("http://169.254.169.254/latest/meta-data/", "http://169.254.169.254"),
        ("http://[fe80::1]/b.mcap", "http://[fe80::1]"),
        ("https://example.invalid/b.mcap", "https://example.invalid"),
    ],
)
def test_a_redirect_to_another_server_is_not_followed(data: bytes, status: str, location: str, place: str) -> None:
    def redirect(_: str) -> Iterator[bytes]:
        places = {"other": other.port, "port": server.port}
        yield whole_answer(status, f"Location: {location.format(**places)}\r\n")

    with raw_server(lambda head: iter([file_answer(head, data)])) as other, raw_server(redirect) as server:
        with pytest.raises(StoreError) as error:
            recordings.open(f"http://user:hidden@127.0.0.1:{server.port}/a.mcap?signature=hidden")
        assert error.value.strerror == OTHER.format(place.format(other=other.port, port=server.port))
        assert (len(server.heads), other.heads) == (1, [])
    assert "hidden" not in str(error.value)


@pytest.mark.parametrize("location", ["file:///etc/passwd", "ftp://a:hidden@b/c", "http://[", "http://a:99999/", ""])
def test_a_redirect_to_what_is_no_address_is_an_error(location: str) -> None:
    with raw_server(lambda _: iter([whole_answer("302 a", f"Location: {location}\r\n")])) as server:
        with pytest.raises(StoreError, match=r"the server redirects without end, or to what is no address$"):
            recordings.open(f"http://127.0.0.1:{server.port}/a.mcap")
        assert len(server.heads) == 1


def test_a_redirect_on_the_same_server_is_followed(data: bytes) -> None:
    def answer(head: str) -> Iterator[bytes]:
        is_moved = head.startswith("GET /b/c.mcap?own=1 ")
        yield file_answer(head, data) if is_moved else whole_answer("302 a", "Location: /b/c.mcap?own=1\r\n")

    with raw_server(answer) as server:
        assert opened(f"http://user:wo%72d@127.0.0.1:{server.port}//a.mcap?first=1") == 5
    assert server.heads[0].startswith("GET //a.mcap?first=1 ")
    assert all("Authorization: Basic dXNlcjp3b3Jk\r\n" in head for head in server.heads)


def test_redirects_end() -> None:
    def answer(head: str) -> Iterator[bytes]:
        number = int(head.partition(" /")[2].partition(" ")[0])
        yield whole_answer("302 a", f"Location: /{number + 1}\r\n")

    with raw_server(answer) as server:
        with pytest.raises(StoreError, match=r"the server redirects without end"):
            recordings.open(f"http://127.0.0.1:{server.port}/0")
        assert len(server.heads) == 11


def certificate(folder: Path) -> tuple[ssl.SSLContext, ssl.SSLContext]:
    """Return the contexts of a server on the loopback interface, and of its clients."""
    path = write_certificate(folder)
    own = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    own.load_cert_chain(path)
    return own, ssl.create_default_context(cafile=str(path))


def test_a_redirect_to_https_of_the_same_host_is_followed_and_none_back(
    data: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, clients = certificate(tmp_path)

    def safe(head: str) -> Iterator[bytes]:
        back = f"Location: http://127.0.0.1:{plain.port}/a.mcap\r\n"
        yield whole_answer("302 a", back) if "/back" in head else file_answer(head, data)

    def redirect(_: str) -> Iterator[bytes]:
        yield whole_answer("302 a", f"Location: https://127.0.0.1:{server.port}/b.mcap\r\n")

    with raw_server(safe, own) as server, raw_server(redirect) as plain:
        with pytest.raises(StoreError, match=r"no connection to the server: .*certificate"):
            recordings.open(f"https://127.0.0.1:{server.port}/a.mcap")
        monkeypatch.setattr(connections, "_context", lambda: clients)
        with pytest.raises(StoreError, match=rf"redirects to another one, https://127.0.0.1:{server.port}: "):
            recordings.open(f"http://127.0.0.1:{plain.port}/a.mcap")
        monkeypatch.setitem(connections._PORTS, "https", server.port)
        assert opened(f"https://127.0.0.1:{server.port}/a.mcap") == 5
        assert opened(f"http://127.0.0.1:{plain.port}/a.mcap") == 5
        with pytest.raises(StoreError, match=r"redirects to another one, http://127"):
            recordings.open(f"https://127.0.0.1:{server.port}/back")


def drips(pieces: bytes) -> Iterator[bytes]:
    import time

    for each in pieces:
        yield bytes([each])
        time.sleep(0.05)


@pytest.mark.parametrize("part", ["head", "body", "more heads"])
def test_an_answer_that_drips_ends_in_time(data: bytes, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "LIMITS", limits.LIMITS._replace(total=0.4, retries=0))

    def answer(head: str) -> Iterator[bytes]:
        whole = file_answer(head, data)
        end = 0 if part == "head" else whole.index(b"\r\n\r\n") + 4
        if part == "more heads":
            for _ in range(100):
                yield from drips(b"HTTP/1.1 100 Continue\r\n\r\n")
        yield whole[:end]
        yield from drips(whole[end:])

    with raw_server(answer) as server:
        with pytest.raises(StoreError, match=r"the server does not answer in time$"):
            recordings.open(f"http://127.0.0.1:{server.port}/a.mcap")
        assert len(server.heads) == 1


FRONT = "HTTP/1.1 206 a\r\n"
CHUNKS = FRONT + "Content-Range: bytes 0-1/2\r\nTransfer-Encoding: chunked\r\n\r\n{}\r\n"
WRONG = {
    "garbage": (b"\0\xff garbage\r\n\r\n", "what the server answers is not HTTP"),
    "headers": (FRONT.encode() + b"a: b\r\n" * 101 + b"\r\n", "what the server answers is not HTTP"),
    "a long header": (FRONT.encode() + b"a" * 70_000, "what the server answers is not HTTP"),
    "no range": (
        whole_answer("206 a", "", b"1234"),
        "the server sent another range than the one that it was asked for",
    ),
    "a size that is too large": (
        whole_answer("206 a", f"Content-Range: bytes 0-1/{'9' * 30}\r\n", b"12"),
        "the server sent another range than the one that it was asked for",
    ),
    "more": (
        f"{FRONT}Content-Range: bytes 0-1/2\r\nContent-Length: 9\r\n\r\n123456789".encode(),
        "the server sent more bytes than the 2 that it told",
    ),
    "half of a chunk": (
        f"{FRONT}Content-Range: bytes 0-9/10\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n12345\r\nzz".encode(),
        "the connection broke off before the end of the answer",
    ),
    "a chunk without end": (CHUNKS.format(-1).encode() + b"12", "what the server answers is not HTTP"),
    "a chunk of less than nothing": (CHUNKS.format(-5).encode() + b"12", "what the server answers is not HTTP"),
    "no content": (whole_answer("204 a"), "the server answers with an error (204)"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_answer_is_an_error(kind: str) -> None:
    wrong, reason = WRONG[kind]

    def answer(_: str) -> Iterator[bytes]:
        yield wrong
        raise ConnectionError

    with raw_server(answer) as server:
        with pytest.raises(StoreError) as error:
            recordings.open(f"http://127.0.0.1:{server.port}/a.mcap")
        assert error.value.strerror == reason


def test_connections_are_used_again_and_one_that_was_closed_is_replaced(data: bytes) -> None:
    found = set()

    def answer(head: str) -> Iterator[bytes]:
        yield file_answer(head, data)
        if len(server.heads) == 3:
            raise ConnectionError

    with raw_server(answer) as server:
        address = f"http://127.0.0.1:{server.port}/a.mcap"
        store = Store(address)
        for _ in range(6):
            found.add(store.look(address)[0])
        assert server.accepted == 2
    assert len(found) == 1


def test_a_server_is_only_read(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"1")
    store = Store("http://127.0.0.1:1/a")
    with pytest.raises(StoreError, match=r"a server of HTTP is only read$"):
        store.put(str(path), "http://127.0.0.1:1/a")


def test_a_proxy_of_the_environment_is_asked(data: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    with raw_server(lambda head: iter([file_answer(head, data)])) as proxy:
        monkeypatch.setenv("http_proxy", f"http://user:word@127.0.0.1:{proxy.port}")
        assert opened("http://server.invalid/a.mcap?b") == 5
        monkeypatch.setenv("no_proxy", "server.invalid")
        with pytest.raises(StoreError, match=r"no connection to the server"):
            recordings.open("http://server.invalid/a.mcap")
    for head in proxy.heads:
        assert head.startswith("GET http://server.invalid/a.mcap?b HTTP/1.1\r\nHost: server.invalid\r\n")
        assert "Proxy-Authorization: Basic dXNlcjp3b3Jk\r\n" in head


@pytest.mark.parametrize(
    "proxy", ["socks5://user:hidden@127.0.0.1:1", "https://127.0.0.1:1", "http://[", "127.0.0.1:99999"]
)
def test_a_proxy_of_another_kind_is_an_error(proxy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", proxy)
    with pytest.raises(StoreError, match=r"no connection to the server: expected http://HOST:PORT in http_proxy$"):
        recordings.open("http://server.invalid/a.mcap")


@pytest.mark.parametrize("url", ["http://a/x", "https://a:443/x", "http://[::1]:8080/x", "http://A.b:81"])
def test_the_origin_of_an_address_is_its_server(url: str) -> None:
    origin = origin_of(urlsplit(url))
    assert origin_of(urlsplit(f"{origin.scheme}://{origin.place}")) == origin
    assert origin.leads_to(origin)
