"""The parser of `.msg` and `.srv` files: the ROS 2 grammar and PX4's additions (docs/wire.md, 1; docs/build.md).

The grammar is at https://docs.ros.org/en/kilted/Concepts/Basic/About-Interfaces.html. The parser reads a file once,
line by line. It continues after an error, so that all errors in a file are reported at once.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic, Level, suggestion
from msggen.base.location import Location
from msggen.definitions.model import (
    QUEUE_LENGTH,
    SPECIAL,
    VERSION,
    Constant,
    Field,
    FieldType,
    Message,
    Service,
    Topic,
    snake_case,
)
from msggen.definitions.parse.comment import parse_comment, parse_constant_comment
from msggen.definitions.parse.field_type import (
    INTERFACE_NAME,
    MESSAGE_NAME,
    NAME_IN_PX4,
    TypeSpellingError,
    parse_type,
    type_hint,
)
from msggen.definitions.parse.value import parse_value
from msggen.definitions.primitives import INTEGERS
from msggen.definitions.tags import ATTRIBUTES, NAMES, UNIT

_ELEMENT = re.compile(r"\s*(?P<type>\S+)(?:\s+(?P<name>[^\s=]+)\s*(?P<equals>=?)\s*(?P<value>.*))?")

_MISSHAPEN = re.compile(
    r"\s*(?:[^\s\[\]]*\[[^\]\s]*\s|\S+:\s|\S+\s+(?:\[|//|[^\s=\[\]]*\[[^\]\s]*\s|[A-Z][A-Z0-9_]*(?::\s*|\s+)[^\s=]))"
)
"""A line that is no element, although it has a type and a name: spaces around brackets, or a constant without `=`."""

_CONSTANT_WITHOUT_EQUALS = re.compile(r"\s*(?:(\S+)\s+)?([A-Z][A-Z0-9_]*)(?::\s*|\s+)(\S.*)")
_SPACED_TYPE = re.compile(r"\s*([^\s\[\]]+)\s*\[([^\[\]]*)\]\s*(\S*)")
_SPACED_LENGTH = re.compile(r"\s*(\S+)\s+(\w+)\[([^\[\]]*)\]")
"""The parts of such lines."""

FIELD_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
CONSTANT_NAME = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*")
TOPIC_NAME = re.compile(r"(?!.*__)[a-z][a-z0-9_]*")
"""The names of fields, constants and topics that ROS 2 and the firmware accept."""

_FIELD_NAME_IN_PX4 = re.compile(r"[a-z][a-z0-9_]*")
_TOPIC_NAME_IN_PX4 = re.compile(r"_?[a-z][a-z0-9_]*")
"""The names of fields and topics that the firmware's generator and its C++ compiler accept. ROS 2 is stricter."""

_KEYWORDS = (
    "alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class compl const "
    "const_cast constexpr continue decltype default delete do double dynamic_cast else enum explicit export extern "
    "false float for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr operator or "
    "or_eq private protected public register reinterpret_cast return short signed sizeof static static_assert "
    "static_cast struct switch template this thread_local throw true try typedef typeid typename union unsigned using "
    "virtual void volatile wchar_t while xor xor_eq"
)
_CPP_KEYWORDS = frozenset(_KEYWORDS.split())
"""Names that fields, constants and topics of the firmware cannot have."""

_IS_KEYWORD = "is a C++ keyword, so the firmware cannot be built with it"

_LOWEST = {VERSION: 0, QUEUE_LENGTH: 1}
"""The smallest valid values of the constants that the firmware itself reads."""

_LIKE_SPECIAL = re.compile(r"ORB_|(?=\w{13,18}$)\w*(?:QUEUE|VERSION|MESSAGE_V)")
_NEAR = 0.9
"""Minimum similarity of a misspelled name. Correct names, such as LATEST_PROTOCOL_VERSION, are less similar."""
_QUOTED_VALUE = re.compile(r"\s*\S+\s+[^\s=]+(?:\s*=)?\s*[\"'\[]")
_NAMED = [f"@{tag.name}" for tag in ATTRIBUTES if tag is not UNIT]
_TAGS_OF_PX4 = f": PX4 has {', '.join(_NAMED[:-1])} and {_NAMED[-1]}, and units such as '[m]'"
_TAG_NAME = re.compile(r"\[@(\w+)")
_LOOKS_LIKE_TOPICS = re.compile(r"\s*#\s*TOPICS?\b")


