"""Decoding of definitions, to text that can be read line by line and copied into generated code safely."""

from __future__ import annotations

import codecs
import re

from msggen.base.diagnostics import Diagnostic
from msggen.base.location import Location

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def decode_text(data: bytes, path: str) -> tuple[str, list[Diagnostic]]:
    """Return the text of `data` and its errors: invalid UTF-8, a byte order mark, CRLF, control characters.

    Invalid bytes and control characters are replaced, so that the rest of the file can be checked in the same run.
    """
    errors: list[Diagnostic] = []

    def add(code: str, position: int, message: str) -> None:
        line_start = data.rfind(b"\n", 0, position) + 1
        column = len(data[line_start:position].decode("utf-8", "replace")) + 1
        location = Location(path, data.count(b"\n", 0, position) + 1, column)
        errors.append(Diagnostic(location, code, message))

    if data.startswith(codecs.BOM_UTF8):
        add("M102", 0, "byte order mark: expected UTF-8 without one")
    if b"\r\n" in data:
        add("M106", data.index(b"\r\n"), "the line ends in CR LF: expected LF alone, as in the firmware's tree")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as invalid:
        add("M102", invalid.start, f"byte 0x{data[invalid.start]:02x} is not UTF-8")
        text = data.decode("utf-8", "replace")
    text = text.removeprefix("\ufeff").replace("\r\n", "\n")
    if _CONTROL.search(text):
        for number, line in enumerate(text.split("\n"), 1):
            bad = _CONTROL.search(line)
            if bad:
                location = Location(path, number, bad.start() + 1)
                errors.append(Diagnostic(location, "M104", f"control character {bad[0]!r}: expected plain text"))
        text = _CONTROL.sub(" ", text)
    return text, errors
