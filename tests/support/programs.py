"""Programs that tests run."""

from __future__ import annotations

import os

import pytest


def required(name: str, *, is_there: bool) -> None:
    """Skip the test if a tool is missing, or fail it in CI, which has all tools."""
    if not is_there and os.environ.get("MSGGEN_CI"):
        pytest.fail(f"CI must have {name}: .ci/run installs it")
    if not is_there:
        pytest.skip(f"needs {name}")
