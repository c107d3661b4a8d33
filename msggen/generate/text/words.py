"""What templates of both languages need: their text, filters for spellings of names and for comments, and errors."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from textwrap import wrap
from types import MappingProxyType

from msggen.base.diagnostics import input_error, suggestion
from msggen.base.disk.reading import read_text
from msggen.definitions.model import snake_case

_WIDTH = 100

_OTHER_NAMES = {
    "array_len": "length",
    "base_type": "base",
    "cpp_type": "cpp_base",
    "ctype": "cpp_base",
    "full_name": "ros_type",
    "is_builtin": "message",
    "parsed_fields": "fields",
    "short_name": "name",
    "val": "value",
}
"""The names of views for names of genmsg and of the firmware's templates."""


class NotTextError(TypeError):
    """An error: a template writes an object that is not text."""


def read_template(path: str) -> str:
    """Return the text of a template. Raises InputError."""
    try:
        return read_text(path)
    except UnicodeDecodeError as error:
        raise input_error(path, "T102", f"byte 0x{error.object[error.start]:02x} is not UTF-8", 0) from None
    except OSError as error:
        raise input_error(path, "T102", f"cannot read the template: {error.strerror or error}", 0) from None


def paragraphs(lines: list[str]) -> list[str]:
    """Return running text with its lines joined to paragraphs; lists and tables keep their lines."""
    found: list[list[str]] = []
    joinable = False
    for line in lines:
        running = bool(line) and (line[0].isalnum() or line[0] in "[(\"'`")
        if running and joinable:
            found[-1].append(line)
        else:
            found.append([line])
        joinable = running
    return [" ".join(parts) for parts in found]


def kind_of(view: object) -> str:
    """Return the kind of a view as templates know it, such as `message`, or "" if `view` is not a view."""
    name = type(view).__name__
    return name.removesuffix("View").lower() if name.endswith("View") else ""


def with_article(noun: str) -> str:
    """Return `noun` with its indefinite article: `an endpoint`."""
    return f"{'an' if noun.startswith(tuple('aeio')) else 'a'} {noun}"


def unknown_name(owner: object, name: str) -> str:
    """Return the error for an unknown name of a view or of a list, or "" if `owner` is neither."""
    kind = kind_of(owner)
    if not kind:
        return f"a list has no '{name}': loop over it" if isinstance(owner, (list, tuple)) else ""
    known = [each for each in dir(owner) if not each.startswith("_")]
    other = _OTHER_NAMES.get(name)
    hint = f", did you mean '{other}'?" if other in known else suggestion(name, known)
    return f"{with_article(kind)} has no '{name}'{hint}"


def known_names(names: Iterable[str]) -> str:
    """Return a hint that lists the names of a template."""
    return f": the template knows {' and '.join(sorted(names))}"


def pascal_case(name: str) -> str:
    """Return `name` in PascalCase: `GyroRad` for `gyro_rad`."""
    return re.sub(r"(?:^|_)([a-z0-9])", lambda match: match[1].upper(), name)


def camel_case(name: str) -> str:
    """Return `name` in camelCase: `gyroRad` for `gyro_rad`."""
    spelled = pascal_case(name)
    return spelled[:1].lower() + spelled[1:]


def comment(text: str, prefix: str = "//", indent: int = 0) -> str:
    """Return `text` as comment lines with `prefix`, wrapped and, except the first line, indented.

    No line ends with a backslash, because C would continue the comment on the next line. Raises TypeError if `indent`
    is not a number.
    """
    if not isinstance(indent, int):
        raise TypeError(f"comment: expected a number of spaces as indent, got {indent!r}")
    room = _WIDTH - indent - len(prefix) - 1
    lines = [part for line in paragraphs(text.splitlines()) for part in wrap(line, room) or [""]]
    return f"\n{' ' * indent}".join(f"{prefix} {line}".rstrip("\\ ") for line in lines)


FILTERS: Mapping[str, Callable[..., str]] = MappingProxyType(
    {function.__name__: function for function in (snake_case, camel_case, pascal_case, comment)}
)
