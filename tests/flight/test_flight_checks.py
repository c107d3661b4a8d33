"""Tests of checks without a mode, of replies to arming checks, their health and arguments, and of wrong ones."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.flight import Check, Component, Executor, Flight, FlightError, Health, Mode, Problem, Severity
from msggen.flight.checks import Answers, Verdict
from msggen.flight.errors import RefusedError, RegistrationError
from msggen.flight.feeds import Feeds
from msggen.flight.registration import Registrar, Wanted
from msggen.flight.resuming import Memory
from msggen.messages.events import CODES, OWN, SIZE, event_id, packed
from msggen.sim import Options
from msggen.sim.loop import run
from support.flown import EXTERNAL, Flown, Line, Short, fly, flying, flying_each
from support.simulation import topics_of

HOLD, POSITION, LAND = 4, 2, 18


class Doors(Check, name="Doors"):
    """Holds the vehicle back while its doors are open."""

    is_open = True

    def problems(self) -> list[Problem]:
        return [Problem("doors_open")] if self.is_open else []


def has_mask(types: Any) -> bool:
    """Whether requests say which checks the vehicle knows."""
    return "valid_registrations_mask" in {field.name for field in types.ArmingCheckRequest.__msg__.fields}


def checks(vehicle: Flown) -> int:
    """Return how many checks without a mode the vehicle knows."""
    return sum(each.mode < 0 for each in vehicle.world.commander.checks.registered.values())


def replies(vehicle: Flown) -> list[Any]:
    return [each.message for each in vehicle.sent if each.topic == "arming_check_reply"]


# arming


@flying_each()
async def test_a_check_keeps_the_vehicle_from_arming_in_all_modes(flight: Flight, vehicle: Flown) -> None:
    """HealthAndArmingChecks, denyArming: pre_flight_checks_pass is false."""

    doors = Doors()

    status = flight.feeds["vehicle_status"]
    await flight.add(Line, doors)
    await status.wait(lambda each: not each.pre_flight_checks_pass, 2.0)
    for mode in (HOLD, EXTERNAL):
        await flight.set_mode(mode)
        with pytest.raises(RefusedError, match=r"arm: .* the preflight checks fail"):
            await flight.arm()
    doors.is_open = False
    await status.wait(lambda each: bool(each.pre_flight_checks_pass), 2.0)
    await flight.arm()
    assert vehicle.world.is_armed


@flying_each()
async def test_after_it_was_added_a_check_that_has_no_problem_lets_the_vehicle_arm_at_once(flight: Flight) -> None:
    doors = Doors()

    doors.is_open = False

    await flight.add(doors)
    await flight.arm()


@flying_each()
async def test_a_check_has_no_effect_in_flight(flight: Flight, vehicle: Flown) -> None:
    doors = Doors()

    doors.is_open = False

    await flight.add(doors, Line)
    await vehicle.in_air(flight)
    await flight.set_mode(Line)
    doors.is_open = True
    await asyncio.sleep(2.0)
    assert vehicle.world.mode == EXTERNAL
    await flight.hold()
    await flight.land()
    await flight.wait_disarmed()
    with pytest.raises(RefusedError, match="the preflight checks fail"):
        await flight.arm()


def test_a_check_that_does_not_answer_permits_arming(types: Any) -> None:
    async def program(flight: Flight, vehicle: Flown) -> float:
        await flight.add(Doors)
        assert checks(vehicle) == 1
        vehicle.lost = {"arming_check_reply"}
        taken = await vehicle.until(lambda: not checks(vehicle), 2.0)
        await flight.arm()
        return taken

    assert 0.6 < fly(types, program) < 1.4


# what is registered


@flying_each()
async def test_a_check_is_registered_without_a_mode_and_unregistered_at_the_end(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Doors)
    (request,) = [each.message for each in vehicle.sent if each.topic == "register_ext_component_request"]
    wanted = request.register_arming_check, request.register_mode, request.register_mode_executor
    assert wanted == (True, False, False)
    await asyncio.sleep(5.0)
    assert checks(vehicle) == 1
    assert not vehicle.world.commander.components.modes
    flight.close()
    await asyncio.sleep(0.1)
    assert not vehicle.world.commander.checks.registered
    (end,) = [each.message for each in vehicle.sent if each.topic == "unregister_ext_component"]
    assert (end.mode_id, end.mode_executor_id) == (-1, -1)


@flying_each(Options(parameters={"COM_MODE_ARM_CHK": 1.0}))
async def test_a_check_is_not_registered_in_flight(flight: Flight, vehicle: Flown) -> None:
    """Also by a vehicle that would take it: a registration disturbs the mode whose check has the id 0."""
    await flight.arm()
    with pytest.raises(RegistrationError, match="Doors: the vehicle is armed: register before arming"):
        await flight.add(Doors)
    assert not vehicle.times("register_ext_component_request")


@flying_each()
async def test_checks_take_the_places_of_modes(flight: Flight, vehicle: Flown) -> None:
    """PX4 has 8 arming checks, those of modes included."""

    many = [type(f"Doors{number}", (Doors,), {"is_open": False}) for number in range(8)]

    await flight.add(Short, *many[:7])
    with pytest.raises(RegistrationError, match=r"Doors7: no slot is free: PX4 has 8 modes, 8 arming checks"):
        await flight.add(many[7])
    assert checks(vehicle) == 7
    await flight.arm()
    await asyncio.sleep(3.0)
    assert checks(vehicle) == 7


# lost registrations


@flying_each()
async def test_after_a_restart_of_the_vehicle_a_check_is_registered_again(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Doors, Short)
    await vehicle.restart_after(2.0)
    await vehicle.until(lambda: checks(vehicle) == 1 and bool(vehicle.world.commander.components.modes), 8.0)
    await asyncio.sleep(0.7)
    with pytest.raises(RefusedError, match="the preflight checks fail"):
        await flight.arm()


@flying_each()
async def test_after_a_lost_link_on_the_ground_a_check_is_registered_again(flight: Flight, vehicle: Flown) -> None:
    """A mode that is selected stays registered, so PX4 goes on to send requests."""
    await flight.add(Short, Doors)
    await flight.set_mode(Short)
    vehicle.loss = 1.0
    await vehicle.until(lambda: not checks(vehicle), 2.0)
    await asyncio.sleep(0.5)
    vehicle.loss = 0.0
    await vehicle.until(lambda: checks(vehicle) == 1, 4.0)
    await asyncio.sleep(3.0)
    assert (checks(vehicle), len(vehicle.world.commander.components.modes)) == (1, 1)


@flying_each()
async def test_a_check_that_was_removed_in_flight_is_registered_again_after_landing(
    flight: Flight, vehicle: Flown
) -> None:
    """The mode, which the vehicle has kept, goes on and is not registered twice."""

    doors = Doors()

    doors.is_open = False

    await flight.add(Line, doors)
    await vehicle.in_air(flight)
    await flight.set_mode(Line)
    vehicle.loss = 1.0
    await vehicle.until(lambda: not checks(vehicle), 2.0)
    vehicle.loss = 0.0
    await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 1.0)
    asked = len(vehicle.times("register_ext_component_request"))
    await asyncio.sleep(4.0)
    assert len(vehicle.times("register_ext_component_request")) == asked
    await flight.land()
    await flight.wait_disarmed()
    await vehicle.until(lambda: checks(vehicle) == 1, 4.0)
    await asyncio.sleep(3.0)
    assert checks(vehicle) == 1
    names = [bytes(each.message.name).rstrip(b"\0") for each in vehicle.sent if each.topic.startswith("register")]
    assert names == [b"Line", b"Doors", b"Doors"]
    assert [each.name for each in vehicle.world.commander.components.modes.values()] == ["Line"]


def test_an_id_that_the_vehicle_has_given_to_another_program_is_not_answered_for(types: Any) -> None:
    """PX4 has removed the check while its program was silent, and takes the replies of both for those of the other."""
    vehicle = Flown(types)

    async def main() -> None:
        await asyncio.sleep(1.0)
        async with Flight(vehicle) as silent, Flight(vehicle) as flight:
            await silent.add(Doors)
            vehicle.lost = {"arming_check_reply"}
            await vehicle.until(lambda: not checks(vehicle), 2.0)
            vehicle.lost = set()
            await flight.add(Short)
            assert vehicle.world.commander.components.modes[EXTERNAL].check == 0
            await vehicle.until(lambda: checks(vehicle) == 1, 4.0)
            await asyncio.sleep(2.0)
            registered = vehicle.world.commander.checks.registered
            assert {number: each.mode for number, each in registered.items()} == {0: EXTERNAL, 1: -1}
            latest = {each.registration_id: each.can_arm_and_run for each in replies(vehicle)[-4:]}
            assert latest == {0: True, 1: False}

    run(main(), vehicle)


class Remembering(Flight):
    """Notes its ids as a flight on a link does, and can be killed."""

    async def _open(self) -> None:
        await super()._open()
        self._own._memory = Memory("a simulated vehicle")

    def kill(self) -> None:
        parts = self._own
        assert parts._memory is not None
        for name in [*parts._registered]:
            parts._memory.release(name)
        parts._registered.clear()
        parts.stop()


@pytest.mark.parametrize("is_late", [False, True])
def test_a_program_that_was_killed_in_flight_goes_on_with_its_check(
    types: Any, *, is_late: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It goes on with the ids. A check that PX4 has removed meanwhile is registered after landing."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    vehicle = Flown(types)

    class Open(Doors, name="Doors"):
        is_open = False

    async def main() -> None:
        await asyncio.sleep(1.0)
        async with Remembering(vehicle) as first:
            await first.add(Line, Open)
            await vehicle.in_air(first)
            await first.set_mode(Line)
            await asyncio.sleep(0.5)
            first.kill()
            await asyncio.sleep(1.5 if is_late else 0.1)
            assert checks(vehicle) == (not is_late)
            async with Remembering(vehicle, resume=True) as flight:
                await flight.add(Open, Line)
                await vehicle.until(lambda: vehicle.world.mode == EXTERNAL, 1.0)
                assert len(vehicle.times("register_ext_component_request")) == 2
                await flight.land()
                await flight.wait_disarmed()
                await vehicle.until(lambda: checks(vehicle) == 1, 3.0)
                await asyncio.sleep(3.0)
                assert (checks(vehicle), len(vehicle.world.commander.components.modes)) == (1, 1)
                is_new = is_late or not has_mask(types)
                assert len(vehicle.times("register_ext_component_request")) == 2 + is_new

    run(main(), vehicle)
    assert ("'Doors': it is registered again once disarmed" in caplog.text) is (is_late or not has_mask(types))


def test_the_ids_of_a_mode_are_not_those_of_a_check(
    px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    vehicle = Flown(px4_types)

    class Other(Doors, name="Line"):
        pass

    async def main() -> None:
        await asyncio.sleep(1.0)
        async with Remembering(vehicle) as first:
            await first.add(Line)
            await vehicle.in_air(first)
            first.kill()
            async with Remembering(vehicle) as flight:
                with pytest.raises(RegistrationError, match="the vehicle is armed"):
                    await flight.add(Other)

    run(main(), vehicle)


# wrong use


class Forgets(Check):
    """Has no `problems`."""


class Awaits(Check):
    """Has a coroutine."""

    async def problems(self) -> list[Problem]:  # type: ignore[override]
        return []


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ((Forgets,), r"check 'Forgets' needs a method `def problems\(self\)`"),
        ((Awaits,), r"check 'Awaits' needs a method `def problems\(self\)`"),
        ((Doors, Doors), "expected one object of each mode and one executor for it, and one object of each check"),
    ],
)
@flying()
async def test_a_wrong_check_is_an_error_before_anything_is_sent(
    flight: Flight, vehicle: Flown, parts: Any, text: str
) -> None:
    with pytest.raises(RegistrationError, match=text):
        await flight.add(Short, *parts)
    assert vehicle.sent == []


def test_a_check_cannot_be_flown(px4_types: Any) -> None:
    doors = Doors()

    class Runs(Executor):
        mode = Short

        async def run(self) -> None:
            await self.fly(Doors)  # type: ignore[arg-type]

    async def program(flight: Flight, vehicle: Flown) -> None:
        await flight.add(doors, Runs)
        sent = len(vehicle.times("vehicle_command"))
        calls: list[Any] = [flight.set_mode, flight.fly]
        for call in calls:
            with pytest.raises(FlightError, match="'Doors' is a check without a mode, and flies nothing"):
                await call(doors)
        assert len(vehicle.times("vehicle_command")) == sent
        assert (flight.mode, doors.is_registered) == ("hold", True)
        with pytest.raises(RegistrationError, match="a check with the name 'Doors' is registered already"):
            await flight.add(Doors)
        with pytest.raises(RegistrationError, match="a mode with the name 'Short' is registered already"):
            await flight.add(type("Other", (Doors,), {}, name="Short"))

    fly(px4_types, program)
    assert not doors.is_registered


@pytest.mark.parametrize(
    "case",
    [
        (Doors, "problems", None),
        (Short, "problems", "doors_open"),
        (Doors, "problems", Problem("doors_open")),
        (Short, "problems", ["doors_open"]),
        (Doors, "health", "payload"),
        (Short, "health", Component.PAYLOAD),
    ],
)
@flying()
async def test_an_answer_of_the_wrong_type_is_told_once_and_does_not_end_the_replies(
    flight: Flight, vehicle: Flown, case: tuple[type[Doors | Mode], str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    base, method, found = case
    wrong: Any = type("Wrong", (base,), {method: lambda _: found, "is_open": False})

    await flight.add(Line, wrong)
    await asyncio.sleep(3.0)
    registered = vehicle.world.commander.checks.registered
    assert len(registered) == 2
    assert not any(each.is_unresponsive for each in registered.values())
    latest = {each.registration_id: each.can_arm_and_run for each in replies(vehicle)[-4:]}
    assert latest == {0: True, 1: method == "health"}
    assert caplog.text.count(f"`{method}` of {'check' if base is Doors else 'mode'} 'Wrong' has failed") == 1
    assert "expected a" in caplog.text or found is None or isinstance(found, Problem)


# what replies carry


@flying_each()
async def test_a_reply_has_the_health_and_the_arguments(flight: Flight, vehicle: Flown) -> None:
    class Camera(Check):
        def problems(self) -> Iterator[Problem]:  # type: ignore[override]
            yield Problem("camera_slow", Severity.WARNING, (("uint8_t", 3), ("float", 1.5), ("int16_t", -2)))
            yield Problem("camera_hot")

        def health(self) -> Health:
            return Health(Component.VISION_POSITION, has_warning=True)

    class Plain(Short):
        """Says nothing of a component."""

    await flight.add(Camera, Plain)
    await asyncio.sleep(0.5)
    plain, camera = sorted(replies(vehicle)[-2:], key=lambda each: bool(each.num_events))
    assert (plain.health_component_index, plain.health_component_is_present) == (0, False)
    health = ("index", "is_present", "warning", "error")
    assert [getattr(camera, f"health_component_{name}") for name in health] == [5, True, True, False]
    slow, hot = camera.events[: camera.num_events]
    assert (slow.id, slow.log_levels) == (event_id("camera_slow"), 0x44)
    assert bytes(slow.arguments) == struct.pack("<IBBfh13x", 0, 5, 3, 1.5, -2)
    assert bytes(hot.arguments) == struct.pack("<IB20x", 0, 5)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((("uint8", 3),), "events have no arguments of type 'uint8', did you mean 'uint8_t'"),
        ((("uint8_t", 256),), "expected uint8_t as an argument of an event, got 256"),
        ((("uint8_t", -1),), "expected uint8_t as an argument of an event, got -1"),
        ((("int32_t", 0.5),), "expected int32_t as an argument of an event, got 0.5"),
        ((("float", 1e39),), "expected float as an argument of an event, got 1e"),
        ((("float", "1"),), "expected float as an argument of an event, got '1'"),
        ((("uint64_t", 1),) * 2 + (("float", 1.0), ("uint8_t", 1)), "the arguments have 21 bytes: 20 fit"),
        (("float", 1.0), "expected pairs as arguments of an event, such as .* got 'float'"),
        ((1,), "expected pairs as arguments of an event"),
    ],
)
def test_an_argument_that_an_event_cannot_have_is_an_error_where_it_is_written(arguments: Any, text: str) -> None:
    with pytest.raises((ValueError, TypeError), match=text):
        Problem("doors_open", Severity.ERROR, arguments)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((3,), 'expected the name of an event, such as "my_mode_no_target", got 3'),
        (("doors_open", "error"), "expected a Severity, such as Severity.WARNING, got 'error'"),
        (("doors_open", 3), "expected a Severity"),
        (("doors_\ud800",), "surrogates not allowed"),
    ],
)
def test_a_problem_that_cannot_be_sent_is_an_error_where_it_is_written(values: Any, text: str) -> None:
    with pytest.raises((ValueError, TypeError), match=text):
        Problem(*values)


def _ranged(kind: str) -> st.SearchStrategy[tuple[str, int]]:
    """Return arguments of a type of integers."""
    bits = 8 * struct.calcsize(f"<{CODES[kind]}")
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if CODES[kind].islower() else (0, (1 << bits) - 1)
    return st.tuples(st.just(kind), st.integers(least, most))


INTEGERS = st.sampled_from(sorted(CODES.keys() - {"float"})).flatmap(_ranged)


@given(st.lists(INTEGERS, max_size=6))
def test_arguments_come_out_as_they_went_in(arguments: list[tuple[str, int]]) -> None:
    layout = "<" + "".join(CODES[kind] for kind, _ in arguments)
    if struct.calcsize(layout) > SIZE - OWN:
        with pytest.raises(ValueError, match="20 fit into an event"):
            packed(arguments)
    else:
        assert struct.unpack(layout, packed(arguments)) == tuple(value for _, value in arguments)


@pytest.mark.parametrize(("component", "text"), [("paylod", r", did you mean 'PAYLOAD'\?"), (23, ""), (None, "")])
def test_health_is_that_of_a_component(component: Any, text: str) -> None:
    with pytest.raises(TypeError, match=rf"expected a Component, such as Component.PAYLOAD, got {component!r}{text}$"):
        Health(component)


def test_components_are_the_bits_of_a_report() -> None:
    assert [*Component] == [*range(32)]


REQUEST, REPLY = "arming_check_request", "arming_check_reply"
PERIOD = 0.314
FOREIGN = 6


class Asked(Flown):
    """A vehicle whose requests are kept. Those of some numbers, counted from the first one, get lost."""

    def __init__(self, types: Any, lose: range = range(0)) -> None:
        super().__init__(types)
        self.asked: list[tuple[float, int]] = []
        self._lose = lose

    def loses(self, topic: str) -> bool:
        return topic == REQUEST and len(self.asked) - 1 in self._lose

    def _publish(self, topic: str, /, **values: Any) -> None:
        if topic == REQUEST:
            self.asked.append((self.time / 1e6, values["request_id"]))
        super()._publish(topic, **values)

    def replies(self) -> list[tuple[float, int]]:
        """Return when replies were sent in s, with the numbers of their requests."""
        return [(each.time, each.message.request_id) for each in self.sent if each.topic == REPLY]


def answered(vehicle: Asked, program: Callable[[Answers, int], Coroutine[Any, Any, None]]) -> Asked:
    """Run a program that replies for a check, which is registered."""

    async def main() -> None:
        feeds = Feeds(vehicle)
        ids = await Registrar(vehicle, feeds).register(Wanted("Any"))
        answers = Answers(vehicle, feeds)
        vehicle.asked.clear()
        await program(answers, ids.check)
        answers.close()
        count = len(vehicle.replies())
        await asyncio.sleep(1.0)
        assert len(vehicle.replies()) == count, "closed"

    run(main(), vehicle)
    return vehicle


@pytest.mark.parametrize("has_time", [True, False])
def test_a_check_of_an_earlier_program_is_answered_if_the_request_says_that_it_is_for_it(
    *, has_time: bool, types: Any
) -> None:
    async def program(answers: Answers, check: int) -> None:
        await asyncio.sleep(0.4)
        answers.add(check if has_time else FOREIGN, Verdict, only_asked=True)
        await asyncio.sleep(PERIOD)

    vehicle = answered(Asked(types), program)
    endpoints = {each.uorb_topic: each.message for each in topics_of(types).ENDPOINTS}
    tells = "valid_registrations_mask" in {each.name for each in endpoints[REQUEST].__msg__.fields}
    assert bool(vehicle.replies()) == (has_time and tells)


def test_each_request_is_answered_at_once_and_again(types: Any) -> None:
    async def program(answers: Answers, check: int) -> None:
        answers.add(check, Verdict)
        await asyncio.sleep(4 * PERIOD)

    vehicle = answered(Asked(types), program)
    replies = vehicle.replies()
    assert len(replies) >= 6
    expected = [(time + late, number) for time, number in vehicle.asked for late in (0.0, 0.1)][: len(replies)]
    assert [number for _, number in replies] == [number for _, number in expected]
    assert [time for time, _ in replies] == pytest.approx([time for time, _ in expected], abs=0.02)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_three_requests_that_are_lost_are_answered(count: int, types: Any) -> None:
    async def program(answers: Answers, check: int) -> None:
        answers.add(check, Verdict)
        await asyncio.sleep(6 * PERIOD)

    vehicle = answered(Asked(types, lose=range(1, 1 + count)), program)
    times: dict[int, float] = {}
    for time, number in vehicle.replies():
        times.setdefault(number, time)
    late = [times[number] - time if number in times else None for time, number in vehicle.asked[: count + 2]]
    assert all(each is not None and 0.0 <= each < 0.05 for each in late[:4]), late
    assert (late[4:5] == [None]) == (count == 4), late


def test_replies_of_many_checks_do_not_come_at_once_before_v1_18(types: Any) -> None:
    async def program(answers: Answers, check: int) -> None:
        for each in range(check, check + 7):
            answers.add(each, Verdict)
        await asyncio.sleep(0.25)

    vehicle = answered(Asked(types), program)
    begin, number = vehicle.asked[0]
    times = [round(time - begin, 3) for time, each in vehicle.replies() if each == number and time < begin + 0.09]
    has_long_queue = "setpoint_config" in {each.uorb_topic for each in topics_of(types).ENDPOINTS}
    assert len(times) == 7
    assert (times[3] < 0.005 and times[4] - times[3] < 0.005) == has_long_queue
