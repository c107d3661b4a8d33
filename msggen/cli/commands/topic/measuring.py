"""`msggen topic hz`, `bw` and `delay`."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from msggen.base.exit_codes import DONE
from msggen.base.foreign import Styled
from msggen.cli.commands.topic.naming import add_topics, heard, names_check
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import ENDED_CODES, Commands, Run, add_shared, new_command
from msggen.cli.printing import finite, number_of_bytes
from msggen.cli.table import YELLOW, Column, print_table
from msggen.cli.watching import add_limits, add_window, rounds, watching
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.link.link import Route
    from msggen.messages.packages import Message
    from msggen.vehicle.watch import Direction

_PERIOD = 1.0
_NOT_IN_SYNC = "not in sync"
_NO_RATE = "one sample"
_SILENT = "silent"


class _Rates:
    """What an action measures, and how it says so: `rows` for JSON, `cells` for a table, and `lines` of one topic."""

    heads: ClassVar[Sequence[str]] = ("topic", "rate", "min", "max", "std dev", "window")
    values: ClassVar[Mapping[str, str]] = {
        "rate": "rate",
        "min": "shortest",
        "max": "longest",
        "std_dev": "deviation",
        "window": "window",
    }
    """The values of a row, and the fields of Flow that have them."""

    def __init__(self, options: argparse.Namespace, _: Connection) -> None:
        from msggen.vehicle.meter import Meter

        self.watcher = self._meter = Meter(options.window)

    def rows(self, now: int) -> list[dict[str, Any]]:
        """Return an object for each topic that was heard. `now` is of `time.time_ns`."""
        return [
            {"topic": each.route.name, **{key: finite(getattr(each, name)) for key, name in self.values.items()}}
            for each in self._meter.flows(now)
            if each.window
        ]

    def cells(self, row: dict[str, Any]) -> list[str]:
        if row["rate"] is None:
            return _without_rate(self, row)
        times = [f"{row['min']:.3f}s", f"{row['max']:.3f}s", f"{row['std_dev']:.5f}s"]
        return [row["topic"], f"{row['rate']:.3f}", *times, str(row["window"])]

    def lines(self, row: dict[str, Any]) -> str:
        if row["rate"] is None:
            return _NO_RATE
        return f"average rate: {row['rate']:.3f}\n{_spread(row, 3)}"


class _Bandwidths(_Rates):
    heads = ("topic", "bandwidth", "mean", "min", "max", "window")
    values: ClassVar[Mapping[str, str]] = {
        "bandwidth": "bandwidth",
        "mean": "mean_size",
        "min": "smallest",
        "max": "largest",
        "window": "window",
    }

    def cells(self, row: dict[str, Any]) -> list[str]:
        if row["bandwidth"] is None:
            return _without_rate(self, row)
        sizes = [number_of_bytes(row[name]) for name in ("mean", "min", "max")]
        return [row["topic"], f"{number_of_bytes(row['bandwidth'])}/s", *sizes, str(row["window"])]

    def lines(self, row: dict[str, Any]) -> str:
        if row["bandwidth"] is None:
            return _NO_RATE
        sizes = " ".join(f"{name}: {number_of_bytes(row[name])}" for name in ("mean", "min", "max"))
        return f"{number_of_bytes(row['bandwidth'])}/s from {row['window']} messages\n\tMessage size {sizes}"


class _Delays:
    heads: ClassVar[Sequence[str]] = ("topic", "field", "delay", "min", "max", "std dev", "window")

    def __init__(self, options: argparse.Namespace, found: Connection) -> None:
        from msggen.messages.lookup import endpoint_at
        from msggen.vehicle.delay import Delays

        def message_of(route: Route) -> type[Message] | None:
            endpoint = endpoint_at(found.package, route.name)
            return None if endpoint is None else endpoint.message

        self.watcher = self._delays = Delays(message_of, options.window)

    def rows(self, now: int) -> list[dict[str, Any]]:
        return [
            {
                "topic": each.topic,
                "field": each.field,
                "delay": each.mean,
                "min": each.shortest,
                "max": each.longest,
                "std_dev": each.deviation,
                "window": each.window,
                "in_sync": each.is_in_sync,
            }
            for each in self._delays.delays(now)
        ]

    def cells(self, row: dict[str, Any]) -> list[str]:
        times = [f"{row[name]:.4f}s" for name in ("delay", "min", "max", "std_dev")]
        shown = times if row["in_sync"] else [_NOT_IN_SYNC, "", "", ""]
        return [row["topic"], row["field"], *shown, str(row["window"])]

    def lines(self, row: dict[str, Any]) -> str:
        of = "" if row["field"] == "timestamp" else f" of {row['field']}"
        if not row["in_sync"]:
            return f"average delay{of}: {_NOT_IN_SYNC}: the timestamps are not of this computer's time"
        return f"average delay{of}: {row['delay']:.4f}\n{_spread(row, 4)}"


_Measure: TypeAlias = _Rates | _Delays


def _without_rate(measure: _Measure, row: dict[str, Any]) -> list[str]:
    """Return the cells of a topic that was heard only once."""
    return [row["topic"], _NO_RATE, *[""] * (len(measure.heads) - 3), str(row["window"])]


def _spread(row: dict[str, Any], digits: int) -> str:
    shown = f"min: {row['min']:.{digits}f}s max: {row['max']:.{digits}f}s std dev: {row['std_dev']:.5f}s"
    return f"\t{shown} window: {row['window']}"


_ACTIONS: tuple[tuple[str, type[_Measure], str, str], ...] = (
    (
        "hz",
        _Rates,
        "measure how often topics are published",
        "Measure the rate of topics, and the time between two samples.",
    ),
    (
        "bw",
        _Bandwidths,
        "measure the bandwidth of topics",
        "Measure the bandwidth of topics, and the size of their samples.",
    ),
    (
        "delay",
        _Delays,
        "measure how old samples are when they arrive",
        (
            "Measure the time from the `timestamp` in samples, and their `timestamp_sample`, to their arrival. "
            "PX4 converts both to the time of this computer."
        ),
    ),
)


def add_to(actions: Commands) -> None:
    """Add the actions to `msggen topic`."""
    for name, measure, summary, description in _ACTIONS:
        new_command(name, summary, description, epilog=ENDED_CODES)(partial(_add, measure))(actions)


def _add(measure: type[_Measure], parser: argparse.ArgumentParser) -> Run:
    add_topics(parser)
    add_window(parser)
    add_limits(parser)
    add_shared(parser, "--json")
    add_link(parser)
    return partial(_measure, measure)


def _measure(kind: type[_Measure], options: argparse.Namespace) -> int:
    with connection(options, names_check(options, options.topics), needs_types=False) as found:
        topics = heard(options, found, options.topics)
        names = [topic.name for topic in topics]
        measure, chosen = kind(options, found), frozenset(names)

        def watch(route: Route, payload: bytes, arrival: int) -> None:
            if not chosen or route.name in chosen:
                measure.watcher(route, payload, arrival)

        direction: Direction = "both" if any(topic.direction == "in" for topic in topics) else "out"
        with found.vehicle.watch(watch, direction), watching():
            for number, _ in enumerate(rounds(options.seconds, found.vehicle, _PERIOD), 1):
                if number > 1 and len(names) != 1 and not options.json:
                    print()
                _report(options, measure, names)
                if number == options.count:
                    break
    return DONE


def _style(cell: str) -> int:
    return YELLOW if cell in (_SILENT, _NO_RATE, _NOT_IN_SYNC) else 0


def _report(options: argparse.Namespace, measure: _Measure, names: Sequence[str]) -> None:
    """Print what was measured, and which of the topics that the user has named are silent."""
    rows = sorted(measure.rows(time.time_ns()), key=lambda row: str(row["topic"]))
    heard = {row["topic"] for row in rows}
    silent = [name for name in names if name not in heard]
    if options.json:
        for each in [*rows, *({"topic": name, "window": 0} for name in silent)]:
            print(dump(each, indent=None))
    elif len(names) == 1:
        print(Styled("\n".join([measure.lines(row) for row in rows]) or "no new messages"))
    elif not rows and not silent:
        print("no new messages")
    else:
        blank = [""] * (len(measure.heads) - 2)
        cells = [*map(measure.cells, rows), *([name, _SILENT, *blank] for name in silent)]
        columns = [
            Column("", head, itemgetter(index), align=">" if index else "<", style=_style)
            for index, head in enumerate(measure.heads)
        ]
        print_table(columns, cells)
