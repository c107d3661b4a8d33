"""The values of a message, as arguments: YAML, from the command line, a file or stdin."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from msggen.base.diagnostics import Diagnostic, InputError, input_error
from msggen.base.location import Location
from msggen.cli.link import Connection
from msggen.cli.options import add_value, refuse
from msggen.cli.values import local_path, positive
from msggen.link.link_types import type_named

if TYPE_CHECKING:
    from msggen.cli.names import Field, Names
    from msggen.messages.lookup import Named
    from msggen.messages.packages import Message

    MessageT = TypeVar("MessageT", bound=Message)

_PATIENCE = 3.0
"""How long to wait in s for what the vehicle says of a definition."""
_TIMEOUT = 5.0
_ARGUMENT = "VALUES"
_SLICE = 0.05
_DISCOVERY = 1.0
"""How long an agent takes in s to find a new writer in DDS (docs/links.md)."""


def add_values(parser: argparse.ArgumentParser) -> None:
    """Add the argument with the values of a message, and the option that reads them from a file."""
    text = "values in YAML, such as '{position: true}', or '{}' for zeros; - reads them from stdin"
    parser.add_argument("values", metavar="VALUES", nargs="?", help=text)
    add_value(parser, "-f, --file", "FILE", local_path, "read the values from a file")


def add_timeout(parser: argparse.ArgumentParser) -> None:
    """Add the option that bounds the wait for an answer."""
    text = f"wait this long for an answer (default: {_TIMEOUT:g})"
    add_value(parser, "--timeout", "SECONDS", positive, text, default=f"{_TIMEOUT:g}")


class Values(NamedTuple):
    """The values of a message, and where they are from."""

    values: object
    place: str

    def message(self, cls: type[MessageT]) -> MessageT:
        """Return the message with these values. Raises InputError, with all problems."""
        from msggen.messages.compose import ValuesError, compose

        try:
            return compose(cls, self.values)
        except ValuesError as error:
            raise InputError(Diagnostic(Location(self.place, 0), "L110", each) for each in error.problems) from None


def read_values(options: argparse.Namespace) -> Values:
    """Return the values that the options of `add_values` name.

    Raises InputError for what is not YAML, and for a file or stdin without a value: zeros would be published.
    """
    from msggen.definitions.parse.yaml_nodes import read_yaml, value_of

    if options.values and options.file:
        refuse(options, "argument --file: not allowed with argument VALUES")
    if not options.values and not options.file:
        refuse(options, "the following arguments are required: VALUES: '{}' stands for a message of zeros")
    data, place = _read(options)
    root = read_yaml(data, place)
    if root is None and place != _ARGUMENT:
        raise input_error(place, "L110", "no values: write {} for a message of zeros", 0)
    return Values(None if root is None else value_of(root), place)


def _read(options: argparse.Namespace) -> tuple[bytes, str]:
    """Return the bytes of the values, and the name of their place."""
    if options.file:
        from msggen.base.disk.reading import read_bytes

        return read_bytes(options.file), options.file
    if options.values == "-":
        return sys.stdin.buffer.read(), "stdin"
    return (options.values or "").encode(errors="replace"), _ARGUMENT


def settle(found: Connection, topic: Named) -> Named:
    """Wait until the vehicle has told its definition of a topic, and return the topic with it.

    Releases before v1.15 do not tell it, and are waited for only shortly. In DDS, the writer has to be found as well.
    """
    ros_type = topic.route.ros_type if topic.route else ""
    wait_told(found, ros_type)
    return found.fitting(topic)


def wait_told(found: Connection, ros_type: str) -> None:
    """Wait until the vehicle has told its definition of a type, and in DDS until the writer is found."""
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        firmware = found.vehicle.firmware
        if firmware.is_complete or ros_type in firmware.hashes:
            break
        time.sleep(_SLICE)
    if type_named(found.link).has_domain:
        time.sleep(_DISCOVERY)


_NAME = re.compile(r"(?:^|[{,])\s*(\w*)\Z")
"""The name of a field, as far as it is typed,"""
_MEMBER = re.compile(r"(\w+):\s*([\w|]*)\Z")
"""and the value of one, as far as it is typed."""


def values_like(prefix: str, own: Mapping[str, Field], names: Names) -> Iterator[str]:
    """Yield values in YAML with the last word completed: the name of a field, or a member of the enum of one."""
    nested = {name: each for field in own.values() for name, each in names.messages.get(field.message, {}).items()}
    known = own if prefix.count("{") - prefix.count("}") <= 1 else nested
    member, name = _MEMBER.search(prefix), _NAME.search(prefix)
    if member is not None and member[1] in known:
        yield from [prefix[: member.start(2)] + each for each in known[member[1]].members]
    elif name is not None:
        yield from [f"{prefix[: name.start(1)]}{each}:" for each in known]
