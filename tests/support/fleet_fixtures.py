"""Fixtures of tests of fleets in stores, which name this module in `pytest_plugins`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from support.fleet_logs import write_logs

if TYPE_CHECKING:
    from support.fleet_stores import Bucket


@pytest.fixture(scope="module")
def _shared() -> Iterator[Bucket]:
    from support.fleet_stores import bucket_of

    with pytest.MonkeyPatch.context() as patch, bucket_of(patch) as found:
        yield found


@pytest.fixture
def bucket(_shared: Bucket) -> Bucket:
    """A bucket that is empty and without faults, on a server that the tests of a file share."""
    _shared.load({})
    return _shared


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A folder with the recordings of `write_logs`."""
    return write_logs(tmp_path / "logs")
