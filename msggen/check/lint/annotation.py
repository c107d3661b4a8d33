"""The annotations in comments, each with what is wrong with it.

    [m/s] [@range 0, 100] [@enum STATE] [@invalid NaN] [@frame NED]

An annotation that cannot be read as a tag is "malformed", one with an unknown name is "unknown".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import suggestion
from msggen.check.lint.definition import Definition, Remark
from msggen.check.lint.frame import frame_problem, is_frame
from msggen.definitions.enumeration import constant_prefixes, is_integer
from msggen.definitions.model import Constant, Field
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.tags import NAMES
from msggen.definitions.unit import bounds, is_unit, nearest_unit, spelled_bounds

MALFORMED, UNKNOWN, INEXACT = "malformed", "unknown", "inexact"
"""The kinds of annotations that are no tag, are a tag with an unknown name, and name an enum by a longer prefix."""

_NAME = "|".join(NAMES)
_START = re.compile(r"\[@\w+")
_TAG = re.compile(r"\[@(\w+)[^\]]*\]")
_WITHOUT_AT = re.compile(rf"\[\s*({_NAME})\b[^\]]*\]")
_WITHOUT_BRACKETS = re.compile(rf"(?<![\[\w])@(?:{_NAME})\b")
_SEPARATORS = ":="
"""What other notations have between the name of a tag and its content."""

_OPENING = re.compile(r"\[[^\s@\d]\S*")
_WORD = re.compile(r"\[\w+\]")

_NUMBER = re.compile(r"[-+]?(?:\d[\d_.]*(?:e[-+]?\d+)?f?|0x[\da-f]+)", re.IGNORECASE)
_NOT_FINITE = re.compile(r"[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
_LIMIT = re.compile(r"(?:U?INT(?:8|16|32|64)|FLT|DBL)_(?:MAX|MIN)")
_EMPTY = ("empty", "true", "false")
"""Words that are invalid values: of an array of characters, and of a bool."""


class Annotation(NamedTuple):
    """An annotation: the name of its tag, "unit" for a unit, or one of the kinds above. `problem` is "" for none."""

    kind: str
    remark: Remark
    text: str
    """The text in the file by which it can be found."""
    problem: str


@lru_cache(maxsize=1)
def find_annotations(definition: Definition) -> tuple[Annotation, ...]:
    """Return the annotations of all comments, those that cannot be read included.

    The last result is kept, because several rules need it.
    """
    return tuple(_annotations(definition))


def _annotations(definition: Definition) -> Iterator[Annotation]:
    for remark in definition.remarks:
        yield from _tags(definition, remark)
        for text, problem in _malformed(definition, remark):
            yield Annotation(MALFORMED, remark, text, problem)


def _tags(definition: Definition, remark: Remark) -> Iterator[Annotation]:
    unit = remark.comment.unit
    if unit:
        intended = _intended(definition, remark, f"[{unit}]")
        kind, problem = (MALFORMED, intended) if intended else ("unit", _unit_problem(unit))
        yield Annotation(kind, remark, f"[{unit}", problem)
    for name, content in remark.comment.tags:
        text = f"[@{name}{'' if content[:1] in _SEPARATORS else ' '}{content}"
        if name not in NAMES:
            hint = suggestion(f"@{name}", [f"@{known}" for known in NAMES])
            yield Annotation(UNKNOWN, remark, f"[@{name}", f"unknown tag '@{name}'{hint}")
        elif not content:
            yield Annotation(name, remark, text, f"'[@{name}]' has no content")
        else:
            yield Annotation(name, remark, text, _tag_problem(definition, remark, name, content))
            inexact = _inexact(definition, content) if name == "enum" else ""
            if inexact:
                yield Annotation(INEXACT, remark, text, inexact)


def _tag_problem(definition: Definition, remark: Remark, name: str, content: str) -> str:
    """Return what is wrong with the content of a tag, "" for nothing, with the form that is meant if it is known."""
    problem = _PROBLEMS[name](definition, remark, content)
    separator = content[0] in _SEPARATORS
    meant = _meant(definition, remark, name, content) if problem or separator else ""
    if not meant:
        return problem
    reason = f"'[@{name}{content}]' cannot be read" if separator else problem.partition(": expected")[0]
    return f"{reason}: expected '{meant}'"


def _meant(definition: Definition, remark: Remark, name: str, content: str) -> str:
    """Return the tag with its content in a form that has no problem, "" if none is known."""
    content = content.lstrip(f" {_SEPARATORS}")
    forms = [content]
    if name == "range":
        spelled = spelled_bounds(content)
        spelled = spelled if len(spelled) > 1 else " ".join(spelled).split()
        forms += [", ".join(spelled), ", ".join(reversed(spelled))]
    elif name == "enum":
        forms += [found[0] for found in [constant_prefixes(definition.message, content)] if found]
    for form in filter(None, forms):
        if not _PROBLEMS[name](definition, remark, form) and not (name == "enum" and _inexact(definition, form)):
            return f"[@{name} {form}]"
    return ""


def _malformed(definition: Definition, remark: Remark) -> Iterator[tuple[str, str]]:
    """Yield the texts that are meant as tags but cannot be read, each with its problem."""
    for line in remark.comment.text.split("\n"):
        if "[" in line or "@" in line:
            yield from dict.fromkeys(_malformed_in(definition, remark, line.strip()))


def _malformed_in(definition: Definition, remark: Remark, line: str) -> Iterator[tuple[str, str]]:
    end = line.rfind("]") + 1
    closed, rest = line[:end], line[end:]  # so that no search for a "]" fails: the time is linear
    for found in _TAG.finditer(closed):
        yield found[0], f"'{found[0]}' is the second tag '@{found[1]}': expected one"
    for found in (*_WITHOUT_AT.finditer(closed), *filter(None, [_WORD.match(closed)])):
        problem = _intended(definition, remark, found[0])
        if problem:
            yield found[0], problem
    for found in _WITHOUT_BRACKETS.finditer(line):
        yield found[0], f"'{found[0]}' has no brackets: expected '[{found[0]} ...]'"
    for found in (*_START.finditer(rest), *filter(None, [None if closed else _OPENING.match(rest)])):
        yield found[0], f"'{found[0]}' is not closed: expected ']'"


def _intended(definition: Definition, remark: Remark, text: str) -> str:
    """Return the problem of `[enum STATE]` or `[NED]`, in which the name of a tag is missing or has no `@`."""
    inside = text.strip("[] ")
    found = _WITHOUT_AT.fullmatch(f"[{inside}]")
    if found:
        name = found[1]
        meant = _meant(definition, remark, name, inside.removeprefix(name)) or f"[@{name} ...]"
        return f"'{text}' is not a tag: expected '{meant}'"
    return f"'{text}' is not a unit: expected '[@frame {inside}]'" if is_frame(inside) else ""


def _unit_problem(unit: str) -> str:
    if is_unit(unit):
        return ""
    near = nearest_unit(unit)
    return f"unknown unit '[{unit}]'" + (f", did you mean '[{near}]'?" if near else "")


def _range_problem(_: Definition, remark: Remark, content: str) -> str:
    found = bounds(content)
    if found is None:
        return f"'[@range {content}]' cannot be read: expected two numbers, such as '[@range 0, 1]'"
    if found[0] > found[1]:
        return f"'[@range {content}]' has the larger bound first"
    outside = [bound for bound in found if abs(bound) != float("inf") and not _fits(remark, bound)]
    return f"'[@range {content}]': a {remark.element.type.base} cannot be {outside[0]:g}" if outside else ""


def _fits(remark: Remark, value: float) -> bool:
    """Whether the field can hold `value`, at least approximately. A parameter of a command can hold any."""
    element = remark.element
    if not isinstance(element, Field) or not is_integer(element):
        return True
    low, high = PRIMITIVES[element.type.name].integer_range
    return low <= value <= high


def _enum_problem(definition: Definition, remark: Remark, content: str) -> str:
    if isinstance(remark.element, Field) and not is_integer(remark.element):
        return f"'[@enum {content}]': a {remark.element.type.base} has no enum"
    message = definition.message
    for prefix in re.findall(r"\w+", content):
        if not constant_prefixes(message, prefix):
            elsewhere = (each for each in definition.catalog.uorb_messages if prefix in _prefixes(each.constants))
            other = next(elsewhere, None)
            hint = suggestion(prefix, _prefixes(message.constants))
            hint = f", but '{other.name}' has" if other and not hint else hint
            return f"no constant of '{message.name}' starts with '{prefix}_'{hint}"
    return ""


def _inexact(definition: Definition, content: str) -> str:
    """Return what is inexact about an enum whose first words have to be left out."""
    for prefix in re.findall(r"\w+", content):
        found = constant_prefixes(definition.message, prefix)
        if found and found[0] != prefix.rstrip("_"):
            return f"the constants of '[@enum {content}]' are '{found[0]}_*': expected '[@enum {found[0]}]'"
    return ""


def _prefixes(constants: Iterable[Constant]) -> list[str]:
    """Return all words from the start that the names of constants have, without the last word of each."""
    words = [constant.name.split("_") for constant in constants]
    return list(dict.fromkeys("_".join(each[:end]) for each in words for end in range(1, len(each))))


def _value_problem(name: str) -> Callable[[Definition, Remark, str], str]:
    def problem(definition: Definition, remark: Remark, content: str) -> str:
        first = content.split(maxsplit=1)[0].strip(",;:.")
        title = f"'[@{name} {content}]'"
        constants = {each.name for each in definition.message.constants}
        if _LIMIT.fullmatch(first) or first in constants or first.lower() in _EMPTY:
            return ""
        if _NOT_FINITE.fullmatch(first):
            return f"{title}: a {remark.element.type.base} cannot be {first}" if not _fits(remark, float(first)) else ""
        number = _number(first)
        if number is None:
            return f"{title} cannot be read: expected a number or a constant"
        return f"{title}: a {remark.element.type.base} cannot be {first}" if not _fits(remark, number) else ""

    return problem


def _number(text: str) -> float | None:
    """Return a number of C, None for another text such as `0..1`."""
    if not _NUMBER.fullmatch(text):
        return None
    with suppress(OverflowError, ValueError):
        return float(int(text, 0))
    with suppress(ValueError):
        return float(text.rstrip("f"))
    return None


_PROBLEMS: Mapping[str, Callable[[Definition, Remark, str], str]] = MappingProxyType(
    {
        "range": _range_problem,
        "enum": _enum_problem,
        "invalid": _value_problem("invalid"),
        "uncontrolled": _value_problem("uncontrolled"),
        "frame": lambda definition, _, content: frame_problem(definition, content),
    }
)
"""A function for each tag that returns what is wrong with its content, "" for nothing."""
