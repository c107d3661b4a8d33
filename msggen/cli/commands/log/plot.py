"""`msggen log plot`: fields of a recording over time."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import few, printable
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.commands.log.arguments import CODES, add_file, add_times, asked_time, check_times
from msggen.cli.commands.log.opening import opened, print_notes, print_problems
from msggen.cli.commands.log.progress import busy_bar
from msggen.cli.options import Commands, add_command, add_shared, refuse
from msggen.cli.packages import needing
from msggen.cli.pictures import add_picture, check_picture, import_matplotlib, write_picture
from msggen.cli.values import non_empty
from msggen.recordings.files.paths import stem_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from msggen.recordings.log.log import Log
    from msggen.recordings.log.plot import Series

_WINDOWLESS = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")
"""The backends of matplotlib that cannot show a window."""


def add_to(actions: Commands) -> None:
    """Add the action to the command line."""
    parser = add_command(
        actions,
        "plot",
        _plot,
        help="plot fields over time, to a file or in a window",
        description="Plot fields of a recording over time: those of one unit share a panel, values with names are "
        "bands, and the flight modes are the background.",
        epilog=CODES,
    )
    add_file(parser)
    parser.add_argument(
        "fields",
        metavar="FIELD",
        nargs="+",
        type=non_empty,
        help="vehicle_local_position.z, vehicle_attitude.q, actuator_motors.control[0], 'sensor_gps[1].eph' of the "
        "second instance",
    )
    add_picture(parser, "a window")
    add_times(parser)
    add_shared(parser, "-q, --quiet")


def _plot(options: argparse.Namespace) -> int:
    check_times(options)
    import_matplotlib("R102")
    with needing("plot", "R102"):
        import matplotlib as mpl

        from msggen.recordings.log import plot
    check_picture(options)
    with opened(options, options.file) as log:
        with busy_bar(options, f"reading {options.file}"):
            series, empty = _read(options, log)
        if not options.output and (not _has_display() or str(mpl.get_backend()).lower() in _WINDOWLESS):
            refuse(options, f"no window can be shown here: write a file, -o {stem_of(options.file)}.png")
        if not options.quiet and any(plot.parse_path(log, path)[0].is_lent for path in options.fields):
            print_notes(options, log.notes)
        if empty:
            print(f"{options.file}: there are no samples of {few(empty)}{asked_time(options)}", file=sys.stderr)
        print_problems(options, log.problems)
        if series and options.output:
            write_picture(options, _drawn(options, log, series))
        elif series:
            _show(options, log, series)
        return FINDINGS if empty or log.problems else DONE


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


def _show(options: argparse.Namespace, log: Log, series: Sequence[Series]) -> None:
    from matplotlib import pyplot as plt

    _drawn(options, log, series, plt.figure(printable(os.path.basename(options.file))))
    plt.show()


def _drawn(options: argparse.Namespace, log: Log, series: Sequence[Series], figure: Any = None) -> Any:
    from msggen.recordings.log import plot

    return plot.draw_series(log, series, start=options.start, stop=options.stop, figure=figure)
