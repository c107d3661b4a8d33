"""Sessions that an earlier program began, and whether this one may continue them. docs/xrce.md, 10."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from msggen.live.link import Route
from msggen.live.xrce import entities, wire
from msggen.live.xrce.outbox import Address
from msggen.live.xrce.streams import distance

_PROOFS: Final = 5
"""Topics that must have samples of the expected size before a session is continued."""
_STEP: Final = 16
"""How far the number of a sample may be ahead of the last one. Those of forged samples would count as lost ones."""
_REMEMBERED: Final = 10.0
"""Seconds in which an address whose session has ended is not continued."""


class Continuation:
    """What is known of clients that send samples without a session here."""

    def __init__(self, known: Iterable[Route], most: int) -> None:
        """Take the routes that a client of the expected firmware has. At most `most` clients are remembered."""
        self.known = [route for route in known if 0 <= route.object_id <= entities.LARGEST_NUMBER]
        self._sizes = {
            entities.object_id(route.object_id, entities.WRITER): route.size
            for route in self.known
            if route.direction == "out"
        }
        self._proofs: dict[Address, tuple[int, set[bytes]]] = {}  # the number of the last sample, and the writers
        self._ended: dict[Address, float] = {}
        self._most = most

    def may_continue(self, header: wire.Header, submessage: wire.Submessage, address: Address) -> bool:
        """Whether a message may belong to a session that can be continued: it is a sample."""
        return (
            bool(self._sizes)
            and submessage.id == wire.WRITE_DATA
            and header.stream == wire.BEST_EFFORT
            and header.session_id > wire.NO_SESSION
            and address not in self._ended
        )

    def fits(self, submessage: wire.Submessage) -> bool:
        """Whether a sample is one of the expected firmware, by its object id and its size.

        With other definitions, object ids mean other topics: samples of this program would reach a wrong one.
        """
        size = self._sizes.get(submessage.payload[2:4])
        return size is not None and size in {-1, len(submessage.payload) - 4}

    def is_proved(self, header: wire.Header, submessage: wire.Submessage, address: Address) -> bool:
        """Take a sample that fits. Return whether the samples so far show that the client has the expected firmware.

        Samples whose numbers do not follow each other are not those of one client.
        """
        if address not in self._proofs and len(self._proofs) >= self._most:
            del self._proofs[next(iter(self._proofs))]
        last, proofs = self._proofs.get(address, (header.sequence, set[bytes]()))
        if not 0 <= distance(last, header.sequence) <= _STEP:
            proofs = set()
        proofs.add(submessage.payload[2:4])
        self._proofs[address] = header.sequence, proofs
        if len(proofs) < min(_PROOFS, len(self._sizes)):
            return False
        del self._proofs[address]
        return True

    def end(self, address: Address, now: float) -> None:
        """Forget the samples of a client, whose session is not continued for a while."""
        self._proofs.pop(address, None)
        if len(self._ended) >= self._most:
            del self._ended[next(iter(self._ended))]
        self._ended[address] = now

    def tick(self, now: float) -> None:
        """Allow sessions again to be continued that have ended long enough ago."""
        self._ended = {address: at for address, at in self._ended.items() if now - at < _REMEMBERED}
