"""Tests of simulated vehicles on a virtual clock: what they publish, how they answer, and how they misbehave."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from msggen.generate.cache import package_of
from msggen.link.link import Sample
from msggen.link.xrce import wire
from msggen.link.xrce.agent import Agent
from msggen.sim import Misbehaviour, Options, SimulatedVehicle
from msggen.sim.alone import INSIDE
from msggen.sim.endpoints import object_ids_of
from msggen.sim.line import Line
from msggen.sim.options import Board
from msggen.sim.parts import PARTS
from msggen.sim.publishing import ANSWERS
from msggen.sim.values import VALUES, Filler, Scene
from msggen.sources.embedded import EMBEDDED
from support.examples import by_day, examples
from support.simulation import NAN, SECOND, SHORT, Bench, fly, topics_of
from support.xrce_agent import EPOCH

RELEASES = EMBEDDED[::-1]


@pytest.fixture(scope="module", params=RELEASES)
def types(request: pytest.FixtureRequest, px4_types: Any) -> Any:
    """The types of each embedded release."""
    return px4_types if request.param == EMBEDDED[0] else package_of(request.param)


@pytest.fixture
def bench(px4_types: Any) -> Bench:
    """A connected vehicle of the newest release."""
    bench = Bench(px4_types)
    bench.run(0.1)
    return bench


# --- every release


def test_all_endpoints_encode_and_have_their_times(types: Any) -> None:
    """Each message has the fields that the release has, and can be encoded, on the ground and in the air."""
    vehicle = SimulatedVehicle(types)
    scene = Scene(vehicle.world, vehicle._noise)
    for time in (1, 5 * SECOND):
        vehicle.world.command(400, (1.0,) * 7)
        vehicle.world.command(22, (NAN,) * 7)
        vehicle.world.advance(time)
        for endpoint in topics_of(types).out:
            message = Filler(endpoint.message).make(scene, time)
            again = endpoint.message.decode(message.encode())
            assert again == message
            assert again.timestamp == time
            assert getattr(again, "timestamp_sample", time) == time


def test_a_flight_with_the_types_of_every_release(types: Any) -> None:
    bench = Bench(types)
    bench.run(0.1)
    assert bench.vehicle.is_connected
    connected = list(bench.vehicle.changes)
    assert [change.text for change in connected] == ["connected"]
    fly(bench, 0.5, {"position": (0.0, 0.0, -3.0)})
    for number, parameters in ((176, (1.0, 6.0)), (400, (1.0,))):
        assert bench.command(number, *parameters) in (0, -1)  # v1.14 does not publish acknowledgements
    fly(bench, 9.0, {"position": (2.0, -1.0, -3.0)})
    bench.run(0.0)
    assert bench.last("vehicle_status").arming_state == 2
    assert bench.last("vehicle_status").nav_state == 14
    place = bench.last("vehicle_local_position")
    assert (place.x, place.y, place.z) == pytest.approx((2.0, -1.0, -3.0), abs=0.2)
    assert not bench.vehicle.refused


@pytest.mark.parametrize("board", ["most", "sitl"])
def test_topics_have_the_names_types_and_ids_of_the_board(types: Any, board: Board) -> None:
    bench = Bench(types, Options(sync="off", namespace="uav_1", board=board))
    bench.run(0.1)
    numbers = object_ids_of(topics_of(types), has_all=board == "sitl")
    expected = {
        (number << 4 | (5 if endpoint.direction == "out" else 6)).to_bytes(2, "big"): "rt/uav_1" + endpoint.ros_name
        for number, endpoint in zip(numbers, topics_of(types).ENDPOINTS, strict=True)
    }
    if board == "sitl":
        assert numbers == tuple(endpoint.object_id for endpoint in topics_of(types).ENDPOINTS)
    found = {identity: name for identity, name in bench.agent.names.items() if identity[1] & 15 != 8}
    assert found == expected
    assert {topic.type for topic in bench.agent.topics.values()} == {
        endpoint.dds_type for endpoint in topics_of(types).ENDPOINTS
    }
    assert bench.agent.participant == "uav_1/px4_micro_xrce_dds"


def test_every_known_message_is_of_some_release(px4_types: Any) -> None:
    published = {endpoint.message_name for endpoint in topics_of(px4_types).out}
    older = package_of("v1.17")
    logged = {px4_types.topics.UORB[name].message_name for name in INSIDE}
    assert {*VALUES} <= logged | published | {endpoint.message_name for endpoint in topics_of(older).out}


# --- what it publishes


OWN_RATES = {
    "estimator_status_flags": 1.0,
    "failsafe_flags": 1.85,
    "home_position": 0.0,
    "manual_control_setpoint": 0.0,
    "position_setpoint_triplet": 0.0,
    "sensor_combined": 250.0,
    "timesync_status": 1.0,
    "transponder_report": 0.0,
    "vehicle_control_mode": 2.0,
    "vehicle_gps_position": 8.0,
    "vehicle_land_detected": 1.0,
    "vehicle_status": 2.0,
}
"""The rates in Hz that are not those of the bridge, of a vehicle to which nothing happens."""


def test_topics_are_published_at_their_rates(bench: Bench) -> None:
    before = Counter(bench.vehicle.sent)
    bench.run(10.0)
    sent = Counter(bench.vehicle.sent)
    sent.subtract(before)
    of_parts = frozenset().union(*PARTS.values()) - {"manual_control_setpoint", "transponder_report"}
    published = [each for each in bench.topics.out if each.uorb_topic not in ANSWERS | of_parts]
    assert sent.keys() == {each.ros_name for each in published}
    for endpoint in published:
        rate = OWN_RATES.get(endpoint.uorb_topic, 1000 / endpoint.publish_interval_ms)
        assert sent[endpoint.ros_name] == pytest.approx(10 * rate, rel=0.06, abs=1 if rate else 0), endpoint.uorb_topic


def test_a_change_of_the_status_is_published_at_once(bench: Bench) -> None:
    bench.run(1.0)
    delays = []
    for mode in (2, 4, 2, 4):
        bench.run(0.33)
        start = bench.now
        bench.command(100_001, mode)
        while bench.last("vehicle_status").nav_state != mode:
            bench.run(0.001)
        delays.append(bench.now - start)
        bench.run(0.25)
        assert bench.last("vehicle_control_mode").flag_control_manual_enabled is (mode == 2)
    assert max(delays) <= 0.2 * SECOND
    assert min(delays) <= 0.01 * SECOND


def test_a_rate_overrides_all_others(px4_types: Any) -> None:
    bench = Bench(px4_types, Options(sync="short", rate=20.0))
    bench.run(5.0)
    rates = {name: number / 5 for name, number in bench.vehicle.sent.items()}
    assert all(rate == pytest.approx(20.0, rel=0.06) for rate in rates.values())
    assert len(rates) == len([topic for topic in bench.topics.out if topic.uorb_topic not in ANSWERS])


def test_times_are_those_of_the_agents_clock(bench: Bench) -> None:
    bench.run(1.0)
    for topic in ("vehicle_local_position", "vehicle_status", "sensor_combined"):
        times = [message.timestamp for message in bench.messages(topic)]
        assert times == sorted(times)
        assert len({*times}) == len(times)
        assert abs(times[-1] - bench.now - EPOCH) < 0.3 * SECOND
    assert bench.last("vehicle_local_position").timestamp_sample == bench.last("vehicle_local_position").timestamp
    status = bench.last("timesync_status")
    assert abs(status.estimated_offset + EPOCH) < SECOND
    assert status.source_protocol == 2


def test_without_time_sync_times_are_those_since_boot(px4_types: Any) -> None:
    bench = Bench(px4_types, Options(sync="off"))
    bench.run(1.0)
    assert 0 < bench.last("vehicle_status").timestamp <= bench.now


def test_messages_agree_with_each_other(bench: Bench) -> None:
    bench.command(400, 1.0)
    fly(bench, 0.5, {"velocity": (3.0, 1.0, -2.0)})
    bench.command(176, 1.0, 6.0)
    fly(bench, 4.0, {"velocity": (3.0, 1.0, -2.0), "yaw": 0.5})
    bench.run(0.2)
    place, odometry = bench.last("vehicle_local_position"), bench.last("vehicle_odometry")
    assert odometry.position == pytest.approx((place.x, place.y, place.z), abs=0.1)
    assert math.hypot(*bench.last("vehicle_attitude").q) == pytest.approx(1.0, abs=1e-6)
    earth, gps = bench.last("vehicle_global_position"), bench.last("vehicle_gps_position")
    assert earth.alt == pytest.approx(place.ref_alt - place.z, abs=0.1)
    assert (gps.latitude_deg, gps.longitude_deg) == pytest.approx((earth.lat, earth.lon), abs=1e-5)
    assert not bench.last("vehicle_land_detected").landed
    mode = bench.last("vehicle_control_mode")
    assert (mode.flag_armed, mode.flag_control_offboard_enabled, mode.flag_control_auto_enabled) == (True, True, False)
    assert not bench.last("failsafe_flags").offboard_control_signal_lost
    force = bench.last("sensor_combined").accelerometer_m_s2
    assert force[2] == pytest.approx(-9.8, abs=1.0)
    w, x, y, z = odometry.q
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(place.heading, abs=0.05)
    assert bench.last("battery_status").remaining < 1


# --- how it answers


def test_commands_are_acknowledged_to_their_sender(bench: Bench) -> None:
    command = bench.package.VehicleCommand(command=16, source_system=7, source_component=190, target_system=1)
    bench.publish(command, "vehicle_command")
    ack = bench.last("vehicle_command_ack")
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (16, 3, 7, 190)


@pytest.mark.parametrize(("target", "is_answered"), [(0, True), (1, True), (2, False)])
def test_commands_for_another_vehicle_are_not_answered(bench: Bench, target: int, is_answered: bool) -> None:  # noqa: FBT001
    assert (bench.command(400, 1.0, target_system=target) == 0) is is_answered
    assert bench.vehicle.world.is_armed is is_answered


def test_the_service_replies_with_the_identity_of_the_request(bench: Bench) -> None:
    srv = bench.package.srv
    request = srv.VehicleCommand.Request(request=bench.package.VehicleCommand(command=400, param1=1.0, target_system=1))
    for number in (5, 2**40):
        bench.agent.call(number, request.encode())
        bench.run(0.05)
    assert [number for number, _ in bench.agent.replies] == [5, 2**40]
    reply = srv.VehicleCommand.Response.decode(bench.agent.replies[0][1]).reply
    assert (reply.command, reply.result) == (400, 0)
    assert bench.vehicle.world.is_armed
    assert len([*bench.messages("vehicle_command_ack")]) == 2


def test_a_request_for_another_vehicle_gets_no_reply(bench: Bench) -> None:
    command = bench.package.VehicleCommand(command=400, param1=1.0, target_system=9)
    bench.agent.call(1, bench.package.srv.VehicleCommand.Request(request=command).encode())
    bench.agent.call(2, b"\0\1\0\0abcd")
    bench.run(0.5)
    assert bench.agent.replies == []
    assert bench.vehicle.refused == {"vehicle_command: not a VehicleCommand_Request": 1}


def asked(bench: Bench, name: str, version: int = 1) -> Any:
    padded = name.encode().ljust(50, b"\0")
    bench.publish(bench.package.MessageFormatRequest(protocol_version=version, topic_name=padded))
    answer = bench.last("message_format_response")
    assert answer.topic_name == padded
    return answer


def test_format_requests_are_answered_with_the_hashes_of_the_package(bench: Bench) -> None:
    for endpoint in bench.topics.ENDPOINTS:
        answer = asked(bench, endpoint.format_request_name)
        bench.run(0.002)  # a loop of the client
        assert (answer.success, answer.message_hash) == (True, endpoint.message.__msg__.message_hash)


@pytest.mark.parametrize(
    "name", ["/fmu/out/vehicle_status_v4", "vehicle_status", "/fmu/out/nothing", "", "/", "/fmu/in/\u00e4"]
)
def test_unknown_topics_have_no_hash(bench: Bench, name: str) -> None:
    answer = asked(bench, name)
    assert (answer.success, answer.message_hash) == (False, 0)


def test_another_version_of_the_protocol_is_not_answered_with_a_hash(bench: Bench) -> None:
    assert not asked(bench, "/fmu/out/vehicle_status", version=2).success


def test_topics_in_are_accepted_and_counted(bench: Bench) -> None:
    for endpoint in bench.topics.in_:
        bench.agent.publish(f"rt{endpoint.ros_name}", endpoint.message().encode())
    bench.run(0.05)
    assert bench.vehicle.received == {endpoint.ros_name: 1 for endpoint in bench.topics.in_}


def test_short_samples_are_refused_and_counted(bench: Bench) -> None:
    bench.agent.publish("rt/fmu/in/trajectory_setpoint", b"\0\1\0\0abcd")
    bench.run(0.05)
    assert bench.vehicle.refused == {"/fmu/in/trajectory_setpoint: not a TrajectorySetpoint": 1}


def test_a_heartbeat_with_times_of_another_clock_is_too_old(bench: Bench) -> None:
    """A program that stamps with a clock that began at its start, as with time.monotonic, loses offboard mode."""
    assert bench.command(176, 1.0, 6.0) == 0  # while the vehicle is disarmed, all modes can be selected
    for number in range(5):
        bench.publish(bench.package.OffboardControlMode(timestamp=1000 + number, position=True))
    bench.run(0.2)
    assert bench.command(400, 1.0) == 1
    for number in range(5):
        bench.publish(bench.package.OffboardControlMode(timestamp=bench.now + EPOCH - 5 + number, position=True))
    bench.run(0.2)
    assert bench.command(400, 1.0) == 0


@settings(max_examples=examples(20), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_no_sample_and_no_request_stops_a_vehicle(px4_types: Any, data: st.DataObject) -> None:
    """Any bytes as the content of any topic: the vehicle goes on, and its messages can be encoded."""
    bench = Bench(px4_types, Options(sync="off"))
    bench.run(0.05)
    for _ in range(data.draw(st.integers(1, 8))):
        endpoint = data.draw(st.sampled_from([*bench.topics.in_]))
        size = endpoint.message.__msg__.cdr_size
        bench.agent.publish(f"rt{endpoint.ros_name}", b"\0\1\0\0" + data.draw(st.binary(min_size=size, max_size=size)))
        bench.agent.call(1, b"\0\1\0\0" + data.draw(st.binary(min_size=56, max_size=56)))
        bench.run(0.02)
    bench.run(0.3)
    assert bench.vehicle.is_connected
    assert bench.last("vehicle_status").timestamp > 0


@by_day(
    ("originated", "transmitted"),
    itertools.product([0, 10**9, 2**31 * 10**9 - 1], [-(2**31) * 10**9, 0, (2**31 - 1) * 10**9]),
    4,
)
def test_no_clock_of_an_agent_stops_a_vehicle(px4_types: Any, transmitted: int, originated: int) -> None:
    bench = Bench(px4_types, SHORT._replace(rate=5.0))
    bench.run(0.1)
    bench.now += 2**33  # two hours, so that a round trip does not fit in 32 bits
    bench.run(1.0)
    bench.agent.wrong_time = wire.TimestampReply(transmitted, transmitted, originated)
    bench.run(2.5)
    assert bench.vehicle.is_connected
    assert bench.last("timesync_status").timestamp > 0


def test_modes_that_end_are_reported(bench: Bench) -> None:
    bench.command(400, 1.0)
    bench.command(22, NAN, NAN, NAN, NAN, NAN, NAN, NAN)
    bench.run(6.0)
    bench.command(21)
    bench.run(8.0)
    ends = [message.nav_state for message in bench.messages("mode_completed")]
    assert [mode for mode, _ in itertools.groupby(ends)] == [17, 18]
    assert 30 <= ends.count(18) <= 45  # 20 a second, until the vehicle disarms 2 s after it has landed


def test_an_agent_that_restarts_gets_a_new_session(bench: Bench) -> None:
    bench.run(0.5)
    bench.agent.reset()
    bench.run(5.0)
    assert bench.agent.is_in_session
    assert {connection for _, _, connection in bench.sent} == {0, 1}
    assert [change.text for change in bench.vehicle.changes if "connected" in change.text] == [
        "connected",
        "disconnected: the agent has ended, or does not answer; looking for the next one",
        "connected",
    ]


# --- misbehaviour

WRONG = Misbehaviour(drop=0.02, reorder=0.05, duplicate=0.05, garbage=0.05)


def datagrams(types: Any, options: Options) -> list[tuple[int, bytes, int]]:
    """Return all that a vehicle sends in 3 s, to an agent that refuses nothing."""
    bench = Bench(types, options)
    receive = bench.agent.receive

    def tolerate(data: bytes, now: int) -> None:
        with suppress(ValueError, KeyError):
            receive(data, now)

    bench.agent.receive = tolerate  # type: ignore[method-assign]
    bench.run(3.0)
    return bench.sent


def test_the_same_seed_gives_the_same_datagrams(px4_types: Any) -> None:
    options = Options(sync="off", misbehaviour=WRONG, seed=3)
    first = datagrams(px4_types, options)
    assert datagrams(px4_types, options) == first
    assert datagrams(px4_types, options._replace(seed=4)) != first
    assert len(first) > 500


@pytest.mark.parametrize("share", ["drop", "reorder", "duplicate", "garbage"])
def test_a_channel_does_its_share(share: str) -> None:
    channel = Line(Misbehaviour()._replace(**{share: 0.1}), "seed")  # type: ignore[arg-type]
    sent = [(bytes([number >> 8, number & 255]), 0) for number in range(10_000)]
    arrived = [each for datagram in sent for each in channel.carry([datagram])]
    genuine = {*sent}
    known = [each for each in arrived if each in genuine]
    overtaken = sum(a > b for a, b in itertools.pairwise(known))
    found = {
        "drop": 10_000 - len(arrived),
        "duplicate": len(arrived) - 10_000,
        "garbage": len(arrived) - 10_000,
        "reorder": overtaken,
    }
    assert found[share] == pytest.approx(1000, rel=0.15)
    if share != "garbage":
        assert sum(number > 0 for name, number in found.items() if name != "garbage") == 1


def test_a_wrong_hash_and_another_version(px4_types: Any) -> None:
    wrong = Misbehaviour(wrong_hashes=("VehicleStatus",), versions={"VehicleStatus": 9, "BatteryStatus": 0})
    bench = Bench(px4_types, SHORT._replace(misbehaviour=wrong))
    bench.run(0.1)
    names = {*bench.agent.names.values()}
    assert {"rt/fmu/out/vehicle_status_v9", "rt/fmu/out/battery_status"} <= names
    right = px4_types.VehicleStatus.__msg__.message_hash
    assert asked(bench, "/fmu/out/vehicle_status").message_hash not in (0, right)
    assert asked(bench, "/fmu/out/battery_status").message_hash == px4_types.BatteryStatus.__msg__.message_hash


def test_silence(px4_types: Any) -> None:
    bench = Bench(px4_types, SHORT._replace(misbehaviour=Misbehaviour(silent_after=1.0)))
    bench.run(4.0)
    assert bench.sent[-1][0] < SECOND
    assert len(bench.sent) > 500


def test_timestamps_are_wrong_on_request(px4_types: Any) -> None:
    clocks = []
    for seconds in (0.0, -7.0, 3.0):
        bench = Bench(px4_types, SHORT._replace(misbehaviour=Misbehaviour(clock_off=seconds)))
        bench.run(2.0)
        clocks.append(bench.last("vehicle_attitude").timestamp)
    assert [clock - clocks[0] for clock in clocks] == [0, -7 * SECOND, 3 * SECOND]


def test_a_client_without_answers_about_the_time_starts_over(px4_types: Any) -> None:
    bench = Bench(px4_types, SHORT._replace(misbehaviour=Misbehaviour(no_time_reply=True)))
    bench.run(30.0)
    assert not bench.vehicle.is_connected
    assert [change.text for change in bench.vehicle.changes][:2] == [
        "disconnected: the agent did not answer TIMESTAMP",
        "disconnected: the agent did not answer TIMESTAMP",
    ]


def test_restarts(px4_types: Any) -> None:
    bench = Bench(px4_types, SHORT._replace(misbehaviour=Misbehaviour(restart_every=0.5)))
    bench.run(2.2)
    assert {connection for _, _, connection in bench.sent} == {0, 1, 2, 3, 4}
    assert not [data for _, data, _ in bench.sent if data[4] == wire.DELETE]
    assert [change.text for change in bench.vehicle.changes].count("connected") == 5


@pytest.mark.parametrize("wrong", [Misbehaviour(restart_every=0.5), Misbehaviour(silent_after=0.5)])
def test_the_first_interval_is_as_long_as_the_others_whenever_a_vehicle_starts(
    wrong: Misbehaviour, px4_types: Any
) -> None:
    bench = Bench(px4_types, SHORT._replace(misbehaviour=wrong))
    bench.now = SECOND
    bench.run(0.6)
    last = max(when for when, _, connection in bench.sent if connection == 0)
    assert 1.4 * SECOND < last <= 1.5 * SECOND


# --- with the agent of this package


def served(vehicle: SimulatedVehicle, agent: Agent, start: int, seconds: float) -> list[Sample]:
    """Connect vehicle and agent on a virtual clock, and return the samples."""
    samples: list[Sample] = []
    for now in range(start, start + round(seconds * SECOND), 1000):
        vehicle.advance(now)
        answers = True
        while answers:
            for data, connection in vehicle.take_outgoing():
                agent.receive(data, ("127.0.0.1", 40_000 + connection), now * 1000 + EPOCH * 1000)
            if now % 100_000 == 0:
                agent.tick(now / SECOND)
            answers = bool(outgoing := agent.take_outgoing())
            for data, _ in outgoing:
                vehicle.receive(data, now)
        samples += [event for event in agent.take_events() if isinstance(event, Sample)]
    return samples


def test_the_agent_receives_all_samples(px4_types: Any) -> None:
    vehicle, agent = SimulatedVehicle(px4_types, SHORT), Agent(0.0)
    samples = served(vehicle, agent, 0, 2.0)
    received = Counter(sample.route.name for sample in samples)
    assert received == vehicle.sent
    assert agent.outbox.lost == 0
    assert not agent.outbox.refused


@by_day("seed", range(2), 2)
def test_vehicle_and_agent_connect_with_10_percent_of_loss_both_ways(px4_types: Any, seed: int) -> None:
    wrong = Misbehaviour(drop=0.1, reorder=0.02, duplicate=0.02)
    vehicle = SimulatedVehicle(px4_types, Options(sync="off", seed=seed, misbehaviour=wrong))
    agent = Agent(0.0)
    samples = served(vehicle, agent, 0, 30.0)
    assert vehicle.is_connected
    assert len(samples) > 1000
    assert {sample.remote.key for sample in samples} == {1}
    assert agent.outbox.lost > 0


def test_an_answer_waits_while_the_client_waits(px4_types: Any) -> None:
    """PX4's client sends nothing while it waits for a ping or a time. What is in uORB's queues follows."""
    bench = Bench(px4_types)
    bench.run(3)
    while bench.vehicle._client.is_ready:
        bench.now += 1000
        bench.vehicle.advance(bench.now)
    message = px4_types.VehicleCommand(command=px4_types.VehicleCommand.VEHICLE_CMD_CUSTOM_0, target_system=1)
    bench.publish(message, "vehicle_command")  # arrives before the answer to the client
    bench.run(0.5)
    unsupported = px4_types.VehicleCommandAck.VEHICLE_CMD_RESULT_UNSUPPORTED
    assert [ack.result for ack in bench.messages("vehicle_command_ack")] == [unsupported]


def test_a_parameter_that_cannot_be_set_is_an_error(px4_types: Any) -> None:
    with pytest.raises(ValueError, match="'COM_MODE_ARM_CH' cannot be set, did you mean 'COM_MODE_ARM_CHK'"):
        SimulatedVehicle(px4_types, Options(parameters={"COM_MODE_ARM_CH": 1.0}))
