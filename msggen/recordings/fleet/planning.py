"""What a run has to convert: recordings that are new, changed, or of which something is missing in the fleet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.fleet.batch import Task
from msggen.recordings.fleet.finding import digest_of, state_of
from msggen.recordings.fleet.layout import DIGITS
from msggen.recordings.fleet.listing import State

if TYPE_CHECKING:
    from msggen.recordings.fleet.ledger import Ledger
    from msggen.recordings.fleet.records import Record

_LARGEST, _SMALLEST = 64 << 20, 4 << 20
"""The bytes of recordings in a batch: a kill loses one, and each has a file of every topic."""
_SHARES = 16
"""How many batches there are at least, so that all processes have some, unless they are small."""
_MOST = 512
"""The recordings in a batch."""


class Copy(NamedTuple):
    """A recording with the contents of another one."""

    path: str
    state: State
    digest: str


class Plan(NamedTuple):
    """What a run has to do with the recordings that it has found."""

    unchanged: int
    new: Sequence[str]
    """The paths of recordings that become part of the fleet at once."""
    replacing: Sequence[str]
    """Those whose files take the place of others, which are removed in the same step: at the end of the run."""
    names: Mapping[str, str]
    """The names that recordings have in the fleet already, by path."""
    instead: Mapping[str, Sequence[int]]
    """The numbers of the records that they replace, by path."""
    copies: Sequence[Copy]
    """What has the contents of a recording that the fleet has, or of one of these."""
    firsts: Mapping[str, str]
    """The paths of recordings to convert, by digest, if copies were looked for."""
    sizes: Mapping[str, int]


def plan_of(paths: Sequence[str], ledger: Ledger) -> Plan:
    """Return what to do with the recordings that were found."""
    torn = ledger.missing()
    records = [record for record in ledger.records.values() if record.number not in torn]
    done = {(path, state) for record in records for path, state in record.paths.items()}
    states = {path: _state(path) for path in paths}
    waiting = {path: state for path, state in states.items() if (path, state) not in done}
    digests = _digests(waiting, ledger)
    by_digest = {record.digest: record for record in ledger.records.values() if record.digest}
    unknown = {record.log[-DIGITS:]: record for record in ledger.records.values() if not record.digest}
    owned = {path for record in ledger.records.values() for path in record.paths}
    names, instead, new, replacing = dict[str, str](), dict[str, list[int]](), list[str](), list[str]()
    copies: list[Copy] = []
    firsts: dict[str, str] = {}
    for path, state in waiting.items():
        digest = digests.get(path, "")
        earlier = [each for each in (by_digest.get(digest), unknown.get(digest[:DIGITS])) if each is not None]
        whole = [each for each in earlier if each.digest and each.number not in torn]
        if state is not None and digest and (whole or digest in firsts):
            copies.append(Copy(path, state, digest))
            continue
        firsts[digest] = path
        if earlier:
            names[path], instead[path] = earlier[0].log, [each.number for each in earlier]
        (replacing if earlier or path in owned else new).append(path)
    sizes = {path: state.size for path, state in waiting.items() if state is not None}
    return Plan(len(states) - len(waiting), new, replacing, names, instead, copies, firsts, sizes)


def tasks_of(plan: Plan, paths: Sequence[str], ledger: Ledger) -> Iterator[Task]:
    """Yield the tasks for some of the recordings of a plan."""
    total = sum(plan.sizes.get(path, 0) for path in paths)
    limit = min(max(total // _SHARES, _SMALLEST), _LARGEST)
    batch: list[str] = []
    size = 0
    for path in paths:
        if batch and (size + plan.sizes.get(path, 0) > limit or len(batch) >= _MOST):
            yield _task(plan, batch, ledger)
            batch, size = [], 0
        batch.append(path)
        size += plan.sizes.get(path, 0)
    if batch:
        yield _task(plan, batch, ledger)


def _task(plan: Plan, paths: Sequence[str], ledger: Ledger) -> Task:
    names = tuple((path, plan.names[path]) for path in paths if path in plan.names)
    return Task(tuple(paths), ledger.fleet, tuple(ledger.by), ledger.token(), names)


def _digests(states: Mapping[str, State | None], ledger: Ledger) -> dict[str, str]:
    """Return the digests of recordings that may be copies, by path: no other one has the size of the others."""
    sizes = Counter(state.size for state in states.values() if state is not None)
    known = {state.size for record in ledger.records.values() for state in record.paths.values()}
    is_known = all(record.digest for record in ledger.records.values())
    paths = [
        path
        for path, state in states.items()
        if state is not None and (sizes[state.size] > 1 or state.size in known or not is_known)
    ]
    with ThreadPoolExecutor() as threads:
        found = dict(zip(paths, threads.map(_digest, paths), strict=True))
    return {path: digest for path, digest in found.items() if digest}


def _digest(path: str) -> str:
    try:
        return digest_of(path)
    except OSError:  # its conversion tells it
        return ""


def _state(path: str) -> State | None:
    """Return the state of a recording, None if it cannot be read."""
    try:
        return state_of(path)
    except (OSError, ValueError):  # a record can have half a surrogate, which is in no path
        return None


def stale_paths(records: Sequence[Record]) -> dict[int, set[str]]:
    """Return the paths that records no longer have, by their numbers: another record has what is there now."""
    owners: dict[str, list[Record]] = {}
    for record in records:
        for path in record.paths:
            owners.setdefault(path, []).append(record)
    stale: dict[int, set[str]] = {}
    for path, found in owners.items():
        current = [each for each in found if len(found) > 1 and each.paths[path] == _state(path)]
        for each in found if current else ():
            if each is not current[0]:
                stale.setdefault(each.number, set()).add(path)
    return stale
