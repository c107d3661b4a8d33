"""Datagrams of hostile clients for an agent: random ones, and captured ones that were changed, from 50 senders.

Each is refused with a reason or taken, and the state of the agent stays within its limits.
"""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from support.xrce_garbage import attack

COUNT = 40


class Case(NamedTuple):
    """A sequence of datagrams, which follows from a seed."""

    seed: int
    size: int


def case(chance: Random) -> Case:
    """Return a random sequence of datagrams."""
    return Case(chance.randrange(2**32), chance.choice((1000, 2000, 4000)))


def check(case: Case) -> None:
    """Give them to an agent, which must not raise, and check its limits."""
    result = attack(case.size, case.seed)
    assert result["accepted"]
    assert result["events"]
