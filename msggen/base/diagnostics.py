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


CODES: Mapping[str, Level] = MappingProxyType(
    {
        "M101": Level.ERROR,
        "M102": Level.ERROR,
        "M103": Level.ERROR,
        "M104": Level.WARNING,
        "M105": Level.ERROR,
        "M106": Level.WARNING,
        "M107": Level.WARNING,
        "M108": Level.WARNING,
        "M201": Level.ERROR,
        "M202": Level.ERROR,
        "M203": Level.ERROR,
        "M204": Level.ERROR,
        "M205": Level.WARNING,
        "M301": Level.ERROR,
        "M302": Level.ERROR,
        "M303": Level.ERROR,
        "M304": Level.ERROR,
        "M305": Level.ERROR,
        "M306": Level.ERROR,
        "M307": Level.ERROR,
        "M401": Level.ERROR,
        "M402": Level.ERROR,
        "M403": Level.ERROR,
        "M404": Level.ERROR,
        "M405": Level.WARNING,
        "M406": Level.WARNING,
        "M407": Level.NOTE,
        "M408": Level.WARNING,
        "M409": Level.WARNING,
        "M410": Level.WARNING,
        "M411": Level.WARNING,
        "Y101": Level.ERROR,
        "Y102": Level.ERROR,
        "Y103": Level.WARNING,
        "Y104": Level.ERROR,
        "Y105": Level.WARNING,
        "Y106": Level.WARNING,
        "Y107": Level.WARNING,
        "Y108": Level.WARNING,
        "Y109": Level.WARNING,
        "Y110": Level.WARNING,
        "Y201": Level.ERROR,
        "Y202": Level.ERROR,
        "Y203": Level.ERROR,
        "Y204": Level.ERROR,
        "Y205": Level.ERROR,
        "Y206": Level.NOTE,
        "Y207": Level.WARNING,
        "Y208": Level.NOTE,
        "S101": Level.ERROR,
        "S102": Level.ERROR,
        "S103": Level.ERROR,
        "S104": Level.ERROR,
        "S105": Level.ERROR,
        "S106": Level.ERROR,
        "S107": Level.ERROR,
        "S108": Level.ERROR,
        "S109": Level.ERROR,
        "S110": Level.ERROR,
        "S111": Level.ERROR,
        "S112": Level.ERROR,
        "S113": Level.ERROR,
        "S114": Level.ERROR,
        "S115": Level.ERROR,
        "S116": Level.ERROR,
        "S117": Level.ERROR,
        "S118": Level.ERROR,
        "S119": Level.NOTE,
        "S120": Level.NOTE,
        "S121": Level.WARNING,
        "S122": Level.NOTE,
        "S123": Level.ERROR,
        "S124": Level.ERROR,
        "S125": Level.ERROR,
        "S126": Level.NOTE,
        "S127": Level.WARNING,
        "S128": Level.ERROR,
        "S129": Level.ERROR,
        "S130": Level.ERROR,
        "S131": Level.ERROR,
        "S132": Level.ERROR,
        "S133": Level.NOTE,
        "B101": Level.ERROR,
        "B102": Level.ERROR,
        "B103": Level.ERROR,
        "B104": Level.ERROR,
        "B105": Level.ERROR,
        "B106": Level.ERROR,
        "B107": Level.ERROR,
        "B108": Level.NOTE,
        "C101": Level.ERROR,
        "C102": Level.ERROR,
        "C103": Level.ERROR,
        "C104": Level.ERROR,
        "C105": Level.WARNING,
        "C106": Level.NOTE,
        "F101": Level.ERROR,
        "F102": Level.ERROR,
        "F103": Level.ERROR,
        "F104": Level.ERROR,
        "F105": Level.WARNING,
        "F106": Level.WARNING,
        "T101": Level.ERROR,
        "T102": Level.ERROR,
        "T103": Level.ERROR,
        "T104": Level.ERROR,
        "T105": Level.ERROR,
        "T106": Level.ERROR,
        "T107": Level.ERROR,
        "T201": Level.ERROR,
        "T202": Level.ERROR,
        "T203": Level.ERROR,
        "T204": Level.ERROR,
        "T205": Level.ERROR,
        "T206": Level.ERROR,
        "T207": Level.ERROR,
        "T208": Level.ERROR,
        "T209": Level.ERROR,
        "T210": Level.ERROR,
        "L101": Level.ERROR,
        "L102": Level.ERROR,
        "L103": Level.ERROR,
        "L104": Level.ERROR,
        "L105": Level.ERROR,
        "L110": Level.ERROR,
        "L111": Level.ERROR,
        "R101": Level.ERROR,
        "R102": Level.ERROR,
        "R141": Level.WARNING,
        "R142": Level.WARNING,
        "R150": Level.ERROR,
    }
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
