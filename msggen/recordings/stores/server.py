"""Servers of HTTP, whose files are read in ranges. A redirect is followed on the same host only.

obstore follows redirects to any address, and has no option against that.
"""

from __future__ import annotations

import re
from email.utils import parsedate_to_datetime
from http.client import HTTPException, IncompleteRead
from time import monotonic, sleep
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import quote, urljoin, urlsplit

from msggen.base.version import __version__
from msggen.recordings.stores.connections import Connections, UnreachableError, authorization, origin_of
from msggen.recordings.stores.errors import (
    BROKEN,
    NO_RANGES,
    REDIRECTS,
    SILENT,
    StoreError,
    answer_error,
    store_error,
    unreachable,
)

if TYPE_CHECKING:
    from datetime import datetime
    from http.client import HTTPResponse
    from urllib.parse import SplitResult

    from msggen.recordings.stores.limits import Limits

_OK, _PARTIAL = 200, 206
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
_LENGTH = re.compile("[0-9]{1,19}")


class Meta(NamedTuple):
    """What a server tells of a file: its size in bytes, its version (ETag), and when it was modified."""

    size: int
    tag: str | None
    modified: datetime | None


class _Question(NamedTuple):
    """A request for the bytes from `start` to before `stop` of a file, or for none."""

    address: str
    method: str
    headers: dict[str, str]
    start: int = 0
    stop: int = 0


class _Answer(NamedTuple):
    """An answer. `content` is a range of a file, or the start of what the server says of an error."""

    status: int
    location: str
    meta: Meta
    content: bytes


class _FailedError(Exception):
    """A try that failed, with its reason. Another one can succeed."""


class Server:
    """The files of servers, by their addresses. Methods raise StoreError. Several threads can use an instance."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._connections = Connections(limits)

    def get(self, address: str, start: int, stop: int, tag: str | None) -> tuple[Meta, bytes]:
        """Return a range of a file, as far as the file goes. Raises ChangedError if it is not of the version `tag`."""
        headers = {"Range": f"bytes={start}-{stop - 1}", **({"If-Match": tag} if tag else {})}
        answer = self._ask(_Question(address, "GET", headers, start, stop))
        return answer.meta, answer.content

    def head(self, address: str) -> Meta:
        """Return what the server tells of a file."""
        return self._ask(_Question(address, "HEAD", {})).meta

    def _ask(self, question: _Question) -> _Answer:
        """Return the answer to a request, also if the server redirects it."""
        url = urlsplit(question.address)
        question.headers["User-Agent"] = f"msggen/{__version__}"
        if url.username is not None:
            question.headers["Authorization"] = authorization(url)
        end = monotonic() + self._limits.total
        for _ in range(_REDIRECTS + 1):
            answer, tries = self._repeat(question, url)
            if answer.status not in _MOVED:
                return _checked(question, answer, tries)
            url = _redirected(question.address, url, answer.location)
            if monotonic() > end:
                raise store_error(question.address, SILENT)
        raise store_error(question.address, REDIRECTS)

    def _repeat(self, question: _Question, url: SplitResult) -> tuple[_Answer, int]:
        """Return the answer to a request, which is sent again if it fails, and how often it was sent."""
        end, tries = monotonic() + self._limits.retry, 0
        while True:
            tries += 1
            is_last = tries > self._limits.retries or monotonic() > end
            try:
                answer = self._send(question, url)
            except _FailedError as error:
                if is_last:
                    raise store_error(question.address, str(error)) from None
            else:
                if is_last or answer.status not in _PASSING:
                    return answer, tries
            sleep(self._limits.backoff * 2 ** (tries - 1))

    def _send(self, question: _Question, url: SplitResult) -> _Answer:
        """Send a request once. Raises _FailedError if it can be sent again."""
        target = quote(f"{url.path or '/'}?{url.query}" if url.query else url.path or "/", _SAFE)
        try:
            with self._connections.answer(origin_of(url), question.method, target, question.headers) as response:
                return _read(question, response)
        except StoreError:
            raise
        except UnreachableError as error:
            raise _FailedError(unreachable(str(error))) from None
        except TimeoutError:
            raise _FailedError(SILENT) from None
        except (IncompleteRead, OSError):
            raise _FailedError(BROKEN) from None
        except HTTPException:
            raise store_error(question.address, "what the server answers is not HTTP") from None


def _read(question: _Question, response: HTTPResponse) -> _Answer:
    """Return an answer with no more bytes than were asked for. Raises IncompleteRead if it has fewer."""
    status, length = response.status, response.getheader("Content-Length", "")
    tag, modified = _version(response)
    if (question.method, status) == ("GET", _PARTIAL):
        size, count = _span(question, response.getheader("Content-Range", ""))
        content = response.read(count + 1)
        if len(content) > count:
            raise store_error(question.address, f"the server sent more bytes than the {count} that it told")
        if len(content) < count:
            raise IncompleteRead(content)
    else:
        size = int(length) if _LENGTH.fullmatch(length) else 0
        content = b"" if status == _OK else response.read(_LARGEST_ERROR)
    return _Answer(status, response.getheader("Location", ""), Meta(size, tag, modified), content)


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


def _checked(question: _Question, answer: _Answer, tries: int) -> _Answer:
    """Return the answer to a request that was successful, or raise the error."""
    if answer.status == (_OK if question.method == "HEAD" else _PARTIAL):
        return answer
    if answer.status == _OK:
        raise store_error(question.address, NO_RANGES)
    raise answer_error(answer.status, answer.content.decode(errors="replace"), question.address, tries)


def _redirected(address: str, url: SplitResult, location: str) -> SplitResult:
    """Return where a server redirects to. Raises StoreError if it is another server, or no address of one."""
    try:
        found = urlsplit(urljoin(url.geturl(), location))
        origin = origin_of(found)
    except ValueError:
        raise store_error(address, REDIRECTS) from None
    if not location:
        raise store_error(address, REDIRECTS)
    if not origin_of(url).leads_to(origin):
        place = f"{origin.scheme}://{origin.place[:_LONGEST]}"
        raise store_error(
            address, f"the server redirects to another one, {place}: name the address there if you trust it"
        )
    return found
