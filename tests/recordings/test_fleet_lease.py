"""Tests of the lock of a fleet in a store: one run at a time, whatever was killed, and without clocks that agree."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from msggen.recordings.fleet import lease, update
from msggen.recordings.fleet.lease import Lease
from msggen.recordings.stores.errors import StoreError
from msggen.recordings.stores.store import Store
from support.fleet_recordings import rows_of
from support.fleet_stores import FLEET, Bucket, change
from support.object_server import object_server

pytest_plugins = ["support.fleet_fixtures"]
pytestmark = pytest.mark.timeout(600)


LOCK = "fleets/own/_msggen/run.txt"
CREDENTIALS = "AWS4-HMAC-SHA256 Credential=test/20261127/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=0"
OTHER = b"process 1 on other\nboot pid:[1] 1 1\n00\n"


def test_runs_at_once_take_turns(bucket: Bucket, logs: Path, tmp_path: Path) -> None:
    told: list[str] = []
    failed: list[BaseException] = []

    def work() -> None:
        try:
            update(str(logs), FLEET, waiting=told.append)
        except BaseException as error:  # noqa: BLE001 - raised below
            failed.append(error)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for each in threads:
        each.start()
    for each in threads:
        each.join(120)
    assert not failed, failed
    assert told
    assert all(each.startswith(f"process {os.getpid()} on ") for each in told)
    update(str(logs), str(tmp_path / "fleet"))
    assert bucket.rows(tmp_path / "copy") == rows_of(tmp_path / "fleet")
    bucket.check_whole()


@pytest.mark.parametrize("kind", ["moto behind the proxy", "server of files"])
def test_the_stores_of_tests_let_one_of_several_conditional_requests_win(bucket: Bucket, kind: str) -> None:
    with object_server() as server:
        url = bucket.proxy.url if kind.startswith("moto") else server.url
        for number in range(60):
            answers = at_once(6, partial(create, f"{url}/bucket/new-{number}"))
            assert sorted(status == 200 for status in answers) == [*[False] * 5, True], answers


def create(address: str) -> int:
    """Create an object, and return the status of the answer."""
    url = urlsplit(address)
    connection = HTTPConnection(url.netloc, timeout=30)
    try:
        connection.request("PUT", url.path, b"own", {"If-None-Match": "*", "Authorization": CREDENTIALS})
        return connection.getresponse().status
    finally:
        connection.close()


def at_once(count: int, work: Callable[[], int]) -> list[int]:
    """Return the results of threads that begin at the same moment."""
    barrier = threading.Barrier(count)
    interval = sys.getswitchinterval()

    def begin(_: int) -> int:
        barrier.wait(30)
        return work()

    sys.setswitchinterval(1e-6)  # the servers are threads of this process: let them stop between any two lines
    try:
        with ThreadPoolExecutor(count) as pool:
            return list(pool.map(begin, range(count)))
    finally:
        sys.setswitchinterval(interval)


def test_a_lock_of_another_machine_is_taken_when_it_is_not_renewed(
    bucket: Bucket, logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lease, "_LIFE", 0.5)
    update(str(logs), FLEET)
    bucket.client.put_object(Bucket="bucket", Key=LOCK, Body=OTHER)
    told: list[str] = []
    renewals = 0

    def renew() -> None:
        nonlocal renewals
        for number in range(10):
            renewals += 1
            bucket.client.put_object(Bucket="bucket", Key=LOCK, Body=OTHER + b"%d\n" % number)
            time.sleep(0.1)

    thread = threading.Thread(target=renew)
    thread.start()
    update(str(logs), FLEET, waiting=told.append)
    assert renewals == 10  # it waited as long as there were some
    thread.join()
    assert told == ["process 1 on other"]
    bucket.check_whole()


def test_a_run_that_has_lost_its_lock_writes_nothing(
    bucket: Bucket, logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    update(str(logs), FLEET)
    change(logs)
    monkeypatch.setattr(lease, "_TRUSTED", 0.0)  # as if the computer had slept
    before = bucket.save()

    def take(_: int, request: str) -> str:
        if "ledger.jsonl" in request and "GET" in request:
            bucket.client.put_object(Bucket="bucket", Key=LOCK, Body=OTHER)
        return ""

    bucket.proxy.begin(take)
    with pytest.raises(StoreError, match="another run has taken the lock: run the same command again"):
        update(str(logs), FLEET)
    after = bucket.save()
    assert after.pop(LOCK) == OTHER
    assert {key: data for key, data in after.items() if ".stage/" not in key} == before


@pytest.mark.skipif(not hasattr(time, "CLOCK_BOOTTIME"), reason="the clock of Linux that goes on in a sleep")
def test_a_lock_is_not_trusted_after_a_sleep_of_the_computer(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, slept = time.clock_gettime, {time.CLOCK_BOOTTIME: 100.0}  # time.monotonic stands still meanwhile
    own = Lease(Store(FLEET), f"{FLEET}/lock")
    with own.held(lambda _: None):
        bucket.client.put_object(Bucket="bucket", Key="fleets/own/lock", Body=OTHER)
        own.check()
        monkeypatch.setattr(time, "clock_gettime", lambda which: clock(which) + slept.get(which, 0.0))
        with pytest.raises(StoreError, match="another run has taken the lock"):
            own.check()
    assert bucket.save() == {"fleets/own/lock": OTHER}


def test_a_store_that_ignores_conditions_is_an_error(
    bucket: Bucket, logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Store, "create", Store.save)
    with pytest.raises(StoreError, match="If-None-Match"):
        update(str(logs), FLEET)
    assert not [key for key in bucket.names() if key.endswith((".parquet", "run.txt"))]


def test_a_lock_whose_answer_was_lost_is_held(bucket: Bucket) -> None:
    bucket.proxy.begin(lambda number, _: "lost" if number == 0 else "")
    with Lease(Store(FLEET), f"{FLEET}/lock").held(lambda _: pytest.fail("it waits for itself")):
        assert bucket.names() == ["fleets/own/lock"]
    assert not bucket.names()
