"""basedpyright's language server, as an editor talks to it: JSON-RPC over its standard streams."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import Any

LONGEST = 240.0
"""The seconds after which a server without an answer is ended, so that the test that waits for it fails."""

_COMMAND = (sys.executable, "-c", "from basedpyright.langserver import main; main()", "--stdio")


class LanguageServer:
    """A session with a server. One request is under way at a time."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._process = process
        self._number = 0

    @contextmanager
    def opened(self, path: Path) -> Iterator[None]:
        """Open a file in the editor, and close it at the end, because the server checks all files that are open."""
        document = {"uri": path.as_uri(), "languageId": "python", "version": 1, "text": path.read_text()}
        self._send({"method": "textDocument/didOpen", "params": {"textDocument": document}})
        yield
        self._send({"method": "textDocument/didClose", "params": {"textDocument": {"uri": path.as_uri()}}})

    def completions(self, path: Path, line: int, column: int) -> set[str]:
        """Return the names that an editor offers. Lines count from 1, columns from 0."""
        place = {"textDocument": {"uri": path.as_uri()}, "position": {"line": line - 1, "character": column}}
        found = self.request("textDocument/completion", place)
        items = found["items"] if isinstance(found, dict) else found or []
        return {str(item["label"]) for item in items}

    def request(self, method: str, params: Mapping[str, object] | None) -> Any:
        """Return the result of a request. Requests of the server meanwhile are answered with nothing."""
        self._number += 1
        self._send({"id": self._number, "method": method, "params": params})
        timer = Timer(LONGEST, self._process.kill)
        timer.start()
        try:
            return self._answer()
        finally:
            timer.cancel()

    def _answer(self) -> Any:
        while True:
            message = self._receive()
            if "method" in message:
                if "id" in message:
                    items: Sequence[object] = (message.get("params") or {}).get("items") or ()
                    self._send({"id": message["id"], "result": [None] * len(items) if items else None})
            elif message.get("id") == self._number:
                assert "error" not in message, message
                return message["result"]

    def notify(self, method: str) -> None:
        """Send a notification without parameters."""
        self._send({"method": method, "params": {}})

    def _send(self, message: Mapping[str, object]) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        stream = self._process.stdin
        assert stream is not None
        stream.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        stream.flush()

    def _receive(self) -> dict[str, Any]:
        stream = self._process.stdout
        assert stream is not None
        size = 0
        while (line := stream.readline().strip()) or not size:
            assert line, "the language server has ended"
            name, _, value = line.partition(b":")
            size = int(value) if name.lower() == b"content-length" else size
        message: dict[str, Any] = json.loads(stream.read(size))
        return message


@contextmanager
def language_server(folder: Path, paths: Sequence[Path]) -> Iterator[LanguageServer]:
    """Start a server for the files of a folder, and end it. `paths` has the folders of packages that they import."""
    settings = {"typeCheckingMode": "off", "extraPaths": [str(path) for path in paths]}
    (folder / "pyrightconfig.json").write_text(json.dumps(settings))
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # with the libraries of this Python
    with subprocess.Popen(
        _COMMAND,
        cwd=folder,
        env={**os.environ, "PATH": path},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            server = LanguageServer(process)
            uri = folder.as_uri()
            where = {"rootUri": uri, "workspaceFolders": [{"uri": uri, "name": folder.name}]}
            server.request("initialize", {"processId": None, "capabilities": {}, **where})
            server.notify("initialized")
            yield server
        finally:
            process.kill()
