"""A bucket behind a proxy, with recordings and fleets, and what there is in them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from botocore.session import Session

from msggen.exports.fleet import compact, files, update
from support.fleet_logs import VEHICLES, flight
from support.fleet_recordings import rows_of
from support.moto import moto_server
from support.object_server import hasten, set_credentials
from support.store_proxy import Proxy, store_proxy

if TYPE_CHECKING:
    import pytest

FLEET = "s3://bucket/fleets/own"


class Bucket(NamedTuple):
    """The bucket `bucket`: a client without the proxy, and the proxy."""

    client: Any
    proxy: Proxy

    def clear(self) -> None:
        """Remove everything."""
        for key in self.names():
            self.client.delete_object(Bucket="bucket", Key=key)

    def names(self, front: str = "") -> list[str]:
        """Return the names of objects."""
        pages = self.client.get_paginator("list_objects_v2").paginate(Bucket="bucket", Prefix=front)
        return [each["Key"] for page in pages for each in page.get("Contents", ())]

    def put(self, folder: Path, front: str) -> None:
        """Put the files of a folder."""
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                key = f"{front}/{path.relative_to(folder).as_posix()}"
                self.client.put_object(Bucket="bucket", Key=key, Body=path.read_bytes())

    def get(self, front: str, folder: Path) -> Path:
        """Copy objects to a folder."""
        for key in self.names(f"{front}/"):
            path = folder / key[len(front) + 1 :]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(self.client.get_object(Bucket="bucket", Key=key)["Body"].read())
        return folder

    def save(self) -> dict[str, bytes]:
        """Return everything."""
        return {key: self.client.get_object(Bucket="bucket", Key=key)["Body"].read() for key in self.names()}

    def load(self, saved: dict[str, bytes]) -> None:
        """Put everything as it was."""
        self.proxy.begin()
        self.clear()
        for key, data in saved.items():
            self.client.put_object(Bucket="bucket", Key=key, Body=data)

    def rows(self, folder: Path, fleet: str = FLEET) -> dict[str, list[dict[str, Any]]]:
        """Return all rows of a fleet, as an engine sees them that lists the files."""
        return rows_of(self.get(fleet.removeprefix("s3://bucket/"), folder))

    def check_whole(self, fleet: str = FLEET) -> None:
        """Check that a fleet has nothing but its files, and that they are listed."""
        front = fleet.removeprefix("s3://bucket/")
        names = [key[len(front) + 1 :] for key in self.names(f"{front}/")]
        assert {name for name in names if name.startswith("_")} == {"_logs.parquet", "_msggen/report.json"}
        assert files(fleet) == [f"{fleet}/{name}" for name in names if not name.startswith(("_", "mine"))]


def change(logs: Path) -> None:
    """Let one of the recordings of `write_logs` be new, one be changed, and one be a copy."""
    flight(7, VEHICLES[1], 0, is_new=True).write(logs / "later.ulg")
    flight(8, VEHICLES[0], 0, is_new=False).write(logs / "2026-11-20" / "10_31_40.ulg")
    shutil.copy(logs / "hangar" / "sess001.ulg", logs / "copy.ulg")


def both(source: str, fleet: str = FLEET) -> None:
    """Convert, and compact."""
    update(source, fleet)
    compact(fleet)


@contextmanager
def bucket(patch: pytest.MonkeyPatch) -> Iterator[Bucket]:
    """Run a server with an empty bucket, and let this process use it through a proxy."""
    from msggen.recordings.stores import limits

    hasten(patch)
    patch.setattr(limits, "LIMITS", limits.LIMITS._replace(read=5))
    with moto_server() as url, store_proxy(url) as proxy:
        set_credentials(patch, proxy.url)
        own = Session().create_client("s3", region_name="us-east-1", endpoint_url=url)
        own.create_bucket(Bucket="bucket")
        yield Bucket(own, proxy)
