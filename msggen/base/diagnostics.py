"""Errors, warnings and notes about an input, printed as `path:line:col: CODE message`."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import Enum
from types import MappingProxyType
from typing import Any, NamedTuple

from msggen.base.foreign import escaped, without_secrets
from msggen.base.location import Location

_SHORTEST = 4
"""The minimum length of a prefix that suggests the name it begins, if no other name is similar."""

_WIDTH = 400
_END = 120
"""Maximum number of characters of a message, and of its end, where hints are, if it is cut."""

_FEW = 4
"""The number of names that `few` lists."""


class Level(Enum):
    """The level of a diagnostic: an error stops the run, a warning only with `--strict`, a note never."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


_CODES = {
    Level.ERROR: (
        "M101 M102 M103 M105 M201 M202 M203 M204 M301 M302 M303 M304 M305 M306 M307 M401 M402 M403 M404 "
        "Y101 Y102 Y104 Y201 Y202 Y203 Y204 Y205 "
        "S101 S102 S103 S104 S105 S106 S107 S108 S109 S110 S111 S112 S113 S114 S115 S116 S117 S118 S123 S124 "
        "S125 S128 S129 S130 S131 S132 "
        "B101 B102 B103 B104 B105 B106 B107 "
        "C101 C102 C103 C104 "
        "F101 F102 F103 F104 "
        "T101 T102 T103 T104 T105 T106 T107 T201 T202 T203 T204 T205 T206 T207 T208 T209 T210 "
        "L101 L102 L103 L104 L105 L110 L111 "
        "R101 R102 R150"
    ),
    Level.WARNING: (
        "M104 M106 M107 M108 M205 M405 M406 M408 M409 M410 M411 Y103 Y105 Y106 Y107 Y108 Y109 Y110 Y207 "
        "S121 S127 C105 F105 F106 R141 R142"
    ),
    Level.NOTE: "M407 Y206 Y208 S119 S120 S122 S126 S133 B108 C106",
}
_KINDS = "MYSBCFTLR"
"""The first letters of the codes, in the order of the page."""

CODES: Mapping[str, Level] = MappingProxyType(
    dict(
        sorted(
            ((code, level) for level, codes in _CODES.items() for code in codes.split()),
            key=lambda row: (_KINDS.index(row[0][0]), row[0]),
        )
    )
)
"""The level of each code. Constructs that PX4 may add in its next release are warnings, so that it still builds.

The text about each code is in msggen/show/report/errors.yaml, not here, because a build with nothing to do imports this
module.
"""

OF_BOARDS = ("M407",)
"""Notes about ids that depend on the board, for commands that do not show ids."""


class _Diagnostic(NamedTuple):
    location: Location
    code: str
    message: str


class Diagnostic(_Diagnostic):
    """An error, a warning or a note, with its location. Its message is `printable`, whatever the input has."""

    __slots__ = ()

    def __new__(cls, location: Location, code: str, message: str) -> "Diagnostic":  # noqa: PYI034 - Self needs 3.11
        """Make a diagnostic from a message of any length, with any characters. Secrets in addresses are left out."""
        path = without_secrets(location.path)
        return super().__new__(
            cls,
            location if path == location.path else location._replace(path=path),
            code,
            printable(without_secrets(message)),
        )

    @classmethod
    def _make(cls, iterable: Iterable[Any]) -> "Diagnostic":  # type: ignore[override]  # cls is always this class
        return cls(*iterable)

    @property
    def level(self) -> Level:
        """The level of the code; `--strict` turns warnings into errors."""
        return CODES[self.code]

    def __str__(self) -> str:
        return f"{self.location}: {self.code} {self.message}"


class InputError(Exception):
    """An input that cannot be used: `diagnostics` has all errors, `notices` has the warnings and notes."""

    def __init__(self, diagnostics: Iterable[Diagnostic], notices: Iterable[Diagnostic] = ()) -> None:
        self.diagnostics = tuple(sorted(set(diagnostics)))
        self.notices = tuple(sorted(set(notices)))
        super().__init__("\n".join(map(str, self.diagnostics)))


def sorted_out(
    found: Iterable[Diagnostic], tolerated: Collection[str] = (), *, strict: bool = False
) -> tuple[Diagnostic, ...]:
    """Return the warnings and notes among `found`, sorted, without those whose code is in `tolerated`.

    Raises InputError with all other diagnostics if there are errors. With `strict`, warnings are errors.
    """
    stopping = {Level.ERROR, Level.WARNING} if strict else {Level.ERROR}
    kept = [each for each in found if each.code not in tolerated]
    errors = [each for each in kept if each.level in stopping]
    if errors:
        raise InputError(errors, set(kept).difference(errors))
    return tuple(sorted(set(kept)))


def input_error(path: str, code: str, message: str, line: int = 1, column: int = 1) -> InputError:
    """Return an InputError with a single diagnostic."""
    return InputError([Diagnostic(Location(path, line, column), code, message)])


def printable(text: str) -> str:
    """Return `text` in one line, `escaped`, which leaves nothing that XML forbids.

    A text that is too long for a line is cut in the middle, with `…` for what is left out.
    """
    shown = text if len(text) <= _WIDTH else text[:_WIDTH] + text[-_WIDTH:]  # escapes make a text only longer
    return shortened(text if text.isprintable() else escaped(shown))


def shortened(text: str, width: int = _WIDTH, end: int = _END) -> str:
    """Return `text`. If it is longer than `width`, cut it to its start, `…`, and its last `end` characters."""
    return text if len(text) <= width else f"{text[: width - end - 1]}…{text[-end:]}"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun in singular or plural: `1 message`, `2 messages`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def few(names: Sequence[str]) -> str:
    """Return the first `names`, and the number of the others: `a, b, c, d and 5 more`."""
    shown = names if len(names) <= _FEW + 1 else names[:_FEW]
    return ", ".join(shown) + (f" and {len(names) - _FEW} more" if len(shown) < len(names) else "")


def either(words: Sequence[str]) -> str:
    """Return two or more words as alternatives: `a, b or c`."""
    return f"{', '.join(words[:-1])} or {words[-1]}"


def suggestion(wrong: str, known: Iterable[str]) -> str:
    """Return ", did you mean 'x'?" for the nearest name in `known`, or "" if no name is near."""
    from difflib import get_close_matches

    by_lower_case = {name.lower(): name for name in known}
    near = get_close_matches(wrong.lower(), by_lower_case, n=1, cutoff=0.6)
    near = near or [name for name in by_lower_case if name.startswith(wrong.lower().ljust(_SHORTEST))]
    return f", did you mean '{by_lower_case[near[0]]}'?" if near else ""
