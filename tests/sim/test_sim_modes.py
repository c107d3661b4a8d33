"""Tests of what programs of flight modes exchange with a simulated vehicle, with the types of every release."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.sim import Options
from msggen.sources.embedded import EMBEDDED
from support.mode_program import Program, Programs
from support.simulation import NAN, Bench

RELEASES = [release for release in EMBEDDED[::-1] if release != "v1.14"]
"""Those that have modes of programs."""
HOLD, TAKEOFF, LAND, OWN = 4, 17, 18, 23
SYNCLESS = Options(sync="off")


@pytest.fixture(scope="module", params=RELEASES)
def types(request: pytest.FixtureRequest, px4_types: Any) -> Any:
    """The types of a release."""
    return px4_types if request.param == EMBEDDED[0] else package_of(request.param)


def started(types: Any, options: Options = SYNCLESS) -> Bench:
    """Return a vehicle that is connected."""
    bench = Bench(types, options)
    bench.run(0.3)
    return bench


# --- every release


def test_a_program_flies_its_mode(types: Any) -> None:
    """Register, select, arm, take off, fly to a place, complete, land, disarm, unregister."""
    bench = started(types)
    own = Program(bench, "Square", with_executor=True)
    reply = own.register()
    assert (reply.success, reply.arming_check_id, reply.mode_id, reply.mode_executor_id) == (True, 0, OWN, 1)
    assert reply.px4_ros2_api_version == types.RegisterExtComponentRequest.LATEST_PX4_ROS2_API_VERSION
    own.run(1.0)
    assert bench.last("failsafe_flags").mode_req_other >> OWN & 1 == 0
    own.configure()
    assert own.command(100_001, OWN) == 0
    own.run(0.3)
    assert (own.status.nav_state, own.status.executor_in_charge) == (OWN, 1)
    assert own.as_executor(400, 1.0) == 0
    assert own.as_executor(22, *[NAN] * 7) == 0
    own.run_until(lambda: TAKEOFF in own.completed, 15.0)
    assert own.as_executor(100_001, OWN) == 0
    own.configure()
    own.run_until(lambda: own.distance((3.0, 2.0, -4.0)) < 0.3, 20.0, goto=(3.0, 2.0, -4.0))
    control = bench.last("vehicle_control_mode")
    assert (control.flag_control_position_enabled, control.flag_control_auto_enabled) == (True, False)
    bench.publish(types.ModeCompleted(nav_state=OWN), "mode_completed")
    own.run(0.1)
    assert own.completed[-1] == OWN
    assert own.as_executor(100_001, LAND) == 0
    own.run_until(lambda: own.status.arming_state == 1, 20.0)
    assert own.completed[-1] == LAND
    assert own.status.nav_state == OWN
    own.unregister()
    own.run(0.5)
    assert (own.status.nav_state, own.status.executor_in_charge) == (HOLD, 0)
    assert not bench.vehicle.refused


def test_commands_of_an_executor_are_answered_to_it(types: Any) -> None:
    own = Program(started(types), "Square", with_executor=True)
    own.register()
    own.run(0.5)
    assert own.as_executor(400, 1.0) == 1  # it is not in charge
    ack = own.bench.last("vehicle_command_ack")
    assert (ack.command, ack.target_system, ack.target_component) == (400, 1, 1001)


def test_a_mode_that_does_not_answer_is_told_in_the_flags(types: Any) -> None:
    own = Program(started(types), "Square")
    own.register()
    own.run(0.7)
    assert own.command(100_001, OWN) == 0
    own.run(0.3)
    assert own.status.pre_flight_checks_pass
    own.answers = False
    own.run(1.6)
    assert not own.status.pre_flight_checks_pass
    assert own.bench.last("failsafe_flags").mode_req_other >> OWN & 1
    if hasattr(types.ArmingCheckRequest(), "valid_registrations_mask"):
        assert own.bench.last("arming_check_request").valid_registrations_mask == 0


def test_more_than_four_answers_in_a_loop_are_lost_before_v1_18(types: Any) -> None:
    bench = started(types)
    programs = [Program(bench, f"Mode {number}") for number in range(6)]
    for program in programs:
        program.register()
    bench.run(4.0, Programs(programs).answer)
    masks = bench.last("failsafe_flags").mode_req_other
    silent = [program.mode for program in programs if masks >> program.mode & 1]
    assert len(silent) == (0 if types.ArmingCheckReply.ORB_QUEUE_LENGTH == 8 else 2)


def test_a_third_registration_in_a_loop_replaces_the_first(types: Any) -> None:
    bench = started(types)
    programs = [Program(bench, f"Mode {number}") for number in range(3)]
    for program in programs:
        program.ask_to_register()
    bench.run(0.1)
    names = [bytes(reply.name).rstrip(b"\0") for reply in bench.messages("register_ext_component_reply")]
    assert names == [b"Mode 1", b"Mode 2"]


@pytest.mark.parametrize("is_whole", [False, True])
def test_a_restart_of_the_client_keeps_registrations_and_one_of_px4_keeps_names(types: Any, *, is_whole: bool) -> None:
    bench = started(types)
    first, second = Program(bench, "First"), Program(bench, "Second")
    first.register()
    second.register()
    both = Programs([first, second])
    bench.run(1.0, both.answer)
    bench.vehicle.fault("restart" if is_whole else "restart-client")
    bench.run(1.0, both.answer)
    assert [change.text for change in bench.vehicle.changes][-2:] == [
        "PX4 restarts" if is_whole else "the client restarts",
        "connected",
    ]
    again = [*bench.messages("register_ext_component_reply")]  # the agent has begun anew, too
    assert [reply.mode_id for reply in again] == ([] if is_whole else [second.mode])
    assert bool([*bench.messages("arming_check_request")]) is not is_whole
    assert (OWN in bench.vehicle.world.commander.components.modes) is not is_whole
    if is_whole:
        assert second.register().mode_id == second.mode == OWN + 1


def test_a_release_without_modes_ignores_them() -> None:
    types = package_of("v1.14")
    bench = started(types)
    assert bench.command(100_001, OWN) in (-1, 0)
    bench.run(1.0)
    assert not hasattr(types, "RegisterExtComponentRequest")
    assert not [*bench.messages("arming_check_request")]
    assert not bench.vehicle.refused


# --- v1.18


def test_each_type_of_setpoints_is_answered(px4_types: Any) -> None:
    bench = started(px4_types)
    own = Program(bench, "Square")
    own.register()
    results = {}
    for kind in range(1, 18):
        bench.publish(px4_types.SetpointConfig(type=kind, source_id=own.mode))
        bench.run(0.05)
        answer = bench.last("setpoint_config_reply")
        assert (answer.type, answer.source_id) == (kind, own.mode)
        results[kind] = answer.result
    assert [kind for kind, result in results.items() if not result] == [1, 2, 4, 5, 6, 15, 16]
    bench.publish(px4_types.SetpointConfig(type=6, source_id=own.mode))
    bench.run(0.05)
    answer = bench.last("setpoint_config_reply")
    assert (answer.mode_req_attitude, answer.mode_req_local_position) == (True, False)


def test_overrides_are_confirmed_as_they_were_sent(px4_types: Any) -> None:
    bench = started(px4_types)
    request = px4_types.ConfigOverrides(source_type=1, source_id=3, defer_failsafes=True, defer_failsafes_timeout_s=7)
    bench.publish(request)
    bench.run(0.05)
    answer = bench.last("config_overrides_confirm")
    answer.timestamp = 0
    assert answer == request


def test_a_mode_that_replaces_no_mode_of_px4_replaces_none(px4_types: Any) -> None:
    bench = started(px4_types)
    own = Program(bench, "Square")
    own.register(enable_replace_internal_mode=True, replace_internal_mode=32)
    own.run(0.5)
    assert bench.last("failsafe_flags").mode_req_other >> OWN & 1 == 0
