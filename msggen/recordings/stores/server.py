"""Servers of HTTP, whose files are read in ranges. A redirect is followed on the same host only.

obstore follows redirects to any address, and has no option against that.
"""

from __future__ import annotations

import re
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from http.client import HTTPException, IncompleteRead
from time import monotonic, sleep
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import quote, urljoin, urlsplit

from msggen.base.version import __version__
from msggen.recordings.stores import limits
from msggen.recordings.stores.connections import Connections, FailedError, authorization, origin_of
from msggen.recordings.stores.errors import (
    BROKEN,
    NO_RANGES,
    REDIRECTS,
    SILENT,
    StoreError,
    answer_error,
    store_error,
)

if TYPE_CHECKING:
    from datetime import datetime
    from http.client import HTTPResponse
    from urllib.parse import SplitResult


_MOVED = (301, 302, 303, 307, 308)
_PASSING = (408, 429, *range(500, 600))
"""The errors after which a request is tried again."""
_REDIRECTS = 10
"""The most redirects of a request."""
_LARGEST_ERROR = 4096
"""The bytes that are read of the body of an error."""
_LONGEST = 1000
"""The most characters of a version, and of the name of a host in an error."""
_SAFE = "/%:@!$&'()*+,;=~?[]"
"""The characters of an address, besides letters and digits, that are sent as they are."""
_RANGE = re.compile(r"bytes ([0-9]{1,19})-([0-9]{1,19})/([0-9]{1,19})")


class Stored(NamedTuple):
    """An object of a store, or a file of a server, as it was when it was looked at."""

    address: str
    size: int
    """In bytes."""
    tag: str | None = None
    """Its version (ETag), None if the server does not tell one."""
    modified: datetime | None = None

    def is_same(self, other: Stored) -> bool:
        """Whether an object that was looked at again has not changed, as far as the server tells."""
        own, found = (self.tag, other.tag) if self.tag and other.tag else (self.modified, other.modified)
        return self.size == other.size and own == found


class _Question(NamedTuple):
    """A request for the bytes from `start` to before `stop` of a file."""

    address: str
    headers: dict[str, str]
    start: int
    stop: int


class _Answer(NamedTuple):
    """An answer. `content` is a range of a file, or the start of what the server says of an error."""

    status: int
    location: str
    stored: Stored
    content: bytes


class Server:
    """The files of servers, by their addresses. Methods raise StoreError. Several threads can use an instance."""

    def __init__(self) -> None:
        self._connections = Connections()

    def get(self, address: str, start: int, stop: int, tag: str | None) -> tuple[Stored, bytes]:
        """Return a range of a file, as far as the file goes. Raises ChangedError if it is not of the version `tag`.

        A redirect is followed on the same host.
        """
        url = urlsplit(address)
        headers = {"User-Agent": f"msggen/{__version__}", "Range": f"bytes={start}-{stop - 1}"}
        headers |= authorization("Authorization", url) | ({"If-Match": tag} if tag else {})
        end = monotonic() + limits.LIMITS.total
        for _ in range(_REDIRECTS + 1):
            answer, tries = self._repeat(_Question(address, headers, start, stop), url)
            if answer.status == HTTPStatus.PARTIAL_CONTENT:
                return answer.stored, answer.content
            if answer.status == HTTPStatus.OK:
                raise store_error(address, NO_RANGES)
            if answer.status not in _MOVED:
                raise answer_error(answer.status, answer.content.decode(errors="replace"), address, tries)
            url = _redirected(address, url, answer.location)
            if monotonic() > end:
                raise store_error(address, SILENT)
        raise store_error(address, REDIRECTS)

    def _repeat(self, question: _Question, url: SplitResult) -> tuple[_Answer, int]:
        """Return the answer to a request, which is sent again if it fails, and how often it was sent."""
        end, tries = monotonic() + limits.LIMITS.retry, 0
        while True:
            tries += 1
            is_last = tries > limits.LIMITS.retries or monotonic() > end
            try:
                answer = self._send(question, url)
            except FailedError as error:
                if is_last:
                    raise store_error(question.address, str(error)) from None
            else:
                if is_last or answer.status not in _PASSING:
                    return answer, tries
            sleep(limits.LIMITS.backoff * 2 ** (tries - 1))

    def _send(self, question: _Question, url: SplitResult) -> _Answer:
        """Send a request once. Raises FailedError if it can be sent again."""
        target = quote(f"{url.path or '/'}?{url.query}" if url.query else url.path or "/", _SAFE)
        try:
            with self._connections.answer(origin_of(url), target, question.headers) as response:
                return _read(question, response)
        except StoreError:
            raise
        except TimeoutError:
            raise FailedError(SILENT) from None
        except (IncompleteRead, OSError):
            raise FailedError(BROKEN) from None
        except HTTPException:
            raise store_error(question.address, "what the server answers is not HTTP") from None


def _read(question: _Question, response: HTTPResponse) -> _Answer:
    """Return an answer with no more bytes than were asked for. Raises IncompleteRead if it has fewer."""
    size = 0
    if response.status == HTTPStatus.PARTIAL_CONTENT:
        size, count = _span(question, response.getheader("Content-Range", ""))
        content = response.read(count + 1)
        if len(content) > count:
            raise store_error(question.address, f"the server sent more bytes than the {count} that it told")
        if len(content) < count:
            raise IncompleteRead(content)
    else:
        content = b"" if response.status == HTTPStatus.OK else response.read(_LARGEST_ERROR)
    stored = Stored(question.address, size, *_version(response))
    return _Answer(response.status, response.getheader("Location", ""), stored, content)


def _span(question: _Question, text: str) -> tuple[int, int]:
    """Return the size of a file, and how many bytes an answer has, by the range that it tells."""
    found = _RANGE.fullmatch(text)
    first, last, size = map(int, found.groups()) if found else (0, 0, 0)
    if first != question.start or last + 1 != min(question.stop, size):
        raise store_error(question.address, "the server sent another range than the one that it was asked for")
    return size, last + 1 - first


def _version(response: HTTPResponse) -> tuple[str | None, datetime | None]:
    """Return the version of a file, and when it was modified, as far as an answer tells it."""
    tag = response.getheader("ETag", "").strip()
    try:
        modified = parsedate_to_datetime(response.getheader("Last-Modified", ""))
    except (TypeError, ValueError, OverflowError):  # what Python raises depends on its version
        modified = None
    return (tag if tag.isprintable() and len(tag) <= _LONGEST else "") or None, modified


def _redirected(address: str, url: SplitResult, location: str) -> SplitResult:
    """Return where a server redirects to. Raises StoreError if it is another server, or no address of one."""
    try:
        found = urlsplit(urljoin(url.geturl(), location))
        origin = origin_of(found)
    except ValueError:
        location = ""
    if not location:
        raise store_error(address, REDIRECTS)
    if not origin_of(url).leads_to(origin):
        place = f"{origin.scheme}://{origin.place[:_LONGEST]}"
        raise store_error(
            address, f"the server redirects to another one, {place}: name the address there if you trust it"
        )
    return found