def parse_message(
    text: str, path: str, name: str, package: str, *, of_uorb: bool = True
) -> tuple[Message, list[Diagnostic]]:
    """Return the message `name` of `package` that `text`, the contents of `path`, defines, with all its errors.

    A message with errors has only the fields and constants that could be read. For messages that are not `of_uorb`,
    only the rules of ROS 2 apply.
    """
    body = _Body(path, name, of_uorb=of_uorb)
    if of_uorb or not INTERFACE_NAME.fullmatch(name):
        _check_name(body, name, is_of_px4=of_uorb)
    body.read(text.split("\n"), 1)
    if not of_uorb:
        return body.message(package, "msg"), body.errors
    if not body.topics and snake_case(name) in _CPP_KEYWORDS:
        body.error("M205", 1, 1, f"the topic '{snake_case(name)}' {_IS_KEYWORD}: name another topic with # TOPICS")
    if not (body.fields or body.constants or any(found.level is Level.ERROR for found in body.errors)):
        body.error("M103", 1, 1, f"message '{name}' is empty: expected at least one field")
    return body.message(package, "msg"), body.errors


def parse_service(
    text: str, path: str, name: str, package: str, *, of_uorb: bool = True
) -> tuple[Service, list[Diagnostic]]:
    """Return the service `name` of `package` that `text`, the contents of `path`, defines, with all its errors."""
    lines = text.split("\n")
    marks = [number for number, line in enumerate(lines, 1) if line.split("#")[0].strip() == "---"]
    request, response = (_Body(path, f"{name}_{half}", of_uorb=of_uorb) for half in ("Request", "Response"))
    _check_name(request, name, is_of_px4=False)
    if len(marks) != 1:
        line = marks[1] if marks else len(lines)
        request.error("M105", line, 1, f"expected one line '---' between request and response, found {len(marks)}")
    mark = marks[0] if marks else len(lines) + 1
    request.read(lines[: mark - 1], 1)
    others = set(marks)
    response.read(["" if mark + index in others else line for index, line in enumerate(lines[mark:], 1)], mark + 1)
    halves = request.message(package, "srv"), response.message(package, "srv")
    service = Service(name, package, Location(path), *halves, comment=halves[0].comment)
    return service, request.errors + response.errors


def _check_name(body: _Body, name: str, *, is_of_px4: bool) -> None:
    """Check the name of a file. With `is_of_px4`, a name that only the firmware's generator accepts is a warning."""
    if MESSAGE_NAME.fullmatch(name):
        return
    near = "".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", name))
    hint = f", for example '{near}'" if MESSAGE_NAME.fullmatch(near) else ""
    if is_of_px4 and NAME_IN_PX4.fullmatch(name):
        body.error("M205", 1, 1, f"file name '{name}': ROS 2 expects a capital, then letters and digits{hint}")
    else:
        body.error("M201", 1, 1, f"file name {name!r}: expected a capital, then letters and digits (CamelCase){hint}")


class _Element(NamedTuple):
    """A line with a field or a constant, and the comments that belong to it, each with its line."""

    line: int
    code: str
    remarks: list[tuple[int, str]]

    @property
    def comment(self) -> list[str]:
        """The comments without their lines."""
        return [remark for _, remark in self.remarks]


