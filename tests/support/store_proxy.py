"""A proxy on the loopback interface in front of a server of S3, which counts requests and lets some of them fail."""

from __future__ import annotations

import http.client
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from urllib.parse import urlsplit

from support.object_server import QuietHandler, serving

FAULTS = {
    "500": r"the server answers with an error \(500\)",
    "lost": r"the server answers with an error \(500\)|the object changed|another run",
    "403": r"access is forbidden \(403\)",
    "507": r"the server answers with an error \(507\)",
    "half": r"the connection broke off before the end of the answer",
    "stall": r"the server does not answer in time",
}
"""What is told of faults. `lost` is a request that was done, and whose answer is an error."""
_KEPT = ("content-type", "etag", "last-modified", "content-range", "x-amz-")


class Proxy:
    """What passes through a proxy."""

    def __init__(self) -> None:
        self.url = ""
        self.requests: list[str] = []
        """The methods and paths of requests, in their order."""
        self.fails: Callable[[int, str], str] = lambda _number, _request: ""
        """Returns the fault of a request by its number and its method and path."""
        self.unfit: dict[str, str] = {}
        """What the server does not do by headers: a status such as `501`, or "" if it ignores them."""
        self.ended = threading.Event()
        self.changing = threading.Lock()
        """Held while a request changes objects: moto compares a condition and writes without a lock."""

    def begin(self, fails: Callable[[int, str], str] = lambda _number, _request: "") -> None:
        """Count from 0, and let requests fail."""
        self.requests.clear()
        self.fails, self.unfit = fails, {}


class _Handler(QuietHandler):
    disable_nagle_algorithm = True
    proxy: Proxy
    target: str

    def _pass(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        request = f"{self.command} {self.path}"
        self.proxy.requests.append(request)
        fault = self.proxy.fails(len(self.proxy.requests) - 1, request)
        for name, status in self.proxy.unfit.items():
            if self.headers.get(name) and self.command == "PUT":
                fault = status or fault
                del self.headers[name]
        if fault == "stall":
            self.proxy.ended.wait(20)
            self.close_connection = True
            return
        if fault.isdecimal():
            self._send(int(fault), {}, b"")
            return
        with nullcontext() if self.command in {"GET", "HEAD"} else self.proxy.changing:
            answer, found = self._ask(body)
        if fault == "lost":
            self._send(500, {}, b"")
            return
        if fault == "half" and not found:
            self.close_connection = True  # without a word
            return
        headers = {name: value for name, value in answer.getheaders() if name.lower().startswith(_KEPT)}
        headers["Content-Length"] = answer.getheader("Content-Length") or str(len(found))
        self._send(answer.status, headers, found[: len(found) // 2] if fault == "half" else found)
        self.close_connection = self.close_connection or fault == "half"

    def _ask(self, body: bytes) -> tuple[http.client.HTTPResponse, bytes]:
        connection = http.client.HTTPConnection(urlsplit(self.target).netloc, timeout=30)
        try:
            connection.request(self.command, self.path, body, dict(self.headers))
            answer = connection.getresponse()
            return answer, answer.read()
        finally:
            connection.close()

    do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = _pass  # noqa: N815 - as http.server calls them

    def _send(self, status: int, headers: dict[str, str], body: bytes) -> None:
        self.send_response(status)
        for name, value in {"Content-Length": str(len(body)), **headers}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)


@contextmanager
def store_proxy(target: str) -> Iterator[Proxy]:
    """Run a proxy in threads."""
    proxy = Proxy()
    with serving(type("Handler", (_Handler,), {"proxy": proxy, "target": target}), proxy.ended) as proxy.url:
        yield proxy
