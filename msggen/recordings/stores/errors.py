"""Errors of stores, in words for people."""

from __future__ import annotations

import errno
import re
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


def store_error(address: str, reason: str) -> StoreError:
    """Return an error about an address."""
    return StoreError(errno.EIO, reason, shown_address(address))


def changed_error(address: str) -> ChangedError:
    """Return the error about an object that was replaced in the meantime."""
    return ChangedError(errno.ESTALE, "the object changed while it was open: open it again", shown_address(address))


def translated(error: Exception, address: str) -> StoreError:
    """Return the error for what obstore raised."""
    text = str(error)
    shown = shown_address(address)
    if _code(text) == "NoSuchBucket":
        return MissingError(errno.ENOENT, "there is no such bucket", shown)
    is_missing = isinstance(error, FileNotFoundError) or _status(text) == _NOT_FOUND
    if is_missing and _code(text) != "NoSuchUpload":  # that of parts which are being written
        return NoObjectError(errno.ENOENT, "there is no such object", shown)
    if _status(text) == _UNSATISFIABLE:
        return RangeError(errno.EINVAL, "the range is behind the end of the object", shown)
    if _status(text) == _PRECONDITION or "precondition failure" in text:
        return changed_error(address)
    number = errno.EACCES if _status(text) in _REFUSED else errno.EIO
    return StoreError(number, _reason(text), shown)


_NOT_FOUND = 404
_PRECONDITION = 412
_UNSATISFIABLE = 416
_REFUSED = {401: "unauthorized", 403: "forbidden"}
_STATUS = re.compile(r"status code: (\d{3})")
_CODE = re.compile(r"<Code>(\w{1,60})</Code>")
"""The code of an error in the answer of a store."""
_REGION = re.compile(r"<Region>([a-z0-9-]{1,40})</Region>")
_SYSTEM = re.compile(r'message: "([^"]{1,200})"')
"""What the system says of a connection."""
_BROKEN = ("kind: Interrupted", "kind: Decode", "error sending request")
_NO_RANGES = "the server does not send parts of files (HTTP Range): copy the file to this computer first"
_SAID = {
    "Range request not supported": _NO_RANGES,
    "non-partial response": _NO_RANGES,
    "error following redirect": "the server redirects without end, or to what is no address",
}
"""What parts of an error of obstore mean, whatever else is in it."""
_RETRIES = re.compile(r"after (\d+) retries")


def _status(text: str) -> int:
    """Return the status of HTTP that a server answered with, 0 if it did not answer."""
    found = _STATUS.search(text)
    return int(found[1]) if found else 0


def _code(text: str) -> str:
    found = _CODE.search(text)
    return found[1] if found else ""


def _reason(text: str) -> str:
    """Return what is wrong in a line."""
    said = next((reason for part, reason in _SAID.items() if part in text), "")
    if said:
        return said
    status = 301 if "redirect without LOCATION" in text else _status(text)
    if status:
        return _answered(status, text)
    if "kind: Timeout" in text:
        return "the server does not answer in time"
    if "kind: Connect" in text:
        found = _SYSTEM.search(text) or re.search(r'error: "([^"]{1,200})"', text)
        return "no connection to the server" + (f": {found[1].rstrip('.')}" if found else "")
    if any(each in text for each in _BROKEN):
        return "the connection broke off before the end of the answer"
    return re.sub(r"^Generic \w+ error: ", "", text.partition("\n")[0]).rstrip(".: ") or "the store failed"


def _answered(status: int, text: str) -> str:
    code = _code(text)
    told = f"{status} {code}" if code else str(status)
    region = _REGION.search(text)
    if region or status in (301, 307):
        return f"the bucket is in another region ({told}): set AWS_REGION{f'={region[1]}' if region else ''}"
    if status in _REFUSED:
        return f"access is {_REFUSED[status]} ({told}): these credentials may not do this"
    retries = _RETRIES.search(text)
    count = int(retries[1]) if retries else 0
    return f"the server answers with an error ({told})" + (f", {count + 1} times" if count else "")
