"""Modules that are imported when a test uses them: each worker imports all tests, and few of them need these."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class Lazy:
    """A module, by its name. It has no private names: pytest asks each global of a test for some."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(import_module(self._name), name)
