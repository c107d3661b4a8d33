"""`msggen topic echo`."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn

from msggen.base.diagnostics import counted
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import FAILED_CODES, Commands, add_command, add_shared, refuse
from msggen.cli.topic.naming import add_topic, heard
from msggen.cli.values import non_empty, positive
from msggen.cli.watching import add_limits, rounds, watching

if TYPE_CHECKING:
    from msggen.live import Subscription, Vehicle
    from msggen.live.messages.expression import Condition, ConditionError
    from msggen.live.messages.lookup import Named

_PERIOD = 0.05
"""How often to print what has arrived, in s: waking up for each sample would take most of the time."""
_PATIENCE = 1.0
"""How long to wait for the vehicle's definition, in s. It is asked for that of a subscription first."""
_NOTICE = 3.0
"""After how many seconds without a sample to say so."""


def add_to(actions: Commands) -> None:
    """Add the action to `msggen topic`."""
    parser = add_command(
        actions,
        "echo",
        _echo,
        help="print the messages of a topic",
        description="Print the messages of a topic as they arrive, with names of enums and units, until Ctrl-C.",
        epilog=f"Exit codes: 0 done, or ended by Ctrl-C, 1 fewer than N messages in the time of --for, {FAILED_CODES}",
    )
    add_topic(parser)
    parser.add_argument(
        "filter",
        metavar="FILTER",
        nargs="?",
        type=non_empty,
        help="print only messages that meet a condition, such as 'arming_state == ARMED and abs(vz) < 0.2'",
    )
    parser.add_argument(
        "--field",
        metavar="PATH",
        type=non_empty,
        action="append",
        default=[],
        help="print only this value: nav_state, position[2], esc[0].esc_rpm; repeatable",
    )
    parser.add_argument("--once", action="store_true", help="end after the first message")
    parser.add_argument("--every", metavar="SECONDS", type=positive, help="print at most one message in this time")
    add_limits(parser)
    group = parser.add_mutually_exclusive_group()
    add_shared(group, "--json")
    group.add_argument("--csv", action="store_true", help="print rows under a line with the names: timestamp,q[0],q[1]")
    add_shared(parser, "--quote-formulas")
    add_link(parser)


def _echo(options: argparse.Namespace) -> int:
    if options.quote_formulas and not options.csv:
        refuse(options, "argument --quote-formulas: only with --csv")
    if options.once:
        if options.count:
            refuse(options, "argument --once: not allowed with argument -n/--count")
        options.count = 1
    condition = _condition(options)
    with connection(options) as found:
        (topic,) = heard(options, found, [options.topic])
        message = topic.message
        if message is None:
            refuse(
                options,
                f"argument TOPIC: {found.label} has no definition of '{topic.name}': name the vehicle's firmware, "
                "--px4 PX4-Autopilot",
            )
        printer = _Printer(options, condition)
        printer.prepare(message)
        with _subscribed(options, found.vehicle, topic) as samples:
            _confirm(found.vehicle, topic)
            return _print(options, found, topic, samples, printer)


def _subscribed(options: argparse.Namespace, vehicle: Vehicle, topic: Named) -> Subscription[Any]:
    """Return the samples of a topic. Ends the process if the types have another version of it."""
    from msggen.live import TopicError

    try:
        return vehicle.subscribe(topic.name)
    except TopicError as error:
        _refuse_types(options, error)


def _refuse_types(options: argparse.Namespace, error: Exception) -> NoReturn:
    """Report types that are not the vehicle's. The end of the error is a cure for programs."""
    how = "name the vehicle's firmware, --px4 PX4-Autopilot, or its package, --types"
    refuse(options, f"argument TOPIC: {str(error).rpartition(': ')[0]}: {how}")


def _confirm(vehicle: Vehicle, topic: Named) -> None:
    """Wait until the vehicle has told its definition of a topic, so that no message of another one is printed."""
    from msggen.live import LinkError

    deadline = time.monotonic() + _PATIENCE
    with suppress(LinkError):
        while topic.route is not None and time.monotonic() < deadline:
            firmware = vehicle.firmware
            if firmware.is_complete or topic.route.ros_type in firmware.hashes:
                return
            time.sleep(_PERIOD / 5)


def _condition(options: argparse.Namespace) -> Condition | None:
    """Parse the condition, before the vehicle is asked. A wrong one ends the process."""
    from msggen.live.messages.expression import Condition, ConditionError

    try:
        return Condition(options.filter) if options.filter else None
    except ConditionError as error:
        _refuse(options, error)


