"""The pictures that commands draw with matplotlib, and write to files."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from msggen.base.disk.resources import resource
from msggen.cli.options import Group, add_value, check_parent, refuse, write_whole
from msggen.cli.packages import needing
from msggen.cli.printing import number_of_bytes
from msggen.cli.values import local_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_picture(group: Group, otherwise: str) -> None:
    """Add the option that names the file of a picture. `otherwise` is what happens without it."""
    text = f"file to write: .png, .svg or .pdf (default: {otherwise})"
    add_value(group, "-o, --output", "FILE", local_path, text)


def import_matplotlib(code: str, extra: str = "plot") -> None:
    """Import matplotlib. Raises InputError with this code if an extra is not installed.

    Stands in a folder of msggen without modules meanwhile if the current folder has a matplotlibrc. matplotlib reads
    it when it is imported, and with it would run LaTeX, listen on a port, import modules, or wait for a pipe.
    """
    with needing(extra, code), _elsewhere():
        import matplotlib as mpl
    del mpl


@contextmanager
def _elsewhere() -> Iterator[None]:
    if not os.path.lexists("matplotlibrc"):
        yield
        return
    here = os.getcwd()
    for name in {"MATPLOTLIBRC", "MPLCONFIGDIR"} & os.environ.keys():
        os.environ[name] = os.path.abspath(os.environ[name])
    os.chdir(resource("templates"))
    try:
        yield
    finally:
        os.chdir(here)


def check_picture(options: argparse.Namespace) -> None:
    """Report a name that is none of a picture, or a folder that there is not. A wrong name ends the process."""
    from msggen.recordings.log import plot

    if not options.output:
        return
    if _ending(options.output) not in plot.ENDINGS:
        known = ", ".join(f".{each}" for each in plot.ENDINGS)
        refuse(options, f"argument -o/--output: expected a name that ends in {known}, found '{options.output}'")
    check_parent(options.output)


def write_picture(options: argparse.Namespace, figure: Figure) -> None:
    """Write a figure to the file of the options. Raises InputError."""
    from msggen.recordings.log import plot

    picture = plot.render(figure, _ending(options.output))
    write_whole(options.output, picture)
    if not options.quiet:
        print(f"{options.output}: {number_of_bytes(len(picture))}")


def _ending(path: str) -> str:
    return os.path.splitext(path)[1].removeprefix(".").lower()
