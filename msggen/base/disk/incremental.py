"""An incremental update of a folder: if the fingerprint of the last update matches, there is nothing to do.

The fingerprint is in `.msggen_cache`, which git ignores: it changes with every input, so it would conflict in every
merge. A folder without it, such as a fresh clone, is rendered once and compared with the files on disk.
"""

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic, InputError, Level
from msggen.base.disk.output import OutputPlan, locked_output, plan_output, write_output
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.record import Record, digest, digest_of, read_record
from msggen.base.disk.staging import write_if_changed

CACHE = ".msggen_cache"
_NAME = "fingerprint.json"


class Outcome(NamedTuple):
    """The result of an update: a line about it, the sorted names of all files, and the plan, None if nothing changed.

    `notices` are those about the sources.
    """

    folder: str
    summary: str
    outputs: tuple[str, ...]
    plan: OutputPlan | None = None
    notices: tuple[Diagnostic, ...] = ()


class Incremental:
    """The update of `folder`, whose files are made from inputs with the digest `inputs`."""

    def __init__(self, folder: str, inputs: str) -> None:
        self.folder = folder
        self.inputs = inputs
        self._record = read_record(folder)
        self._last = _read_fingerprint(folder)
        self.has_warnings = self._last.has_warnings
        """Whether the last update had warnings: the next one reads the definitions again to repeat them."""

    def unchanged(self) -> Outcome | None:
        """Return the last outcome, without its notices, if its inputs and its files are unchanged, or None.

        The record itself must match too: it differs after a merge, and after a kill while files were being replaced.
        """
        if self._last[:2] != (self.inputs, _digest_record(self._record)):
            return None
        files = self._record.files
        if any(digest_of(self.folder, name) != expected for name, expected in files.items()):
            return None
        return Outcome(self.folder, self._last.summary, tuple(sorted(files)))

    def run(self, files: Mapping[str, str], summary: str, notices: tuple[Diagnostic, ...], *, write: bool) -> Outcome:
        """Make the folder contain `files`, texts by name. If `write` is false, only plan it.

        Raises InputError for files that msggen did not write, and OSError if the folder cannot be written.
        """
        if not write:
            plan = plan_output(self.folder, files, self._record)
        else:
            with locked_output(self.folder):
                plan, record = write_output(self.folder, files)
                has_warnings = bool(warnings_among(notices))
                fingerprint = _Fingerprint(self.inputs, _digest_record(record), summary, has_warnings)
                _write_fingerprint(self.folder, fingerprint)
        return Outcome(self.folder, summary, tuple(sorted(files)), plan, notices)


def warnings_among(notices: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the warnings, without the notes."""
    return tuple(each for each in notices if each.level is Level.WARNING)


class _Fingerprint(NamedTuple):
    """The inputs and outputs of an update, as digests, and its summary."""

    inputs: str
    outputs: str
    summary: str
    has_warnings: bool = False


def _digest_record(record: Record) -> str:
    return digest(json.dumps(sorted(record.files.items())).encode())


def _read_fingerprint(folder: str) -> _Fingerprint:
    """Return the fingerprint in `folder`, or an empty one if it is missing or invalid."""
    try:
        stored = json.loads(read_bytes(os.path.join(folder, CACHE, _NAME), follow=False))
        inputs, outputs, summary = (str(stored[key]) for key in ("inputs", "outputs", "summary"))
        return _Fingerprint(inputs, outputs, summary, stored["has_warnings"] is True)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return _Fingerprint("", "", "")


def _write_fingerprint(folder: str, fingerprint: _Fingerprint) -> None:
    """Write the fingerprint into `folder`, or do nothing if this is not possible, as in a read-only folder."""
    cache = os.path.join(folder, CACHE)
    if os.path.islink(cache):
        return
    with suppress(OSError, InputError):
        write_if_changed(os.path.join(cache, ".gitignore"), "*\n", flushed=False)
        text = json.dumps(fingerprint._asdict(), indent=1) + "\n"
        write_if_changed(os.path.join(cache, _NAME), text, flushed=False)
