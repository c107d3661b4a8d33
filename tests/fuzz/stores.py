"""Fleets in a store that fails at a random request, and whose state is damaged, for `log convert` and `log compact`.

A run ends with 0, 1, or 2 and a named error. Afterwards the same commands finish: the fleet has all rows once, the list
of its files is right, and nothing else in the bucket has changed. A list that is damaged is an error, and is restored.
"""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from random import Random
from tempfile import mkdtemp
from typing import Any, NamedTuple

import pytest

from fuzz.conversions import NAMED
from support.commands import check_outcome, run
from support.fleet_logs import write_logs
from support.fleet_stores import FAULTS, FLEET, Bucket, both, bucket_of, change
from support.scratch import scratch_folder

COUNT = 12
MEMORY = 1 << 33
"""The servers are in this process, and each of their threads reserves addresses."""

_DAMAGED = ("_msggen/report.json", "_logs.parquet", "_logs.parquet")
_MINE = {"fleets/own/mine.txt": b"mine", "fleets/own2/battery_status/a.parquet": b"mine", "a.ulg": b"mine"}
"""Objects of others."""
_LIST = "fleets/own/_logs.parquet"


class Case(NamedTuple):
    """A fault, at which share of the requests, and what is damaged before."""

    fault: str
    moment: float
    lasts: bool
    damaged: str
    seed: int


class Start(NamedTuple):
    """A bucket, recordings, what is there before a run, its requests, and all rows afterwards."""

    bucket: Bucket
    logs: str
    saved: dict[str, bytes]
    requests: int
    rows: dict[str, list[dict[str, Any]]]


def case(chance: Random) -> Case:
    faults = ("", *(name for name in FAULTS if name != "stall"))
    damaged = chance.choice(("", "", *_DAMAGED))
    begin(is_changed=not damaged)  # before the time of the case begins
    return Case(chance.choice(faults), chance.random(), chance.random() < 0.5, damaged, chance.randrange(1 << 32))


def check(case: Case) -> None:
    start = begin(is_changed=not case.damaged)
    own, first = start.bucket, int(case.moment * start.requests)
    own.load(start.saved)
    if case.damaged:
        _damage(own, case.damaged, Random(case.seed))  # noqa: S311 - no secret
    own.server.begin(lambda each, _: case.fault if each == first or (case.lasts and each > first) else "")
    for words in (["convert", start.logs, "-o", FLEET, "--jobs", "1"], ["compact", FLEET]):
        outcome = run(["log", *words])
        check_outcome(outcome)
        assert outcome.code != 2 or (NAMED.search(outcome.stderr) and FLEET in outcome.stderr), outcome
    own.server.begin()
    if "_logs" in case.damaged:
        own.server.files[f"/bucket/{_LIST}"] = start.saved[_LIST]
    both(start.logs)
    with scratch_folder() as folder:
        assert own.rows(folder) == start.rows
    own.check_whole()
    found = own.save()
    assert all(found.get(key) == data for key, data in _MINE.items()), "objects of others have changed"


@cache
def begin(*, is_changed: bool) -> Start:
    """Make a fleet, and let recordings change then. Return what there is."""
    own = _bucket()
    own.load({})
    logs = write_logs(Path(mkdtemp()) / "logs")
    both(str(logs))
    saved = {**own.save(), **_MINE}
    if is_changed:
        change(logs)
    own.server.begin()
    both(str(logs))
    count = len(own.server.requests)
    return Start(own, str(logs), saved, count, own.rows(Path(mkdtemp())))


@cache
def _bucket() -> Bucket:
    end = ExitStack()
    atexit.register(end.close)
    patch = end.enter_context(pytest.MonkeyPatch.context())
    return end.enter_context(bucket_of(patch))


def _damage(own: Bucket, name: str, chance: Random) -> None:
    """Remove an object of the fleet, cut it, or replace it."""
    path = f"/bucket/fleets/own/{name}"
    data = own.server.files[path]
    content = chance.choice((None, b"", data[: chance.randrange(len(data))], b"\xff\0", b"[" * 100_000))
    if content is None:
        del own.server.files[path]
    else:
        own.server.files[path] = content
