"""A server of HTTP on the loopback interface that has files, counts what it sends, and fails on request.

To clients of S3, `/bucket/key` is an object, and there is no bucket `nobucket`. `tests/exports/test_stores_written.py`
compares it with moto's server.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from hashlib import md5
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import parse_qs, unquote
from xml.sax.saxutils import escape, unescape

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
        """`half`, `stall`, `lost`, `no range`, `wrong range`, or the status of an error, such as `500`.

        `lost` is a request that is done, and whose answer is an error.
        """
        self.code = ""
        """The code of S3 in the body of an error."""
        self.after = 0
        """How many requests are answered before the fault."""
        self.fails: Callable[[int, str], str] | None = None
        """Returns the fault of a request by its number and its method and path, in place of `fault` and `after`."""
        self.unfit: dict[str, str] = {}
        """What the server does not do by headers: a status such as `501`, or "" if it ignores them."""
        self.tags = True
        """Whether files have ETags, and these are compared."""
        self.ended = threading.Event()
        self.lock = threading.Lock()
        self.url = ""

    def fault_of(self, number: int, request: str) -> str:
        """Return the fault of a request."""
        if self.fails is not None:
            return self.fails(number, request)
        return self.fault if number >= self.after else ""

    def begin(self, fails: Callable[[int, str], str] | None = None) -> None:
        """Count requests from 0, and let some fail."""
        self.requests.clear()
        self.fails, self.unfit = fails, {}

    @property
    def sent(self) -> int:
        """The bytes of files that were sent."""
        return sum(each.sent for each in self.requests)


class QuietHandler(BaseHTTPRequestHandler):
    """A handler of HTTP/1.1 that prints nothing."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *_: object) -> None:
        """Print nothing."""


class _Answer(NamedTuple):
    status: int
    body: bytes = b""
    headers: Mapping[str, str] = MappingProxyType({})


class _Handler(QuietHandler):
    disable_nagle_algorithm = True
    has: ObjectServer

    def _take(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        with self.has.lock:
            number = len(self.has.requests)
            self.has.requests.append(Request(self.command, self.path, 0, 0))
        fault = self.has.fault_of(number, f"{self.command} {self.path}")
        for name, status in self.has.unfit.items():
            if self.headers.get(name) and self.command == "PUT":
                fault = status or fault
                del self.headers[name]
        if fault == "stall":
            self.has.ended.wait(20)
            self.close_connection = True
            return
        with self.has.lock:
            answer = self._error(int(fault)) if fault.isdecimal() else self._done(body, fault, number)
        if fault == "half" and not answer.body:
            self.close_connection = True  # without a word
            return
        self._send(self._error(500) if fault == "lost" else answer, is_half=fault == "half")

    do_GET = do_PUT = do_POST = do_DELETE = _take  # noqa: N815 - as http.server calls them

    def _done(self, body: bytes, fault: str, number: int) -> _Answer:
        """Do what is asked."""
        front, _, query = self.path.partition("?")
        path = unquote(front)
        if path.split("/")[1] == "nobucket":
            return self._error(404, "NoSuchBucket")
        if self.command == "PUT":
            return self._put(path, body)
        if self.command in {"DELETE", "POST"}:
            keys = re.findall(rb"<Key>(.*?)</Key>", body)
            for gone in [f"{path}/{unescape(key.decode())}" for key in keys] or [path]:
                self.has.files.pop(gone, None)
            told = b"".join(b"<Deleted><Key>%b</Key></Deleted>" % key for key in keys)
            return _Answer(200, b"<DeleteResult>%b</DeleteResult>" % told) if keys else _Answer(204)
        if "list-type=2" in query:
            return _Answer(200, self._listed(f"{path}/", parse_qs(query)))
        return self._file(path, fault, number)

    def _put(self, path: str, body: bytes) -> _Answer:
        found = self.has.files.get(path)
        is_new, expected = self.headers.get("If-None-Match"), self.headers.get("If-Match")
        if (is_new and found is not None) or (expected and found is not None and expected != _tag(found)):
            return self._error(412)
        if expected and found is None:
            return self._error(404)
        self.has.files[path] = body
        return _Answer(200, b"", {"ETag": _tag(body)})

    def _listed(self, bucket: str, query: Mapping[str, list[str]]) -> bytes:
        prefix, stop = query.get("prefix", [""])[0], query.get("delimiter", [""])[0]
        told, folders = [], set()
        for path, data in sorted(self.has.files.items()):
            key = path.removeprefix(bucket)
            if path.startswith(bucket + prefix):
                if stop and stop in key[len(prefix) :]:
                    folders.add(prefix + key[len(prefix) :].partition(stop)[0] + stop)
                else:
                    told.append(
                        f"<Contents><Key>{escape(key)}</Key><LastModified>2026-11-27T02:33:02.000Z</LastModified>"
                        f"<ETag>{_tag(data)}</ETag><Size>{len(data)}</Size></Contents>"
                    )
        told += [f"<CommonPrefixes><Prefix>{escape(each)}</Prefix></CommonPrefixes>" for each in sorted(folders)]
        return f"<ListBucketResult><IsTruncated>false</IsTruncated>{''.join(told)}</ListBucketResult>".encode()

    def _file(self, path: str, fault: str, number: int) -> _Answer:
        data = self.has.files.get(path)
        if data is None:
            return self._error(404)
        headers = {"ETag": _tag(data)} if self.has.tags else {}
        expected = self.headers.get("If-Match")
        if self.has.tags and expected not in (None, _tag(data)):
            return self._error(412)
        text = self.headers.get("Range")
        if text is None or fault == "no range":
            return _Answer(200, data, headers)
        first, _, last = text.removeprefix("bytes=").partition("-")
        start, stop = int(first), min(int(last or len(data)) + 1, len(data))
        if start >= len(data):
            return self._error(416)
        body = data[start:stop]
        if number < len(self.has.requests):  # else they are counted anew
            self.has.requests[number] = Request(self.command, self.path, start, len(body))
        told = start + 1 if fault == "wrong range" else start
        headers["Content-Range"] = f"bytes {told}-{told + len(body) - 1}/{len(data)}"
        return _Answer(206, body, headers)

    def _send(self, answer: _Answer, *, is_half: bool) -> None:
        self.send_response(answer.status)
        for name, value in answer.headers.items():
            self.send_header(name, value)
        self.send_header("Last-Modified", "Fri, 27 Nov 2026 02:33:02 GMT")
        if answer.status != 204:
            self.send_header("Content-Length", str(len(answer.body)))
        self.end_headers()
        self.wfile.write(answer.body[: len(answer.body) // 2] if is_half else answer.body)
        self.close_connection = self.close_connection or is_half

    def _error(self, status: int, code: str = "") -> _Answer:
        code = code or self.has.code
        return _Answer(status, f"<Error><Code>{code}</Code><Message>no</Message></Error>".encode() if code else b"")


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


def hasten(patch: pytest.MonkeyPatch, fault: str = "") -> None:
    """Let clients try once more without a pause, and wait for 0.5 s if the server stalls.

    They wait longer for other servers, whose answers can come late on a busy computer.
    """
    from msggen.recordings.stores import limits

    read = 0.5 if fault == "stall" else 10
    patch.setattr(limits, "LIMITS", limits.LIMITS._replace(read=read, retries=1, backoff=0.01))
