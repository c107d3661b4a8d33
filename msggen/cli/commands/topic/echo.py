"""`msggen topic echo`."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import input_error
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.topic.naming import SPELLINGS, format_errors, heard, named
from msggen.cli.commands.topic.printer import Printer, check_fields, condition_of
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_shared, add_value, new_command, refuse
from msggen.cli.packages import check_reading, read_errors
from msggen.cli.values import local_path, non_empty, positive
from msggen.cli.watching import add_limits, rounds, watching

if TYPE_CHECKING:
    from msggen.messages.expression import Condition
    from msggen.messages.lookup import Named
    from msggen.recordings.log.event_texts import EventTexts
    from msggen.vehicle.subscription import Subscription

_PERIOD = 0.05
"""How often to print what has arrived, in s: waking up for each sample would take most of the time."""
_PATIENCE = 1.0
"""How long to wait for the vehicle's definition, in s. It is asked for that of a subscription first."""
_NOTICE = 3.0
"""After how many seconds without a sample to say so."""
_CONDITION = re.compile(r"[\s=<>!&|^()%*+]")
"""What a condition has, and no name of a topic."""


@new_command(
    "echo",
    "print the messages of topics",
    "Print the messages of topics as they arrive, with names of enums and units, until Ctrl-C. A "
    "condition can stand behind a single topic, too: a second word with an operator, a space or parentheses is "
    "one. Of several topics, each has its own number of messages, by -n or --once.",
    epilog="Example: `msggen topic echo vehicle_status 'arming_state == ARMED' --once`. "
    f"Exit codes: 0 done, or ended by Ctrl-C, 1 fewer than N messages in the time of --for, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = f"topics to print, also as TOPIC.FIELD, or TOPIC FILTER; {SPELLINGS}"
    add_value(parser, "topics", "TOPIC", non_empty, text, nargs="+")
    text = "print only messages that meet a condition, such as 'arming_state == ARMED and abs(vz) < 0.2'"
    add_value(parser, "--filter", "CONDITION", non_empty, text)
    add_shared(parser, "--field")
    text = "print what events say, too, by all_events.json.xz of the firmware's build, or a ULog that it has written"
    add_value(parser, "--events", "FILE", local_path, text)
    add_flag(parser, "--once", "end after the first message")
    add_value(parser, "--every", "SECONDS", positive, "print at most one message in this time")
    add_limits(parser)
    group = parser.add_mutually_exclusive_group()
    add_shared(group, "--json", "--csv")
    add_shared(parser, "--quote-formulas")
    add_link(parser)
    return _echo


def _echo(options: argparse.Namespace) -> int:
    _read_words(options)
    condition = condition_of(options)
    options.event_texts = _event_texts(options.events) if options.events else None
    with connection(options, lambda package: _check(options, condition, package)) as found, ExitStack() as stack:
        topics = [found.fitting(topic) for topic in heard(options, found, options.topics)]
        _check_known(options, found, topics)
        with format_errors(options):
            subscriptions = [stack.enter_context(found.vehicle.subscribe(topic.name)) for topic in topics]
        topics = [_confirmed(found, topic) for topic in topics]
        messages = [topic.message for topic in topics if topic.message]
        check_fields(options, messages)
        printers = [Printer(options, condition, topic.name if len(topics) > 1 else "") for topic in topics]
        for printer, message in zip(printers, messages, strict=True):
            printer.prepare(message)
        streams = [_Stream(*each) for each in zip(topics, subscriptions, printers, strict=True)]
        return _print(options, found, streams)


def _event_texts(path: str) -> EventTexts:
    """Return the texts of events in a file. Raises InputError."""
    check_reading("R102")
    from msggen.recordings.decode.event_metadata import EventMetadataError
    from msggen.recordings.log.event_texts import event_texts

    try:
        with read_errors(path):
            return event_texts(path)
    except EventMetadataError as error:
        raise input_error(path, "R102", f"the metadata of events {error}", 0) from None


def _read_words(options: argparse.Namespace) -> None:
    """Take a condition behind a topic for that of --filter. Refuse options that exclude each other."""
    options.filter_name = "--filter"
    conditions = [word for word in options.topics[1:] if _CONDITION.search(word)]
    options.topics = [word if word in conditions else _topic_in(options, word) for word in options.topics]
    if conditions and (options.filter or len(options.topics) > 2):  # noqa: PLR2004 - a topic and a condition
        refuse(options, f"argument TOPIC: '{conditions[0]}' is a condition: write it once, as --filter CONDITION")
    if conditions:
        options.filter, options.filter_name = options.topics.pop(), "FILTER"
    if options.csv and len(options.topics) > 1:
        refuse(options, "argument --csv: only with one topic, as topics have different columns: use --json")
    if options.events and (options.csv or options.json):
        refuse(options, "argument --events: not allowed with --json and --csv, which have the fields alone")
    if options.quote_formulas and not options.csv:
        refuse(options, "argument --quote-formulas: only with --csv")
    if options.once:
        if options.count:
            refuse(options, "argument --once: not allowed with argument -n/--count")
        options.count = 1


def _topic_in(options: argparse.Namespace, word: str) -> str:
    """Return the topic in a word, and take a field behind it, as in TOPIC.FIELD, for one of --field."""
    topic, _, field = word.partition(".")
    options.field = [*options.field, *([field] if field else [])]
    return topic


def _check(options: argparse.Namespace, condition: Condition | None, package: ModuleType) -> None:
    """Refuse names of topics and fields that a package does not have."""
    topics = [named(options, text, "out", package) for text in options.topics]
    messages = [topic.message for topic in topics if topic.message]
    check_fields(options, messages)
    for message in messages:
        Printer(options, condition).prepare(message)


def _check_known(options: argparse.Namespace, found: Connection, topics: Sequence[Named]) -> None:
    """Refuse topics whose definition is not known."""
    for topic in topics:
        if topic.message is None:
            text = f"{found.label} has no definition of '{topic.name}'"
            refuse(options, f"argument TOPIC: {text}: name the vehicle's firmware, --px4 PX4-Autopilot")


def _confirmed(found: Connection, topic: Named) -> Named:
    """Return a topic with the vehicle's definition, which is waited for: no message of another one is printed."""
    from msggen.link.link import LinkError

    deadline = time.monotonic() + _PATIENCE
    with suppress(LinkError):
        while topic.route is not None and time.monotonic() < deadline:
            firmware = found.vehicle.firmware
            if firmware.is_complete or topic.route.ros_type in firmware.hashes:
                break
            time.sleep(_PERIOD / 5)
        return found.fitting(topic)
    return topic


class _Stream:
    """The samples of a topic, and what prints them."""

    def __init__(self, topic: Named, samples: Subscription[Any], printer: Printer) -> None:
        self.topic, self.samples, self.printer = topic, samples, printer
        self._is_told = False

    def arrived(self) -> Iterator[tuple[int, Any]]:
        """Yield the times and messages that have arrived. Raises FormatError."""
        for message, arrival in self.samples.arrived():
            yield arrival, message

    def take_last(self) -> None:
        """Print the last message from before this command, if the process that owns the link has it."""
        last = self.samples.last()
        if last is not None:
            self.printer.take(*last)

    def tell_silence(self) -> None:
        """Say once that no sample has arrived."""
        if not (self._is_told or self.samples.received):
            self._is_told = True
            print(f"waiting for a sample of {self.topic.name}{_absence(self.topic)}", file=sys.stderr, flush=True)


def _print(options: argparse.Namespace, found: Connection, streams: Sequence[_Stream]) -> int:
    """Print messages until the end, and return the exit code."""
    with watching(), format_errors(options):
        _follow(options, found, streams)
    for stream in streams:
        for text in stream.printer.summary(stream.samples):
            print(text, file=sys.stderr)
    return FINDINGS if options.seconds and options.count and not _are_done(streams) else DONE


def _follow(options: argparse.Namespace, found: Connection, streams: Sequence[_Stream]) -> None:
    """Print what arrives until all is printed, or the time is over. Raises FormatError."""
    if options.count == 1:
        for stream in streams:
            stream.take_last()
    if _are_done(streams):
        return
    for number, _ in enumerate(rounds(options.seconds, found.vehicle, _PERIOD)):
        _print_arrived(streams)
        if _are_done(streams):
            return
        if number * _PERIOD > _NOTICE:
            for stream in streams:
                stream.tell_silence()


def _are_done(streams: Sequence[_Stream]) -> bool:
    return all(stream.printer.is_done for stream in streams)


def _print_arrived(streams: Sequence[_Stream]) -> None:
    """Print what has arrived of all topics, by the time of arrival. Raises FormatError."""
    if len(streams) == 1:
        (stream,) = streams
        for arrival, message in stream.arrived():
            stream.printer.take(message, arrival)
            if stream.printer.is_done:
                return
        return
    rows = [(arrival, index, message) for index, each in enumerate(streams) for arrival, message in each.arrived()]
    for arrival, index, message in sorted(rows, key=lambda row: row[:2]):
        if not streams[index].printer.is_done:
            streams[index].printer.take(message, arrival)


def _absence(topic: Named) -> str:
    if topic.route is None:
        return ", which the vehicle does not have"
    return ", which programs on this link publish to PX4" if topic.direction == "in" else ""
