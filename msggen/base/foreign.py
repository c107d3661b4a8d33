"""Foreign text on a terminal: names, contents and metadata of files and vehicles, which can have any characters.

The command line guards stdout and stderr, so all that it prints is escaped. A program of its own can use `escaped`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

_OURS = re.compile(r"(\r?\n|\t|\r\x1b\[K|\x1b\[[0-9;?]*[A-Za-z])")
"""What a `Styled` text has besides printable characters: line ends, tabs, and sequences for colours and the cursor."""
_COMMAND = re.compile(r"^((?:[^\S\n]|\x1b\[[0-9;?]*[A-Za-z])*):(?=:)|#(?=#[\w.-]{0,20}\[)", re.MULTILINE)
"""The start of a command of GitHub Actions, `::error::` or `##[error]`, of Azure, `##vso[`, and of TeamCity."""
_IN_JSON = re.compile(
    r"\\\\|\\ud[89ab][0-9a-f]{2}\\ud[c-f][0-9a-f]{2}|(?P<lone>\\ud[89a-f][0-9a-f]{2})|(?P<other>\x7f|#(?=#[\w.-]{0,20}\[))"
)


_FORMULAS = frozenset("=+-@＝＋－＠")  # noqa: RUF001 - some spreadsheets take the wide ones too
"""The characters with which a formula begins in a spreadsheet."""


class Styled(str):
    """A text with line ends and colours of our own, whose foreign parts are `escaped`: `print(Styled(text))`."""

    __slots__ = ()

    def __str__(self) -> str:
        return self  # print calls it, and the result of str has another type


_ADDRESS = re.compile(r"\b(https?://)(?:[^\s/?#'\"<>]*@)?([^\s?'\"<>]*)(?:\?[^\s'\"<>]*)?", re.IGNORECASE)
"""The address of a server in a text: what is before its user, what is behind that, and its query are told apart."""


def without_secrets(text: str) -> str:
    """Return a text without the users, passwords and queries of the addresses of servers: queries have signatures.

    All errors pass this function, whatever part of a program or a library has put an address into them.
    """
    return _ADDRESS.sub(r"\1\2", text) if "://" in text else text


def escaped(text: str) -> str:
    r"""Return `text` in one line, with escapes for what is not printable, as Python has them: `\x1b`, `\n`, `\u202e`.

    These are control characters, line separators, lone surrogates, and invisible ones such as those that change the
    direction of text. Letters of all languages stay.
    """
    return text if text.isprintable() else "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def without_commands(text: str, *, is_at_start: bool = True) -> str:
    r"""Return `text` with escapes in what CI servers would take as a command: `\x3a:error::`, `\x23#[error]`.

    `is_at_start` tells whether `text` begins a line.
    """

    def shown(found: re.Match[str]) -> str:
        if found[1] is None:
            return r"\x23"
        return rf"{found[1]}\x3a" if is_at_start or found.start() else found[0]

    return _COMMAND.sub(shown, text)


def safe_json(text: str) -> str:
    r"""Return JSON in ASCII without DEL and commands of CI servers. A lone surrogate is text: `\udc80`.

    Python decodes bytes of paths that are not UTF-8 to lone surrogates, and many parsers of JSON reject them.
    """

    def shown(found: re.Match[str]) -> str:
        other = found["other"]
        return f"\\{found[0]}" if found["lone"] else f"\\u{ord(other):04x}" if other else found[0]

    return _IN_JSON.sub(shown, text) if "\x7f" in text or "##" in text or "\\ud" in text else text


def csv_text(text: str, *, quotes_formulas: bool = False) -> str:
    """Return a text for a cell of CSV: `escaped`, and if asked with `'` before what a spreadsheet would evaluate."""
    is_formula = quotes_formulas and text.lstrip()[:1] in _FORMULAS
    return f"'{escaped(text)}" if is_formula else escaped(text)


@contextmanager
def guarded_output() -> Iterator[None]:
    """Guard stdout and stderr in the block: what is printed is `escaped`, and has no command of a CI server.

    Only a line end at the end of what is written ends a line, because others are foreign. `Styled` texts keep theirs,
    and their colours.
    """
    guard_output()
    try:
        yield
    finally:
        for name in ("stdout", "stderr"):
            setattr(sys, name, unguarded(getattr(sys, name)))


def guard_output() -> None:
    """Guard stdout and stderr from now on."""
    for name in ("stdout", "stderr"):
        setattr(sys, name, cast("TextIO", _Guarded(unguarded(getattr(sys, name)))))


def unguarded(stream: TextIO) -> TextIO:
    """Return the stream behind a guarded one, for output that is safe and has commands of CI servers, or bars."""
    return stream.stream if isinstance(stream, _Guarded) else stream


class _Guarded:
    """A stream of text that escapes what is written to it. All else is that of the stream behind it."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self._write = stream.write
        self._is_at_start = True

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        """Write a text. Return its length."""
        if text == "\n":
            self._write(text)
            self._is_at_start = True
            return 1
        is_styled = isinstance(text, Styled)
        if (text.replace("\n", "") if is_styled else text).isprintable():  # nearly always
            shown = text
        else:
            shown = _shown(text) if is_styled else _line(text)
        if "::" in shown or "##" in shown:
            shown = without_commands(shown, is_at_start=self._is_at_start)
        self._write(shown)
        _, end, last = shown.rpartition("\n")
        if end or self._is_at_start:
            self._is_at_start = not _OURS.sub("", last).strip()
        return len(text)


def _line(text: str) -> str:
    """Return a text that is not styled. A line end at its end ends a line."""
    return f"{escaped(text[:-1])}\n" if text[-1:] == "\n" else escaped(text)


def _shown(text: str) -> str:
    """Return a styled text. Characters that it should not have are escaped."""
    return "".join(piece if index % 2 else escaped(piece) for index, piece in enumerate(_OURS.split(text)))
