"""Connections to servers of HTTP, which are used again. An answer takes limited time, also if its bytes drip."""

from __future__ import annotations

import socket
import ssl
from base64 import b64encode
from contextlib import contextmanager, suppress
from functools import cache
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from threading import Event, Timer
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote, urlsplit
from urllib.request import getproxies, proxy_bypass
from weakref import finalize

from msggen.recordings.stores import limits
from msggen.recordings.stores.errors import UNREACHABLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from urllib.parse import SplitResult


_PORTS = {"http": 80, "https": 443}
_OF_PROXY = "Proxy-Authorization"


class FailedError(Exception):
    """A request that failed, with its reason. Another try can succeed."""


class Origin(NamedTuple):
    """A server: the scheme `http` or `https`, the host in lower case, and the port."""

    scheme: str
    host: str
    port: int

    @property
    def place(self) -> str:
        """The host and the port, as in an address. The usual port is left out."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == _PORTS[self.scheme] else f"{host}:{self.port}"

    def leads_to(self, other: Origin) -> bool:
        """Whether a redirect is followed: on the same host and port, or to https on its usual port of the same host.

        Other ports can be those of other services, which only this computer reaches.
        """
        return other in (self, Origin("https", self.host, _PORTS["https"]))


def origin_of(url: SplitResult) -> Origin:
    """Return the server of an address. Raises ValueError if it has none."""
    if url.scheme not in _PORTS or not url.hostname:
        raise ValueError(url.scheme)
    return Origin(url.scheme, url.hostname, url.port or _PORTS[url.scheme])


def authorization(header: str, url: SplitResult) -> dict[str, str]:
    """Return the header that tells a server or a proxy the user and the password of its address, if there is one."""
    if url.username is None:
        return {}
    text = f"{unquote(url.username)}:{unquote(url.password or '')}"
    return {header: f"Basic {b64encode(text.encode()).decode()}"}


class _Response(HTTPResponse):
    """An answer that has no chunks of a negative size: for -1, http.client reads until the connection ends."""

    def _read_next_chunk_size(self) -> int:
        size: int = super()._read_next_chunk_size()  # type: ignore[misc]
        if size < 0:
            raise HTTPException(size)
        return size


class Connections:
    """Connections that wait to be used again. An instance can be used by several threads."""

    def __init__(self) -> None:
        self._idle: dict[Origin, list[HTTPConnection]] = {}
        finalize(self, _close, self._idle)

    @contextmanager
    def answer(self, origin: Origin, target: str, headers: Mapping[str, str]) -> Iterator[HTTPResponse]:
        """Yield the answer to a request, whose body the block reads.

        Raises FailedError without a connection, TimeoutError, HTTPException, and OSError if the connection breaks off.
        """
        idle = self._idle.setdefault(origin, [])
        try:
            connection = idle.pop()
        except IndexError:
            connection = _connected(origin)
        proxy = _proxy(origin)
        if proxy and origin.scheme == "http":
            target, headers = f"http://{origin.place}{target}", {**headers, **authorization(_OF_PROXY, proxy)}
        try:
            with _ending(connection.sock, limits.LIMITS.total):
                connection.request("GET", target, headers=headers)
                response = connection.getresponse()
                with response:
                    yield response
                    is_whole = response.isclosed()
        except BaseException:
            connection.close()
            _close({origin: idle})  # the server may have closed the others too
            raise
        if is_whole and connection.sock is not None:
            idle.append(connection)
        else:
            connection.close()


def _connected(origin: Origin) -> HTTPConnection:
    """Return a new connection, through the proxy that the environment names."""
    proxy = _proxy(origin)
    host, port = (proxy.hostname, proxy.port or 80) if proxy else origin[1:]
    try:
        if origin.scheme == "http":
            connection = HTTPConnection(host or "", port, timeout=limits.LIMITS.connect)
        else:
            connection = HTTPSConnection(host or "", port, timeout=limits.LIMITS.connect, context=_context())
            if proxy:
                connection.set_tunnel(*origin[1:], headers=authorization(_OF_PROXY, proxy))
        connection.response_class = _Response
        connection.connect()
    except TimeoutError:
        raise
    except (OSError, UnicodeError) as error:  # a label of a host can be too long
        reason = str(getattr(error, "strerror", "") or error)
        raise FailedError(f"{UNREACHABLE}: {reason}".rstrip(": .")) from None
    connection.sock.settimeout(limits.LIMITS.read)
    return connection


def _proxy(origin: Origin) -> SplitResult | None:
    """Return the address of the proxy for a server, None if it is asked itself. Raises FailedError."""
    text = getproxies().get(origin.scheme)
    if not text or proxy_bypass(origin.place):
        return None
    with suppress(ValueError):
        found = urlsplit(text if "://" in text else f"http://{text}")
        if origin_of(found).scheme == "http":
            return found
    raise FailedError(f"{UNREACHABLE}: expected http://HOST:PORT in {origin.scheme}_proxy")


@cache
def _context() -> ssl.SSLContext:
    return ssl.create_default_context()


@contextmanager
def _ending(connection: socket.socket, seconds: float) -> Iterator[None]:
    """End a connection if the block takes longer. Its reader gets no more bytes, and TimeoutError is raised."""
    late = Event()

    def end() -> None:
        late.set()
        with suppress(OSError):
            socket.socket.shutdown(connection, socket.SHUT_RDWR)  # that of TLS would let a reader see its records

    timer = Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    except Exception:
        if late.is_set():
            raise TimeoutError from None
        raise
    finally:
        timer.cancel()


def _close(idle: Mapping[Origin, list[HTTPConnection]]) -> None:
    for connections in idle.values():
        while connections:
            with suppress(IndexError):
                connections.pop().close()
