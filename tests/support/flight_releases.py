"""A fixture with the types of each release that has flight modes. Tests name this module in `pytest_plugins`."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.sources.embedded import EMBEDDED
from support.simulation import built

RELEASES = [release for release in EMBEDDED[::-1] if release != "v1.14"]


@pytest.fixture(scope="module", params=RELEASES)
def types(request: pytest.FixtureRequest, px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The types of a release."""
    return px4_types if request.param == EMBEDDED[0] else built(request.param, tmp_path_factory.mktemp("types"))
