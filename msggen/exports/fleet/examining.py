"""What the flights in many recordings show: an object of JSON for each one, made in processes."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from msggen.analysis.document import document_of, examined
from msggen.base.disk.urls import is_address
from msggen.exports.fleet.batch import text_of
from msggen.exports.fleet.finding import Found, State, at_hand, checked, digest_of, find_recordings
from msggen.exports.fleet.layout import name_of
from msggen.exports.fleet.planning import digest_if_any, state_if_any
from msggen.exports.fleet.pools import results_of
from msggen.exports.fleet.records import Record, decoded, original_of
from msggen.exports.fleet.storage import absolute, storage_of

_KILLED = "the process that examined it was killed"


class Work(NamedTuple):
    """The recordings below a folder, and what is to be done."""

    found: int
    """How many there are."""
    known: int
    """How many of them were examined before, or have the contents of another one."""
    failed: Sequence[Found]
    """What cannot be read."""
    states: Mapping[str, State | None]
    """Those to examine: the size and the time of change of each, None if it cannot be read."""


def work_in(folder: str, lines: Sequence[Mapping[str, Any]]) -> Work:
    """Return what is to be done below a folder, or in the recordings of a fleet, after lines that there are already.

    Raises RecordingError if there is no recording, OSError, and StoreError.
    """
    found = checked(_recordings(absolute(folder)))
    states = {each.path: state_if_any(each) for each in found if not each.error}
    done = {(line["recording"], line.get("size"), line.get("changed")) for line in lines}
    waiting = {path: state for path, state in states.items() if (path, *(state or (None, None))) not in done}
    digests = {line.get("digest") for line in lines}
    sizes = Counter(state.size for state in waiting.values() if state)
    sizes.update({line.get("size", -1) for line in lines if "digest" in line})
    for path, state in [*waiting.items()]:
        if state and sizes[state.size] > 1:
            digest = digest_if_any(path)
            if digest and digest in digests:
                del waiting[path]
            digests.add(digest)
    failed = [each for each in found if each.error and (each.path, None, None) not in done]
    return Work(len(found), len(states) - len(waiting), failed, waiting)


def _recordings(folder: str) -> list[Found]:
    """Return the recordings below a folder, or those of a fleet: where they were."""
    content = storage_of(folder).read_list()
    if content is not None:
        records = ((_path_of(record), record) for record in decoded(content.data).records)
        return [Found(path, listed=record.paths.get(path)) for path, record in records]
    return list(find_recordings(folder))


def _path_of(record: Record) -> str:
    """Return where a recording is: in the folders that can be seen, or else where it was first."""
    return next((path for path in record.paths if not is_address(path) and os.path.lexists(path)), original_of(record))


def examine_all(work: Work, jobs: int) -> Iterator[dict[str, Any]]:
    """Examine recordings in some processes. Yield an object for each, as soon as it is done."""
    for each in work.failed:
        yield {"recording": each.path, "error": each.error}
    paths = [*work.states]
    killed = []
    results = ((path, examine(path)) for path in paths) if jobs == 1 else results_of(examine, paths, jobs)
    for path, made in results:
        if made is None:
            killed.append(path)
        else:
            yield _whole(work, path, made)
    for path, made in results_of(examine, killed, 1):  # alone: the others may have had the memory that it needs
        yield _whole(work, path, made or {"error": _KILLED})


def _whole(work: Work, path: str, made: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object with what tells that its recording has not changed."""
    state = work.states[path]
    return {"recording": path, **(state._asdict() if state else {}), **made}


def examine(path: str) -> dict[str, Any]:
    """Return what a flight shows as an object of JSON, or why the recording cannot be read."""
    from msggen.recordings.log import opening

    try:
        with at_hand(path) as (copy, _):
            digest = digest_of(copy)
            with opening.open(copy) as log:
                made = document_of(*examined(log))
        for key in ("notes", "problems"):
            made[key] = [each.replace(copy, path) for each in made[key]]
    except Exception as error:  # noqa: BLE001 - whatever is wrong with some recordings must not stop the others
        return {"error": text_of(error, path)}
    return {**made, "recording": path, "log": name_of(path, digest), "digest": digest}
