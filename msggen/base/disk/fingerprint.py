"""The fingerprint of the last build of a package. If it matches, the next build has nothing to do.

It is in `.msggen_cache`, which git ignores: it changes with every input, so it would conflict in every merge. A package
without it, such as a fresh clone, is rendered once and compared with the files on disk.
"""

import json
import os
from contextlib import suppress
from typing import NamedTuple

from msggen.base.diagnostics import InputError
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.record import Record, digest, digest_of
from msggen.base.disk.staging import write_if_changed

CACHE = ".msggen_cache"
_NAME = "fingerprint.json"


class Fingerprint(NamedTuple):
    """The inputs and outputs of a build, as digests, and its summary.

    If `has_warnings` is set, the next build reads the definitions again to repeat the warnings.
    """

    inputs: str
    outputs: str
    summary: str
    has_warnings: bool = False

    def matches(self, folder: str, record: Record, inputs: str) -> bool:
        """Whether `folder` has the files of `record` unchanged, and they were built from `inputs`.

        The record itself must match too: it differs after a merge, and after a kill while files were being replaced.
        """
        if (self.inputs, self.outputs) != (inputs, digest_record(record)):
            return False
        return all(digest_of(folder, name) == expected for name, expected in record.files.items())


NO_FINGERPRINT = Fingerprint("", "", "")


def digest_record(record: Record) -> str:
    """Return one digest for all files of a record."""
    return digest(json.dumps(sorted(record.files.items())).encode())


def read_fingerprint(folder: str) -> Fingerprint:
    """Return the fingerprint in `folder`, or NO_FINGERPRINT if it is missing or invalid."""
    try:
        stored = json.loads(read_bytes(os.path.join(folder, CACHE, _NAME), follow=False))
        inputs, outputs, summary = (str(stored[key]) for key in ("inputs", "outputs", "summary"))
        return Fingerprint(inputs, outputs, summary, stored["has_warnings"] is True)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return NO_FINGERPRINT


def write_fingerprint(folder: str, fingerprint: Fingerprint) -> None:
    """Write the fingerprint into `folder`, or do nothing if this is not possible, as in a read-only folder."""
    cache = os.path.join(folder, CACHE)
    if os.path.islink(cache):
        return
    with suppress(OSError, InputError):
        write_if_changed(os.path.join(cache, ".gitignore"), "*\n", flushed=False)
        text = json.dumps(fingerprint._asdict(), indent=1) + "\n"
        write_if_changed(os.path.join(cache, _NAME), text, flushed=False)
