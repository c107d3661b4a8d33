"""What a client tells: docs/xrce.md."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias


class Connected(NamedTuple):
    """The entities are created, and samples flow."""


class Disconnected(NamedTuple):
    """The session has ended. The client starts again, on a new connection."""

    reason: str


class Received(NamedTuple):
    """A sample for a reader. `data` is CDR without encapsulation, with up to 3 bytes of padding."""

    number: int
    data: bytes


class Requested(NamedTuple):
    """A request to a service. The reply has the same 24 bytes of identity."""

    number: int
    identity: bytes
    data: bytes


class Exchange(NamedTuple):
    """An exchange of times with the agent, in us."""

    agent: int
    """The agent's time."""
    observed: int
    """The agent's clock minus the client's, as this exchange tells it."""
    round_trip: int


Event: TypeAlias = Connected | Disconnected | Received | Requested
