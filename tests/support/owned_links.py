"""A fixture with which a process owns the links of a test."""

from __future__ import annotations

from collections.abc import Iterator
from tempfile import TemporaryDirectory

import pytest

from support.served import end_owners


@pytest.fixture
def owned(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let a process own the link. It has ended after the test."""
    with TemporaryDirectory(prefix="run-") as name:  # whose name is short, as those of sockets are
        monkeypatch.setenv("MSGGEN_RUNTIME", name)
        monkeypatch.delenv("MSGGEN_DIRECT")
        yield
        monkeypatch.setenv("MSGGEN_RUNTIME", name)
        end_owners()
