"""What is wrong with an input, said to people: `path:line:col: CODE message`."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from msggen.location import Location

_SHORTEST = 4
"""The beginning of a name is near it from so many letters on, where nothing is nearer."""

_FEW = 4
"""So many names are listed."""

CODES: dict[str, str] = {
    "M101": "a line that is neither a field, a constant nor a comment",
    "M102": "a file that is not UTF-8, or has a byte order mark",
    "M103": "a file that defines nothing",
    "M104": "a control character",
    "M105": "a service without its `---` line, or with several",
    "M106": "lines that end in CR LF",
    "M107": "a tag that msggen does not know",
    "M201": "a name that the grammar forbids",
    "M202": "two messages that would be one class in Python",
    "M203": "a field or constant defined twice",
    "M204": "a message or service defined twice",
    "M205": "a name that only one of PX4 and ROS 2 can be built with",
    "M301": "an unknown type",
    "M302": "messages that nest each other, or too deep",
    "M303": "an array length or string bound that cannot be",
    "M304": "a message that is too large",
    "M305": "a value that its type cannot hold",
    "M306": "no fixed size, in uORB",
    "M401": "a uORB message without `uint64 timestamp`",
    "M402": "a `# TOPICS` line that the firmware would misread",
    "M403": "a uORB topic declared twice",
    "M404": "an archived version with another MESSAGE_VERSION than its name says",
    "M405": "a special constant without its usual meaning",
    "M406": "a `# TOPICS` line that the firmware ignores",
    "M407": "messages that only some boards build",
    "M408": "a message that the firmware does not build",
    "M409": "a condition that a board does not decide",
    "Y101": "a file that is not YAML",
    "Y102": "a value of the wrong kind",
    "Y103": "a key that msggen does not know",
    "Y104": "a missing key",
    "Y105": "a value of a kind that msggen does not know",
    "Y106": "a key that has no effect where it stands",
    "Y107": "options that Zenoh's client does not know",
    "Y108": "a route of a kind that msggen does not know",
    "Y201": "a type that no message defines",
    "Y202": "a topic that no message declares",
    "Y203": "a topic that another message declares",
    "Y204": "a topic bridged twice",
    "Y205": "a field to route by that the message does not have",
    "S101": "a source that cannot be read",
    "S102": "a folder without definitions",
    "S103": "a name that no package can have here",
    "S104": "an output that msggen did not write",
    "S105": "an unknown release",
    "S106": "a ROS package under another name",
    "S107": "a package.xml that cannot be read",
    "S108": "a revision that git cannot give",
    "S109": "an archive that cannot be read",
    "S110": "no bridge to say what crosses it",
    "S111": "a target that is no ROS package",
    "S112": "a package of another name",
    "S113": "changes that are not committed",
    "S114": "a target that is read-only",
    "S115": "a symbolic link that leads out of the package",
    "S116": "a file that differs only in case from one of the firmware",
    "S117": "no earlier versions of messages",
    "S118": "a board that cannot be used",
    "S119": "a firmware that has more than the newest release msggen knows",
    "S120": "a path or revision with the name of an embedded release",
    "S121": "a folder of definitions that msggen does not read",
    "S122": "a board, of a release that is embedded",
    "B101": "a firmware that `bump` cannot write to",
    "B102": "a message that has no versions",
    "B103": "a version that is not one more than the old one",
    "B104": "a service: not yet",
    "B105": "an archived version that is another definition",
    "B106": "a symbolic link that leads out of the firmware",
    "C101": "a pyproject.toml that cannot be read",
    "C102": "an unknown setting",
    "C103": "a setting of the wrong kind",
    "C104": "an unknown rule",
    "T101": "EmPy is not there, or is another version",
    "T102": "a template that cannot be read",
    "T103": "EmPy markup that is wrong",
    "T104": "code in a template that is not Python",
    "T105": "a template that raises an exception",
    "T106": "a definition that the firmware's templates do not know",
    "T107": "a name that the firmware's script computes and msggen does not",
    "T201": "a template that is not Jinja2",
    "T202": "a name in a template that is not there",
    "T203": "a template to include that is not there",
    "T204": "a Jinja2 template that raises an exception",
    "T205": "a template that is neither Jinja2 nor EmPy",
    "T206": "an output that cannot be named so",
    "T207": "two outputs of one name",
    "T208": "nothing to render",
}
"""Every code, and what it stands for. docs/errors.md shows each with an example."""


class Level(Enum):
    """How much a diagnostic matters: an error stops the run, a warning does under `--strict`, a note never does."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


