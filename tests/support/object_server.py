"""A server of HTTP on the loopback interface that has files, counts what it sends, and fails on request.

To clients of S3, `/bucket/key` is an object, and lists have no folders; those of moto do.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import md5
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote

if TYPE_CHECKING:
    import pytest


FAULTS = {
    "half": "the connection broke off before the end of the answer",
    "stall": "the server does not answer in time",
    "500": "the server answers with an error (500), 2 times",
    "403": "access is forbidden (403): these credentials may not do this",
}
"""What is told of some faults, with `hasten`."""


class Request(NamedTuple):
    """A request, and the bytes of the file that were sent."""

    method: str
    path: str
    start: int
    sent: int


class ObjectServer:
    """The files by their paths, and how the server fails."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.requests: list[Request] = []
        self.fault = ""
        """`half`, `stall`, `no range`, `wrong range`, `longer`, or the status of an error, such as `500`."""
        self.code = ""
        """The code of S3 in the body of an error."""
        self.after = 0
        """How many requests are answered before the fault."""
        self.tags = True
        """Whether files have ETags, and these are compared."""
        self.before: Callable[[int], None] = lambda _: None
        """Called before each request with the number of those before."""
        self.ended = threading.Event()
        self.lock = threading.Lock()
        self.url = ""

    @property
    def sent(self) -> int:
        """The bytes of files that were sent."""
        return sum(each.sent for each in self.requests)


class QuietHandler(BaseHTTPRequestHandler):
    """A handler of HTTP/1.1 that prints nothing."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *_: object) -> None:
        """Print nothing."""


class _Handler(QuietHandler):
    has: ObjectServer

    def do_HEAD(self) -> None:
        self._answer()

    def do_GET(self) -> None:
        self._answer()

    def do_PUT(self) -> None:
        data = self.rfile.read(int(self.headers["Content-Length"]))
        if self._fails() or not self._put(data):
            self._error(self._status() or 412)
            return
        self._send(200, b"", {"ETag": _tag(data)})

    def _put(self, data: bytes) -> bool:
        with self.has.lock:
            if self.headers.get("If-None-Match") and self.path in self.has.files:
                return False
            self.has.files[self.path] = data
            return True

    def _fails(self) -> str:
        has = self.has
        number = len(has.requests)
        has.before(number)
        has.requests.append(Request(self.command, self.path, 0, 0))
        return has.fault if number >= has.after else ""

    def _status(self) -> int:
        return int(self.has.fault) if self.has.fault.isdecimal() else 0

    def _answer(self) -> None:
        fault = self._fails()
        if "list-type=2" in self.path and not fault.isdecimal():
            self._send(200, self._listed(), {})
            return
        data = self.has.files.get(self.path.partition("?")[0])
        if fault.isdecimal() or data is None:
            self._error(int(fault) if fault.isdecimal() else 404)
            return
        if fault == "stall":
            self.has.ended.wait(20)
            self.close_connection = True
            return
        headers = {"ETag": _tag(data)} if self.has.tags else {}
        expected = self.headers.get("If-Match")
        if self.has.tags and expected not in (None, _tag(data)):
            self._error(412)
            return
        self._send_range(data, headers, fault)

    def _listed(self) -> bytes:
        prefix = unquote(self.path.partition("prefix=")[2].partition("&")[0])
        own = {path.removeprefix("/bucket/"): data for path, data in self.has.files.items()}
        entries = [
            f"<Contents><Key>{key}</Key><LastModified>2026-11-27T02:33:02.000Z</LastModified><ETag>{_tag(data)}</ETag>"
            f"<Size>{len(data)}</Size></Contents>"
            for key, data in own.items()
            if key.startswith(prefix)
        ]
        return f"<ListBucketResult><IsTruncated>false</IsTruncated>{''.join(entries)}</ListBucketResult>".encode()

    def _send_range(self, data: bytes, headers: dict[str, str], fault: str) -> None:
        text = self.headers.get("Range")
        if text is None or fault == "no range":
            self._send(200, data, headers)
            return
        first, _, last = text.removeprefix("bytes=").partition("-")
        start, stop = int(first), min(int(last or len(data)) + 1, len(data))
        if start >= len(data):
            self._error(416)
            return
        body = data[start:stop]
        self.has.requests[-1] = Request(self.command, self.path, start, len(body))
        told = start + 1 if fault == "wrong range" else start
        headers["Content-Range"] = f"bytes {told}-{told + len(body) - 1}/{len(data)}"
        self._send(206, body, headers, half=fault == "half")

    def _send(self, status: int, body: bytes, headers: dict[str, str], *, half: bool = False) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Last-Modified", "Fri, 27 Nov 2026 02:33:02 GMT")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body[: len(body) // 2] if half else body)
        self.close_connection = self.close_connection or half

    def _error(self, status: int) -> None:
        body = f"<Error><Code>{self.has.code}</Code><Message>no</Message></Error>".encode() if self.has.code else b""
        self._send(status, body, {})


def _tag(data: bytes) -> str:
    return f'"{md5(data, usedforsecurity=False).hexdigest()}"'


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, *_: object) -> None:
        """Pass over clients that have left."""


@contextmanager
def serving(handler: type[QuietHandler], ended: threading.Event) -> Iterator[str]:
    """Run a server in threads, and yield its URL. At the end, set `ended`, for which a handler may wait."""
    with _Server(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)  # `atexit` may end it
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            ended.set()
            server.shutdown()
            thread.join()


@contextmanager
def object_server() -> Iterator[ObjectServer]:
    """Run a server in threads."""
    has = ObjectServer()
    with serving(type("Handler", (_Handler,), {"has": has}), has.ended) as has.url:
        yield has


def set_credentials(patch: pytest.MonkeyPatch, endpoint: str) -> None:
    """Set the environment of clients of S3: an endpoint, keys, and no configuration of the user or the machine."""
    for name in ("AWS_PROFILE", "AWS_SKIP_SIGNATURE", "AWS_SESSION_TOKEN", "AWS_REGION", "AWS_ENDPOINT_URL_S3"):
        patch.delenv(name, raising=False)
    for name in ("http_proxy", "https_proxy", "all_proxy", "no_proxy"):
        patch.delenv(name.upper(), raising=False)
        patch.delenv(name, raising=False)
    patch.setenv("AWS_ENDPOINT_URL", endpoint)
    patch.setenv("AWS_ACCESS_KEY_ID", "test")
    patch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    patch.setenv("AWS_CONFIG_FILE", "/dev/null")
    patch.setenv("AWS_SHARED_CREDENTIALS_FILE", "/dev/null")
    patch.setenv("AWS_EC2_METADATA_DISABLED", "true")


def hasten(patch: pytest.MonkeyPatch) -> None:
    """Let clients wait and try again for a short time only."""
    from msggen.recordings.stores import limits

    patch.setattr(limits, "LIMITS", limits.LIMITS._replace(read=0.3, retries=1, backoff=0.01))
