"""Where a fleet is: in a folder, or in an object store."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, TypeAlias

from msggen.base.disk.urls import is_address, is_in_store
from msggen.recordings.fleet.folder import Folder
from msggen.recordings.fleet.layout import topic_of

if TYPE_CHECKING:
    from msggen.recordings.fleet.stored import StoredFolder

    Storage: TypeAlias = Folder | StoredFolder


def storage_of(fleet: str) -> Storage:
    """Return the storage of a fleet. Raises StoreError, and ModuleNotFoundError without the extra, for a store."""
    if is_in_store(fleet):
        from msggen.recordings.fleet.stored import StoredFolder

        return StoredFolder(fleet)
    return Folder(fleet)


def files(fleet: str, topic: str) -> list[str]:
    """Return the paths or addresses of the files of a topic, sorted: those before a change of the fleet or after it.

    `topic` is the name of a folder in the fleet. Raises OSError.
    """
    storage = storage_of(fleet)
    places = [place for place in storage.files() if topic_of(place) == topic]
    return [f"{storage.path}/{each}" if storage.is_in_store else os.path.join(fleet, each) for each in places]


def absolute(path: str) -> str:
    """Return the absolute path of a folder, or an address without a slash at its end."""
    return path.rstrip("/") if is_address(path) else os.path.abspath(path)
