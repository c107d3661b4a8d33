"""Errors of stores, in words for people."""

from __future__ import annotations

import errno
import re
from http import HTTPStatus
from typing import TYPE_CHECKING

from msggen.base.disk.urls import shown_address
from msggen.base.foreign import without_secrets

if TYPE_CHECKING:
    from typing_extensions import Self


class StoreError(OSError):
    """A store or a server that does not do what it was asked for.

    `filename` is the address without secrets, and `strerror` the reason.
    """

    def __new__(cls, number: int, reason: str, address: str) -> Self:
        """Make an error. The libraries of stores put whole addresses into their reasons."""
        return super().__new__(cls, number, without_secrets(reason), shown_address(address))

    @property
    def is_lasting(self) -> bool:
        """Whether other objects of the store cannot be read or written either, as if its server does not answer."""
        return self.errno == errno.EIO

    def __str__(self) -> str:
        """Return the address and the reason."""
        return f"{self.filename}: {self.strerror}"


class MissingError(StoreError, FileNotFoundError):
    """A store that does not have an object or a bucket."""


class NoObjectError(MissingError):
    """A bucket that does not have an object."""


class ChangedError(StoreError):
    """An object that is not the version that was asked for."""


class RangeError(StoreError):
    """A range behind the end of an object, as each range of an empty one is."""


BROKEN = "the connection broke off before the end of the answer"
SILENT = "the server does not answer in time"
REDIRECTS = "the server redirects without end, or to what is no address"
NO_RANGES = "the server does not send parts of files (HTTP Range): copy the file to this computer first"
UNREACHABLE = "no connection to the server"
_SAID = {
    "Range request not supported|non-partial response": NO_RANGES,
    "error following redirect": REDIRECTS,
    "redirect without LOCATION": "301",
    "precondition failure": "412",
    r"status code: (\d{3})": r"\1",
    "kind: Timeout": SILENT,
    r'(?s)kind: Connect.*message: "([^"]{1,200})"': rf"{UNREACHABLE}: \1",
    r'(?s)kind: Connect.*error: "([^"]{1,200})"': rf"{UNREACHABLE}: \1",
    "kind: Connect": UNREACHABLE,
    "kind: Interrupted|kind: Decode|error sending request": BROKEN,
    r"\A(?:Generic \w+ error: )?(.+)": r"\1",
}
"""What errors of obstore mean: the status of an answer, or a text. The first expression that is found tells it."""
_RETRIES = re.compile(r"after (\d+) retries")
_CODE = re.compile(r"<Code>(\w{1,60})</Code>")
"""The code of an error in the answer of a store."""
_REGION = re.compile(r"<Region>([a-z0-9-]{1,40})</Region>")
_REFUSED = {401: "unauthorized", 403: "forbidden"}


def store_error(address: str, reason: str) -> StoreError:
    """Return an error about an address."""
    return StoreError(errno.EIO, reason, address)


def changed_error(address: str) -> ChangedError:
    """Return the error about an object that was replaced in the meantime."""
    return ChangedError(errno.ESTALE, "the object changed while it was open: open it again", address)


def translated(error: Exception, address: str) -> StoreError:
    """Return the error for what obstore raised."""
    text = str(error)
    each = (found.expand(said) for expression, said in _SAID.items() if (found := re.search(expression, text)))
    said = "404" if isinstance(error, FileNotFoundError) else next(each, "").rstrip(".: ")
    if said.isdecimal():
        return answer_error(int(said), text, address, 1 + int(_found(_RETRIES, text) or 0))
    return store_error(address, said or "the store failed")


def answer_error(status: int, text: str, address: str, tries: int) -> StoreError:
    """Return the error for the status of an answer, after so many tries. `text` has what the server says of it."""
    code, region = _found(_CODE, text), _found(_REGION, text)
    told = f"{status} {code}".rstrip()
    if code == "NoSuchBucket":
        return MissingError(errno.ENOENT, "there is no such bucket", address)
    if status == HTTPStatus.NOT_FOUND and code != "NoSuchUpload":  # that of parts which are being written
        return NoObjectError(errno.ENOENT, "there is no such object", address)
    if status == HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
        return RangeError(errno.EINVAL, "the range is behind the end of the object", address)
    if status == HTTPStatus.PRECONDITION_FAILED:
        return changed_error(address)
    if region or status in (HTTPStatus.MOVED_PERMANENTLY, HTTPStatus.TEMPORARY_REDIRECT):
        reason = f"the bucket is in another region ({told}): set AWS_REGION{f'={region}' if region else ''}"
    elif status in _REFUSED:
        reason = f"access is {_REFUSED[status]} ({told}): these credentials may not do this"
    else:
        reason = f"the server answers with an error ({told})" + (f", {tries} times" if tries > 1 else "")
    return StoreError(errno.EACCES if status in _REFUSED else errno.EIO, reason, address)


def _found(expression: re.Pattern[str], text: str) -> str:
    found = expression.search(text)
    return found[1] if found else ""
