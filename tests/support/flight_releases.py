"""A fixture with the types of each release that has flight modes.

By day, a test flies one release, which its name draws: the newest one as often as all others. At night, it flies all.
"""

from __future__ import annotations

import re
from typing import Any
from zlib import crc32

import pytest

from msggen.generate.cache import package_of
from msggen.sources.embedded import EMBEDDED

NEWEST, *OTHERS = (release for release in EMBEDDED if release != "v1.14")
RELEASES = [*OTHERS[::-1], NEWEST]
_DRAWN = [*OTHERS, *[NEWEST] * len(OTHERS)]


@pytest.fixture(scope="module", params=RELEASES)
def types(request: pytest.FixtureRequest, px4_types: Any) -> Any:
    """The types of a release."""
    return px4_types if request.param == NEWEST else package_of(request.param)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the releases to the night that are not drawn for a test."""
    for item in items:
        release = (
            item.callspec.params.get("types")
            if isinstance(item, pytest.Function) and hasattr(item, "callspec")
            else None
        )
        if release in RELEASES and release != drawn(item.nodeid):
            item.add_marker("night")


def drawn(test: str) -> str:
    """Return the release that a test flies by day, the same one for all of its releases."""
    return _DRAWN[crc32(re.sub(r"v1\.\d+", "", test).encode()) % len(_DRAWN)]
