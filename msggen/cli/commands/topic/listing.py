"""`msggen topic list`, `msggen topic type` and `msggen topic find`."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from msggen.cli.commands.topic.naming import add_topic, names_check, topic_of
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import Commands, Run, add_flag, add_shared, add_value, new_command, refuse
from msggen.cli.printing import number_of_bytes
from msggen.cli.table import DIM, YELLOW, Column, objects_of, print_table
from msggen.cli.values import non_empty
from msggen.cli.watching import add_window
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.messages.lookup import Named
    from msggen.vehicle.meter import Flow

_NOT_THERE = "not on the vehicle"
_ENDED = 5.0
"""After how many times the time between samples a topic has ended."""


def add_to(actions: Commands) -> None:
    """Add the actions to `msggen topic`."""
    _add_list(actions)
    _add_type(actions)
    _add_find(actions)


@new_command(
    "list",
    "list the topics of the vehicle",
    "List the topics of the vehicle in both directions, sorted by name: `out` if PX4 publishes it, "
    "`in` if PX4 reads it.",
)
def _add_list(parser: argparse.ArgumentParser) -> Run:
    add_flag(parser, "-t, --show-types", "show the type of each topic")
    text = "listen for a while, and show rates, sizes, the age of the last sample, and topics that are silent"
    add_flag(parser, "-v, -l, --verbose", text)
    parser.add_argument("--direction", choices=("out", "in"), metavar="WAY", help="only the topics of a way: out, in")
    add_window(parser)
    add_shared(parser, "--json")
    add_link(parser)
    return _list


@new_command(
    "type",
    "print the type of a topic",
    "Print the type of a topic in ROS 2, such as px4_msgs/msg/VehicleStatus. `msggen topic info` shows its fields.",
)
def _add_type(parser: argparse.ArgumentParser) -> Run:
    add_topic(parser)
    add_link(parser)
    return _print_type


@new_command(
    "find",
    "list the topics with a message",
    "List the topics of the vehicle with a message, such as VehicleCommand, or px4_msgs/msg/VehicleCommand.",
)
def _add_find(parser: argparse.ArgumentParser) -> Run:
    add_value(parser, "message_type", "MESSAGE", non_empty, "the message: VehicleCommand")
    add_link(parser)
    return _find


def _list(options: argparse.Namespace) -> None:
    from msggen.messages.lookup import all_topics

    with connection(options) as found:
        flows = _flows(options, found) if options.verbose else {}
        now = time.time_ns()
        rows = [
            _Row(topic, flows.get(topic.name), now)
            for topic in all_topics(found.package, found.vehicle.routes)
            if (topic.route or options.verbose) and options.direction in (None, topic.direction)
        ]
        if options.json:
            print(dump(objects_of(_columns(options), rows)))
        elif options.verbose:
            print_table(_columns(options), rows)
        else:
            for row in rows:
                print(f"{row.topic.name} [{_type(row.topic)}]" if options.show_types else row.topic.name)


def _flows(options: argparse.Namespace, found: Connection) -> dict[str, Flow]:
    """Listen for a while, and return what was heard by topic."""
    from msggen.vehicle.meter import Meter

    meter = Meter(options.window)
    print(f"listening for {options.window:g} s", file=sys.stderr, flush=True)
    with found.vehicle.watch(meter):
        time.sleep(options.window)
        return {flow.route.name: flow for flow in meter.flows(time.time_ns())}


class _Row(NamedTuple):
    """A topic, and what was heard of it until `now`, of `time.time_ns`."""

    topic: Named
    flow: Flow | None
    now: int


def _type(topic: Named) -> str:
    """Return the type of a topic in ROS 2, "" if it is not known."""
    if topic.route is not None:
        return topic.route.ros_type
    return topic.endpoint.message.__msg__.ros_type if topic.endpoint is not None else ""


def _state(row: _Row) -> str:
    """Return why a topic has no rate, "" if it has one."""
    topic, flow, now = row
    if flow is None:
        return _NOT_THERE if topic.route is None else "silent" if topic.direction == "out" else ""
    if math.isnan(flow.rate):
        return "one sample"
    is_over = now - flow.last > _ENDED * 1e9 * max(1 / flow.rate, flow.longest)  # a burst of answers has a rate, too
    return "ended" if is_over else ""


def _columns(options: argparse.Namespace) -> Iterator[Column[_Row]]:
    """Yield what is told of each topic."""
    yield Column("topic", "topic", lambda row: row.topic.name)
    yield Column("type", "", lambda row: _type(row.topic))
    yield Column("direction", "way", lambda row: row.topic.direction)
    yield Column("on_vehicle", "", lambda row: row.topic.route is not None)
    if options.show_types:
        yield Column("", "type", lambda row: _type(row.topic))
    else:
        yield Column("", "message", lambda row: _type(row.topic).rpartition("/")[2])
    if options.verbose:
        yield Column("samples", "", lambda row: row.flow.samples if row.flow else 0)
        yield Column("rate", "", lambda row: row.flow and row.flow.rate)
        yield Column(
            "", "rate", lambda row: _state(row) or (row.flow and f"{row.flow.rate:.1f} Hz"), align=">", style=_style
        )
        yield Column("size", "size", lambda row: row.flow and row.flow.size, "{} B".format, ">")
        yield Column("bandwidth", "", lambda row: row.flow and row.flow.bandwidth)
        yield Column("", "bandwidth", _bandwidth, align=">")
        yield Column(
            "age", "age", lambda row: row.flow and max(row.now - row.flow.last, 0) / 1e9, "{:.1f} s".format, ">"
        )


def _style(rate: str | None) -> int:
    """Return the style of a rate, or of the state of a topic without one."""
    return 0 if not rate or rate.endswith(" Hz") else DIM if rate == _NOT_THERE else YELLOW


def _bandwidth(row: _Row) -> str:
    return f"{number_of_bytes(row.flow.bandwidth)}/s" if row.flow and not _state(row) else ""


def _print_type(options: argparse.Namespace) -> None:
    with connection(options, names_check(options, [options.topic]), needs_types=False) as found:
        topic = topic_of(options, options.topic, found, "out")
        print(_type(topic))
        if topic.route is None:
            print(f"the vehicle does not have {topic.name}", file=sys.stderr)


def _find(options: argparse.Namespace) -> None:
    with connection(options, lambda package: _message_type(options, package), needs_types=False) as found:
        ros_type = _ros_type(options, found)
        names = sorted(route.name for route in found.vehicle.routes if route.ros_type == ros_type)
        print(*names, sep="\n", end="\n" if names else "")
        if not names:
            print(f"no topic of the vehicle has the message {ros_type}", file=sys.stderr)


def _ros_type(options: argparse.Namespace, found: Connection) -> str:
    """Return the type that the user names. Raises WrongArgumentError for a wrong name."""
    for route in found.vehicle.routes:  # also of messages that the package does not have
        if options.message_type in (route.ros_type, route.ros_type.rpartition("/")[2]):
            return route.ros_type
    return _message_type(options, found.package)


def _message_type(options: argparse.Namespace, package: ModuleType) -> str:
    """Return the type that the user names, of a package. Raises WrongArgumentError for a wrong name."""
    from msggen.messages.lookup import message_named

    try:
        return str(message_named(options.message_type, package).__msg__.ros_type)
    except KeyError as error:
        refuse(options, f"argument MESSAGE: {error}")
