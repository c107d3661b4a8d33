"""A bucket with recordings and fleets, and what there is in it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.exports.fleet import compact, files, update
from support.fleet_logs import VEHICLES, flight
from support.fleet_recordings import rows_of
from support.object_server import ObjectServer, hasten, object_server, set_credentials

if TYPE_CHECKING:
    import pytest

FLEET = "s3://bucket/fleets/own"

FAULTS = {
    "500": r"the server answers with an error \(500\)",
    "lost": r"the server answers with an error \(500\)|the object changed|another run",
    "403": r"access is forbidden \(403\)",
    "507": r"the server answers with an error \(507\)",
    "half": r"the connection broke off before the end of the answer",
    "stall": r"the server does not answer in time",
}
"""What is told of faults."""


class Bucket(NamedTuple):
    """The bucket `bucket` of a server."""

    server: ObjectServer

    def save(self) -> dict[str, bytes]:
        """Return all objects by their names, in their order."""
        return {path.removeprefix("/bucket/"): data for path, data in sorted(self.server.files.items())}

    def load(self, saved: dict[str, bytes]) -> None:
        """Put everything as it was, without faults."""
        self.server.begin()
        self.server.files.clear()
        self.server.files.update({f"/bucket/{key}": data for key, data in saved.items()})

    def names(self, front: str = "") -> list[str]:
        """Return the names of objects."""
        return [key for key in self.save() if key.startswith(front)]

    def put(self, folder: Path, front: str) -> None:
        """Put the files of a folder."""
        own = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
        self.server.files.update({f"/bucket/{front}/{name}": path.read_bytes() for name, path in own.items()})

    def get(self, front: str, folder: Path) -> Path:
        """Copy objects to a folder."""
        for key in self.names(f"{front}/"):
            path = folder / key[len(front) + 1 :]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(self.server.files[f"/bucket/{key}"])
        return folder

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
def bucket_of(patch: pytest.MonkeyPatch) -> Iterator[Bucket]:
    """Run a server with an empty bucket, and let this process use it."""
    hasten(patch)
    with object_server() as server:
        set_credentials(patch, server.url)
        yield Bucket(server)
