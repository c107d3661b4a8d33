"""Keys, tokens, attachments and samples of strangers in the key space of a vehicle that is genuine.

Strangers know the vehicle's names and its guid. Each thing is refused and counted, or taken within the limits; what is
told to the user of the link is of the form; and each sample of the vehicle arrives, whole and without what follows it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

from msggen.link import age
from msggen.link.link import Connected, Disconnected, Event, Lost, Opened, Sample
from msggen.link.rmw_zenoh.names import Attachment, Token, beat_of, gid_of
from msggen.link.rmw_zenoh.vehicles import Vehicles
from support.zenoh_space import COMMAND, GUID, OTHER, STATUS, ZID, definition, token_of

COUNT = 40

STEP_NS = 1_000_000
NAME = re.compile(r"(/[A-Za-z0-9_]+)+")
PIECES = (
    "/",
    "%",
    "*",
    "$*",
    "**",
    "#",
    "?",
    "\0",
    "\x1b[2J",
    "é",
    "@ros2_lv",
    "RIHS01_",
    "TypeHashNotSupported",
    "::",
    "0",
)
OWN = b"\0\1\0\0" + b"v" * definition(STATUS).size
CARRIED_STATUS = STATUS._replace(name="/uav_1/fmu/out/vehicle_status_v4")
CARRIED = str(Token(0, ZID, "MP", "msggen_1", CARRIED_STATUS))
LARGEST_GAP = 1_000_000
MAX_VEHICLES, MAX_ENDPOINTS, MAX_KEYS = 100, 1000, 10_000


class Case(NamedTuple):
    """A sequence of things that arrive, which follows from a seed."""

    seed: int
    size: int


def case(chance: Random) -> Case:
    """Return a random sequence."""
    return Case(chance.randrange(2**32), chance.choice((200, 500, 1000)))


def check(case: Case) -> None:
    """Let them arrive, each followed by a sample of the genuine vehicle."""
    chance, told = Random(case.seed), Told()  # noqa: S311 - for repetition, not for secrets
    vehicles = Vehicles(told)
    now = 10**10
    for key in (None, COMMAND, STATUS):
        vehicles.token(token_of(key), now, is_alive=True)
    vehicles.token(CARRIED, now, is_alive=True)
    for number in range(1, case.size + 1):
        now += chance.choice((STEP_NS, STEP_NS, 10 * STEP_NS, 1000 * STEP_NS))
        before = vehicles.lost
        chance.choice(ACTS)(vehicles, chance, now)
        assert vehicles.lost - before <= LARGEST_GAP
        told.samples.clear()
        attachment = Attachment(number, now, GUID).pack()
        vehicles.sample(str(STATUS), OWN + chance.randbytes(chance.randrange(40)), attachment, now, now)
        assert [each.payload for each in told.samples] == [OWN], "a sample of the vehicle has not arrived"
        vehicles.beat(beat_of(ZID, 0, "uav_1"), attachment, now)
        clocks = [each.clock.of(age.now()) for each in vehicles._vehicles.values() if each.clock is not None]
        assert all(time < 1 << 62 for time in clocks), "a clock that no message can tell"
        attachment = Attachment(number, now, gid_of(CARRIED)).pack()
        vehicles.sample(str(CARRIED_STATUS), OWN, attachment, now, now)
        assert [each.payload for each in told.samples[1:]] == [OWN], "a sample of the carried vehicle has not arrived"
        if chance.random() < 0.1:
            vehicles.tick(now)
        assert len(told.connected) <= MAX_VEHICLES
        assert all(len(routes) <= MAX_ENDPOINTS for routes in told.connected.values())
        assert len(vehicles._flows) <= MAX_KEYS
    vehicles.close("the end")
    assert not told.connected


class Told:
    """Checks what is told, as a listener of a link may expect it."""

    def __init__(self) -> None:
        self.connected: dict[int, set[str]] = {}
        self.samples: list[Sample] = []

    def __call__(self, event: Event) -> None:
        """Take an event."""
        if isinstance(event, Connected):
            assert event.remote.number not in self.connected
            assert re.fullmatch("[A-Za-z0-9_/]*", event.remote.namespace)
            assert re.fullmatch("[A-Za-z0-9_]+", event.remote.address)
            self.connected[event.remote.number] = set()
        elif isinstance(event, Opened):
            assert NAME.fullmatch(event.route.name)
            assert event.route.name not in self.connected[event.remote.number]
            self.connected[event.remote.number].add(event.route.name)
        elif isinstance(event, Disconnected):
            del self.connected[event.remote.number]
        elif isinstance(event, Sample):
            assert event.route.name in self.connected[event.remote.number]
            self.samples.append(event)
        elif isinstance(event, Lost):
            assert 0 < event.missing <= LARGEST_GAP


def _changed(text: str, chance: Random) -> str:
    """Return a text with some of its characters changed, or much longer."""
    for _ in range(chance.randrange(4)):
        place = chance.randrange(len(text) + 1)
        end = place + chance.choice((0, 1, 1, 10, 100))
        text = text[:place] + chance.choice(PIECES) * chance.choice((0, 1, 1, 3)) + text[end:]
    return text * chance.choice((1, 1, 1, 1, 2, 1000))


def _key(chance: Random) -> Any:
    names = (
        STATUS.name,
        COMMAND.name,
        f"/uav_{chance.randrange(200)}/fmu/out/x",
        f"/fmu/out/t{chance.randrange(3000)}",
    )
    hashes = (STATUS.type_hash, "TypeHashNotSupported", f"RIHS01_{chance.randbytes(32).hex()}")
    return STATUS._replace(domain=chance.choice((0, 0, 7)), name=chance.choice(names), type_hash=chance.choice(hashes))


def _gid(chance: Random) -> bytes:
    return chance.choice((GUID, OTHER, chance.randbytes(16)))


def _token(vehicles: Vehicles, chance: Random, now: int) -> None:
    node = chance.choice((f"px4_{_gid(chance).hex()}", "msggen_1", f"node_{chance.randrange(500)}"))
    kind: Any = chance.choice(("NN", "MP", "MS", "SS", "SC"))
    zid = chance.choice((ZID[::-1], chance.randbytes(16).hex()))
    text = str(Token(0, zid, kind, node, None if kind == "NN" else _key(chance)))
    vehicles.token(text if chance.random() < 0.5 else _changed(text, chance), now, is_alive=chance.random() < 0.7)


def _sample(vehicles: Vehicles, chance: Random, now: int) -> None:
    key = str(_key(chance))
    attachment = Attachment(
        chance.randrange(2**63), chance.randrange(2**63), chance.choice((OTHER, chance.randbytes(16)))
    )
    given = chance.choice((attachment.pack(), chance.randbytes(chance.randrange(64)), None, b""))
    text = key if chance.random() < 0.7 else _changed(key, chance)
    vehicles.sample(text, chance.randbytes(chance.randrange(200)), given, now, now)


def _beat(vehicles: Vehicles, chance: Random, now: int) -> None:
    key = beat_of(chance.choice((ZID, chance.randbytes(16).hex())), 0, f"uav_{chance.randrange(3)}")
    given = chance.choice((Attachment(1, chance.randrange(2**63), OTHER).pack(), chance.randbytes(33), None, b""))
    vehicles.beat(key if chance.random() < 0.7 else _changed(key, chance), given, now)


def _many(vehicles: Vehicles, chance: Random, now: int) -> None:
    for _ in range(chance.randrange(100)):
        _token(vehicles, chance, now)
        _sample(vehicles, chance, now)


ACTS: tuple[Callable[[Vehicles, Random, int], None], ...] = (_token, _token, _sample, _sample, _beat, _many)
"""What a stranger does."""
