"""Owners of links, lines and programs that stand still at any moment, with vehicles that lose or acknowledge nothing.

No message reaches a vehicle later than 0.5 s after it was published, no request after its caller has given up, and
what does not arrive is counted. All time is simulated.
"""

from __future__ import annotations

import selectors
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from random import Random
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest.mock import patch

from msggen.link.address import parse_address
from msggen.link.age import LONGEST_NS, NEVER, OtherClock, expiry
from msggen.link.agent_link import AgentLink
from msggen.link.link import deliver
from msggen.link.serial import SerialLink
from msggen.link.xrce import wire
from msggen.link.xrce.framing import CLIENT, Deframer
from msggen.link.xrce.outbox import Address
from msggen.vehicle.owned.records import CALL, EVENT, SAMPLE, UNTIL, RecordReader, event_in, event_of, record_of
from msggen.vehicle.owner.owner import LOGGER, Owner
from msggen.vehicle.owner.program import Program
from msggen.vehicle.owner.requests import obey
from support.served import hello
from support.xrce_client import Client

COUNT = 150

_SECOND = 1_000_000_000
_TICK = 100_000_000
_SLACK = {"udp": 1_000_000, "serial": _TICK + 20_000_000}
"""The time in ns by which a message may be older: a line is looked at every 0.1 s."""
_CLOCKS = (
    "link.age.now",
    "link.agent_link.now",
    "link.serial.now_ns",
    "vehicle.owner.calls.now",
    "vehicle.owner.program.now",
)
"""The clock, at all places that have imported it."""
_DEVICE = 99


class Case(NamedTuple):
    """A link, how the vehicle reads its topic, and what happens."""

    kind: str
    is_reliable: bool
    baud: int
    loss: float
    skews: tuple[int, ...]
    """By how many ns the clock of each program is ahead of the owner's."""
    acts: tuple[tuple[str, int, float], ...]
    """What happens, to which program, and how much of it."""


ACTS = ("publish", "publish", "publish", "publish", "read", "read", "call", "pass", "stand", "stall", "flow", "answer")


def case(chance: Random) -> Case:
    skews = (0, *(chance.choice((0, 3, -4_000 * _SECOND, 10**17, -(10**17))) for _ in range(chance.randrange(3))))
    acts = (
        (chance.choice(ACTS), chance.randrange(len(skews)), chance.choice((0.01, 0.1, 0.3, 0.6, 1.0)) * chance.random())
        for _ in range(chance.randrange(20, 200))
    )
    return Case(
        chance.choice(("udp", "serial")),
        chance.random() < 0.3,
        chance.choice((57600, 115200, 921600)),
        chance.choice((0.0, 0.0, 0.3)),
        skews,
        tuple(acts),
    )


class _Clock:
    """The simulated time in ns, and by how much the clock that is asked is ahead of it."""

    def __init__(self) -> None:
        self.time = _SECOND
        self.skew = 0

    def __call__(self) -> int:
        return self.time + self.skew

    @contextmanager
    def of(self, skew: int) -> Iterator[None]:
        """Ask the clock of a program."""
        self.skew = skew
        try:
            yield
        finally:
            self.skew = 0


class _Datagrams(AgentLink):
    """A link whose datagrams arrive at once."""

    def __init__(self, arrive: Callable[[bytes], None]) -> None:
        super().__init__()
        self._arrive = arrive

    def open(self, listener: Any) -> None:
        raise NotImplementedError

    def wait(self, seconds: float, listener: Any) -> None:
        raise NotImplementedError

    def wake(self) -> None:
        raise NotImplementedError

    def transmit(self, datagrams: list[tuple[bytes, Address]], until: int = NEVER) -> None:  # noqa: ARG002
        for data, _ in datagrams:
            self._arrive(data)


class _Device:
    """A serial device with the buffer of a system, which sends at the rate of its line, or stands still."""

    def __init__(self, baud: int) -> None:
        self.buffer = b""
        self.is_stalled = False
        self.events = selectors.EVENT_READ
        """What the link waits for."""
        self.arrive: Callable[[bytes], None] = lambda _: None
        self.wake: Callable[[], None] = lambda: None
        self._baud, self._credit = baud, 0.0
        self._size = 4096 if baud > 115_200 else 128
        self._frames = Deframer(CLIENT)

    def watch(self, _: int, events: int, __: object) -> None:
        self.events = events

    def serve(self) -> None:
        """Wake the link if it waits for space, and there is some."""
        if self.events & selectors.EVENT_WRITE and len(self.buffer) < self._size:
            self.wake()

    def write(self, _: int, data: bytes) -> int:
        count = min(len(data), self._size - len(self.buffer))
        if not count:
            raise BlockingIOError
        self.buffer += data[:count]
        return count

    def discard(self, _: int) -> None:
        self.buffer = b""

    def flow(self, nanoseconds: int) -> None:
        """Send what the line takes in a time."""
        self._credit = 0.0 if self.is_stalled or not self.buffer else self._credit + self._baud / 10 * nanoseconds / 1e9
        count = min(int(self._credit), len(self.buffer))
        self._credit -= count
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        for message in self._frames.feed(data):
            self.arrive(message)


