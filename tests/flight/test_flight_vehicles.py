"""Tests of the setpoints of all vehicles: which each follows in which release, and that nothing is sent too long."""

from __future__ import annotations

import asyncio
import random
import re
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

import msggen.flight
from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.followers import use_for
from msggen.flight.mode import Mode
from msggen.generate.cache import package_of
from msggen.messages.setpoints import ATTITUDE, FIXED_WING, GOTO, KINDS, ROVER, SENT, TRAJECTORY, Kind
from msggen.messages.vehicle_types import FIXED_WING as WINGS
from msggen.messages.vehicle_types import ROTARY_WING
from msggen.sim import Options
from support.examples import by_day
from support.flown import EXTERNAL, Flown, Sent, fly, flying, flying_each
from support.kinds import RELEASES, VEHICLES, followed, in_air, is_bridged, send

HOLD = 4
TOPICS = {topic for kind in KINDS for topic in kind.topics}
ORDER = {frozenset({ROTARY_WING}): 0, frozenset({WINGS}): 1}
"""So that a vehicle flies by its motors last, which lets it fall."""


@pytest.fixture
def release(request: pytest.FixtureRequest) -> str:
    """The release of `types`."""
    return str(request.node.callspec.params["types"])


class Waits(Mode, name="Any"):
    """Waits. Its setpoints are set on it."""

    async def fly(self) -> None:
        await asyncio.Event().wait()


def with_kind(kind: Kind) -> Mode:
    """Return a mode that declares a kind of setpoints."""

    class Declares(Waits):
        setpoints = (kind,)

    return Declares()


def advised(text: str) -> set[Kind]:
    """Return the kinds that an error says to declare."""
    _, _, rest = text.partition("`setpoints = ")
    found = eval(rest.partition("`")[0], dict(vars(msggen.flight)))  # noqa: S307 - of this repository
    return {*found}


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("each", RELEASES)
def test_what_is_advised_for_a_vehicle_is_what_its_release_takes(vehicle: str, each: str) -> None:
    one, *others = VEHICLES[vehicle]
    status = SimpleNamespace(vehicle_type=one, is_vtol=bool(others))
    topics: Any = SimpleNamespace(takes=partial(is_bridged, release=each))
    found = advised(use_for(status, topics))
    assert found
    assert found <= {*followed(vehicle, each)}
    if each in {"v1.15", "v1.16"} and not VEHICLES[vehicle] & {ROTARY_WING}:
        assert found == {*followed(vehicle, each)}  # there are no others


@flying_each(Options(vehicle="plane"))
async def test_what_is_advised_instead_of_a_kind_that_is_not_declared(
    flight: Flight, vehicle: Flown, release: str
) -> None:
    """A plane that cannot hold its place, and one that is to fly by a course."""

    class Tumbles(Mode):
        setpoints = (ATTITUDE,)

        async def fly(self) -> None:
            with pytest.raises(UnsupportedError, match="cannot hold a place by its `setpoints`: for a fixed") as caught:
                await self.hold()
            assert advised(str(caught.value)) <= {*followed("plane", release)}
            wanted = "add `FIXED_WING` to its" if is_bridged(FIXED_WING, release) else "PX4 v1.17 and later have it"
            with pytest.raises(UnsupportedError, match=wanted):
                self.fixed_wing(course_deg=90.0)

    await flight.add(Tumbles)
    await in_air(flight, vehicle)
    await flight.fly(Tumbles)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_kind_that_is_not_followed_or_not_bridged_is_an_error_before_arming(
    vehicle: str, types: Any, release: str
) -> None:
    async def program(flight: Flight, flown: Flown) -> None:
        for kind in SENT:
            if kind in followed(vehicle, release):
                continue
            sent = len(flown.sent)
            with pytest.raises(UnsupportedError) as caught:
                await flight.add(with_kind(kind))
            told = str(caught.value)
            if kind.followed_by & VEHICLES[vehicle]:
                assert not is_bridged(kind, release)
                assert f"PX4 {kind.since} and later have it there" in told
            else:
                assert f"does not follow {kind.name} setpoints, which are for a" in told
                assert advised(told) <= {*followed(vehicle, release)}
            assert {each.topic for each in flown.sent[sent:]} <= {"arming_check_reply"}, kind

    fly(types, program, Options(vehicle=vehicle))


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_each_kind_that_a_vehicle_follows_is_sent_at_its_rate(vehicle: str, types: Any, release: str) -> None:
    kinds = followed(vehicle, release)
    spans: dict[Kind, tuple[float, float]] = {}
    flown: Any = None

    class Each(Mode, name="Each"):
        setpoints = kinds

        async def fly(self) -> None:
            for kind in sorted(kinds, key=lambda each: ORDER.get(each.followed_by, 2)):
                if kind.followed_by == {WINGS} and flown.world.airframe.is_vtol:
                    await self.to_fixed_wing()
                begin = flown.time / 1e6
                await send(self, kind, 0.5)
                spans[kind] = begin, flown.time / 1e6

    async def program(flight: Flight, vehicle: Flown) -> None:
        nonlocal flown
        flown = vehicle
        await flight.add(Each)
        await in_air(flight, vehicle)
        await flight.fly(Each)

    fly(types, program, Options(vehicle=vehicle))
    for kind, (begin, end) in spans.items():
        for topic in kind.topics:
            times = [each for each in flown.times(topic) if begin <= each <= end]
            expected = 1 if topic in kind.renewed else kind.rate * 0.5
            assert expected <= len(times) <= expected * 1.05 + 3, (kind.name, topic)  # with those of its neighbours
    assert spans.keys() == {*kinds}


