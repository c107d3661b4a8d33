"""Tests of flights over links with a simulated vehicle in real time: direct, and through the process that owns it."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from msggen.flight import (
    BlockingFlight,
    Flight,
    FlightError,
    Mode,
    NoAnswerError,
    UnsupportedError,
)
from msggen.flight.link import _WAITING, LinkConnection, _Inbox
from msggen.generate.cache import package_from, package_of
from msggen.link.udp import UdpLink
from msggen.link.xrce.client_entities import Sync
from msggen.live import Vehicle
from msggen.sim import Misbehaviour, Simulator
from msggen.sim.commander.components import Registration
from msggen.sources.finding import find_sources
from support.examples import by_day
from support.flying import (
    CALM,
    EXTERNAL,
    LONG,
    PATIENCE,
    FlyingProgram,
    Hop,
    Hops,
    commander,
    simulated,
    until,
    wait_long_for_replies,
)
from support.link_records import nothing_is_left
from support.ports import free_port
from support.repository import ROOT
from support.served import owners

pytest_plugins = ["support.owned_links"]

REGISTER = "/fmu/in/register_ext_component_request"


class Rests(Mode, name="Rests"):
    """Flies for ever."""

    async def fly(self) -> None:
        await self.hold(1000.0)


@pytest.fixture
def url() -> str:
    return f"udp://127.0.0.1:{free_port()}"


async def hops(flight: Flight) -> list[str]:
    """Fly, and return what has been done."""
    executor = Hops()
    async with flight:
        await flight.add(executor)
        await flight.set_mode(Hop)
        await flight.arm()
        await executor.end.wait()
    return executor.done


async def enters(flight: Flight, *parts: Any) -> None:
    """Register, and end."""
    async with flight:
        await flight.add(*parts)


@pytest.mark.slow
@by_day("release", ["v1.18", "v1.16"], 2)
def test_a_flight_over_an_own_link(release: str, url: str, px4_types: Any) -> None:
    types = px4_types if release == "v1.18" else package_of(release)
    with nothing_is_left(), simulated(types, url, speed=2.0) as simulator:
        wait_long_for_replies(simulator)
        assert asyncio.run(hops(Flight(url, types, key=1))) == ["takeoff", "hop", "landed"]
        until(lambda: not commander(simulator).components.modes, LONG)


@pytest.mark.slow
@pytest.mark.usefixtures("owned")
def test_a_flight_over_a_link_that_another_process_owns(url: str, px4_types: Any) -> None:
    with simulated(px4_types, url) as simulator, nothing_is_left(), Vehicle(url, px4_types) as vehicle:
        assert vehicle.is_shared
        wait_long_for_replies(simulator)
        assert asyncio.run(hops(Flight(vehicle))) == ["takeoff", "hop", "landed"]
        until(lambda: not commander(simulator).components.modes, LONG)
        assert vehicle.is_connected, "a flight closes only a Vehicle of its own"


@by_day("sync", ["short", "off"], 2)
def test_measurements_are_fused_over_a_link(sync: Sync, url: str, px4_types: Any) -> None:
    """By UTC, and by times since boot if the clocks are not synchronized."""

    async def see(flight: Flight) -> None:
        while True:
            flight.measure.local(position=(3.0, 0.0, 0.0), variance=0.01, time=flight.measure.time - 20_000)
            await asyncio.sleep(0.03)

    async def measures() -> bool:
        async with Flight(url, px4_types, key=1) as flight:
            camera = asyncio.ensure_future(see(flight))
            await flight.measure.fused(PATIENCE)
            camera.cancel()
            return flight.measure.time > 10**15

    options = CALM._replace(sync=sync, parameters={"EKF2_EV_CTRL": 15.0, "EKF2_GPS_CTRL": 0.0})
    with simulated(px4_types, url, options) as simulator:
        assert asyncio.run(measures()) == (sync == "short")
        assert simulator.vehicles[0].world.flight.position[0] == 3.0


@pytest.mark.usefixtures("owned")
def test_two_programs_do_not_fly_one_mode(url: str, px4_types: Any) -> None:
    with simulated(px4_types, url) as simulator:
        program = FlyingProgram(url, px4_types)
        program.tell()
        program.wait("ready")
        other = FlyingProgram(url.replace("127.0.0.1", "localhost"), px4_types)
        other.tell()
        told = other.wait("RegistrationError")
        assert (
            told == f"RegistrationError: process {program.process.pid} flies mode 'Stays' of this vehicle: end it first"
        )
        assert other.end() == 0
        assert {*commander(simulator).components.modes} == {EXTERNAL}
        wait_long_for_replies(simulator)
        program.process.terminate()
        assert program.end() == 143
        until(lambda: not commander(simulator).components.modes, LONG)


def test_subscriptions_that_have_ended_are_forgotten(url: str, px4_types: Any) -> None:
    async def subscribes(vehicle: Vehicle) -> int:
        connection = LinkConnection(vehicle, (px4_types,))
        await connection.open(())
        for topic in ("vehicle_status", "vehicle_land_detected") * 20:
            older, newer = (connection.subscribe(topic, lambda _: None) for _ in range(2))
            older()
            connection.recall(topic, lambda *_: None)
            newer()
        return len(connection._subscriptions)

    with simulated(px4_types, url), Vehicle(url, px4_types) as vehicle:
        assert asyncio.run(subscribes(vehicle)) == 0


def test_a_slot_that_another_program_has_is_told(url: str, px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    with simulated(px4_types, url) as simulator:
        asyncio.run(enters(Flight(url, px4_types, key=1), Rests))
        assert not caplog.records
        until(lambda: not commander(simulator).components.modes)
        commander(simulator).register(Registration("Rests", check=True, mode=True))
        asyncio.run(enters(Flight(url, px4_types, key=1), Rests))
        assert "mode 'Rests' is mode 24 of the vehicle and was 23 before" in caplog.text


def test_other_definitions_are_told_before_anything_is_sent(url: str, px4_types: Any) -> None:
    options = CALM._replace(misbehaviour=Misbehaviour(wrong_hashes=["GotoSetpoint", "ArmingCheckReply"]))
    with simulated(px4_types, url, options) as simulator:
        with pytest.raises(UnsupportedError) as caught:
            asyncio.run(enters(Flight(url, px4_types, key=1), Rests))
        assert "other definitions of ArmingCheckReply, GotoSetpoint: give the types of its release" in str(caught.value)
        assert "px4_types" in str(caught.value)
        assert not simulator.vehicles[0].received[REGISTER + "_v2"]


def test_the_package_that_fits_the_vehicle_is_taken(url: str, px4_types: Any) -> None:
    old = package_of("v1.16")
    with simulated(old, url):
        with pytest.raises(UnsupportedError, match=r"the vehicle has v1\.16, and px4_types has other definitions of"):
            asyncio.run(enters(Flight(url, px4_types, key=1), Rests))
        asyncio.run(enters(Flight(url, [px4_types, old], key=1), Rests))


def test_a_topic_that_the_vehicle_does_not_have_is_named(url: str, px4_types: Any, tmp_path: Path) -> None:
    less = without(["/fmu/in/goto_setpoint", "/fmu/out/home_position"], tmp_path)

    async def asks() -> None:
        async with Flight(url, px4_types, key=1) as flight:
            with pytest.raises(UnsupportedError, match="does not bridge /fmu/in/goto_setpoint: "):
                await flight.add(Rests)
            with pytest.raises(UnsupportedError, match="does not bridge /fmu/out/home_position: "):
                await flight.telemetry.home()

    with simulated(less, url):
        asyncio.run(asks())


def test_types_and_an_address_are_needed(url: str, px4_types: Any) -> None:
    with pytest.raises(TypeError, match="a flight needs the generated package"):
        asyncio.run(enters(Flight(url)))
    with pytest.raises(FlightError, match="is not the address of a link"):
        asyncio.run(enters(Flight("8888:udp", px4_types)))


def test_a_wait_for_a_vehicle_can_be_cancelled(url: str, px4_types: Any) -> None:
    async def waits() -> None:
        task = asyncio.create_task(enters(Flight(url, px4_types)))
        await asyncio.sleep(0.3)
        begin = time.monotonic()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert time.monotonic() - begin < 10.0

    with nothing_is_left():
        asyncio.run(waits())


@pytest.mark.slow
def test_a_link_that_is_lost_keeps_the_modes(url: str, px4_types: Any) -> None:
    options = CALM._replace(misbehaviour=Misbehaviour(restart_every=4.0))

    async def stays() -> None:
        async with Flight(url, px4_types, key=1) as flight:
            await flight.add(Rests)
            ids = flight.find(Rests).ids
            await asyncio.sleep(9.0)
            assert flight.find(Rests).ids is ids
            assert not commander(simulator).checks.is_unresponsive(ids.check)

    with simulated(px4_types, url, options) as simulator:
        asyncio.run(stays())
        vehicle = simulator.vehicles[0]
        assert sum(count for name, count in vehicle.received.items() if name.startswith(REGISTER)) == 1
        assert [each.text for each in vehicle.changes].count("the client restarts") >= 2


@pytest.mark.slow
@by_day("release", ["v1.18", "v1.16"], 2)
def test_a_vehicle_that_restarts_gets_all_modes_again(
    release: str, url: str, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    types = px4_types if release == "v1.18" else package_of(release)

    async def restarts() -> None:
        loop = asyncio.get_running_loop()
        simulator = await asyncio.to_thread(Simulator(types, url, [CALM]).__enter__)
        async with Flight(url, types, key=1) as flight:
            await flight.add(Hops, Rests)
            await flight.arm()
            await flight.takeoff(2.5)
            await flight.set_mode(Rests)
            await until_so(lambda: flight.find(Rests).is_active)
            old = flight.find(Rests)
            await asyncio.to_thread(simulator.close)
            simulator = await asyncio.to_thread(Simulator(types, url, [CALM]).__enter__)
            begin = loop.time()
            await until_so(lambda: {EXTERNAL, EXTERNAL + 1} <= {*commander(simulator).components.modes})
            assert loop.time() - begin < 8.0
            await until_so(lambda: flight.find(Rests) is not old)
            assert not old.is_active
            await flight.set_mode(Rests)  # its replies arrive
            await flight.arm()
        await asyncio.to_thread(simulator.close)

    asyncio.run(restarts())
    assert "mode 'Rests' has ended" in caplog.text
    assert "the vehicle has restarted" in caplog.text


@pytest.mark.slow
@pytest.mark.usefixtures("owned")
def test_the_death_of_the_owner_of_the_link_does_not_end_a_mode(url: str, px4_types: Any) -> None:
    async def stays(simulator: Simulator) -> None:
        async with Flight(url, px4_types, key=1) as flight:
            await flight.add(Rests)
            await flight.arm()
            await flight.takeoff(2.5)
            await flight.set_mode(Rests)
            (owner,) = owners()
            wait_long_for_replies(simulator)
            os.kill(owner.state["pid"], signal.SIGKILL)
            await until_so(lambda: {each.state.get("pid") for each in owners()} - {None, owner.state["pid"]})
            status = flight.feeds["vehicle_status"]
            last = status.latest
            await until_so(lambda: status.latest is not last)
            assert commander(simulator).mode == EXTERNAL
            assert "return" not in " ".join(each.text for each in simulator.vehicles[0].changes)
            await flight.land()

    with simulated(px4_types, url) as simulator, nothing_is_left():
        asyncio.run(stays(simulator))


@pytest.mark.usefixtures("owned")
def test_a_flight_is_told_that_the_owner_of_the_link_stands_still(url: str, px4_types: Any) -> None:
    async def program() -> None:
        async with Flight(url, px4_types, key=1) as flight:
            assert flight.problem == ""
            (owner,) = owners()
            os.kill(owner.state["pid"], signal.SIGSTOP)
            try:
                with pytest.raises(NoAnswerError, match="do not get through: the process that owns the link has taken"):
                    await flight.set_mode("land")  # it is in Hold, as samples say that have waited
                assert "does it stand still?" in flight.problem
            finally:
                os.kill(owner.state["pid"], signal.SIGCONT)
            await flight.set_mode("land")
            await until_so(lambda: not flight.problem)

    with simulated(px4_types, url), nothing_is_left():
        asyncio.run(program())


async def until_so(condition: Callable[[], object]) -> None:
    """Wait until something is so. A mode that is not registered yet is none."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            if condition():
                return
        except FlightError:
            pass
        await asyncio.sleep(0.02)
    raise AssertionError("it is not so")


