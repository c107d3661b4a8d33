"""What goes wrong on purpose between a simulated vehicle and its agent."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import NamedTuple

_LONGEST_GARBAGE = 600


class Misbehaviour(NamedTuple):
    """What goes wrong. Shares are from 0 to 1, and apply to each datagram of both directions."""

    drop: float = 0.0
    """The share of datagrams that are lost."""
    reorder: float = 0.0
    """The share of datagrams that are overtaken by the next one."""
    duplicate: float = 0.0
    """The share of datagrams that arrive twice."""
    garbage: float = 0.0
    """The share of datagrams to the agent that are followed by random bytes or by a damaged copy."""
    silent_after: float | None = None
    """The time in s after which nothing is sent or received any more."""
    restart_every: float | None = None
    """The interval in s at which the client restarts, without a word to its agent and with a new port."""
    wrong_hashes: Sequence[str] = ()
    """The messages whose hash in a MessageFormatResponse is wrong, as after a change of their definitions."""
    versions: Mapping[str, int] | None = None
    """The messages whose topics have another version suffix."""
    clock_off: float = 0.0
    """The error in s of the timestamps of all samples."""
    no_time_reply: bool = False
    """Whether the agent's answers to requests for the time are lost."""
    no_position: bool = False
    """Whether the vehicle has no estimate of its position, so that it refuses to arm and to change to some modes."""


class Line:
    """One direction. The same seed and the same datagrams give the same result."""

    def __init__(self, misbehaviour: Misbehaviour, seed: str) -> None:
        self._wrong = misbehaviour
        self._is_perfect = not any(misbehaviour[:4])
        self._random = random.Random(seed)  # noqa: S311 - for repetition, not for secrets
        self._held: tuple[bytes, int] | None = None

    def carry(self, datagrams: list[tuple[bytes, int]]) -> list[tuple[bytes, int]]:
        """Return what arrives of datagrams, each with the number of its connection."""
        if self._is_perfect:
            return datagrams
        arrived: list[tuple[bytes, int]] = []
        for datagram in datagrams:
            if self._happens(self._wrong.drop):
                continue
            held, self._held = self._held, None
            if held is None and self._happens(self._wrong.reorder):
                self._held = datagram
                continue
            arrived.append(datagram)
            if self._happens(self._wrong.duplicate):
                arrived.append(datagram)
            if held is not None:
                arrived.append(held)
            if self._happens(self._wrong.garbage):
                arrived.append((self._damaged(datagram[0]), datagram[1]))
        return arrived

    def _happens(self, share: float) -> bool:
        return share > 0.0 and self._random.random() < share

    def _damaged(self, data: bytes) -> bytes:
        """Return random bytes, or a datagram that is cut or has a few other bytes."""
        kind = self._random.randrange(3)
        if kind == 0:
            return self._random.randbytes(self._random.randrange(1, _LONGEST_GARBAGE))
        if kind == 1:
            return data[: self._random.randrange(len(data))]
        changed = bytearray(data)
        for _ in range(self._random.randrange(1, 5)):
            changed[self._random.randrange(len(changed))] = self._random.randrange(256)
        return bytes(changed)
