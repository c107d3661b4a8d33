"""URLs in the place of paths: the name of a file in an object store, or the address of a server."""

from __future__ import annotations

import re

from msggen.base.diagnostics import input_error
from msggen.base.location import Location

_URL = re.compile(r"(?:\w+=)?([A-Za-z][A-Za-z0-9+.-]+)://")
"""The scheme at the beginning of a URL, also behind `PKG=`. A single letter is a drive of Windows."""
NO_URL = rf"^(?!{_URL.pattern})"
"""A regular expression, also of JSON Schema, for what is no URL."""
STORES = ("s3", "gs", "az")
"""The schemes of stores, which recordings are read from and written to."""
_SERVERS = ("https", "http")
"""The schemes of servers, which recordings are only read from."""
_CREDENTIALS = re.compile(r"(?<=://)[^/?#]*@|\?.*", re.DOTALL)
"""What can be secret in the URL of a server: a user, and a query, which can have a signature."""


def scheme_of(text: str) -> str:
    """Return the scheme of the address of a recording, "" for a path."""
    found = _URL.match(text)
    scheme = found[1].lower() if found and "=" not in found[0] else ""
    return scheme if scheme in (*STORES, *_SERVERS) else ""


def is_address(text: str) -> bool:
    """Whether a text is the address of a recording in a store or on a server."""
    return bool(scheme_of(text))


def is_in_store(text: str) -> bool:
    """Whether a text is an address in a store, where recordings can be written."""
    return scheme_of(text) in STORES


def shown_address(text: str) -> str:
    """Return a path or an address as it is shown: without a user and a query, which can be secrets."""
    return _CREDENTIALS.sub("", text) if scheme_of(text) in _SERVERS else text


def refuse_url(text: str, place: Location, title: str = "") -> None:
    """Raise InputError for a URL: as a path, it would name a folder such as `s3:`. `title` begins the message."""
    found = _URL.match(text)
    if not found:
        return
    scheme = found[1].lower()
    hint = f"copy files of {scheme}:// with another program, or mount it"
    if scheme == "file":
        from urllib.request import url2pathname

        hint = f"name {url2pathname(text[found.end() :])}"
    raise input_error(place.path, "S131", f"{title}a URL, expected a path: {hint}", *place[1:])