class _Sender:
    """A program: what it has sent and the owner has not read yet."""

    def __init__(self, owner: Owner) -> None:
        theirs, self.socket = socket.socketpair()
        theirs.setblocking(False)  # noqa: FBT003 - the name of the method says what it means
        self.socket.setblocking(False)  # noqa: FBT003
        self.program = Program(theirs)
        owner.programs[self.program] = None
        self.backlog = b""
        self.clock = OtherClock()
        self._reader = RecordReader()

    def listen(self) -> None:
        """Read what the owner tells."""
        try:
            data = self.socket.recv(1 << 20)
        except BlockingIOError:
            return
        for kind, *_, body in self._reader.add(data):
            if kind == EVENT and event_in(body)[0] == "taken":
                _, _, theirs, name = event_in(body)[1]
                self.clock.hear(theirs, name)


class World:
    """Programs, the owner of a link, the link and a vehicle."""

    def __init__(self, case: Case, clock: _Clock, device: _Device) -> None:
        self.case, self.clock = case, clock
        self.chance = Random(case.baud + len(case.acts))  # noqa: S311 - no secret
        self.client = Client()
        self.limits: list[int] = []
        """The times until which each message may arrive."""
        self.arrived: set[int] = set()
        self.published: set[int] = set()
        self.device: _Device | None = None
        self.link: AgentLink
        if case.kind == "serial":
            self.device, device.arrive = device, self._arrive
            self.client.address = "line"
            self.link = link = SerialLink("line", case.baud)
            device.wake = lambda: link._ready(selectors.EVENT_WRITE, self.owner)
            link._fd = _DEVICE
            link.selector = SimpleNamespace(get_key=lambda _: device, modify=device.watch)  # type: ignore[assignment]
        else:
            self.link = _Datagrams(self._arrive)
        self.link.agent._time = clock
        self.loss = 0.0
        self.owner = Owner(self.link, parse_address("udp://127.0.0.1:8888"), (), lambda: None)
        self._connect()
        self.senders = [_Sender(self.owner) for _ in case.skews]
        for sender, skew in zip(self.senders, case.skews, strict=True):
            self._obey(sender, event_of("hello", hello()))
            with clock.of(skew):
                sender.listen()
        self.loss = case.loss

    def _connect(self) -> None:
        client = self.client
        client.ping()
        client.begin()
        client.participate()
        client.publish(1)
        client.subscribe(2, stream=wire.RELIABLE if self.case.is_reliable else wire.BEST_EFFORT)
        client.serve()
        while not self.owner.vehicles or not self.owner.vehicles[1].known.services:
            self.answer()
            self.flow(_TICK)

    def close(self) -> None:
        for sender in self.senders:
            self.owner.remove(sender.program)
            sender.socket.close()

    def _arrive(self, data: bytes) -> None:
        """Let a datagram arrive at the vehicle, or get lost, and look at the samples in it."""
        if self.chance.random() < self.loss:
            return
        self.client.receive(data)
        for part in wire.submessages(data[4:]):
            if part.id != wire.DATA:
                continue
            (number,) = struct.unpack("<Q", part.payload[-8:])
            late = self.clock.time - self.limits[number]
            is_repeated = wire.parse_header(data).stream == wire.RELIABLE and self.device is not None
            again = LONGEST_NS if is_repeated else 0  # what is sent again may wait for the line once more
            assert late <= _SLACK[self.case.kind] + again, f"message {number} arrives {late / 1e9:.3f} s too late"
            self.arrived.add(number)

    def _obey(self, sender: _Sender, data: bytes) -> None:
        for record in sender.program.reader.add(data):
            obey(self.owner, sender.program, record)

    # acts

    def publish(self, index: int, _: float) -> None:
        sender, number = self.senders[index], len(self.limits)
        self.limits.append(self.clock.time + LONGEST_NS)
        self.published.add(number)
        with self.clock.of(self.case.skews[index]):
            until = sender.clock.of(expiry())
        route = self.owner.vehicles[1].known.indexes["/fmu/in/b"]
        sender.backlog += record_of(SAMPLE, b"\0\1\0\0" + struct.pack("<Q", number), 1, route, until)

    def call(self, index: int, seconds: float) -> None:
        sender, number = self.senders[index], len(self.limits)
        self.limits.append(self.clock.time + round(seconds * _SECOND))
        with self.clock.of(self.case.skews[index]):
            until = sender.clock.of(self.clock() + round(seconds * _SECOND))
        body = UNTIL.pack(until) + b"\0\1\0\0" + struct.pack("<Q", number)
        sender.backlog += record_of(CALL, body, 1, 0, number)

    def read(self, index: int, part: float) -> None:
        """Let the owner read a part of what a program has sent."""
        sender = self.senders[index]
        size = len(sender.backlog) if part > 0.1 else round(part * len(sender.backlog))
        data, sender.backlog = sender.backlog[:size], sender.backlog[size:]
        self._obey(sender, data)

    def flow(self, nanoseconds: int, *, is_served: bool = False) -> None:
        """Let time pass, in which the line sends. A link that is served writes as soon as the line has space."""
        left = nanoseconds
        while left > 0:
            step = min(left, 1_000_000 if self.device and self.device.buffer else left)
            self.clock.time += step
            left -= step
            if self.device is not None:
                self.device.flow(step)
                if is_served:
                    self.device.serve()

    def let_pass(self, _: int, seconds: float) -> None:
        """Let time pass, in which the link is served."""
        end = self.clock.time + round(seconds * _SECOND)
        while self.clock.time < end:
            self.flow(min(_TICK, end - self.clock.time), is_served=True)
            self.look()

    def look(self) -> None:
        """Do what the owner does from time to time."""
        self.client.beat()
        self.client.write(1, bytes(8))
        self.answer()
        self.link.agent.tick(self.clock.time / 1e9)
        self.link.look(self.clock.time / 1e9, self.owner)
        deliver(self.link.settle(), self.owner)
        self.owner.look()
        for sender, skew in zip(self.senders, self.case.skews, strict=True):
            sender.program.flush()
            with self.clock.of(skew):
                sender.listen()

    def stand(self, _: int, seconds: float) -> None:
        """Let the owner stand still."""
        self.flow(round(2 * seconds * _SECOND))

    def stall(self, *_: object) -> None:
        if self.device is not None:
            self.device.is_stalled = True

    def let_flow(self, *_: object) -> None:
        """Let the line go on, after the owner has looked at it."""
        if self.device is not None:
            self.look()
            self.device.is_stalled = False

    def answer(self, *_: object) -> None:
        """Let the vehicle answer what it has received."""
        outgoing, self.client.outgoing = self.client.outgoing, []
        for data in outgoing:
            self.link.agent.receive(data, self.client.address, 1)
        deliver(self.link.settle(), self.owner)


