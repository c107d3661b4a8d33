"""Clients in a session of an earlier program that left no record: which topics they have. docs/xrce.md, 10."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from msggen.link.link import Route
from msggen.link.xrce import entities, wire
from msggen.link.xrce.outbox import Address
from msggen.link.xrce.streams import distance

_PROOFS: Final = 5
"""Topics that must have samples of the expected size before a session is continued."""
_STEP: Final = 16
"""How far the number of a message may be ahead of the last one. Those of forged messages would count as lost ones."""
_UNPROVED: Final = 3.0
"""Seconds after which a client is not taken for a vehicle any more if its samples have not shown its topics."""
_REMEMBERED: Final = 10.0
"""Seconds in which an address whose session has ended is not continued."""
_FIRST_TOPIC: Final = entities.object_id(0x800, entities.TOPIC)
"""The topic of the first reader, which PX4's client creates first."""
_SEPARATOR: Final = Route("", "", "out", -1)


class Candidate(NamedTuple):
    """The routes that a client may have, all of them."""

    routes: tuple[Route, ...]
    sizes: Mapping[bytes, int]
    """The sizes of samples by the object ids of writers, -1 for one that varies."""

    def fits(self, sample: wire.Sample) -> bool:
        """Whether a sample is of one of these routes, by its object id and its size."""
        size = self.sizes.get(sample.object_id)
        return size is not None and size in {-1, len(sample.data)}


class _Stranger:
    """A client that is being observed."""

    def __init__(self, candidates: Sequence[Candidate], now: float) -> None:
        self.candidates = candidates
        self.since = now
        self.last: int | None = None
        self.proofs: set[bytes] = set()


class Continuation:
    """What is known of clients that have a session, but none here."""

    def __init__(self, known: Iterable[Route], most: int) -> None:
        """Take the routes that clients may have: `joined` sets of them. At most `most` clients are remembered."""
        self._candidates = tuple(_candidates(known))
        self._strangers: dict[Address, _Stranger] = {}
        self._ended: dict[Address, float] = {}
        self._most = most

    @property
    def is_enabled(self) -> bool:
        """Whether sessions without a record are continued at all."""
        return bool(self._candidates)

    def greet(self, address: Address, now: float) -> bool:
        """Take note of a client that has been heard. Return whether it may turn out to be a known vehicle."""
        if address in self._ended:
            return False
        if address not in self._strangers:
            if len(self._strangers) >= self._most:
                del self._strangers[next(iter(self._strangers))]
            self._strangers[address] = _Stranger(self._candidates, now)
        return True

    def is_alone(self, address: Address) -> bool:
        """Whether the client at an address is the only one that has been heard with a session of an earlier program."""
        return not {*self._strangers, *self._ended} - {address}

    def has_refused(self, address: Address) -> bool:
        """Whether the client at an address cannot be continued."""
        return address in self._ended

    def may_create(self, header: wire.Header, create: wire.Create, address: Address) -> bool:
        """Whether a client has created its participant only, as in PX4's time synchronization, and goes on from there.

        The participant is the first reliable message, or two of them if it has a long name.
        """
        is_first = header.sequence == 1 or (header.sequence == 2 and create.object_id == _FIRST_TOPIC)
        is_seen = address in self._strangers and self._strangers[address].last is not None
        return is_first and not is_seen and address not in self._ended

    def observe(self, sequence: int, samples: Sequence[wire.Sample], address: Address) -> Sequence[Candidate]:
        """Take the samples in a message of a greeted client. Return the candidates that all its samples fit.

        With other definitions, object ids mean other topics: samples of this program would reach a wrong one.
        """
        stranger = self._strangers[address]
        if stranger.last is not None and not 0 <= distance(stranger.last, sequence) <= _STEP:
            stranger.proofs.clear()  # messages whose numbers do not follow each other are not those of one client
        stranger.last = sequence
        stranger.proofs.update(sample.object_id for sample in samples)
        stranger.candidates = [each for each in stranger.candidates if all(map(each.fits, samples))]
        return stranger.candidates

    def proved(self, address: Address) -> Candidate | None:
        """Return what a client has, if its samples leave one candidate and are of enough topics."""
        stranger = self._strangers[address]
        if len(stranger.candidates) != 1:
            return None
        (candidate,) = stranger.candidates
        return candidate if len(stranger.proofs) >= min(_PROOFS, len(candidate.sizes)) else None

    def end(self, address: Address, now: float) -> None:
        """Forget a client, whose session is not continued for a while."""
        self._strangers.pop(address, None)
        self._ended.pop(address, None)
        if len(self._ended) >= self._most:
            del self._ended[next(iter(self._ended))]
        self._ended[address] = now

    def tick(self, now: float) -> None:
        """Give up clients that do not show their topics. Allow sessions again that have ended long enough ago."""
        self._ended = {address: at for address, at in self._ended.items() if now - at < _REMEMBERED}
        for address in [each for each, stranger in self._strangers.items() if now - stranger.since > _UNPROVED]:
            self.end(address, now)


def joined(sets: Iterable[Iterable[Route]]) -> tuple[Route, ...]:
    """Return the sets of routes that clients may have in one sequence, for the argument `known` of an agent.

    A route whose type is that of a request stands for its service.
    """
    return tuple(route for each in sets for route in (_SEPARATOR, *each))


def _candidates(known: Iterable[Route]) -> list[Candidate]:
    """Return the sets in a sequence, each once."""
    sets: list[list[Route]] = [[]]
    for route in known:
        if route == _SEPARATOR:
            sets.append([])
        elif 0 <= route.object_id <= entities.LARGEST_NUMBER:
            sets[-1].append(route)
    found = {frozenset(each): _candidate(each) for each in sets}
    return [each for each in found.values() if each.sizes]


def _candidate(routes: list[Route]) -> Candidate:
    sizes = {
        entities.object_id(route.object_id, entities.WRITER): route.size for route in routes if route.direction == "out"
    }
    return Candidate(tuple(routes), MappingProxyType(sizes))
