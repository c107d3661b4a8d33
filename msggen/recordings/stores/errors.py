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
    status = 301 if "redirect without LOCATION" in text else _status(text)
    if isinstance(error, FileNotFoundError):
        status = _NOT_FOUND
    elif "precondition failure" in text:
        status = _PRECONDITION
    said = next((reason for part, reason in _SAID.items() if part in text), "")
    if not status or said:
        return store_error(address, said or _reason(text))
    found = _RETRIES.search(text)
    return answer_error(status, text, address, int(found[1]) + 1 if found else 1)


def answer_error(status: int, text: str, address: str, tries: int) -> StoreError:
    """Return the error for the status of an answer, after so many tries. `text` has what the server says of it."""
    shown, code = shown_address(address), _code(text)
    if code == "NoSuchBucket":
        return MissingError(errno.ENOENT, "there is no such bucket", shown)
    if status == _NOT_FOUND and code != "NoSuchUpload":  # that of parts which are being written
        return NoObjectError(errno.ENOENT, "there is no such object", shown)
    if status == _UNSATISFIABLE:
        return RangeError(errno.EINVAL, "the range is behind the end of the object", shown)
    if status == _PRECONDITION:
        return changed_error(address)
    number = errno.EACCES if status in _REFUSED else errno.EIO
    return StoreError(number, _answered(status, text, tries), shown)


def unreachable(reason: str) -> str:
    """Return what is told of a server that takes no connection, with what the system says."""
    return "no connection to the server" + (f": {reason.rstrip('.')}" if reason else "")


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
_ENDED = ("kind: Interrupted", "kind: Decode", "error sending request")
BROKEN = "the connection broke off before the end of the answer"
SILENT = "the server does not answer in time"
REDIRECTS = "the server redirects without end, or to what is no address"
NO_RANGES = "the server does not send parts of files (HTTP Range): copy the file to this computer first"
_SAID = {
    "Range request not supported": NO_RANGES,
    "non-partial response": NO_RANGES,
    "error following redirect": REDIRECTS,
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
    """Return what is wrong in a line, if no server answered."""
    if "kind: Timeout" in text:
        return SILENT
    if "kind: Connect" in text:
        found = _SYSTEM.search(text) or re.search(r'error: "([^"]{1,200})"', text)
        return unreachable(found[1] if found else "")
    if any(each in text for each in _ENDED):
        return BROKEN
    return re.sub(r"^Generic \w+ error: ", "", text.partition("\n")[0]).rstrip(".: ") or "the store failed"


def _answered(status: int, text: str, tries: int) -> str:
    code = _code(text)
    told = f"{status} {code}" if code else str(status)
    region = _REGION.search(text)
    if region or status in (301, 307):
        return f"the bucket is in another region ({told}): set AWS_REGION{f'={region[1]}' if region else ''}"
    if status in _REFUSED:
        return f"access is {_REFUSED[status]} ({told}): these credentials may not do this"
    return f"the server answers with an error ({told})" + (f", {tries} times" if tries > 1 else "")
