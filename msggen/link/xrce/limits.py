"""The bounds of an agent and of its sessions, and the times after which they act. docs/xrce.md, 11."""

from __future__ import annotations

from typing import Final, NamedTuple

HEARTBEAT_PERIOD: Final = 0.1
"""Seconds without acknowledgement after which a HEARTBEAT asks for it."""
REPLY_TICKS: Final = 50
"""Ticks after a request in which a lost reply is asked for: 5 s."""
REPLIES: Final = 32
"""The most datagrams that answer a datagram, so that no client keeps a link busy with its own. PX4's needs up to 4."""
REPETITIONS: Final = 4
"""The most messages that are sent again after an ACKNACK: as many as PX4's client keeps."""
VEHICLE: Final = 32
"""Entities from which on a client keeps its place when others want it. PX4's client has 70 or more."""
IDLE: Final = 0.5
"""Seconds without a sample or a new entity after which it does not keep it. PX4's client sends some 100 in them."""
LOSSES: Final = 16
"""The most missing messages that count for a message: the others count with those that follow. So what a forged session
makes up is bounded by what it sends, and a burst of a vehicle that goes on is counted as a whole soon after it."""
ABSENCE: Final = 1.0
"""Seconds of silence after which no HEARTBEAT is sent: its address may be a forged one."""

QUESTIONS: Final = 4
"""How often the sequence numbers of a continued session are asked for, in case that the answers are lost."""
QUESTION_PERIOD: Final = 0.3
"""Seconds between them."""


class Limits(NamedTuple):
    """Bounds of an agent."""

    clients: int = 64
    """Sessions, with those that are silent."""
    message: int = 4096
    """Bytes of a message from or to a client. PX4's client sends and takes up to 508."""
    fragments: int = 65536
    """Bytes of a client's joined fragments."""
    entities: int = 1024
    """Entities of a client. PX4's client has about 200."""
    text: int = 255
    """Characters of a topic's or a type's name."""
    outgoing: int = 4096
    """Datagrams that wait for `take_outgoing`."""
    silence: float = 5.0
    """Seconds after which a silent client is reported as disconnected. PX4's client sends every second."""
    memory: float = 60.0
    """Seconds after which a silent client is forgotten. Until then it continues its session if it sends again."""
    patience: float = 7.0
    """Seconds after which the client of a record is forgotten if it was not heard. PX4's client waits for 5 s."""
    record: int = 131_072
    """Bytes of the entities in a record. Those of PX4's client have 20,000."""
