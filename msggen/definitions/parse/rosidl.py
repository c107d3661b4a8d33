r"""Comments that rosidl, the generator of ROS 2, cannot build, and how they are written for it.

rosidl copies comments into IDL and from there into C. Its adapter (rosidl_adapter 4.9) replaces Python's escapes in
each line, such as `\x41`, before its parser replaces those of IDL. Its C generator writes the comments of a message and
of a constant as `/* */`, those of a field as `//`. `tests/vectors/rosidl_comments.json` has its verdicts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

_SUSPECT = re.compile(r"\\|\*/|\[[^,\[\]\n]*$", re.MULTILINE)
_UNIT = re.compile(r"\[([^,\]]*)(\]|,|\Z)")
"""What rosidl reads as a unit if a comment has exactly one, even across lines: if it has a text and ends in a bracket.

Other matches are passed over, so that many brackets without an end take linear time.
"""

_LINE_ENDS = re.compile(r"[\x0b\x0c\x1c-\x1e\x85\u2028\u2029]|\r(?!\n|\Z)")
"""Characters at which rosidl begins another line, although editors do not."""


_ESCAPE = "rosidl reads a backslash in a comment as an escape, and may fail to build it"
_END = "'*/' ends the comment in the C that rosidl generates"
_DIVIDED = "rosidl reads brackets that are closed on another line as a unit, and fails to build it"


class Unbuildable(NamedTuple):
    """A place in a comment that rosidl cannot build: indices of its line and column, its text, and what to write."""

    line: int
    column: int
    text: str
    instead: str
    reason: str


class _Comment(NamedTuple):
    """The lines of a comment as rosidl assigns them, and whether it is that of a field."""

    lines: list[int]
    is_of_field: bool = False


def find_unbuildable(text: str) -> list[Unbuildable]:
    """Return what rosidl cannot build in the comments of the message or service that `text` defines."""
    if not _SUSPECT.search(text):
        return []
    lines = text.split("\n")
    marks = [index for index, line in enumerate(lines) if line.partition("#")[0].strip() == "---"]
    starts, ends = [0, *(mark + 1 for mark in marks)], [*marks, len(lines)]
    comments = (each for part in zip(starts, ends, strict=True) for each in _comments(lines, *part))
    return [found for comment in comments for found in _find(lines, comment)]


def buildable(text: str) -> str:
    """Return the definition `text` with comments that rosidl can build. Texts that it can build are not changed."""
    text = "\n".join(map(_in_one_line, text.split("\n")))
    while found := find_unbuildable(text):  # again, because `*\\` becomes `*/`
        lines = text.split("\n")
        for each in sorted(found, reverse=True):
            line, end = lines[each.line], each.column + len(each.text)
            lines[each.line] = line[: each.column] + each.instead + line[end:]
        text = "\n".join(lines)
    return text


def _in_one_line(line: str) -> str:
    code, mark, comment = line.partition("#")
    return f"{code}{mark}{_LINE_ENDS.sub(' ', comment)}"


def _comments(lines: Sequence[str], start: int, end: int) -> Iterator[_Comment]:
    """Yield the comments of the lines from `start` to `end`, as rosidl assigns them to elements.

    The comment of the message is the block at the top. That of an element has all lines since the one before it, the
    text after it, and the indented lines below it.
    """
    top = start
    while top < end and lines[top].startswith("#"):
        top += 1
    yield _Comment([*range(start, top)])
    above: list[int] = []
    element: _Comment | None = None
    for index in range(top, end):
        code, mark, _ = lines[index].partition("#")
        if not code.strip():
            below = element.lines if element and code else []
            (below if code else above).extend([index] if mark else [])
            continue
        if element:
            yield element
        element = _Comment([*above, *([index] if mark else [])], "=" not in "".join(code.split(maxsplit=1)[1:]))
        above = []
    if element:
        yield element


def _find(lines: Sequence[str], comment: _Comment) -> Iterator[Unbuildable]:
    for index in comment.lines:
        start = lines[index].index("#")
        for found in re.finditer(r"\\|\*/", lines[index][start:]):
            column = start + found.start()
            if found[0] == "\\":
                yield Unbuildable(index, column, "\\", "/", _ESCAPE)
            elif not comment.is_of_field:
                yield Unbuildable(index, column, "*/", "* /", _END)
    if comment.is_of_field:
        yield from _divided_unit(lines, comment)


def _divided_unit(lines: Sequence[str], comment: _Comment) -> Iterator[Unbuildable]:
    """Yield the brackets of a text that rosidl takes for a unit, although it continues on another line."""
    texts = [lines[index].partition("#")[2] for index in comment.lines]
    found = [each[0] for each in _UNIT.finditer("\n".join(texts)) if each[1] and each[2] == "]"]
    if len(found) != 1 or "\n" not in found[0]:
        return
    first, *_, last = found[0].split("\n")
    for index in comment.lines:
        start, line = lines[index].index("#"), lines[index]
        if line.endswith(first):
            yield Unbuildable(index, len(line) - len(first), "[", "(", _DIVIDED)
        if line[start + 1 :].startswith(last):
            yield Unbuildable(index, start + len(last), "]", ")", _DIVIDED)
