"""What a run has to convert: recordings that are new, changed, or of which something is missing in the fleet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, NamedTuple

from msggen.base.disk.urls import is_address
from msggen.exports.fleet.batch import Task
from msggen.exports.fleet.finding import Found, State, digest_of, state_of

if TYPE_CHECKING:
    from msggen.exports.fleet.fleet import Fleet

_LARGEST, _SMALLEST = 64 << 20, 4 << 20
"""The bytes of recordings in a batch: a kill loses one, and each has a file of every topic."""
_SHARES = 16
"""How many batches there are at least, so that all processes have some, unless they are small."""
_MOST = 512
"""The recordings in a batch."""


class Plan(NamedTuple):
    """What a run has to do with the recordings that it has found."""

    states: Mapping[str, State | None]
    """Those that an earlier run has not converted, by path."""
    new: Sequence[str]
    """The paths of recordings that become part of the fleet at once."""
    replacing: Sequence[str]
    """Those whose files take the place of others, which are removed in the same step: at the end of the run."""
    names: Mapping[str, str]
    """The names that recordings have in the fleet already, by path."""
    copies: Mapping[str, str]
    """The digests of those with the contents of a recording that the fleet has, or of one of these, by path."""
    firsts: Mapping[str, str]
    """The paths of recordings to convert, by digest, if copies were looked for."""


def plan_of(found: Sequence[Found], fleet: Fleet) -> Plan:
    """Return what to do with the recordings that were found."""
    records = fleet.records.values()
    whole = [record for record in records if fleet.found.keys() >= {*record.files}]
    done = {(path, state) for record in whole for path, state in record.paths.items()}
    states = {each.path: state_if_any(each) for each in found}
    waiting = {path: state for path, state in states.items() if (path, state) not in done}
    digests = _digests(waiting, fleet)
    known, copied = {record.digest: record.log for record in records}, {record.digest for record in whole}
    owned = {path for record in records for path in record.paths}
    new, replacing = list[str](), list[str]()
    names, copies, firsts = dict[str, str](), dict[str, str](), dict[str, str]()
    for path in waiting:
        digest = digests.get(path, "")
        if digest and (digest in copied or digest in firsts):
            copies[path] = digest
            continue
        firsts[digest] = path
        if digest in known:
            names[path] = known[digest]
        (replacing if digest in known or path in owned else new).append(path)
    return Plan(waiting, new, replacing, names, copies, firsts)


def tasks_of(plan: Plan, paths: Sequence[str], fleet: Fleet) -> Iterator[Task]:
    """Yield the tasks for some of the recordings of a plan."""
    sizes = {path: state.size if (state := plan.states[path]) else 0 for path in paths}
    limit = min(max(sum(sizes.values()) // _SHARES, _SMALLEST), _LARGEST)
    batches, size = list[list[str]](), 0
    for path in paths:
        size += sizes[path]
        if not batches or size > limit or len(batches[-1]) >= _MOST:
            batches.append([])
            size = sizes[path]
        batches[-1].append(path)
    for batch in batches:
        names = {path: plan.names[path] for path in batch if path in plan.names}
        yield Task(tuple(batch), fleet.address, tuple(fleet.by), fleet.token(), names)


def _digests(states: Mapping[str, State | None], fleet: Fleet) -> dict[str, str]:
    """Return the digests of recordings that may be copies, by path: no other one has the size of the others."""
    sizes = Counter(state.size for state in states.values() if state is not None)
    known = {state.size for record in fleet.records.values() for state in record.paths.values()}
    paths = [
        path for path, state in states.items() if state is not None and (sizes[state.size] > 1 or state.size in known)
    ]
    with ThreadPoolExecutor() as threads:
        found = dict(zip(paths, threads.map(digest_if_any, paths), strict=True))
    return {path: digest for path, digest in found.items() if digest}


def digest_if_any(path: str) -> str:
    """Return the digest of a recording, "" if it cannot be read."""
    try:
        return digest_of(path)
    except OSError:  # its conversion, or its examination, tells it
        return ""


def state_if_any(found: Found) -> State | None:
    """Return the state of a recording, None if it cannot be read."""
    if is_address(found.path):
        return found.listed
    try:
        return state_of(found.path)
    except (OSError, ValueError):  # a record can have half a surrogate, which is in no path
        return None