class _Body:
    """A reader of a list of fields and constants."""

    def __init__(self, path: str, name: str, *, of_uorb: bool) -> None:
        self.path = path
        self.name = name
        self.of_uorb = of_uorb
        self.fields: list[Field] = []
        self.constants: list[Constant] = []
        self.topics: list[Topic] = []
        self.errors: list[Diagnostic] = []
        self.comment = ""
        self._seen: dict[str, int] = {}
        self._lines: list[str] = []
        self._first_line = 1

    def message(self, package: str, folder: str) -> Message:
        return Message(
            name=self.name,
            package=package,
            location=Location(self.path),
            folder=folder,
            fields=tuple(self.fields),
            constants=tuple(self.constants),
            topics=tuple(self.topics),
            comment=self.comment,
        )

    def error(self, code: str, line: int, column: int, message: str) -> None:
        self.errors.append(Diagnostic(Location(self.path, line, column), code, message))

    def read(self, lines: list[str], first_line: int) -> None:
        self._lines = lines
        self._first_line = first_line
        for element in self._elements(lines, first_line):
            self._read_element(element)

    def _elements(self, lines: list[str], first_line: int) -> list[_Element]:
        """Return the fields and constants in `lines`, each with its comments.

        The comment of an element is the block directly above it, the text after it on its line, and the comments on
        indented lines below it. A block at the top of the file is the comment of the message, not of the element below
        it. Any other block with a blank line after it is a heading, and belongs to no element.
        """
        elements: list[_Element] = []
        above: list[tuple[int, str]] = []
        for number, line in enumerate(lines, first_line):
            code, remark = _split_comment(line)
            if remark is not None and self.of_uorb and "TOPIC" in line and _LOOKS_LIKE_TOPICS.match(line):
                self._read_topics(line, number)
            elif code.strip():
                trailing = [] if remark is None else [(number, remark)]
                if not elements and not self.comment:
                    self.comment, above = _text(above), []
                elements.append(_Element(number, code, above + trailing))
                above = []
            elif remark is None:
                if not elements and not self.comment:
                    self.comment = _text(above)
                above = []
            elif code and elements and not above:
                elements[-1].remarks.append((number, remark))
            else:
                above.append((number, remark))
        if not elements and not self.comment:
            self.comment = _text(above)
        return elements

    def _read_topics(self, line: str, number: int) -> None:
        if not line.startswith("# TOPICS "):
            text = "the firmware ignores this line: expected '# TOPICS ' and names, from column 1"
            self.error("M406", number, 1, text)
            return
        column = len("# TOPICS ") + 1
        names = line.rstrip()[column - 1 :].split(" ")
        problem = "doubled space" if len(names) > 1 else "no name"
        is_reported = False
        for name in names:
            topic = snake_case(name)
            if not name:
                if not is_reported:
                    text = f"{problem}: the firmware would read a topic without a name here"
                    self.error("M402", number, column, text)
                is_reported = True
            elif not _TOPIC_NAME_IN_PX4.fullmatch(topic):
                text = f"{name!r} is not a topic name: expected letters, digits and underscores"
                self.error("M402", number, column, text)
            else:
                self.topics.append(Topic(topic, Location(self.path, number, column)))
                shown = f"'{name}'" if topic == name else f"'{name}' ('{topic}' in the firmware)"
                if topic in _CPP_KEYWORDS:
                    self.error("M205", number, column, f"topic name {shown} {_IS_KEYWORD}")
                elif not TOPIC_NAME.fullmatch(topic):
                    text = f"topic name {shown}: ROS 2 expects a letter first, and single underscores"
                    self.error("M205", number, column, text)
            column += len(name) + 1

    def _read_element(self, element: _Element) -> None:
        match = _ELEMENT.fullmatch(element.code.rstrip())
        if match is None or not match["name"] or match["value"].startswith("//") or _MISSHAPEN.match(element.code):
            self._report_unreadable(element)
            return
        spelling, name, equals, text = match.groups()
        type_column, name_column = match.start("type") + 1, match.start("name") + 1
        location = Location(self.path, element.line, type_column)
        is_constant = bool(equals)
        self._check_field_name(name, element.line, name_column, is_constant=is_constant)
        try:
            type_ = parse_type(spelling, of_uorb=self.of_uorb)
        except TypeSpellingError as error:
            self.error(error.code, element.line, type_column, error.message)
            return
        value = None
        hint = "" if type_.is_primitive or type_.package or not (is_constant or text) else type_hint(type_.name)
        if hint:
            self.error("M301", element.line, type_column, f"unknown type '{type_.name}'{hint}")
            return
        if is_constant or text:
            try:
                value = parse_value(type_, text, is_constant=is_constant)
            except ValueError as error:
                self.error("M305", element.line, match.start("value") + 1, f"'{name}': {error}")
                return
        comment = (parse_constant_comment if is_constant else parse_comment)(element.comment)
        if comment.tags and self.of_uorb:
            self._check_tags(element, comment.tags)
        if is_constant and value is not None:
            self._check_special(name, type_, value, location)
            constant = Constant(
                name=name, type=type_, value=value, location=location, name_column=name_column, comment=comment
            )
            self.constants.append(constant)
        else:
            field = Field(
                name=name, type=type_, location=location, name_column=name_column, default=value, comment=comment
            )
            self.fields.append(field)

    def _report_unreadable(self, element: _Element) -> None:
        column = len(element.code) - len(element.code.lstrip()) + 1
        text = element.code.strip()
        if "//" in text:
            self.error("M101", element.line, element.code.index("//") + 1, "comments start with '#', found '//'")
            return
        meant = _meant(text)
        problem = f"{meant}, found" if meant else "expected 'TYPE NAME' or 'TYPE NAME = VALUE', found"
        self.error("M101", element.line, column, f"{problem} {text!r}")

    def _check_field_name(self, name: str, line: int, column: int, *, is_constant: bool) -> None:
        kind = "constant" if is_constant else "field"
        pattern, wanted = (CONSTANT_NAME, "UPPER_CASE") if is_constant else (FIELD_NAME, "lower_case")
        if not pattern.fullmatch(name):
            near = re.sub(r"[^a-z0-9]+", "_", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()).strip("_")
            near = near.upper() if is_constant else near
            hint = f", for example '{near}'" if pattern.fullmatch(near) else ""
            array = re.fullmatch(r"(\w+)(\[.*\])", name)
            hint = f": the length of an array follows its type, 'TYPE{array[2]} {array[1]}'" if array else hint
            is_built = self.of_uorb and (NAME_IN_PX4 if is_constant else _FIELD_NAME_IN_PX4).fullmatch(name)
            code, who = ("M205", "ROS 2 expects") if is_built else ("M201", "expected")
            self.error(code, line, column, f"{kind} name {name!r}: {who} {wanted} with single underscores{hint}")
        elif self.of_uorb and name in _CPP_KEYWORDS:
            self.error("M205", line, column, f"{kind} name '{name}' {_IS_KEYWORD}")
        first = self._seen.setdefault(name, line)
        if first != line:
            self.error("M203", line, column, f"'{name}' is already defined on line {first}")

    def _check_tags(self, element: _Element, tags: tuple[tuple[str, str], ...]) -> None:
        """Warn about tags with unknown names, each at its place in the comments of the element."""
        unknown = [name for name, _ in tags if name not in NAMES]
        places = self._places_of_tags(element) if unknown else {}
        for name in unknown:
            hint = suggestion(f"@{name}", [f"@{known}" for known in NAMES]) or _TAGS_OF_PX4
            self.error("M107", *places[name], f"unknown tag '@{name}'{hint}")

    def _places_of_tags(self, element: _Element) -> dict[str, tuple[int, int]]:
        """Return the line and the column of each tag in the comments of an element."""
        places: dict[str, tuple[int, int]] = {}
        for number, _ in element.remarks:
            for tag in _TAG_NAME.finditer(self._lines[number - self._first_line]):
                places.setdefault(tag[1], (number, tag.start() + 1))
        return places

    def _check_special(self, name: str, type_: FieldType, value: object, location: Location) -> None:
        """Check the constants that the firmware itself reads, and warn about names that are similar to them."""
        if not self.of_uorb or not _LIKE_SPECIAL.match(name):
            return
        low = _LOWEST.get(name)
        if low is None:
            from difflib import get_close_matches

            near = get_close_matches(name, SPECIAL, n=1, cutoff=_NEAR)
            hint = f"did you mean '{near[0]}'?" if near else f"only {' and '.join(SPECIAL)}"
            if near or name.startswith("ORB_"):
                text = f"the firmware does not use '{name}', {hint}"
                self.errors.append(Diagnostic(location, "M405", text))
        elif type_.name not in INTEGERS or not isinstance(value, int) or value < low:
            text = f"{name} should be an integer of at least {low}, found '{type_} {name} = {value}'"
            self.errors.append(Diagnostic(location, "M405", text))


