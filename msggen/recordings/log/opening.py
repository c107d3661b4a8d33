"""Recordings, opened by their path or from a file object."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, cast

from msggen.base.missing import RECORDINGS, installed_by

if TYPE_CHECKING:
    from msggen.recordings.definitions.lent import Definitions, Nearby
    from msggen.recordings.files.spooled import Readable
    from msggen.recordings.log.log import Log


def open(  # noqa: A001 - users write recordings.open
    path: str | os.PathLike[str] | Readable,
    definitions: Definitions | Nearby | list[Definitions | Nearby] | None = None,
    *,
    verify: bool = True,
    keep_damaged: bool = False,
) -> Log:
    """Return the recording at `path`: an MCAP file, a ULog, a db3 file or a folder of rosbag2.

    `path` can be the address of a recording in a store, such as "s3://bucket/flight.mcap", or on a server of HTTP, with
    the extra `stores`.

    `path` can also be a file object in binary mode, such as `io.BytesIO` or a pipe: what is left of it is copied to a
    temporary file, which `Log.close` removes. A file that was just opened is read by its name, and not copied.

    `definitions` are for topics that have none in the recording: a generated package, the folder of a ROS package such
    as "my_msgs=DIR", an embedded release such as "v1.17", what else `msggen.read` takes, or a list of them. Without
    them, those of the embedded release that fits best are used. `Log.notes` tells which.

    Chunks and attachments of MCAP are compared with their checksums when they are read. Those that differ are reported
    in `Log.problems` and left out; with `keep_damaged`, they are read all the same. `verify=False` does not compare
    them. Raises RecordingError, InputError for `definitions`, TypeError for a file in text mode, and OSError.
    """
    with installed_by(RECORDINGS):
        import numpy  # noqa: F401, ICN001
        import zstandard  # noqa: F401
    from msggen.base.disk.urls import shown_address
    from msggen.recordings.files.opening import open_sources
    from msggen.recordings.log.log import Log
    from msggen.recordings.source.source import Verification

    lender = None
    if definitions is not None:
        from msggen.recordings.definitions.lent import lender_of

        lender = lender_of(definitions)
    verification = Verification(verify, keep_damaged)
    place = _place_of(path)
    if place is not None:
        return Log(open_sources(place, verification), lender, shown_address(place))
    from msggen.recordings.files.spooled import name_of, open_stream

    file = cast("Readable", path)
    return Log(open_stream(file, name_of(file), verification), lender, name_of(file))


def _place_of(path: Any) -> str | None:
    """Return the path of a recording, None for a file object that has to be copied."""
    if isinstance(path, (str, os.PathLike)) or not hasattr(path, "read"):
        return os.fsdecode(path)
    from msggen.recordings.files.spooled import path_of

    return path_of(path)
