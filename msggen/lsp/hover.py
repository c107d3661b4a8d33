"""What an editor shows about a name: under the cursor, in Markdown, and between the words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from msggen.base.diagnostics import CODES, few
from msggen.definitions.enumeration import Enumeration, enumerations
from msggen.definitions.identity import Endpoint, message_hash, type_hash
from msggen.definitions.layout import Layout
from msggen.definitions.model import Catalog, Comment, Constant, Field, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.tags import TAGS
from msggen.lsp.names import Kind, Use
from msggen.lsp.project import State
from msggen.show.report.errors import explain_code
from msggen.show.report.examples import example_of
from msggen.show.report.rules import explain_rule
from msggen.show.report.table import named

_WIDTH = 88
_MOST_MEMBERS = 24
"""Maximum number of constants of an enum that are shown."""
_MOST_HINTED = 4
"""The number of members of an enum in a hint."""

Before = Callable[[Message], tuple[Catalog, Message] | None]
"""Return a message in the last commit, and the catalog there; None if it is not known."""


def hover(state: State, use: Use, before: Before) -> str:
    """Return the text about a name, "" if nothing is known about it."""
    name = use.name
    if name.kind is Kind.TOPIC:
        return "\n\n".join(_topic(state, name.text))
    key = name.owner or name.text
    message = next((each for each in state.messages if each.key == key), None)
    if message is None:
        return ""
    message = state.complete(message)
    if name.kind is Kind.MESSAGE:
        return "\n\n".join(_message(state, message, before))
    if name.kind is Kind.FIELD:
        field = next((each for each in message.fields if each.name == name.text), None)
        return "\n\n".join(_field(state, message, field)) if field else ""
    if name.kind is Kind.CONSTANT:
        constant = next((each for each in message.constants if each.name == name.text), None)
        return "\n\n".join(_constant(message, constant)) if constant else ""
    return "\n\n".join(_members(each) for each in enumerations(message) if name.text in each.tag.split())


def explained(code: str) -> str:
    """Return the text of `msggen explain` about a code or a rule, "" for an unknown one."""
    if code in CODES:
        return f"```text\n{explain_code(code, width=_WIDTH)}\n```"
    rules = named(code)
    if not rules or rules[0].id != code:
        return ""
    return f"```text\n{explain_rule(rules[0], example_of(rules[0]), width=_WIDTH, colour=False)}\n```"


def _message(state: State, message: Message, before: Before) -> Iterator[str]:
    layout = state.layout(message)
    size = f"{layout.size} bytes" if layout else "size varies"
    version = f", version {message.message_version}" if message.is_versioned else ""
    yield f"**{message.ros_type}** ({size}{version})"
    if message.comment:
        yield _text(message.comment)
    if message.package == (state.catalog.package if state.catalog else ""):
        yield "\n".join(f"- {_crossing(state, topic)}" for topic in message.topic_names)
    if outer := _nesting(state, message.key):
        yield f"nested in {few(outer)}"
    yield from _hashes(state, message, before)


def _nesting(state: State, key: str) -> list[str]:
    """Return the names of the messages that nest a message."""
    return sorted(
        {
            each.name
            for each in state.messages
            for field in each.fields
            if not field.type.is_primitive and each.key_of(field.type) == key
        }
    )


def _hashes(state: State, message: Message, before: Before) -> Iterator[str]:
    """Yield the hashes of a message, and those of the last commit if they differ."""
    if state.catalog is None or not state.is_whole(message):
        return
    own = _both(state.catalog, message)
    known = before(message)
    was = _both(*known) if known else own
    rows = zip(("hash of the fields", "type hash"), own, was, strict=True)
    yield "  \n".join(f"{title} `{now}`" + (f", before `{then}`" if then != now else "") for title, now, then in rows)


def _both(catalog: Catalog, message: Message) -> tuple[str, str]:
    return f"{message_hash(catalog, message):#010x}", type_hash(catalog, message)


def _crossing(state: State, topic: str) -> str:
    """Return a uORB topic with the way in which it is bridged."""
    found = [each for each in state.endpoints if each.entry.uorb_topic == topic]
    return f"`{topic}`: {'; '.join(map(_endpoint, found)) if found else 'not bridged'}"


def _endpoint(endpoint: Endpoint) -> str:
    interval = endpoint.publish_interval_ms
    rate = f", at most {1000 / interval:.4g} Hz" if interval else ""
    direction = "from PX4" if endpoint.publish_interval_ms is not None else "to PX4"
    return f"`{endpoint.ros_name}` {direction}{rate}"


def _topic(state: State, topic: str) -> Iterator[str]:
    owner = next((each for each in state.messages if each.folder == "msg" and topic in each.topic_names), None)
    yield f"**{topic}**" + (f", a topic of {owner.ros_type}" if owner else "")
    found = [each for each in state.endpoints if each.entry.uorb_topic == topic]
    yield "\n".join(f"- {_endpoint(each)}" for each in found) if found else "not bridged"


def _field(state: State, message: Message, field: Field) -> Iterator[str]:
    yield f"**{field.name}** `{field.type}` of {message.name}"
    if field.comment.text:
        yield _text(field.comment.text)
    rows = [*_attributes(field.comment), *_extent(state.layout(message), field.name)]
    if rows:
        yield "\n".join(f"- {row}" for row in rows)
    yield from (_members(each) for each in enumerations(message) if field.name in each.fields)


def _attributes(comment: Comment) -> Iterator[str]:
    titles = {tag.name: tag.title for tag in TAGS}
    for name, content in comment.attributes:
        origin = comment.origin(name)
        yield f"{titles.get(name, name)}: `{content}`" + ("" if origin == "tag" else f" ({origin})")


def _extent(layout: Layout | None, name: str) -> Iterator[str]:
    if layout is None or name not in layout.extents():
        return
    offset, size = layout.extents()[name]
    padding = next(leaf.padding for leaf in layout.leaves if leaf.path[0][0] == name)
    after = f", after {padding} bytes of padding" if padding else ""
    place = f"bytes {offset} to {offset + size - 1}" if size > 1 else f"byte {offset}"
    yield f"{place} of {layout.size}{after}"


def _constant(message: Message, constant: Constant) -> Iterator[str]:
    yield f"**{constant.name}** `{constant.type}` = `{constant.value}` of {message.name}"
    if constant.comment.text:
        yield _text(constant.comment.text)
    own = [each for each in enumerations(message) if constant.name in {one.constant.name for one in each.members}]
    fields = [name for each in own for name in each.fields]
    if fields:
        yield f"a value of {few(fields)}"


def _members(enumeration: Enumeration) -> str:
    shown = enumeration.members[:_MOST_MEMBERS]
    rows = [f"{member.value} {member.name}" for member in shown]
    rows += [f"and {len(enumeration.members) - len(shown)} more"] if len(shown) < len(enumeration.members) else []
    kind = "flags" if enumeration.is_flags else "values"
    return "\n".join([f"{kind} of `{enumeration.tag}`:", "```text", *rows, "```"])


def _text(comment: str) -> str:
    """Return a comment as plain text of Markdown: what a definition says is no markup."""
    return "".join(f"\\{each}" if each in "\\`*_{}[]<>()#+-!|~&" else each for each in comment)


def primitive(name: str) -> str:
    """Return the text about a primitive, "" for another word."""
    found = PRIMITIVES.get(name)
    if found is None:
        return ""
    if found.is_integer:
        low, high = found.integer_range
        return f"`{name}`: {found.size} bytes, {low} to {high}"
    return f"`{name}`: {found.size} bytes" if found.size else f"`{name}`: text of any length"


class Hint(NamedTuple):
    """A text to show behind the name at a line and a column, which count from 1. `tip` is shown on request."""

    line: int
    column: int
    text: str
    tip: str = ""


def hints(state: State, path: str) -> Iterator[Hint]:
    """Yield the hints in a definition."""
    for each in state.in_file(path):
        message = state.complete(each)
        layout = state.layout(message)
        extents = layout.extents() if layout else {}
        enums = {name: enum for enum in enumerations(message) for name in enum.fields}
        for field in message.fields:
            parts = [f"@{extents[field.name][0]}"] if field.name in extents else []
            tip = ""
            if enum := enums.get(field.name):
                members = [f"{member.value} {member.name}" for member in enum.members]
                parts.append(", ".join(members[:_MOST_HINTED]) + ("…" if len(members) > _MOST_HINTED else ""))
                tip = "\n".join(members)
            if parts:
                yield Hint(field.location.line, field.name_column + len(field.name), " ".join(parts), tip)
