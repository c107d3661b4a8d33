"""`msggen topic list` and `msggen topic find`."""

from __future__ import annotations

import argparse
import math
import sys
import time
from typing import TYPE_CHECKING, Any

from msggen.base.exit_codes import DONE
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import Commands, add_command, add_shared, refuse
from msggen.cli.printing import finite, number_of_bytes, print_table
from msggen.cli.values import non_empty
from msggen.cli.watching import add_window
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.live.messages.lookup import Named
    from msggen.live.vehicle.meter import Flow

_ENDED = 5.0
"""After how many times the time between samples a topic has ended."""


def add_to(actions: Commands) -> None:
    """Add the actions to `msggen topic`."""
    _add_list(actions)
    _add_find(actions)


def _add_list(actions: Commands) -> None:
    parser = add_command(
        actions,
        "list",
        _list,
        help="list the topics of the vehicle",
        description="List the topics of the vehicle in both directions, sorted by name: `out` if PX4 publishes it, "
        "`in` if PX4 reads it.",
    )
    parser.add_argument("-t", "--show-types", action="store_true", help="show the type of each topic")
    parser.add_argument(
        "-v",
        "-l",
        "--verbose",
        action="store_true",
        help="listen for a while, and show rates, sizes, the age of the last sample, and topics that are silent",
    )
    parser.add_argument("--direction", choices=("out", "in"), metavar="WAY", help="only the topics of a way: out, in")
    add_window(parser)
    add_shared(parser, "--json")
    add_link(parser)


def _add_find(actions: Commands) -> None:
    parser = add_command(
        actions,
        "find",
        _find,
        help="list the topics with a message",
        description="List the topics of the vehicle with a message, such as VehicleCommand, or "
        "px4_msgs/msg/VehicleCommand.",
    )
    parser.add_argument("message_type", metavar="MESSAGE", type=non_empty, help="the message: VehicleCommand")
    add_link(parser)


def _list(options: argparse.Namespace) -> int:
    from msggen.live.messages.lookup import all_topics

    with connection(options) as found:
        flows = _flows(options, found) if options.verbose else {}
        topics = [
            topic
            for topic in all_topics(found.package, found.vehicle.routes)
            if (topic.route or options.verbose) and options.direction in (None, topic.direction)
        ]
        now = time.time_ns()
        if options.json:
            print(dump([_object(topic, flows.get(topic.name), now, options) for topic in topics]))
        elif options.verbose:
            heads = ("topic", "way", "type" if options.show_types else "message", "rate", "size", "bandwidth", "age")
            rows = [_row(topic, flows.get(topic.name), now, options) for topic in topics]
            print_table(heads, rows, right=4)
        else:
            for topic in topics:
                print(f"{topic.name} [{_type(topic)}]" if options.show_types else topic.name)
    return DONE


def _flows(options: argparse.Namespace, found: Connection) -> dict[str, Flow]:
    """Listen for a while, and return what was heard by topic."""
    from msggen.live.vehicle.meter import Meter

    meter = Meter(options.window)
    print(f"listening for {options.window:g} s", file=sys.stderr, flush=True)
    with found.vehicle.watch(meter):
        time.sleep(options.window)
        return {flow.route.name: flow for flow in meter.flows(time.time_ns())}


def _type(topic: Named) -> str:
    if topic.route is not None:
        return topic.route.ros_type
    return topic.endpoint.message.__msg__.ros_type if topic.endpoint is not None else ""


def _row(topic: Named, flow: Flow | None, now: int, options: argparse.Namespace) -> list[str]:
    type_ = _type(topic)
    about = [topic.name, topic.direction, type_ if options.show_types else type_.rpartition("/")[2]]
    if flow is None:
        state = "not on the vehicle" if topic.route is None else "silent" if topic.direction == "out" else ""
        return [*about, state, "", "", ""]
    age = f"{max(now - flow.last, 0) / 1e9:.1f} s"
    if math.isnan(flow.rate):
        return [*about, "one sample", f"{flow.size} B", "", age]
    if now - flow.last > _ENDED * 1e9 * max(1 / flow.rate, flow.longest):  # a burst of answers has a rate, too
        return [*about, "ended", f"{flow.size} B", "", age]
    return [*about, f"{flow.rate:.1f} Hz", f"{flow.size} B", f"{number_of_bytes(flow.bandwidth)}/s", age]


def _object(topic: Named, flow: Flow | None, now: int, options: argparse.Namespace) -> dict[str, Any]:
    made: dict[str, Any] = {
        "topic": topic.name,
        "type": _type(topic),
        "direction": topic.direction,
        "on_vehicle": topic.route is not None,
    }
    if options.verbose:
        made |= {
            "samples": flow.samples if flow else 0,
            "rate": finite(flow.rate) if flow else None,
            "size": flow.size if flow else None,
            "bandwidth": finite(flow.bandwidth) if flow else None,
            "age": max(now - flow.last, 0) / 1e9 if flow else None,
        }
    return made


def _find(options: argparse.Namespace) -> int:
    with connection(options) as found:
        ros_type = _ros_type(options, found)
        names = sorted(route.name for route in found.vehicle.routes if route.ros_type == ros_type)
        print(*names, sep="\n", end="\n" if names else "")
        if not names:
            print(f"no topic of the vehicle has the message {ros_type}", file=sys.stderr)
    return DONE


def _ros_type(options: argparse.Namespace, found: Connection) -> str:
    """Return the type that the user names. A wrong name ends the process."""
    from msggen.live.messages.lookup import message_named

    text = options.message_type
    for route in found.vehicle.routes:  # also of messages that the package does not have
        if text in (route.ros_type, route.ros_type.rpartition("/")[2]):
            return route.ros_type
    try:
        return str(message_named(text, found.package).__msg__.ros_type)
    except KeyError as error:
        refuse(options, f"argument MESSAGE: {error}")
