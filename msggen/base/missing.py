"""Packages that a function needs, and that may not be installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

RECORDINGS = "'msggen[recordings]'"
"""The arguments of pip for what reads and writes recordings."""


@contextmanager
def installed_by(arguments: str) -> Iterator[None]:
    """Raise the error about a package that is not installed with the arguments of `pip install` that bring it."""
    try:
        yield
    except ModuleNotFoundError as error:
        name = str(error.name).partition(".")[0]
        raise ModuleNotFoundError(f"the package {name} is not installed: pip install {arguments}", name=name) from None
