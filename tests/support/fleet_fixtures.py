"""Fixtures of tests of fleets in stores, which name this module in `pytest_plugins`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from support.fleet_logs import write_logs

if TYPE_CHECKING:
    from support.fleet_stores import Bucket


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A folder with the recordings of `write_logs`."""
    return write_logs(tmp_path / "logs")


@pytest.fixture(scope="module")
def fleet_server() -> Iterator[Bucket]:
    """A bucket behind a proxy, on a server that the tests of a file share."""
    from support.fleet_stores import bucket

    with pytest.MonkeyPatch.context() as patch, bucket(patch) as found:
        yield found


@pytest.fixture
def bucket(fleet_server: Bucket) -> Bucket:
    """The bucket, empty and without faults."""
    fleet_server.proxy.begin()
    fleet_server.clear()
    return fleet_server
