"""SOURCE rules, changes that break source code that uses the definitions, and DRIFT rules, which break nothing.

Only `check` applies the rules of DRIFT.
"""

from __future__ import annotations

from collections.abc import Iterator
from struct import pack, unpack

from msggen.base.location import Location
from msggen.check.compare.comparison import Comparison, MessagePair, constants_of, definitions
from msggen.check.finding import Change, Excerpt
from msggen.definitions.enumeration import constant_prefixes
from msggen.definitions.model import VERSION, Constant


def find_removed_messages(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages that the current side does not have, except renamed messages."""
    for name in _missing(
        [message.name for message in comparison.previous.catalog.uorb_messages],
        [message.name for message in comparison.current.catalog.uorb_messages],
    ):
        if name in comparison.renamed_messages:
            continue
        location = definitions(comparison.previous.catalog)[name].location
        text = f"message '{name}' of {comparison.previous.label} is missing"
        yield Change(name, text, Location(comparison.current.place, 0), Excerpt(location, f"{name}.msg"))


def find_renamed_messages(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages that the current side has under another name."""
    before, after = (definitions(side.catalog) for side in (comparison.previous, comparison.current))
    for name, now in comparison.renamed_messages.items():
        text = f"message '{now}' is called '{name}' in {comparison.previous.label}"
        excerpts = Excerpt(before[name].location, f"{name}.msg"), Excerpt(after[now].location, f"{now}.msg")
        yield Change(now, text, after[now].location, *excerpts)


def find_removed_services(comparison: Comparison) -> Iterator[Change]:
    """Yield the services that the current side does not have."""
    services = {service.name: service for service in comparison.previous.catalog.own_services}
    for name in _missing(list(services), [service.name for service in comparison.current.catalog.own_services]):
        text = f"service '{name}' of {comparison.previous.label} is missing"
        yield Change(name, text, Location(comparison.current.place, 0), Excerpt(services[name].location, f"{name}.srv"))


def find_removed_constants(comparison: Comparison) -> Iterator[Change]:
    """Yield the constants that the current side does not have, in messages that both sides have."""
    for pair in comparison.pairs:
        known = constants_of(pair.current)
        neighbour = pair.current.location
        for name, constant in constants_of(pair.previous).items():
            if name in known:
                neighbour = known[name].location
            elif name != VERSION:
                text = f"constant '{name}' of {comparison.previous.label} is missing"
                yield Change(pair.name, text, neighbour, excerpt(constant), names=_names(pair, name))


def find_other_values(comparison: Comparison) -> Iterator[Change]:
    """Yield the constants with another value."""
    for pair, before, after in _both(comparison):
        if wire_value(before) != wire_value(after):
            text = f"'{after.name}' is {after.value}, but {before.value} in {comparison.previous.label}"
            yield _change(pair, before, after, text)


def find_other_types(comparison: Comparison) -> Iterator[Change]:
    """Yield the constants with another type."""
    for pair, before, after in _both(comparison):
        if str(before.type) != str(after.type):
            text = f"'{after.name}' is {after.type}, but {before.type} in {comparison.previous.label}"
            yield _change(pair, before, after, text)


def find_added_definitions(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages and services that the previous side does not have."""
    for kind, name, location in comparison.current.extra:
        if name not in comparison.renamed_messages.values():
            yield Change(name, f"{kind} '{name}' is not in {comparison.previous.label}", location)


def find_added_constants(comparison: Comparison) -> Iterator[Change]:
    """Yield the constants that the previous side does not have, in messages that both sides have."""
    for pair in comparison.pairs:
        known = constants_of(pair.previous)
        for name, constant in constants_of(pair.current).items():
            if name not in known and name != VERSION:
                text = f"constant '{name}' is not in {comparison.previous.label}"
                yield Change(pair.name, text, constant.location, after=excerpt(constant))


def find_other_versions(comparison: Comparison) -> Iterator[Change]:
    """Yield the messages of another version, whose topics have another name in ROS 2."""
    for pair in comparison.pairs:
        before, after = constants_of(pair.previous).get(VERSION), constants_of(pair.current).get(VERSION)
        if (before and before.value) != (after and after.value):
            now, then = (str(constant.value) if constant else "missing" for constant in (after, before))
            text = f"{VERSION} is {now}, but {then} in {comparison.previous.label}"
            lines = [excerpt(constant) if constant else None for constant in (before, after)]
            yield Change(pair.name, text, after.location if after else pair.current.location, lines[0], lines[1])


def wire_value(constant: Constant) -> str:
    """Return the value as its type stores it, as text: the same for all spellings of a number, and for NaN."""
    is_single = constant.type.name == "float32" and isinstance(constant.value, float)
    return repr(unpack("<f", pack("<f", constant.value))[0] if is_single else constant.value)


def excerpt(constant: Constant) -> Excerpt:
    """Return the line that defines a constant."""
    return Excerpt(constant.location, f"{constant.type} {constant.name} = {constant.value}")


def _change(pair: MessagePair, before: Constant, after: Constant, text: str) -> Change:
    lines = excerpt(before), excerpt(after)
    return Change(pair.name, text, after.location, *lines, names=_names(pair, after.name))


def _names(pair: MessagePair, constant: str) -> tuple[str, ...]:
    """Return the name of a constant and those of the fields whose enum on either side has a prefix of the constant."""
    fields = (
        field.name
        for message in (pair.previous, pair.current)
        for field in message.fields
        for prefix in constant_prefixes(message, field.comment.tag("enum"))
        if constant.startswith(f"{prefix}_")
    )
    return (constant, *dict.fromkeys(fields))


def _both(comparison: Comparison) -> Iterator[tuple[MessagePair, Constant, Constant]]:
    for pair in comparison.pairs:
        previous = constants_of(pair.previous)
        for name, after in constants_of(pair.current).items():
            if name in previous and name != VERSION:
                yield pair, previous[name], after


def _missing(wanted: list[str], known: list[str]) -> list[str]:
    return sorted(set(wanted) - set(known))
