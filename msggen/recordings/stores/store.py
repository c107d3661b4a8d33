"""Objects of a store by their addresses: read in ranges, written whole, listed and deleted.

Calls of obstore run in threads of their own, so that Ctrl-C does not wait for a server that stalls.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import islice
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, NamedTuple, TypeVar, cast

from msggen.base.disk.urls import scheme_of, shown_address
from msggen.recordings.stores.client import client_for, split
from msggen.recordings.stores.errors import (
    ChangedError,
    NoObjectError,
    RangeError,
    StoreError,
    changed_error,
    store_error,
    translated,
)
from msggen.recordings.stores.server import Server, Stored

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from obstore import GetOptions, ObjectMeta, PutMode, PutResult, UpdateVersion
    from obstore.store import ObjectStore

_REQUESTS = 8
"""The requests at a time."""
_PIECE = 4 << 20
"""The most bytes of a request."""
_ATOMIC = 64 << 20
"""The most bytes that are put in one request, which the store refuses if there is such an object."""
_PARTS = 4
"""The parts of a larger object that are sent at a time."""


class Content(NamedTuple):
    """A small object, and which version of it this is."""

    data: bytes
    version: UpdateVersion


class Store:
    """A bucket, or a server of HTTP. Methods raise StoreError, NoObjectError for an object that there is not.

    The constructor raises StoreError too, and ModuleNotFoundError without the extra. An instance can be used by several
    threads.
    """

    def __init__(self, address: str) -> None:
        self._place, _ = split(address)
        self._opened = client_for(self._place, address)

    def look(self, address: str, size: int = 1) -> tuple[Stored, bytes]:
        """Return an object, and its first bytes, as many as it has up to `size`. That is one request."""
        try:
            return result_of(lambda: self._get(address, 0, size))
        except RangeError:  # an empty object has no range
            return Stored(address, 0), b""

    def read(self, stored: Stored, start: int, stop: int) -> bytes:
        """Return a range of an object. Raises StoreError if it is another object by now."""
        tag = None if (stored.tag or "").startswith("W/") else stored.tag  # which never match
        found, data = self._get(stored.address, start, stop, tag)
        if not stored.is_same(found):
            raise changed_error(stored.address)
        if len(data) != stop - start:
            raise store_error(stored.address, f"the server sent {len(data)} of {stop - start} bytes")
        return data

    def _get(self, address: str, start: int, stop: int, tag: str | None = None) -> tuple[Stored, bytes]:
        """Return an object and a range of it, as far as it goes. Raises ChangedError if its version is another one."""
        key = self._key(address)
        if isinstance(self._opened, Server):
            return self._opened.get(address, start, stop, tag)
        import obstore

        with _translating(address):
            options: GetOptions = {"range": (start, stop)}
            if tag:
                options["if_match"] = tag
            found = obstore.get(self._client, key, options=options)
            return _stored(address, found.meta), bytes(found.bytes())

    def read_all(self, stored: Stored, ranges: Iterable[tuple[int, int]]) -> Iterator[tuple[int, bytes]]:
        """Yield the pieces of ranges, each with the offset at which it begins, in the order in which they arrive."""
        pieces = [(begin, min(begin + _PIECE, stop)) for start, stop in ranges for begin in range(start, stop, _PIECE)]
        yield from results_of(lambda piece: (piece[0], self.read(stored, *piece)), pieces, _REQUESTS)

    def put(self, path: str, address: str, *, is_new: bool = True) -> None:
        """Write a file to an object, of which others never see a part: to a new one, or over any that is there.

        Raises FileExistsError if `is_new` and there is such an object: for up to 64 MiB the store itself refuses it,
        otherwise it is looked for before. Raises StoreError for a server that is only read.
        """
        import obstore
        from obstore.exceptions import AlreadyExistsError

        key, is_large = self._key(address), os.path.getsize(path) > _ATOMIC
        if not key or key.endswith("/"):
            raise store_error(address, "expected the name of an object, found that of a folder")
        exists = FileExistsError(errno.EEXIST, "there is such an object already", shown_address(address))
        if is_new and is_large and self.has(address):
            raise exists
        mode: PutMode = "create" if is_new and not is_large else "overwrite"
        put = partial(obstore.put, self._client, key, mode=mode, use_multipart=is_large, max_concurrency=_PARTS)
        try:
            with _translating(address), open(path, "rb") as file:
                data = file if is_large else file.read()
                result_of(lambda: put(data))
        except AlreadyExistsError:
            raise exists from None

    def load(self, address: str) -> Content | None:
        """Return a small object, None if there is none of this name."""
        import obstore

        key = self._key(address)

        def load() -> Content:
            found = obstore.get(self._client, key)
            return Content(bytes(found.bytes()), _version(found.meta))

        try:
            with _translating(address):
                return result_of(load)
        except NoObjectError:
            return None

    def save(self, address: str, data: bytes, mode: PutMode = "overwrite") -> Content:
        """Write a small object whole: a new one, over any that is there, or only over one version of it.

        Raises ChangedError if there is such an object, or that version is not there any more.
        """
        import obstore
        from obstore.exceptions import AlreadyExistsError

        key = self._key(address)
        try:
            with _translating(address):
                done = result_of(lambda: obstore.put(self._client, key, data, mode=mode, use_multipart=False))
        except (AlreadyExistsError, ChangedError, NoObjectError) as error:
            if isinstance(error, NoObjectError) and isinstance(mode, str):
                raise
            found = self.load(address)
            if found is None or found.data != data:  # else an earlier try has written it, whose answer was lost
                raise changed_error(address) from None
            return found
        return Content(data, _version(done))

    def fetch(self, address: str, path: str) -> Stored:
        """Write an object to a new file. Return it. Raises ChangedError if it changes in the meantime, and OSError."""
        stored, front = self.look(address, _PIECE)
        with open(path, "xb") as file:
            file.write(front)
            for start, data in self.read_all(stored, [(len(front), stored.size)]):
                file.seek(start)
                file.write(data)
        return stored

    def has(self, address: str) -> bool:
        """Whether there is an object, as far as the credentials allow to look. Raises MissingError without bucket."""
        try:
            self.look(address)
        except NoObjectError:
            return False
        except StoreError as error:
            if error.errno == errno.EACCES:  # S3 forbids to read a missing object to those who may not list
                return False
            raise
        return True

    def has_below(self, address: str) -> bool:
        """Whether there is an object in a folder, as far as the credentials allow to look."""
        try:
            return next(self.below(address), None) is not None
        except StoreError as error:
            if error.errno == errno.EACCES:  # who may only write
                return False
            raise

    def folder(self, address: str) -> list[Stored]:
        """Return the objects directly in a folder: those whose names begin with its own and a slash."""
        import obstore

        prefix = self._prefix(address)
        with _translating(address):
            found = result_of(lambda: obstore.list_with_delimiter(self._client, prefix.rstrip("/") or None))
            return sorted(_stored(f"{self._place}/{each['path']}", each) for each in found["objects"])

    def below(self, address: str) -> Iterator[Stored]:
        """Yield the objects in a folder and its folders."""
        import obstore

        prefix = self._prefix(address)
        with _translating(address):
            pages = obstore.list(self._client, prefix.rstrip("/") or None)
            while page := result_of(lambda: next(pages, None)):
                for each in page:
                    yield _stored(f"{self._place}/{each['path']}", each)

    def delete(self, addresses: Sequence[str]) -> None:
        """Delete objects. Those that there are not are passed over."""
        import obstore

        keys = [self._key(address) for address in addresses]
        is_at_once = len(keys) > 1 and scheme_of(self._place) == "s3"
        for address, paths in [(addresses[0], keys)] if is_at_once else zip(addresses, keys, strict=True):
            with _translating(address), suppress(FileNotFoundError):
                result_of(partial(obstore.delete, self._client, paths))

    @property
    def _client(self) -> ObjectStore:
        """The client of a store. Raises StoreError for that of a server."""
        if isinstance(self._opened, Server):
            raise store_error(self._place, "a server of HTTP is only read")
        return self._opened

    def canonical(self, address: str) -> str:
        """Return the address of a folder as those of its objects begin."""
        return f"{self._place}/{self._key(address).strip('/')}".rstrip("/")

    def _key(self, address: str) -> str:
        place, key = split(address)
        if place != self._place:
            raise store_error(address, f"this is not in {shown_address(self._place)}")
        return key

    def _prefix(self, address: str) -> str:
        if scheme_of(address) in ("http", "https"):
            raise store_error(address, "a server of HTTP does not list files: name a file")
        return self._key(address)


def _stored(address: str, meta: ObjectMeta) -> Stored:
    return Stored(address, meta["size"], meta["e_tag"], meta["last_modified"])


def _version(found: ObjectMeta | PutResult) -> UpdateVersion:
    told: UpdateVersion = {}
    if found["e_tag"]:
        told["e_tag"] = found["e_tag"]
    if found["version"]:
        told["version"] = found["version"]
    return told


@contextmanager
def _translating(address: str) -> Iterator[None]:
    """Raise StoreError for the errors of obstore."""
    from obstore.exceptions import AlreadyExistsError, BaseError

    try:
        yield
    except (StoreError, FileExistsError, AlreadyExistsError):
        raise
    except (BaseError, FileNotFoundError, ValueError) as error:
        raise translated(error, address) from None


Item = TypeVar("Item")
Result = TypeVar("Result")


def results_of(work: Callable[[Item], Result], items: Sequence[Item], count: int) -> Iterator[Result]:
    """Yield what a function returns for items, as soon as it does. `count` is how many calls run, or wait, at a time.

    Raises the first error. The calls that run then go on alone: they end when the server answers, or not in time.
    """
    done: SimpleQueue[tuple[Result | None, BaseException | None]] = SimpleQueue()

    def run(item: Item) -> None:
        try:
            done.put((work(item), None))
        except BaseException as error:  # noqa: BLE001 - raised below
            done.put((None, error))

    def start(most: int) -> None:
        for item in islice(waiting, most):
            Thread(target=run, args=(item,), name="msggen store", daemon=True).start()

    waiting = iter(items)
    start(count)
    for _ in items:
        result, error = done.get()
        if error is not None:
            raise error
        yield cast("Result", result)
        start(1)


def result_of(call: Callable[[], Result]) -> Result:
    """Return what a function returns, or raise what it raises."""
    (found,) = results_of(lambda each: each(), [call], 1)
    return found
