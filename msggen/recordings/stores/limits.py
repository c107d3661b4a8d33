"""How long stores and servers may take, and how often they are asked again."""

from __future__ import annotations

from typing import NamedTuple


class Limits(NamedTuple):
    """Times in seconds, and the number of further tries of a request that failed."""

    connect: float = 10
    read: float = 15
    """The time without a byte."""
    total: float = 300
    """The time of a request of a few MB."""
    retries: int = 2
    retry: float = 45
    """The time after which no request is tried again."""
    backoff: float = 0.1
    """The time before the first further try."""


LIMITS = Limits()