_DO = {
    "publish": World.publish,
    "call": World.call,
    "read": World.read,
    "pass": World.let_pass,
    "stand": World.stand,
    "stall": World.stall,
    "flow": World.let_flow,
    "answer": World.answer,
}


def check(case: Case) -> None:
    clock, device = _Clock(), _Device(case.baud)
    fakes = {
        **dict.fromkeys(_CLOCKS, clock),
        "vehicle.owner.program.clock_name": lambda: "the clock of the case",
        "link.serial.os.write": device.write,
        "link.serial.waiting_in": lambda _: len(device.buffer),
        "link.serial.discard": device.discard,
    }
    with ExitStack() as stack:
        for place, fake in fakes.items():
            stack.enter_context(patch(f"msggen.{place}", fake))
        stack.enter_context(patch.object(LOGGER, "disabled", True))  # noqa: FBT003 - the name says what it means
        world = World(case, clock, device)
        stack.callback(world.close)
        for act, index, amount in case.acts:
            _DO[act](world, index, amount)
        world.let_flow()
        for index in range(len(case.skews)):
            world.read(index, 1.0)
        world.let_pass(0, 2.0)
        world.publish(0, 0.0)
        world.read(0, 1.0)
        world.let_pass(0, 0.5)
        _check_counts(case, world)


def _check_counts(case: Case, world: World) -> None:
    """Check that what was not lost has arrived, or is counted."""
    missing = world.published - world.arrived
    counted = world.owner.unsent + world.link.unsent
    if case.kind == "udp" and not case.loss and not case.is_reliable:
        assert len(missing) == counted == sum(each.program.unsent for each in world.senders)
    if not case.loss and not case.is_reliable:
        assert len(world.limits) - 1 in world.arrived, "a message that is sent at once arrives"
