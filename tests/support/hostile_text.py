"""Text that tries to command a terminal, a CI server or a spreadsheet, and a check of what is printed."""

from __future__ import annotations

import json
import re
import threading
import time
from types import ModuleType

from msggen.link.link import LinkError, Listener, Route
from support.fake_link import FakeLink, routes_of

PIECES = (
    "::error::one",
    "##[error]two",
    "##vso[task.setvariable variable=x]three",
    "\x1b[35;45mfour",
    "\x1b]0;five\x07",
    "\x9b35m",
    "\nINJECTED",
    "\r::error::six",
    "\u202eseven\u2066\u200b\u2028INJECTED\x85INJECTED",
    "\x7f\x08\x0b\x0c\x0e",
    "[red]eight",
    "é Ω 風 ש",
)
NAME = "".join(PIECES)
"""Also a name of a file in Linux."""
BYTES = NAME.encode() + b"\xff"
"""The same, and not UTF-8."""
SURROGATES = BYTES.decode(errors="surrogateescape")
"""The name of such a file in Python."""
SAMPLE = b"=\x1b[35;45m\x1b]0;\x07\nINJECTED\r\x7f\xe2\x80\xae##[error]\xff".ljust(50, b"\0")
"""A text of 50 bytes in a sample."""
ONE_LINE = NAME.replace("\n", "")


def check_shown(text: str, *, is_terminal: bool = False, has_commands: bool = False) -> None:
    """Check that a terminal and a CI server obey nothing in an output, and that no foreign text begins a line."""
    assert "\x1b[35;45" not in text, repr(text)
    shown = re.sub(r"\r?\x1b\[[0-9;?]*[A-Za-z]|\r(?=\x1b|\n)", "", text) if is_terminal else text
    bad = {each for each in shown if not each.isprintable() and each not in "\n\t"}
    assert not bad, (bad, text)
    for line in shown.split("\n"):
        assert not line.startswith("INJECTED"), text
        if not (has_commands and line.startswith(("::error file=", "::error title=", "::warning ", "::notice "))):
            assert not line.lstrip().startswith("::"), line
        assert not re.search(r"##[\w.-]*\[", line), line


def check_json(text: str) -> None:
    """Check that a text has documents of JSON, without lone surrogates."""
    texts = [text] if text.startswith(("[", "{\n")) else text.splitlines()
    for each in texts:
        json.loads(each)
    assert not re.search(r"(?<!\\)(?:\\\\)*\\ud[89a-f]", text.replace("\\ud83d\\ude81", ""))


class HostileLink(FakeLink):
    """A link with a vehicle whose names and samples are hostile."""

    def __init__(self, package: ModuleType) -> None:
        super().__init__(package)
        self._own = package
        self._ended = threading.Event()

    def start(self, listener: Listener) -> None:
        super().start(listener)
        threading.Thread(target=self._serve, daemon=True).start()

    def close(self) -> None:
        self._ended.set()
        super().close()

    def publish(self, remote: object, route: Route, payload: bytes, until: int = 0) -> None:
        del remote, route, payload, until
        raise LinkError(NAME)

    def _serve(self) -> None:
        user = self.user()
        user.warned(NAME)
        hostile = [
            Route(name, f"{NAME}/msg/{NAME}", "out", 900 + number)
            for number, name in enumerate((NAME, *PIECES, f"/fmu/out/{NAME}"))
        ]
        remote = self.connect(address=NAME, namespace="", routes=[*routes_of(self._own), *hostile])
        response = self._own.MessageFormatResponse(protocol_version=1, topic_name=SAMPLE, success=True)
        while not self._ended.wait(0.02):
            self.answer(remote)
            user.lost(remote, 1)
            for each in hostile:
                user.sample(remote, each, bytes(8), time.time_ns())
            self.sample(remote, response)
