"""Tests of fleets in a store that fails: the next run finishes, and nothing is in part."""

from __future__ import annotations

import re
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from msggen.exports.fleet import update
from msggen.exports.fleet.records import FleetError
from msggen.recordings.stores.errors import StoreError
from support.examples import by_day
from support.fleet_logs import write_small
from support.fleet_recordings import rows_of
from support.fleet_stores import FAULTS, FLEET, Bucket, both
from support.object_server import hasten

pytest_plugins = ["support.fleet_fixtures"]
pytestmark = pytest.mark.timeout(600)


def a_change(bucket: Bucket, logs: Path, folder: Path) -> tuple[dict[str, bytes], int, Any]:
    """Change a fleet, and return the bucket before it, the number of requests that it takes, and all rows after it."""
    for number in range(2):
        write_small(logs / f"{number}.ulg", number)
    update(str(logs), FLEET)
    saved = bucket.save()
    write_small(logs / "1.ulg", 3)
    write_small(logs / "2.ulg", 2)
    shutil.copy(logs / "0.ulg", logs / "copy.ulg")
    bucket.server.begin()
    both(str(logs))
    return saved, len(bucket.server.requests), bucket.rows(folder)


def fails(fault: str, number: int, each: int, _: str, *, lasts: bool) -> str:
    return fault if (each >= number if lasts else each == number) else ""


@pytest.mark.slow
@by_day("step", [8, 1], 2)
def test_a_store_that_fails_at_any_request(
    bucket: Bucket, tmp_path: Path, step: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each request has one of the faults, which passes or lasts. To a store, a run that is killed is one that lasts."""
    logs = tmp_path / "small"
    saved, count, whole = a_change(bucket, logs, tmp_path / "whole")
    failures = []
    faults = [(fault, lasts) for fault in FAULTS for lasts in (True, False)]
    for index, number in enumerate(range(step - 1, count, step)):
        fault, lasts = faults[index % len(faults)]
        bucket.load(saved)
        bucket.server.begin(partial(fails, fault, number, lasts=lasts))
        with monkeypatch.context() as patched:
            hasten(patched, fault)
            try:
                both(str(logs))
            except (StoreError, FleetError) as error:
                failures.append((fault, error))
        bucket.server.begin()
        for key, data in bucket.save().items():
            assert not key.endswith(".parquet") or data[:4] == data[-4:] == b"PAR1", f"{key} is in part"
        both(str(logs))
        assert bucket.rows(tmp_path / f"copy-{number}") == whole, f"request {number}: {fault}"
        bucket.check_whole()
    for fault, failure in failures:
        assert isinstance(failure, StoreError), failure
        assert str(failure.filename).startswith("s3://bucket/fleets/own")
        assert re.search(FAULTS[fault], str(failure.strerror)), failure
    assert len(failures) >= 3


def test_a_store_of_recordings_that_fails_ends_the_run(bucket: Bucket, logs: Path, tmp_path: Path) -> None:
    """A recording that may not be read is listed, and the others are converted."""
    bucket.put(logs, "logs")
    bucket.server.begin(lambda _, request: "500" if "15_47" in request else "")
    with pytest.raises(StoreError, match=r"^s3://bucket/logs/2026-11-21/15_47_03.ulg: the server answers") as error:
        update("s3://bucket/logs", FLEET)
    assert error.value.is_lasting
    bucket.server.begin(lambda _, request: "403" if "15_47" in request else "")
    found = update("s3://bucket/logs", FLEET)
    assert [each.error for each in found.failed if "15_47" in each.path] == [
        "cannot be read: access is forbidden (403): these credentials may not do this"
    ]
    bucket.server.begin()
    assert len(update("s3://bucket/logs", FLEET).converted) == 1
    update(str(logs), str(tmp_path / "fleet"))
    assert bucket.rows(tmp_path / "copy") == rows_of(tmp_path / "fleet")
