"""`msggen log plot`: fields of a recording over time, and pictures of what analysis finds in a flight."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import few, printable, suggestion
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.log.arguments import CODES, add_file, add_times, asked_time, check_times
from msggen.cli.commands.log.opening import opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.options import Run, add_shared, add_value, new_command, refuse
from msggen.cli.packages import needing
from msggen.cli.pictures import add_picture, check_picture, import_matplotlib, write_picture
from msggen.cli.values import non_empty
from msggen.recordings.files.paths import stem_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from msggen.recordings.log.log import Log
    from msggen.recordings.log.plot import Series

_WINDOWLESS = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")
"""The backends of matplotlib that cannot show a window."""


@new_command(
    "plot",
    "plot fields over time, step responses, spectra and others, to a file or in a window",
    "Plot fields of a recording over time: those of one unit share a panel, values with names are "
    "bands, and the flight modes are the background. Or one of: step-response, spectrum, spectrogram, actuators, "
    "thrust, innovations.",
    epilog=CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_file(parser)
    text = (
        "vehicle_local_position.z, vehicle_attitude.q, actuator_motors.control[0], 'sensor_gps[1].eph' of the "
        "second instance; or step-response; spectrum, spectrogram, with gyro, accel or topics of them; actuators; "
        "thrust; innovations"
    )
    add_value(parser, "fields", "FIELD", non_empty, text, nargs="+")
    add_picture(parser, "a window")
    add_times(parser)
    add_shared(parser, "-q, --quiet")
    return _plot


def _plot(options: argparse.Namespace) -> int:
    check_times(options)
    import_matplotlib("R102")
    with needing("plot", "R102"):
        import matplotlib as mpl

        from msggen.exports.pictures import PICTURES
        from msggen.recordings.log import plot
    check_picture(options)
    with opened(options, options.file) as log:
        if options.fields[0] in PICTURES:
            return _plot_kind(options, log)
        _check_kind(options, log)
        with busy_bar(options, f"reading {options.file}"):
            series, empty = _read(options, log)
        _check_window(options, mpl)
        if not options.quiet and any(plot.parse_path(log, path)[0].is_lent for path in options.fields):
            print_notes(options, log.notes)
        if empty:
            print(f"{options.file}: there are no samples of {few(empty)}{asked_time(options)}", file=sys.stderr)
        print_problems(options, log.problems)
        if series and options.output:
            write_picture(options, _drawn(options, log, series))
        elif series:
            _show(options, lambda figure: _drawn(options, log, series, figure))
        return FINDINGS if empty or log.problems else DONE


def _check_kind(options: argparse.Namespace, log: Log) -> None:
    """Report a word that is nearly the name of a picture."""
    from msggen.exports.pictures import PICTURES

    word = options.fields[0]
    near = suggestion(word, PICTURES)
    if near and "." not in word and word not in log:
        refuse(options, f"argument FIELD: expected TOPIC.FIELD or the name of a picture, found '{word}'{near}")


def _check_window(options: argparse.Namespace, mpl: Any) -> None:
    if not options.output and (not _has_display() or str(mpl.get_backend()).lower() in _WINDOWLESS):
        refuse(options, f"no window can be shown here: write a file, -o {stem_of(options.file)}.png")


def _plot_kind(options: argparse.Namespace, log: Log) -> int:
    """Plot what analysis finds."""
    import matplotlib as mpl

    from msggen.exports.pictures import PICTURES, Span, draw

    kind, *words = options.fields
    if words and not PICTURES[kind].takes_sources:
        refuse(options, f"argument FIELD: {kind} is a picture by itself: leave out {few(words)}")
    span = Span(options.start, options.stop)
    _check_window(options, mpl)
    texts: list[str] = []
    unsaid: list[str] = []

    def drawn(figure: Any = None) -> Any:
        made, *told = draw(log, kind, words, span, figure)
        texts[:], unsaid[:] = told
        return made

    with busy_bar(options, f"reading {options.file}"):
        figure = drawn()
    print_problems(options, log.problems)
    if figure is not None and options.output:
        write_picture(options, figure)
    if texts and not options.quiet:
        print(*texts, sep="\n")
    for text in unsaid:
        print(f"{options.file}: {text}", file=sys.stderr)
    if figure is not None and not options.output:
        _show(options, drawn)
    return FINDINGS if unsaid or log.problems else DONE


def _read(options: argparse.Namespace, log: Log) -> tuple[Sequence[Series], Sequence[str]]:
    """Return the fields that have samples, and the paths of the others. Raises RecordingError."""
    from msggen.recordings.log import plot

    try:
        return plot.read_series(log, options.fields, start=options.start, stop=options.stop), ()
    except plot.NoSamplesError as error:
        rest = [path for path in options.fields if path not in error.paths]
        return plot.read_series(log, rest, start=options.start, stop=options.stop), error.paths


def _has_display() -> bool:
    """Whether there is a screen, where the environment tells."""
    return sys.platform in ("win32", "darwin") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")))


def _show(options: argparse.Namespace, draw: Callable[[Any], Any]) -> None:
    from matplotlib import pyplot as plt

    draw(plt.figure(printable(os.path.basename(options.file))))
    plt.show()


def _drawn(options: argparse.Namespace, log: Log, series: Sequence[Series], figure: Any = None) -> Any:
    from msggen.recordings.log import plot

    return plot.draw_series(log, series, start=options.start, stop=options.stop, figure=figure)
