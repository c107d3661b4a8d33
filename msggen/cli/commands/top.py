"""`msggen top`: a live table of the topics of a running vehicle."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import ENDED_CODES, Run, add_flag, add_shared, new_command
from msggen.cli.screen import can_draw, held_warnings
from msggen.cli.watching import add_window, watching
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.show.top.rows import Health, Row, Table
    from msggen.show.top.view import View
    from msggen.vehicle.meter import Meter

_REFRESH = 0.5
"""The time in s after which the table is drawn again."""


@new_command(
    "top",
    "show the rates, ages and values of all topics of a running vehicle",
    "Show all topics that a vehicle publishes: how often, against the limit in its dds_topics.yaml, "
    "how long ago, how large, and the last values of a selected one. Keys sort, filter, open a topic and pause; "
    "the last line lists them. Into a pipe, the table is printed once.",
    epilog=ENDED_CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_flag(parser, "--once", "measure, print the table once, and exit")
    add_shared(parser, "--json")
    add_window(parser)
    add_link(parser)
    return _top


def _top(options: argparse.Namespace) -> None:
    with connection(options) as found:
        from msggen.vehicle.meter import Meter

        meter = Meter(options.window)
        with found.vehicle.watch(meter):
            source = _Source(found, meter)
            if options.once or options.json or not can_draw():
                _print_once(source, options.window, is_json=options.json)
            else:
                with watching():
                    _run(source)


class _Source:
    """Makes tables of a vehicle, also while it is disconnected."""

    def __init__(self, found: Connection, meter: Meter) -> None:
        from msggen.show.top.rows import History, limits_of

        self._found, self._meter, self._history = found, meter, History()
        self._limits = limits_of(found.package)
        self._routes, self._namespace, self._lost = found.vehicle.routes, found.vehicle.remote.namespace, 0
        self.notices: Sequence[str] = ()

    def table(self) -> Table:
        """Return what is known now."""
        from msggen.link.link import NotConnectedError
        from msggen.show.top.rows import Table, rows_of

        vehicle, trouble = self._found.vehicle, ""
        try:
            self._routes, self._lost = vehicle.routes, vehicle.lost
        except NotConnectedError as error:
            trouble = str(error).partition(";")[0]
        now = time.time_ns()
        rows = rows_of(self._routes, self._meter.flows(now), self._limits, self._namespace, now)
        rows = self._history.add(rows, now)
        namespace = f"  /{self._namespace}" if self._namespace else ""
        label = f"{self._found.label}  {self._found.link}{namespace}"
        return Table(rows, label, trouble, self._lost, "".join(self.notices[-1:]), self._health(rows))

    def _health(self, rows: Sequence[Row]) -> Health:
        """Return the state of the vehicle, as its newest messages tell it."""
        from msggen.show.top.rows import BATTERY, STATUS, health_of

        newest = [self._newest(rows, stem) for stem in (STATUS, BATTERY)]
        return health_of(*newest)

    def _newest(self, rows: Sequence[Row], stem: str) -> Any:
        """Return the newest message of a topic, or None without one that can be decoded."""
        from msggen.link.link import LinkError
        from msggen.messages.names import is_topic

        for row in rows:
            if row.flow is not None and is_topic(row.topic, stem):
                with suppress(LinkError, ValueError):
                    return self._found.vehicle.decode(row.route, row.flow.payload)
        return None

    def values(self, row: Row) -> list[str]:
        """Return the newest message of a topic as lines, or why there are none."""
        from msggen.link.link import LinkError
        from msggen.messages.packages import package_of_class

        if row.flow is None:
            return ["no sample yet"]
        try:
            message = self._found.vehicle.decode(row.route, row.flow.payload)
        except (LinkError, ValueError) as error:
            return [str(error)]
        shown: str = package_of_class(type(message)).show(message)
        return shown.splitlines()


def _print_once(source: _Source, seconds: float, *, is_json: bool) -> None:
    """Measure, and print the table."""
    time.sleep(seconds)
    table = source.table()
    if is_json:
        from msggen.show.top.rows import as_document

        print(dump(as_document(table)))
        return
    from msggen.show.top.drawing import plain

    print(*plain(table), sep="\n")


def _run(source: _Source) -> None:
    """Show the table until a key ends it."""
    from rich.console import Console

    from msggen.show.top.drawing import ansi, page_of, screen
    from msggen.show.top.terminal import Terminal
    from msggen.show.top.view import View, press

    console = Console()
    view, table, due = View(), source.table(), 0.0
    with held_warnings() as source.notices, Terminal() as terminal:
        while not view.is_ended:
            now = time.monotonic()
            if now >= due:
                due = now + _REFRESH
                table = table if view.is_paused else source.table()
            width, height = terminal.size
            terminal.draw(ansi(console, screen(table, view, _values(source, view, table.rows), width, height), width))
            for key in terminal.keys(max(0.0, due - time.monotonic())):
                view = press(view, key, view.shown(table.rows), page_of(height))


def _values(source: _Source, view: View, rows: Sequence[Row]) -> list[str]:
    """Return the lines of the open topic, if one is open."""
    shown = view.shown(rows) if view.is_open else []
    return source.values(shown[view.selected(shown)]) if shown else []
