"""The depfile of a run: a Makefile rule that lists its inputs, for build systems."""

import os
import re
from collections.abc import Collection, Sequence

from msggen.base.diagnostics import InputError, input_error
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.staging import write_if_changed

_CONTROL = re.compile(r"[\0-\x1f\x7f]")
_RULE = re.compile(rb"(?:[^\n]*:(?: \\\n|\n?\Z)|\Z)")
"""The beginning of a rule that `rule` returned, or an empty file."""


def rule(target: str, inputs: Collection[str]) -> str:
    """Return a Makefile rule that makes `target`, the first of several outputs, depend on all `inputs`.

    The rule names only the first output, because Ninja rejects outputs that it does not know, such as a removed one.
    """
    return " \\\n ".join([f"{_escape(target)}:", *map(_escape, inputs)]) + "\n"


def check_depfile(path: str, inputs: Collection[str], outputs: Sequence[str]) -> None:
    """Raise InputError if the depfile `path` would replace anything but a depfile, or cannot list these paths.

    The depfile cannot be one of `outputs`, the files and folders that the run writes, or inside one or around one.
    """
    place = os.path.join(os.path.realpath(path), "")
    for output in outputs:
        other = os.path.join(os.path.realpath(output), "")
        if place.startswith(other) or other.startswith(place):
            raise _error(path, f"this overlaps with {output}, an output of this run: name another file")
    if os.path.lexists(path) and (not _is_depfile(path) or any(os.path.samefile(path, each) for each in inputs)):
        raise _error(path, "this exists and is not a depfile: remove it, or name another file")
    for each in (*outputs[:1], *inputs):
        if _CONTROL.search(each):
            raise _error(path, f"a depfile cannot list {each!r}: rename it, without control characters")


def write_depfile(path: str, inputs: Collection[str], target: str) -> None:
    """Write the depfile `path`, which `check_depfile` accepted, if it differs. Raises OSError."""
    write_if_changed(path, rule(target, inputs), flushed=False)


def _is_depfile(path: str) -> bool:
    """Whether this is a regular file, empty or with a rule as msggen writes it."""
    try:
        return bool(_RULE.match(read_bytes(path, follow=False)))
    except OSError:
        return False


def _escape(path: str) -> str:
    return path.replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")


def _error(path: str, text: str) -> InputError:
    return input_error(path, "S123", text, 0)
