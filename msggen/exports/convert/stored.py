"""Recordings and tables that are written to a store: first to a temporary folder, then each file whole."""

from __future__ import annotations

import errno
import os
import tempfile
from contextlib import suppress
from typing import TYPE_CHECKING

from msggen.recordings.files.paths import METADATA
from msggen.recordings.stores.errors import StoreError
from msggen.recordings.stores.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable

    from msggen.exports.convert.selection import Converted


def write_stored(target: str, write: Callable[[str], Converted]) -> Converted:
    """Call `write` with a path for a file or folder, and put what it made to an address if that has samples.

    A store has no step that makes several objects visible: the files of a folder come one after the other,
    `metadata.yaml` as the last, and are deleted if one cannot be put. Raises FileExistsError, StoreError and OSError.
    """
    target = target.rstrip("/")
    store = Store(target)
    if store.has(target) or store.has_below(target):
        raise FileExistsError(errno.EEXIST, "there is such an object or folder already", target)
    with tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True) as folder:
        made = os.path.join(folder, target.rpartition("/")[2])
        written = write(made)
        if not written.rows:
            return written._replace(files=[])
        addresses = {path: _address(target, made, path) for path in sorted(written.files, key=_metadata_last)}
        _put(store, addresses)
        size = sum(map(os.path.getsize, addresses))
    return written._replace(files=[addresses[path] for path in written.files], size=size)


def _put(store: Store, addresses: dict[str, str]) -> None:
    done: list[str] = []
    try:
        for path, address in addresses.items():
            store.put(path, address)
            done.append(address)
    except BaseException:
        with suppress(StoreError):
            store.delete(done)
        raise


def _address(target: str, made: str, path: str) -> str:
    below = "" if path == made else "/" + os.path.relpath(path, made).replace(os.sep, "/")
    return target + below


def _metadata_last(path: str) -> tuple[bool, str]:
    return os.path.basename(path) == METADATA, path