class Watched(Flown):
    """Keeps in which mode the vehicle was when a message was sent."""

    def __init__(self, package: Any, options: Options) -> None:
        super().__init__(package, options)
        self.modes: list[int] = []

    def publish(self, topic: str, message: Any) -> None:
        super().publish(topic, message)
        self.modes.append(self.world.mode)

    def of(self, topics: set[str], begin: float) -> list[tuple[Sent, int]]:
        """Return the messages of topics since a time, with the modes of the vehicle."""
        found = zip(self.sent, self.modes, strict=True)
        return [(each, mode) for each, mode in found if each.topic in topics and each.time > begin]


class Case(NamedTuple):
    """A mode that sends, and how it ends or stops to send."""

    release: str
    vehicle: str
    doing: str
    """A kind of setpoints, or `forward` or `back`: a transition of a VTOL."""
    way: str

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """What the mode declares."""
        return followed(self.vehicle, self.release)

    @property
    def kind(self) -> Kind | None:
        """The kind of the setpoints, None in a transition."""
        return next((each for each in self.kinds if each.name == self.doing), None)


def all_cases() -> list[Case]:
    """Return each kind, vehicle and end in the first and in the newest release, so that a few are of all sorts."""
    found = []
    for release in (min(RELEASES), max(RELEASES)):
        for vehicle in VEHICLES:
            kinds = followed(vehicle, release)
            names = [each.name for each in kinds] + ["forward", "back"] * ({GOTO, FIXED_WING} <= {*kinds})
            found += [Case(release, vehicle, name, way) for name in names for way in ENDS]
    random.Random(1).shuffle(found)  # noqa: S311 - not for secrets
    return found


ENDS = ("pilot", "hangs", "unheard", "closes", "returns", "raises")
CASES = all_cases()
HOLDING = {topic for kind in (GOTO, TRAJECTORY, FIXED_WING, *ROVER) for topic in kind.topics}


