"""The names of files and folders that the actions of `msggen log` write, and the formats that they name."""

from __future__ import annotations

import argparse
import os

from msggen.base.recording_formats import FORMATS, MCAP, PACKED
from msggen.cli.options import refuse
from msggen.recordings.files.paths import stem_of

_FORMATS = {
    ".csv": "csv",
    ".parquet": "parquet",
    ".arrow": "arrow",
    ".feather": "arrow",
    **{each.suffix: "rosbag2" for each in FORMATS.values() if each.storage},
}
"""The formats that are folders, by the suffixes of the files in them."""
_READ_ONLY = {each.suffix: each.name for each in FORMATS.values() if each.suffix not in _FORMATS}
SUFFIXES = (*_FORMATS, *_READ_ONLY, *PACKED)
"""The suffixes of files that a user may mean to write."""


def format_of(options: argparse.Namespace) -> str:
    """Return the format that `--format` or the suffix of the output names. One that does not fit ends the process."""
    output = options.output or ""
    stem, suffix = _split(output)
    if suffix == MCAP and options.format in (None, "mcap"):
        return "mcap"
    if suffix in _READ_ONLY:
        refuse(options, f"argument -o/--output: no {_READ_ONLY[suffix]} is written: --format mcap -o {stem}{MCAP}")
    if options.format == "mcap":
        check_mcap(options)
    elif suffix in SUFFIXES:
        named = options.format or _FORMATS.get(suffix, "parquet")
        refuse(options, f"argument -o/--output: a folder is written: --format {named} -o {stem}")
    return options.format or "parquet"


def default_target(path: str, format_: str) -> str:
    """Return the path of the output without `-o`: the name of the recording, in the current folder.

    Next to a recording that is a folder itself, it has the format behind it: `flight_parquet`.
    """
    stem = stem_of(path)
    if format_ == "mcap":
        return stem + MCAP
    return f"{stem}_{format_}" if os.path.isdir(path) and os.path.abspath(stem) == os.path.abspath(path) else stem


def check_mcap(options: argparse.Namespace) -> None:
    """End the process if the name of the output is that of another format than MCAP."""
    stem, suffix = _split(options.output or "")
    if suffix != MCAP and suffix in SUFFIXES:
        refuse(options, f"argument -o/--output: an MCAP file is written, not {suffix}: -o {stem}{MCAP}")


def check_folder(options: argparse.Namespace) -> None:
    """End the process if the name of the output is that of a file."""
    stem, suffix = _split(options.output or "")
    if suffix in SUFFIXES:
        refuse(options, f"argument -o/--output: a folder is written: -o {stem}")


def _split(path: str) -> tuple[str, str]:
    stem, suffix = os.path.splitext(path)
    return stem, suffix.lower()