def _meant(code: str) -> str:
    """Return the line that was probably meant by `code`, with the rule that it breaks, or "" if nobody can tell."""
    constant = _CONSTANT_WITHOUT_EQUALS.fullmatch(code)
    if constant:
        type_, name, value = constant.groups()
        needs = "'='" if type_ else "a type and '='"
        return f"a constant needs {needs}: expected '{type_ or 'uint8'} {name} = {value}'"
    spaced = _SPACED_TYPE.match(code)
    if spaced:
        base, length, name = spaced.groups()
        return f"a type has no spaces: expected '{base}[{''.join(length.split())}] {name or 'NAME'}'"
    spaced = _SPACED_LENGTH.match(code)
    if spaced:
        base, name, length = spaced.groups()
        return f"the length of an array follows its type: expected '{base}[{''.join(length.split())}] {name}'"
    return ""


def _split_comment(line: str) -> tuple[str, str | None]:
    """Return the code and the comment in `line`, split at the first `#` outside of quotes; None without a comment."""
    code, mark, remark = line.partition("#")
    if not mark:
        return line, None
    if ('"' in code or "'" in code) and _QUOTED_VALUE.match(code):
        quote = ""
        for index, character in enumerate(line):
            if quote:
                quote = "" if character == quote and line[index - 1] != "\\" else quote
            elif character == "#":
                return line[:index], line[index + 1 :].lstrip("#").strip()
            elif character in "\"'":
                quote = character
        if quote == "":
            return line, None
    return code, remark.lstrip("#").strip()


def _text(remarks: list[tuple[int, str]]) -> str:
    return "\n".join(remark for _, remark in remarks).strip()
