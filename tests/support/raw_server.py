"""A server on the loopback interface that answers each request with the bytes that a function makes of it."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import ssl

Answer = Callable[[str], Iterator[bytes]]
"""Yields the pieces of an answer to the head of a request. ConnectionError ends the connection."""


class RawServer:
    """The heads of the requests, how many connections there were, and the port."""

    def __init__(self, answer: Answer, context: ssl.SSLContext | None) -> None:
        self.heads: list[str] = []
        self.accepted = 0
        self._answer, self._context = answer, context
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._open: set[socket.socket] = set()
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._listening.accept()
                self.accepted += 1
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with suppress(OSError), connection:
            connection.settimeout(20)
            own = self._context.wrap_socket(connection, server_side=True) if self._context else connection
            self._open.add(own)
            with own:
                while head := self._head(own):
                    self.heads.append(head)
                    for piece in self._answer(head):
                        own.sendall(piece)

    @staticmethod
    def _head(connection: socket.socket) -> str:
        data = b""
        while b"\r\n\r\n" not in data:
            piece = connection.recv(65536)
            if not piece:
                return ""
            data += piece
        return data.decode("latin-1")

    def close(self) -> None:
        """End the server and its connections."""
        for each in (self._listening, *self._open):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()


def whole_answer(status: str, headers: str = "", body: bytes = b"") -> bytes:
    """Return an answer, with lines of headers."""
    return f"HTTP/1.1 {status}\r\n{headers}Content-Length: {len(body)}\r\n\r\n".encode("latin-1") + body


def range_of(head: str, size: int) -> tuple[int, int]:
    """Return the range that a request asks for, as far as a file of this size has it."""
    found = re.search(r"^Range: bytes=(\d+)-(\d+)", head, re.IGNORECASE | re.MULTILINE)
    assert found
    return int(found[1]), min(int(found[2]) + 1, size)


def file_answer(head: str, data: bytes) -> bytes:
    """Return the answer that a request for a range of a file should have."""
    start, stop = range_of(head, len(data))
    told = f'Content-Range: bytes {start}-{stop - 1}/{len(data)}\r\nETag: "1"\r\n'
    told += "Last-Modified: Fri, 27 Nov 2026 02:33:02 GMT\r\n"
    return whole_answer("206 Partial Content", told, data[start:stop])


@contextmanager
def raw_server(answer: Answer, context: ssl.SSLContext | None = None) -> Iterator[RawServer]:
    """Run a server in threads. With a context it speaks TLS."""
    server = RawServer(answer, context)
    try:
        yield server
    finally:
        server.close()