def test_a_program_that_hangs_keeps_few_messages() -> None:
    async def hangs() -> list[int]:
        taken: list[int] = []
        inbox = _Inbox(asyncio.get_running_loop(), taken.append)
        for number in range(10_000):  # before the loop runs
            inbox.put(number)
        await asyncio.sleep(0.0)
        inbox.put(10_000)
        await asyncio.sleep(0.0)
        inbox.put(10_001)
        inbox.close()
        await asyncio.sleep(0.0)
        return taken

    assert asyncio.run(hangs()) == [*range(10_000 - _WAITING, 10_001)]


def test_a_vehicle_that_is_gone_makes_actions_fail_in_time(
    url: str, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    async def goes() -> None:
        simulator = await asyncio.to_thread(Simulator(px4_types, url, [CALM]).__enter__)
        async with Flight(url, px4_types, key=1) as flight:
            await flight.add(Rests)
            await asyncio.to_thread(simulator.close)
            begin = time.monotonic()
            with pytest.raises(NoAnswerError):
                await flight.arm()
            with pytest.raises(NoAnswerError):
                await flight.add(Hop)
            assert time.monotonic() - begin < 8.0

    with caplog.at_level(logging.WARNING):
        asyncio.run(goes())
    assert caplog.text.count("messages to the vehicle are lost") == 1


def without(topics: list[str], folder: Path) -> Any:
    """Return a package of the newest release without some topics."""
    rows = (ROOT / "dds_topics.yaml").read_text()
    for topic in topics:
        rows, count = re.subn(f" *- topic: {topic}\n(?: +[a-z_]+:.*\n)*", "", rows)
        assert count == 1
    (folder / "less.yaml").write_text(rows)
    return package_from(find_sources(None, topics=str(folder / "less.yaml")))


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait longer for vehicles that connect later: a busy computer connects them so.

    A flight that begins within 2 s after that of another test would not wait at all.
    """
    monkeypatch.setattr("msggen.flight.registered.FRESH", 0.0)
    for name in ("vehicle.alone._OTHERS", "link.xrce.agent._SETTLED"):
        monkeypatch.setattr(f"msggen.{name}", 30.0)


@pytest.mark.usefixtures("patient")
@by_day(("keys", "fixtures"), [((1, 2), ()), ((2, 1), ()), ((1, 2), ("owned",)), ((2, 1), ("owned",))], 3)
def test_a_vehicle_that_connects_later_is_not_overlooked(
    keys: tuple[int, int], fixtures: tuple[str, ...], url: str, px4_types: Any, request: pytest.FixtureRequest
) -> None:
    for each in fixtures:
        request.getfixturevalue(each)

    async def begins() -> None:
        first, second = (Simulator(px4_types, url, [CALM._replace(key=key)]) for key in keys)
        with ExitStack() as vehicles:
            vehicles.enter_context(first)
            flight = asyncio.create_task(Flight(url, px4_types).__aenter__())
            await asyncio.sleep(0.3)
            await asyncio.to_thread(vehicles.enter_context, second)
            with pytest.raises(FlightError, match=r"2 vehicles are on udp.*key 1.*key 2.*Flight\(url, key=1\)"):
                await flight

    asyncio.run(begins())


def test_two_vehicles_with_the_same_key_are_two(url: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is 1 unless it was set, so this is the usual case."""
    monkeypatch.setattr("msggen.flight.registered.FRESH", 0.0)  # see `patient`

    async def begins() -> None:
        with pytest.raises(FlightError, match=r"2 vehicles are on udp.*key 1.*key 1.*UXRCE_DDS_KEY of each"):
            await Flight(url, px4_types).__aenter__()

    with Simulator(px4_types, url, [CALM]), Simulator(px4_types, url, [CALM]):
        asyncio.run(begins())


@pytest.mark.parametrize("which", [{"key": 1}, {"namespace": ""}])
def test_a_vehicle_that_was_chosen_waits_for_no_other(
    which: dict[str, Any], url: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_settled(_: object) -> bool:
        raise AssertionError

    async def begins() -> None:
        async with Flight(url, px4_types, **which) as flight:
            assert not flight.is_armed

    monkeypatch.setattr(UdpLink, "is_settled", is_settled)
    with simulated(px4_types, url):
        asyncio.run(begins())


@pytest.mark.usefixtures("owned")
def test_one_of_several_vehicles_flies_only_if_it_was_chosen(url: str, px4_types: Any) -> None:
    async def key_of(flight: Flight) -> int:
        async with flight:
            status = await flight._feeds["vehicle_status"].wait(lambda _: True, PATIENCE)
            return int(status.system_id)

    with Simulator(px4_types, url, [CALM, CALM._replace(key=2)]), Vehicle(url, px4_types) as vehicle:
        vehicle.wait_connected(PATIENCE)
        until(lambda: vehicle.others)
        chosen = Vehicle(url, px4_types, key=2)
        for flight in (Flight(url, px4_types), Flight(vehicle), BlockingFlight(url, px4_types)):
            with pytest.raises(FlightError, match=r"2 vehicles are on udp.*key 1.*key 2.*Flight\(url, key=1\)"):
                flight.__enter__() if isinstance(flight, BlockingFlight) else asyncio.run(key_of(flight))
        with chosen:
            assert [asyncio.run(key_of(each)) for each in (Flight(url, px4_types, key=2), Flight(chosen))] == [2, 2]
        with pytest.raises(TypeError, match="give them to the Vehicle"):
            asyncio.run(key_of(Flight(vehicle, key=2)))