_LEVELS: Mapping[str, Level] = MappingProxyType(
    {
        "M104": Level.WARNING,
        "M106": Level.WARNING,
        "M107": Level.WARNING,
        "M205": Level.WARNING,
        "M405": Level.WARNING,
        "M406": Level.WARNING,
        "M407": Level.NOTE,
        "M408": Level.WARNING,
        "M409": Level.WARNING,
        "S121": Level.WARNING,
        "S122": Level.NOTE,
        "Y103": Level.WARNING,
        "Y105": Level.WARNING,
        "Y106": Level.WARNING,
        "Y107": Level.WARNING,
        "Y108": Level.WARNING,
        "S119": Level.NOTE,
        "S120": Level.NOTE,
    }
)
"""The codes that are no errors. What PX4 may add to its files is a warning, so that its next release still builds."""


class Diagnostic(NamedTuple):
    """One error, warning or note, at one place."""

    location: Location
    code: str
    message: str

    @property
    def level(self) -> Level:
        """How much it matters; `--strict` makes an error of a warning."""
        return _LEVELS.get(self.code, Level.ERROR)

    def __str__(self) -> str:
        return f"{self.location}: {self.code} {self.message}"


class InputError(Exception):
    """The input cannot be used: `diagnostics` has all errors, `notices` the warnings and notes found beside them."""

    def __init__(self, diagnostics: Iterable[Diagnostic], notices: Iterable[Diagnostic] = ()) -> None:
        self.diagnostics = tuple(sorted(set(diagnostics)))
        self.notices = tuple(sorted(set(notices)))
        super().__init__("\n".join(map(str, self.diagnostics)))


def sorted_out(
    found: Iterable[Diagnostic], tolerated: Collection[str] = (), *, strict: bool = False
) -> tuple[Diagnostic, ...]:
    """Return the warnings and notes among `found`, sorted, without the codes `tolerated`.

    Raises InputError with all errors; with `strict`, warnings are errors too.
    """
    stopping = {Level.ERROR, Level.WARNING} if strict else {Level.ERROR}
    kept = [each for each in found if each.code not in tolerated]
    errors = [each for each in kept if each.level in stopping]
    if errors:
        raise InputError(errors, set(kept).difference(errors))
    return tuple(sorted(set(kept)))


def fault(path: str, code: str, message: str, line: int = 1, column: int = 1) -> InputError:
    """Return an InputError with a single diagnostic."""
    return InputError([Diagnostic(Location(path, line, column), code, message)])


def counted(number: int, noun: str) -> str:
    """Return `1 message`, `2 messages`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def few(names: Sequence[str]) -> str:
    """Return the first of `names`, and how many more there are."""
    shown = names if len(names) <= _FEW + 1 else names[:_FEW]
    return ", ".join(shown) + (f" and {len(names) - _FEW} more" if len(shown) < len(names) else "")


def suggestion(wrong: str, known: Iterable[str]) -> str:
    """Return ", did you mean 'x'?" for the nearest of `known`, or "" when none is near."""
    from difflib import get_close_matches

    by_lower_case = {name.lower(): name for name in known}
    near = get_close_matches(wrong.lower(), by_lower_case, n=1, cutoff=0.6)
    near = near or [name for name in by_lower_case if name.startswith(wrong.lower().ljust(_SHORTEST))]
    return f", did you mean '{by_lower_case[near[0]]}'?" if near else ""
