"""URLs in the place of paths: the name of a file in an object store, or the address of a server."""

from __future__ import annotations

import re

from msggen.base.diagnostics import input_error
from msggen.base.location import Location

_URL = re.compile(r"(?:\w+=)?([A-Za-z][A-Za-z0-9+.-]+)://")
"""The scheme at the beginning of a URL, also behind `PKG=`. A single letter is a drive of Windows."""


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
