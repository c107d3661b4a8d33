"""Tests of the setpoints of all vehicles: which each follows in which release, and that nothing is sent too long."""

from __future__ import annotations

import asyncio
import re
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import msggen.flight
from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.flight import Flight
from msggen.flight.followers import use_for
from msggen.flight.mode import Mode
from msggen.messages.setpoints import ATTITUDE, FIXED_WING, KINDS, SENT, Kind
from msggen.messages.vehicle_types import FIXED_WING as WINGS
from msggen.messages.vehicle_types import ROTARY_WING
from msggen.sim import Options
from support.examples import examples
from support.flown import EXTERNAL, Flown, Sent, fly
from support.kinds import RELEASES, VEHICLES, followed, in_air, is_bridged, send

pytest_plugins = ["support.flight_releases"]

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


def test_what_is_advised_instead_of_a_kind_that_is_not_declared(types: Any, release: str) -> None:
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

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(Tumbles)
        await in_air(flight, vehicle)
        await flight.fly(Tumbles)

    fly(types, program, Options(vehicle="plane"))


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


KINDS_OF = [(vehicle, kind) for vehicle in VEHICLES for kind in followed(vehicle, "v1.18")]


@settings(max_examples=examples(80, by_day=8))
@given(
    of=st.sampled_from(KINDS_OF),
    how=st.sampled_from(["pilot", "hangs", "unheard", "closes"]),
    after=st.floats(0.3, 1.5),
    seconds=st.floats(0.6, 4.0),
)
def test_nothing_is_sent_after_the_end_of_the_mode_or_while_the_program_hangs(
    px4_types: Any, of: tuple[str, Kind], how: str, after: float, seconds: float
) -> None:
    """For every kind and vehicle: setpoints come only in the mode, and none is 0.5 s late. Replies end, too."""
    vehicle, kind = of
    kinds = followed(vehicle, "v1.18")

    class Sends(Mode, name="Sends"):
        setpoints = kinds

        async def fly(self) -> None:
            if kind == FIXED_WING and flown.world.airframe.is_vtol:
                await self.to_fixed_wing()
            is_ready.set()
            await send(self, kind, 1000.0)

    flown: Any = None
    is_ready: Any = None

    async def program(flight: Flight, found: Flown) -> tuple[float, float]:
        nonlocal flown, is_ready
        flown, is_ready = found, asyncio.Event()
        await flight.add(Sends)
        await in_air(flight, found)
        await flight.set_mode(EXTERNAL)
        await is_ready.wait()
        await asyncio.sleep(after)
        begin = found.time / 1e6
        if how == "pilot":
            found.choose(HOLD)
        elif how == "hangs":
            found.hang(seconds)
        elif how == "unheard":
            found.lost |= {each.uorb_topic for each in px4_types.topics.ENDPOINTS if each.direction == "out"}
        else:
            flight.close()
        end = found.time / 1e6
        await asyncio.sleep(3.0)
        return begin, end

    begin, end = fly(px4_types, program, Options(vehicle=vehicle), made=Watched)
    late = flown.of(TOPICS, begin)
    if how == "pilot":
        assert all(each.time < begin + 0.25 for each, _ in late)  # PX4 tells its status at 5 Hz
    elif how == "closes":
        assert not late
    elif how == "unheard":
        assert all(each.time < begin + 2.2 for each, _ in late)  # PX4 tells its status at 2 Hz
        assert all(each.time < begin + 2.2 for each, _ in flown.of({"arming_check_reply"}, begin))
    else:
        assert not [each for each, _ in late if begin + 0.5 < each.time < end]
        assert not [each for each, _ in flown.of({"arming_check_reply"}, begin + 0.01) if each.time < end]
        assert all(mode == EXTERNAL for each, mode in late if each.time > begin + 0.5)


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


def test_only_a_vtol_changes_in_flight(px4_types: Any) -> None:
    async def program(flight: Flight, _: Flown) -> None:
        with pytest.raises(
            UnsupportedError, match="only a VTOL changes between hovering and forward flight, not a multi"
        ):
            await flight.to_fixed_wing()
        with pytest.raises(FlightError, match="only a VTOL"):
            await flight.to_multicopter()

    fly(px4_types, program)
