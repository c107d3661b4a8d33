"""`msggen topic pub`."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted
from msggen.cli.commands.topic.naming import SPELLINGS_IN, add_topic, named
from msggen.cli.link import add_link, connection
from msggen.cli.message import Values, add_values, read_values, settle
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_shared, add_value, new_command, refuse
from msggen.cli.values import Deferred, positive
from msggen.cli.watching import add_limits, watching

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.messages.lookup import Named
    from msggen.messages.packages import Message

_RATE = 1.0
_FASTEST = 1e4


@new_command(
    "pub",
    "publish to a topic that the vehicle reads",
    "Publish a message to a topic that the vehicle reads, once or at a rate until Ctrl-C. The values "
    "are YAML, checked against the definition of the message: fields without a value are zero, numbers can be "
    "names of enum members, as in 'landing_gear: DOWN'.",
    epilog="Example: `msggen topic pub --once trajectory_setpoint '{position: [0, 0, -5]}'`. "
    f"Exit codes: 0 done, or ended by Ctrl-C, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_topic(parser, SPELLINGS_IN)
    add_values(parser)
    add_value(parser, "-r, --rate", "HZ", _rate, f"messages a second (default: {_RATE:g})")
    add_flag(parser, "-1, --once", "end after the first message")
    add_limits(parser)
    add_shared(parser, "-q, --quiet")
    add_link(parser)
    return _pub


def _pub(options: argparse.Namespace) -> None:
    if options.once and options.count:
        refuse(options, "argument --once: not allowed with argument -n/--count")
    values = read_values(options)
    with connection(options, lambda package: _message(options, values, _named(options, package)), acts=True) as found:
        topic = _named(options, found.package, found.vehicle.routes)
        if found.has_one_package:
            _message(options, values, topic)  # errors are told before the vehicle has told its definition
        message = _message(options, values, settle(found, topic))
        _repeat(lambda: found.vehicle.publish(message, topic.name), message, options)


@Deferred
def _rate(text: str) -> float:
    found: float = positive.convert(text)
    if found > _FASTEST:
        raise argparse.ArgumentTypeError(f"expected up to {_FASTEST:g} Hz, found {text!r}")
    return found


def _named(options: argparse.Namespace, package: ModuleType, routes: Sequence[Route] = ()) -> Named:
    """Return the topic that the user names. Raises WrongArgumentError for a wrong name."""
    topic = named(options, options.topic, "in", package, routes)
    if topic.direction == "out":
        text = f"PX4 publishes '{topic.name}', and does not read it: msggen topic echo prints it"
        refuse(options, f"argument TOPIC: {text}")
    return topic


def _message(options: argparse.Namespace, values: Values, topic: Named) -> Message:
    """Return the message to publish. Raises InputError for wrong values."""
    if topic.message is None:
        refuse(options, f"argument TOPIC: the types do not have '{topic.name}': name those of the firmware with --px4")
    return values.message(topic.message)


def _repeat(publish: Callable[[], None], message: Message, options: argparse.Namespace) -> None:
    """Publish at a rate, until a limit of the options or Ctrl-C ends it. A vehicle that is away gets nothing."""
    from msggen.link.link import NotConnectedError

    number, most = 0, 1 if options.once else options.count
    start = due = time.monotonic()
    end = start + (options.seconds or math.inf)
    with watching():
        while number != most and due < end:
            time.sleep(max(0.0, due - time.monotonic()))
            due = max(due + 1 / (options.rate or _RATE), time.monotonic())
            with suppress(NotConnectedError):
                publish()
                number += 1
                if not options.quiet:
                    print(f"publishing #{number}: {message!r}", flush=True)
    if most is None and not options.quiet:
        print(f"{counted(number, 'message')} in {time.monotonic() - start:.1f} s", flush=True)
