"""What `msggen topic echo` prints: messages that meet a condition, as text, JSON or CSV."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from msggen.base.diagnostics import counted
from msggen.base.foreign import Styled, escaped, safe_json
from msggen.cli.options import refuse

if TYPE_CHECKING:
    from msggen.messages.expression import Condition, ConditionError
    from msggen.messages.packages import Message
    from msggen.recordings.source.facts import Event
    from msggen.vehicle.subscription import Subscription


def condition_of(options: argparse.Namespace) -> Condition | None:
    """Return the parsed condition of the options, or None. Raises WrongArgumentError."""
    from msggen.messages.expression import Condition, ConditionError

    try:
        return Condition(options.filter) if options.filter else None
    except ConditionError as error:
        _refuse(options, error)


def check_fields(options: argparse.Namespace, messages: Sequence[type[Message]]) -> None:
    """Refuse a path of --field that none of the messages has."""
    for path in options.field:
        problems = [_problem(message, path) for message in messages]
        if all(problems):
            refuse(options, f"argument --field: {problems[0]}")


def _problem(message: type[Message], path: str) -> str:
    """Return why a message has no value at a path, or ""."""
    from msggen.messages.places import PlaceError, place_of

    try:
        place_of(message, path)
    except PlaceError as error:
        return str(error)
    return ""


def _refuse(options: argparse.Namespace, error: ConditionError) -> NoReturn:
    refuse(options, f"argument {options.filter_name}: column {error.column}: {error}")


def _said(event: Event) -> str:
    """Return a line with what an event says."""
    return f"# {event.level}: {escaped(event.text)}\n"


class Printer:
    """Prints messages that meet a condition, up to a number of them, and at most one in a time.

    `name` is that of the topic if there are several.
    """

    def __init__(self, options: argparse.Namespace, condition: Condition | None, name: str = "") -> None:
        self._options, self._condition, self._name = options, condition, name
        self._made: dict[type, tuple[Callable[[Any], bool] | None, Callable[[Any], str]]] = {}
        self._seen = self._printed = self._last = 0
        self._every = round((options.every or 0) * 1e9)

    @property
    def is_done(self) -> bool:
        """Whether the number of messages was printed."""
        return self._options.count is not None and self._printed >= self._options.count

    def prepare(self, message: type[Any]) -> tuple[Callable[[Any], bool] | None, Callable[[Any], str]]:
        """Return what to do with messages of a class. Raises WrongArgumentError for a wrong condition."""
        from msggen.messages.expression import ConditionError

        try:
            condition = self._condition.of(message) if self._condition else None
        except ConditionError as error:
            _refuse(self._options, error)
        self._made[message] = condition, self._writer(message)
        return self._made[message]

    def _writer(self, message: type[Any]) -> Callable[[Any], str]:
        """Return what makes the text of a message, with the name of its topic."""
        from msggen.messages.formats import csv_writer, json_writer, text_writer

        paths, front = self._paths(message), self._name
        if self._options.csv:
            return csv_writer(message, paths, quotes_formulas=self._options.quote_formulas)
        if self._options.json:
            write = json_writer(message, paths)
            head = safe_json(json.dumps(front))
            return (lambda each: f'{{"topic": {head}, "message": {write(each)}}}') if front else write
        write, start = text_writer(message, paths), f"# {escaped(front)}\n" if front else ""
        texts = self._options.event_texts
        if texts is None or message.__name__ != "Event":
            return lambda each: Styled(f"{start}{write(each)}\n---")
        return lambda each: Styled(f"{start}{_said(texts.event(each))}{write(each)}\n---")

    def _paths(self, message: type[Any]) -> list[str]:
        """Return the paths of --field that a message has."""
        return [path for path in self._options.field if not _problem(message, path)]

    def take(self, message: Any, arrival: int) -> None:
        """Print a message, if it is one to print."""
        self._seen += 1
        if self._every and arrival - self._last < self._every:
            return
        cls = type(message)
        condition, write = self._made.get(cls) or self.prepare(cls)
        if condition is None or condition(message):
            if self._options.csv and not self._printed:
                from msggen.messages.formats import csv_header

                print(csv_header(cls, self._paths(cls)))
            print(write(message))
            self._printed += 1
            self._last = arrival

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
        return [f"{self._name}: {text}" if self._name else text for text in told]
