"""The names of files and folders that the actions of `msggen log` write, and the formats that they name."""

from __future__ import annotations

import argparse
import os
import re

from msggen.base.diagnostics import either
from msggen.base.recording_formats import FORMATS, MCAP, PACKED
from msggen.cli.options import refuse
from msggen.exports.convert import TABLE_SUFFIXES
from msggen.recordings.files.paths import stem_of

STDIN = "-"
"""The name of a recording that comes through a pipe."""
_FOLDERS = {each.suffix: f"--format rosbag2 --storage {each.storage}" for each in FORMATS.values() if each.storage}
"""The options for folders, by the suffixes of the files in them."""
_READ_ONLY = {each.suffix: each.name for each in FORMATS.values() if each.suffix not in _FOLDERS}
SUFFIXES = (*TABLE_SUFFIXES, *_FOLDERS, *_READ_ONLY, *PACKED)
"""The suffixes of files that a user may mean to write."""
_OF_FILE = re.compile(r"\.[A-Za-z]\w*")
"""A suffix that names a format. That of `2026.11` does not."""


def format_of(options: argparse.Namespace) -> str:
    """Return the format that `--format` or the suffix of the output names. One that does not fit ends the process."""
    output, named = options.output or "", options.format
    stem, suffix = _split(output)
    if output == STDIN:
        refuse(options, "argument -o/--output: nothing is written to stdout; `msggen log show FILE TOPIC --csv` prints")
    if suffix == MCAP and named in (None, "mcap"):
        return "mcap"
    if suffix in _READ_ONLY:
        refuse(options, f"argument -o/--output: no {_READ_ONLY[suffix]} is written: --format mcap -o {stem}{MCAP}")
    if named == "mcap":
        check_mcap(options)
    elif suffix in PACKED:
        refuse(options, f"argument -o/--output: no compressed file is written: -o {stem}")
    elif suffix in TABLE_SUFFIXES:
        return _table_format(options, stem, suffix)
    elif suffix in _FOLDERS:
        words = f"--format {named}" if named else _FOLDERS[suffix]
        refuse(options, f"argument -o/--output: a folder is written: {words} -o {stem}")
    elif named is None and _OF_FILE.fullmatch(suffix):
        expected = either([*TABLE_SUFFIXES, MCAP])
        text = f"no {suffix} is written, expected {expected}; for a folder of this name, add --format"
        refuse(options, f"argument -o/--output: {text}")
    return named or "parquet"


def _table_format(options: argparse.Namespace, stem: str, suffix: str) -> str:
    """Return the format of a table in one file. Another one in the options ends the process."""
    own = TABLE_SUFFIXES[suffix]
    named = options.format or own
    if named != own:
        refuse(options, f"argument -o/--output: a folder is written: --format {named} -o {stem}")
    return own


def named_stem(options: argparse.Namespace) -> str:
    """Return the name of the recording without its suffixes, for outputs. That of stdin ends the process."""
    if options.file == STDIN:
        refuse(options, "argument -o/--output: needed, because a recording from stdin has no name")
    return stem_of(options.file)


def default_target(options: argparse.Namespace, format_: str) -> str:
    """Return the path of the output without `-o`: the name of the recording, in the current folder.

    Next to a recording that is a folder itself, it has the format behind it: `flight_parquet`.
    """
    stem, path = named_stem(options), options.file
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