def _refuse(options: argparse.Namespace, error: ConditionError) -> NoReturn:
    refuse(options, f"argument FILTER: column {error.column}: {error}")


def _print(
    options: argparse.Namespace, found: Connection, topic: Named, samples: Subscription[Any], printer: _Printer
) -> int:
    from msggen.live import FormatError

    is_told = False
    with watching():
        if options.count == 1:
            _print_last(options, samples, printer)
        for number, _ in enumerate(() if printer.is_done else rounds(options, found.vehicle, _PERIOD)):
            try:
                for message, arrival in samples.arrived():
                    printer.take(message, arrival)
                    if printer.is_done:
                        break
            except FormatError as error:
                _refuse_types(options, error)
            if printer.is_done:
                break
            if not (is_told or samples.received) and number * _PERIOD > _NOTICE:
                is_told = True
                print(f"waiting for a sample of {topic.name}{_absence(topic)}", file=sys.stderr, flush=True)
    for text in printer.summary(samples):
        print(text, file=sys.stderr)
    return FINDINGS if getattr(options, "for") and options.count and not printer.is_done else DONE


def _print_last(options: argparse.Namespace, samples: Subscription[Any], printer: _Printer) -> None:
    """Print the last message from before this command, if the process that owns the link has it."""
    from msggen.live import FormatError

    try:
        last = samples.last()
    except FormatError as error:
        _refuse_types(options, error)
    if last is not None:
        printer.take(*last)


def _absence(topic: Named) -> str:
    if topic.route is None:
        return ", which the vehicle does not have"
    return ", which programs on this link publish to PX4" if topic.direction == "in" else ""


class _Printer:
    """Prints messages that meet a condition, up to a number of them, and at most one in a time."""

    def __init__(self, options: argparse.Namespace, condition: Condition | None) -> None:
        self._options, self._condition = options, condition
        self._has_lines = not (options.json or options.csv)
        self._made: dict[type, tuple[Callable[[Any], bool] | None, Callable[[Any], str]]] = {}
        self._seen = self._printed = self._last = 0
        self._every = round((options.every or 0) * 1e9)

    @property
    def is_done(self) -> bool:
        """Whether the number of messages was printed."""
        return self._options.count is not None and self._printed >= self._options.count

    def prepare(self, message: type[Any]) -> tuple[Callable[[Any], bool] | None, Callable[[Any], str]]:
        """Return what to do with messages of a class. A wrong condition or path ends the process."""
        from functools import partial

        from msggen.live.messages.expression import ConditionError
        from msggen.live.messages.formats import csv_writer, json_writer, text_writer
        from msggen.live.messages.places import PlaceError

        options = self._options
        rows = partial(csv_writer, quotes_formulas=options.quote_formulas)
        writer = json_writer if options.json else rows if options.csv else text_writer
        try:
            write = writer(message, options.field)
        except PlaceError as error:
            refuse(options, f"argument --field: {error}")
        try:
            condition = self._condition.of(message) if self._condition else None
        except ConditionError as error:
            _refuse(options, error)
        self._made[message] = condition, write
        return condition, write

    def take(self, message: Any, arrival: int) -> None:
        """Print a message, if it is one to print."""
        self._seen += 1
        if self._every and arrival - self._last < self._every:
            return
        cls = type(message)
        condition, write = self._made.get(cls) or self.prepare(cls)
        if condition is None or condition(message):
            if self._options.csv and not self._printed:
                self._print_header(cls)
            print(Styled(f"{write(message)}\n---") if self._has_lines else write(message))
            self._printed += 1
            self._last = arrival

    def _print_header(self, cls: type[Any]) -> None:
        from msggen.live.messages.formats import csv_header

        print(csv_header(cls, self._options.field))

    def summary(self, samples: Subscription[Any]) -> list[str]:
        """Return what to say at the end."""
        told = []
        if self._condition and not self._printed and self._seen:
            told.append(f"none of {counted(self._seen, 'message')} met the condition")
        elif not self._seen:
            told.append("no message arrived")
        if samples.dropped:
            told.append(f"{counted(samples.dropped, 'message')} left out, because the output is slow")
        if samples.undecodable:
            told.append(f"{counted(samples.undecodable, 'sample')} could not be decoded")
        return told
