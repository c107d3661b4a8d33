"""`msggen topic plot`: fields of a running vehicle over time."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from msggen.base.diagnostics import few
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled
from msggen.cli.commands.topic.naming import check_heard, format_errors, named
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import FAILED_CODES, Run, add_shared, add_value, new_command, refuse
from msggen.cli.packages import needing
from msggen.cli.pictures import add_picture, check_picture, import_matplotlib, write_picture
from msggen.cli.screen import can_draw, held_warnings
from msggen.cli.values import non_empty
from msggen.cli.watching import add_window, rounds, watching

if TYPE_CHECKING:
    from rich.text import Text

    from msggen.link.link import Route
    from msggen.messages.lookup import Named
    from msggen.show.plot.drawing import Plot
    from msggen.show.plot.fields import FieldPath, Number, Samples
    from msggen.vehicle.subscription import Subscription

_PERIOD = 0.25
"""The time in s after which the plot is drawn again,"""
_PAUSE = 10
"""or this many times that of a drawing, if that is longer: a large plot takes a tenth of a core, too."""
_QUEUE = 8192
"""The samples of a topic that wait for the next drawing at most."""
_SIZE = 80, 24
"""The columns and lines of a plot that is printed where there is no terminal."""


@new_command(
    "plot",
    "plot fields over time in the terminal, and to a file",
    "Plot fields over time in the terminal as their samples arrive: those of one unit share a panel, "
    "and values with names are bands. Space pauses; q or Ctrl-C ends it. Into a pipe, the plot is printed once, "
    "after the time of --for, or else of --window.",
    epilog=f"Exit codes: 0 done, or ended by Ctrl-C, 1 no samples of a field, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = "vehicle_local_position.z, vehicle_attitude.q, actuator_motors.control[0]; or a topic, with --field"
    add_value(parser, "fields", "FIELD", non_empty, text, nargs="+")
    add_shared(parser, "--field")
    add_picture(parser, "none; at the end, the plot of the last --window")
    add_window(parser, "plot", 30.0)
    add_shared(parser, "--for", "-q, --quiet")
    add_link(parser)
    return _plot


class _Field(NamedTuple):
    """A field of the command line, as the vehicle has it."""

    path: FieldPath
    topic: Named
    numbers: Sequence[Number]


def _plot(options: argparse.Namespace) -> int:
    _check_packages(options)
    paths = _paths(options)
    with connection(options, lambda package: _found(options, paths, package)) as found:
        fields = _found(options, paths, found.package, found.vehicle.routes)
        check_heard(options, found, [field.topic for field in fields], "FIELD")
        curves = _Curves(options, found, fields)
        is_drawn = can_draw()
        with watching():
            if is_drawn:
                _run(options, found, curves)
            else:
                for _ in rounds(options.seconds or options.window, found.vehicle, _PERIOD):
                    curves.take()
        return _finish(options, curves.plot(), is_drawn=is_drawn)


def _check_packages(options: argparse.Namespace) -> None:
    """Report packages that are missing, and a wrong name of a picture."""
    with needing("plot", "L111"):
        from msggen.show.plot import drawing
    del drawing
    if options.output:
        import_matplotlib("L111")
        check_picture(options)


# The fields


def _paths(options: argparse.Namespace) -> list[FieldPath]:
    """Return the paths of the options, each once. A wrong one ends the process."""
    from msggen.messages.places import PlaceError
    from msggen.show.plot.fields import parse_path

    topics = [word for word in options.fields if "." not in word]
    if options.field and not topics:
        refuse(options, "argument --field: name a topic without a field, or leave it out")
    texts = [
        text
        for word in options.fields
        for text in ([f"{word}.{field}" for field in options.field] if word in topics and options.field else [word])
    ]
    try:
        return [parse_path(text) for text in dict.fromkeys(texts)]
    except PlaceError as error:
        _refuse(options, error)


def _refuse(options: argparse.Namespace, error: Exception | str) -> NoReturn:
    refuse(options, f"argument FIELD: {error}")


def _found(
    options: argparse.Namespace, paths: Sequence[FieldPath], package: ModuleType, routes: Sequence[Route] = ()
) -> list[_Field]:
    """Return the fields that a package and a vehicle have. A wrong one ends the process."""
    from msggen.messages.places import PlaceError
    from msggen.show.plot.fields import numbers_of

    found = []
    for path in paths:
        topic = named(options, path.topic, "out", package, routes, "FIELD")
        if topic.message is None:
            _refuse(options, f"the types do not have '{topic.name}': name those of the firmware with --px4")
        try:
            found.append(_Field(path, topic, numbers_of(topic.message, path)))
        except PlaceError as error:
            _refuse(options, error)
    return found


class _Curves:
    """The fields with the samples of the window."""

    def __init__(self, options: argparse.Namespace, found: Connection, fields: Sequence[_Field]) -> None:
        from msggen.messages.names import stem_of
        from msggen.show.plot.fields import Samples

        self._options, self._window = options, options.window
        self._start = time.time_ns()
        by_topic: dict[str, dict[str, Number]] = {}
        for field in fields:
            front = stem_of(field.topic.name).rpartition("/")[2]
            numbers = {f"{front}.{number.path}": number for number in field.numbers}
            by_topic.setdefault(field.topic.name, {}).update(numbers)
        self._labels = {name: list(numbers) for name, numbers in by_topic.items()}
        self._samples: dict[str, tuple[Subscription[Any], Samples]] = {}
        with format_errors(options, "FIELD"):
            for name, numbers in by_topic.items():
                subscription, samples = found.vehicle.subscribe(name, queue=_QUEUE), Samples(numbers, options.window)
                self._samples[name] = subscription, samples
                last = subscription.last()  # from before the command, which tells a state that changes seldom
                if last is not None:
                    samples.add((last[1] - self._start) / 1e9, last[0])

    def take(self) -> None:
        """Add what has arrived. Raises LinkError. A vehicle of another definition ends the process."""
        with format_errors(self._options, "FIELD"):
            for subscription, samples in self._samples.values():
                for message, arrival in subscription.arrived():
                    samples.add((arrival - self._start) / 1e9, message)

    def plot(self) -> Plot:
        """Return what to draw now."""
        from msggen.show.plot.drawing import Plot

        now = (time.time_ns() - self._start) / 1e9
        low = max(0.0, now - self._window)
        found = [each for _, samples in self._samples.values() for each in samples.series(low, now)]
        silent = [
            label for name, (_, samples) in self._samples.items() if not len(samples) for label in self._labels[name]
        ]
        return Plot(found, low, max(now, low + _PERIOD), silent)


# Drawing


def _run(options: argparse.Namespace, found: Connection, curves: _Curves) -> None:
    """Draw again and again, until a key or the time of the options ends it."""
    from rich.console import Console

    from msggen.cli.watching import check_link
    from msggen.show.top.drawing import ansi
    from msggen.show.top.terminal import Terminal

    console, plot, is_paused = Console(), curves.plot(), False
    end = time.monotonic() + (options.seconds or math.inf)
    with held_warnings() as notices, Terminal() as terminal:
        while time.monotonic() < end:
            begin = time.monotonic()
            curves.take()
            plot = plot if is_paused else curves.plot()
            trouble = "" if found.vehicle.is_connected else "the vehicle has disconnected, waiting for it"
            if trouble:
                check_link(found.vehicle)
            width, height = terminal.size
            head = _head(found, "".join(notices[-1:]) or trouble, is_paused=is_paused)
            terminal.draw(ansi(console, _screen(head, plot, width, height, is_paused=is_paused), width))
            spent = time.monotonic() - begin
            due = min(begin + max(_PERIOD, _PAUSE * spent), end)
            for key in terminal.keys(max(0.0, due - time.monotonic())):
                if key in ("q", "ctrl-c"):
                    return
                is_paused ^= key in ("space", "p")


def _head(found: Connection, notice: str, *, is_paused: bool) -> list[Text]:
    """Return the lines above the plot."""
    from rich.text import Text

    from msggen.base.foreign import escaped

    title = Text.assemble(("msggen topic plot", "bold"), f"  {escaped(found.label)}  {escaped(found.link)}")
    if is_paused:
        title.append("  paused", "bold yellow")
    return [title, Text(escaped(notice), "bold red")] if notice else [title]


def _screen(head: Sequence[Text], plot: Plot, width: int, height: int, *, is_paused: bool) -> list[Text]:
    """Return the lines of the screen."""
    from rich.text import Text

    from msggen.show.plot.drawing import draw

    keys = Text.assemble(("q", "bold"), " quit   ", ("space", "bold"), " go on" if is_paused else " pause")
    keys.append("   time in s since the start", "dim")
    room = max(0, height - len(head) - 1)
    drawn = draw(plot, width, room)
    lines = [*head, *drawn, *[Text()] * (room - len(drawn)), keys]
    for line in (*head, keys):
        line.truncate(width, overflow="ellipsis")
    return lines[-height:]


def _finish(options: argparse.Namespace, plot: Plot, *, is_drawn: bool) -> int:
    """Print the last plot, or write it to the file of the options."""
    from msggen.show.plot.drawing import draw
    from msggen.show.top.drawing import ansi

    if options.output and plot.series:
        from msggen.recordings.log.plot import draw_panels

        write_picture(options, draw_panels(plot.series, "msggen topic plot", start=plot.low))
    if not options.output or is_drawn:
        from rich.console import Console

        console = Console(width=None if is_drawn else _SIZE[0])
        lines = draw(plot, console.width, (console.height if is_drawn else _SIZE[1]) - 1)
        print(Styled("\n".join(line.rstrip() for line in ansi(console, lines, console.width))))
    if plot.silent:
        print(f"there are no samples of {few(list(plot.silent))}", file=sys.stderr)
    return FINDINGS if plot.silent else DONE
