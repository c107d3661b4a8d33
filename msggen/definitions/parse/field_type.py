"""The parser of the types of fields and constants: `float32[3]`, `string<=10`, `EscReport[8]`, `std_msgs/Header`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

from msggen.base.diagnostics import suggestion
from msggen.definitions.model import ArrayKind, FieldType
from msggen.definitions.primitives import PRIMITIVES, STRINGS

MAX_LENGTH = 2**16 - 1
"""Maximum length of a fixed array in a uORB message: the maximum number of bytes in such a message."""

MAX_OTHER_LENGTH = 2**24
"""Maximum length of a fixed array in other messages, to limit memory. `consistency` has the limit for a message."""

MAX_BOUND = 2**31 - 1
"""Maximum bound of a sequence or string. CDR counts elements in 32 bits."""

_TYPE = re.compile(
    r"(?:(?P<package>[^\s/\[\]<=]+)/)?(?P<name>[^\s/\[\]<=]+)"
    r"(?:<=(?P<bound>\w+))?"
    r"(?P<array>\[(?P<atmost><=)?(?P<length>[^\[\]<=]*)\])?"
)
MESSAGE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
INTERFACE_NAME = re.compile(
    r"[A-Z][A-Za-z0-9]*(?:_(?:SendGoal|GetResult))?(?:_(?:Request|Response|Event|Goal|Result|Feedback|FeedbackMessage))?"
)
"""The names of messages in ROS 2, with those that rosidl derives from services and actions."""
_PACKAGE_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")

NAME_IN_PX4 = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
"""The names of messages and constants that the firmware's generator and its C++ compiler accept."""

OTHER_SPELLINGS = {
    "boolean": "bool",
    "double": "float64",
    "duration": "builtin_interfaces/Duration",
    "float": "float32",
    "int": "int32",
    "str": "string",
    "time": "builtin_interfaces/Time",
    "unsigned": "uint32",
}
"""Names that these types have in other languages, with the type that is probably meant."""


class TypeSpellingError(Exception):
    """A type that cannot be parsed; `code` is that of the error."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code, self.message = code, message


@lru_cache(maxsize=4096)
def parse_type(text: str, *, of_uorb: bool = True) -> FieldType:
    """Return the type in `text`, such as `float32[3]`, `string<=10`, `EscReport[8]` or `std_msgs/Header`.

    Definitions `of_uorb` may nest messages with names in lower case, and have a lower limit for array lengths. Raises
    TypeSpellingError.
    """
    pattern, most = (NAME_IN_PX4, MAX_LENGTH) if of_uorb else (INTERFACE_NAME, MAX_OTHER_LENGTH)
    match = _TYPE.fullmatch(text)
    if match is None:
        hint = suggestion(text, PRIMITIVES) or ": expected a type such as 'float32', 'float32[3]' or 'package/Name'"
        hint = ": arrays have one dimension" if text.count("[") > 1 else hint
        raise TypeSpellingError("M301", f"cannot read type '{text}'{hint}")
    package, name = match["package"], match["name"]
    if package is None and name not in PRIMITIVES and not pattern.fullmatch(name):
        raise TypeSpellingError("M301", f"unknown type '{name}'{type_hint(name)}")
    if package is not None and not (_PACKAGE_NAME.fullmatch(package) and pattern.fullmatch(name)):
        raise TypeSpellingError("M301", f"unknown type '{text}': expected 'package/Name'")
    bound = None
    if match["bound"] is not None:
        if name not in STRINGS:
            raise TypeSpellingError("M303", f"'{text}': only strings take a bound")
        bound = _length(match["bound"], text, MAX_BOUND)
    if not match["array"]:
        return FieldType(name, package, string_bound=bound)
    if not match["length"] and not match["atmost"]:
        return FieldType(name, package, ArrayKind.UNBOUNDED, string_bound=bound)
    if match["atmost"]:
        length = _length(match["length"], text, MAX_BOUND)
        return FieldType(name, package, ArrayKind.BOUNDED, length, string_bound=bound)
    return FieldType(name, package, ArrayKind.FIXED, _length(match["length"], text, most), string_bound=bound)


def type_hint(name: str, others: Iterable[str] = ()) -> str:
    """Return the primitive type, or one of `others`, that is probably meant by an unknown type, "" if none is near."""
    known = OTHER_SPELLINGS.get(name)
    return f", did you mean '{known}'?" if known else suggestion(name, [*others, *PRIMITIVES])


def _length(digits: str, text: str, most: int) -> int:
    if not digits.isdecimal() or not digits.isascii():
        raise TypeSpellingError("M303", f"'{text}': expected a number, found {digits!r}")
    if len(digits) > len(str(most)) or not 1 <= int(digits) <= most:
        raise TypeSpellingError("M303", f"'{text}': expected a length from 1 to {most}")
    return int(digits)