class Ending:
    """The flight of a case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        times = random.Random("-".join(case))  # noqa: S311 - not for secrets
        self.after, self.seconds = times.uniform(0.3, 1.5), times.uniform(0.6, 4.0)
        self.begin = self.end = 0.0
        """When the mode ends, and when what ended it is over."""
        self.flown: Any = None

    async def program(self, flight: Flight, flown: Flown) -> None:
        """Fly, and end."""
        asyncio.get_running_loop().set_exception_handler(lambda *_: None)
        self.flown, is_ready = flown, asyncio.Event()

        class Sends(Mode, name="Sends"):
            setpoints = self.case.kinds

            async def fly(mode) -> None:  # noqa: N805 - self is another one
                await self.fly(mode, is_ready)

        await flight.add(Sends)
        await in_air(flight, flown)
        await flight.set_mode(EXTERNAL)
        await is_ready.wait()
        await asyncio.sleep(self.after)
        self.begin = flown.time / 1e6
        match self.case.way:
            case "pilot":
                flown.choose(HOLD)
            case "hangs":
                flown.hang(self.seconds)
            case "unheard":
                topics = flown.package.topics.ENDPOINTS
                flown.lost |= {each.uorb_topic for each in topics if each.direction == "out"}
            case "closes":
                flight.close()
            case _:
                await asyncio.sleep(self.seconds)
                flown.choose(HOLD)
        self.end = flown.time / 1e6
        await asyncio.sleep(3.0)

    async def fly(self, mode: Mode, is_ready: asyncio.Event) -> None:
        """Send."""
        doing, kind, way = self.case.doing, self.case.kind, self.case.way
        if self.flown.world.airframe.is_vtol and (doing == "back" or kind == FIXED_WING):
            await mode.to_fixed_wing()
        is_ready.set()
        change = mode.to_fixed_wing if doing == "forward" else mode.to_multicopter
        sending = asyncio.ensure_future(change() if kind is None else send(mode, kind, 1000.0))
        await asyncio.sleep(self.after if way in {"returns", "raises"} else 1000.0)
        sending.cancel()
        if way == "raises":
            raise ArithmeticError("planned")

    def check(self) -> None:
        """Check what was sent since."""
        begin, end = self.begin, self.end
        late = self.flown.of(TOPICS, begin)
        replies = self.flown.of({"arming_check_reply"}, begin + 0.01)
        match self.case.way:
            case "pilot":
                assert all(each.time < begin + 0.25 for each, _ in late)  # PX4 tells its status at 5 Hz
            case "closes":
                assert not late
            case "unheard":
                assert all(each.time < begin + 2.2 for each, _ in late + replies)  # PX4 tells its status at 2 Hz
            case "hangs":
                assert not [each for each, _ in late if begin + 0.5 < each.time < end]
                assert not [each for each, _ in replies if each.time < end]
                assert all(mode == EXTERNAL for each, mode in late if each.time > begin + 0.5)
            case _:
                left = next((each.time for each, mode in replies if mode != EXTERNAL), end)
                assert all(each.time < left + 0.25 for each, _ in late)
                self.check_holds([each for each, _ in late if each.time > begin + 0.05])

    def check_holds(self, late: list[Sent]) -> None:
        """Check that a mode that has ended only holds: its own setpoint is not sent any more."""
        assert {each.topic for each in late} <= HOLDING
        kind = self.case.kind
        if kind is not None:
            before = [each for each in self.flown.sent if each.topic == kind.topic and each.time < self.begin - 0.1]
            assert not [each for each in late if each.topic == kind.topic and is_same(each.message, before[-1].message)]


@by_day("case", CASES, 80, ids=["-".join(each) for each in CASES])
def test_nothing_is_sent_after_the_end_of_the_mode_or_while_the_program_hangs(case: Case) -> None:
    """Setpoints come only in the mode, and none is 0.5 s late. Replies end, too. A mode that has ended only holds."""
    ending = Ending(case)
    fly(package_of(case.release), ending.program, Options(vehicle=case.vehicle), made=Watched)
    ending.check()


def is_same(one: Any, other: Any) -> bool:
    """Whether two setpoints are the same, whenever they were sent."""
    names = [each.name for each in type(one).__msg__.fields if not each.name.startswith("timestamp")]
    return all(repr(getattr(one, name)) == repr(getattr(other, name)) for name in names)


def test_the_errors_say_what_to_use_instead(px4_types: Any) -> None:
    async def plane(flight: Flight, _: Flown) -> None:
        with pytest.raises(UnsupportedError, match=re.escape("declare `setpoints = (FIXED_WING,)`")):
            await flight.add(Waits)  # goto and trajectory, the default

    async def rover(flight: Flight, _: Flown) -> None:
        with pytest.raises(
            UnsupportedError,
            match=re.escape(
                "mode 'Declares': a rover does not follow fixed-wing setpoints, which are for a fixed-wing aircraft. "
                "For a rover, declare `setpoints = ROVER`: `goto` and `rover` drive it"
            ),
        ):
            await flight.add(with_kind(FIXED_WING))
        await flight.arm()
        with pytest.raises(UnsupportedError, match="a rover does not take off"):
            await flight.takeoff()

    fly(px4_types, plane, Options(vehicle="plane"))
    fly(px4_types, rover, Options(vehicle="rover"))


@flying()
async def test_only_a_vtol_changes_in_flight(flight: Flight) -> None:
    with pytest.raises(UnsupportedError, match="only a VTOL changes between hovering and forward flight, not a multi"):
        await flight.to_fixed_wing()
    with pytest.raises(FlightError, match="only a VTOL"):
        await flight.to_multicopter()
