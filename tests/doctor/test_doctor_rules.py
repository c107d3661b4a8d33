"""Tests of the doctor's rules on what was seen, without sockets: each example, and what must not be found."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import astuple
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.check.finding import OF_VEHICLES, Category, Rule
from msggen.doctor import not_following as arming
from msggen.doctor.case import Case, matches, plain
from msggen.doctor.decoding import _values
from msggen.doctor.diagnose import diagnose
from msggen.doctor.examples import _EXAMPLES, HEALTHY, STEERED, case_of
from msggen.doctor.expected import expected_of, expected_of_catalog
from msggen.doctor.observation import (
    AgentSeen,
    InputSeen,
    Observation,
    Process,
    ProgramSeen,
    ReaderSeen,
    SampleSeen,
    Sender,
    TopicSeen,
    VehicleSeen,
    WriterSeen,
)
from msggen.doctor.rules import DOCTOR, LIVE
from msggen.link.link import Remote, Route, Statistics
from msggen.messages.names import stem_of, uorb_name
from msggen.show.report import FORMATS, render
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.vehicle.selection import Selection
from support import flight_captures

SEEN = HEALTHY.seen
VEHICLE = SEEN.vehicles[0]
ROUTES = VEHICLE.routes
EFFECTS = {
    "AGENT_HAS_CLIENT": {"PORT_TAKEN"},
    "AGENT_WITHOUT_CLIENT": {"NO_CLIENT"},
    "AGENT_MISSING": {"NO_CLIENT"},
    "RELEASE_DIFFERS": {"TYPE_UNKNOWN"},
}
"""Examples that have further findings."""

each_rule = pytest.mark.parametrize("rule", DOCTOR, ids=lambda rule: rule.id)


def ids(case: Case) -> list[str]:
    """Return the rules that find something."""
    return [finding.rule.id for finding in diagnose(case).findings]


def texts(case: Case) -> str:
    return "\n".join(finding.change.message for finding in diagnose(case).findings)


def seen(**values: Any) -> Case:
    return HEALTHY._replace(seen=SEEN._replace(**values))


def vehicle(**values: Any) -> Case:
    return seen(vehicles=(VEHICLE._replace(**values),))


def example_of(name: str) -> Case:
    """Return the example of a rule."""
    return case_of(next(rule for rule in DOCTOR if rule.id == name))


def changed_vehicle(case: Case, **values: Any) -> Case:
    """Return a case of one vehicle with other facts of it."""
    (own,) = case.seen.vehicles
    return case._replace(seen=case.seen._replace(vehicles=(own._replace(**values),)))


def test_nothing_is_found_in_the_healthy_vehicle() -> None:
    report = diagnose(HEALTHY)
    assert (report.findings, report.fails) == ((), False)
    assert report.summary.startswith("no problem found: udp://127.0.0.1:8888, the vehicle at 127.0.0.1:40123 (key 1)")


@each_rule
def test_the_example_of_a_rule_has_its_finding_and_no_other(rule: Rule) -> None:
    assert {*ids(case_of(rule))} == {rule.id} | EFFECTS.get(rule.id, set())
    (finding,) = (each for each in diagnose(case_of(rule)).findings if each.rule is rule)
    assert finding.fails
    assert "\n" not in finding.change.message
    assert finding.change.message.isprintable()


def test_nothing_is_found_in_a_vehicle_that_follows_setpoints() -> None:
    assert texts(STEERED) == ""
    assert texts(STEERED._replace(wanted=("/fmu/in/trajectory_setpoint",))) == ""


def test_every_rule_has_an_example() -> None:
    assert [*_EXAMPLES] == [rule.id for rule in DOCTOR]
    assert {rule.category for rule in DOCTOR} == {*OF_VEHICLES} - {Category.FLIGHT}
    assert len(LIVE) == 3


@each_rule
@pytest.mark.parametrize("output_format", FORMATS)
def test_every_format_shows_every_finding(rule: Rule, output_format: str) -> None:
    shown = render(diagnose(case_of(rule)), output_format, width=100, colour=False)
    assert rule.id in shown
    if output_format == "sarif":
        (run,) = json.loads(shown)["runs"]
        locations = [place for result in run["results"] for place in result["locations"]]
        uris = {place["physicalLocation"]["artifactLocation"]["uri"] for place in locations}
        assert uris == {case_of(rule).seen.link}


# --- names


SPELLINGS = st.sampled_from(
    [
        "/fmu/out/vehicle_status_v1",
        "rt/fmu/out/vehicle_status_v1",
        "fmu/out/vehicle_status_v1",
        "vehicle_status_v1",
        "vehicle_status",
        "VehicleStatus",
    ]
)


@given(SPELLINGS)
def test_every_spelling_of_a_topic_is_right(name: str) -> None:
    assert ids(HEALTHY._replace(wanted=(name,))) == []
    assert matches(name, ROUTES[0])


@given(st.text("abfmuoutinv_/0123456789V", max_size=30))
def test_names_are_right_or_have_one_finding(name: str) -> None:
    """The reference: the names that ROS 2 has, and the last parts of these."""
    right = {route.name for route in ROUTES} | {route.name.rpartition("/")[2] for route in ROUTES}
    found = ids(HEALTHY._replace(wanted=(name,)))
    if plain(name) in right:
        assert found == []
    else:
        assert len(found) == 1
        assert set(found) <= {"NAMESPACE_WRONG", "VERSION_WRONG", "TOPIC_NOT_BRIDGED", "TOPIC_UNKNOWN"}


@given(st.sampled_from(ROUTES), st.integers(0, 9))
def test_another_suffix_is_a_wrong_version(route: Route, version: int) -> None:
    name = stem_of(route.name) + (f"_v{version}" if version else "")
    expected = [] if name == route.name else ["VERSION_WRONG"]
    assert ids(HEALTHY._replace(wanted=(name,))) == expected


@given(st.sampled_from(ROUTES), st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True))
def test_a_name_in_another_namespace_is_told_with_the_right_one(route: Route, namespace: str) -> None:
    asked = f"/{namespace}{route.name}"
    assert ids(HEALTHY._replace(wanted=(asked,))) == ["NAMESPACE_WRONG"]
    remote = VEHICLE.remote._replace(namespace=namespace)
    own = tuple(each._replace(name=f"/{namespace}{each.name}") for each in ROUTES)
    topics = {f"/{namespace}{name}": topic for name, topic in VEHICLE.topics.items()}
    inside = vehicle(remote=remote, routes=own, topics=topics)
    assert ids(inside) == ids(inside._replace(wanted=(asked,))) == []
    other = inside._replace(wanted=(route.name,))
    assert ids(other) == ["NAMESPACE_WRONG"]
    assert f"'{asked}'" in texts(other)


def test_a_topic_of_the_other_direction_is_named() -> None:
    case = HEALTHY._replace(wanted=("/fmu/out/vehicle_command",))
    assert ids(case) == ["TOPIC_NOT_BRIDGED"]
    assert "the vehicle reads '/fmu/in/vehicle_command_v1'" in texts(case)


def test_a_topic_of_a_given_package_that_the_vehicle_lacks_is_found() -> None:
    case = vehicle(routes=ROUTES[1:])
    assert ids(case) == []
    given_types = {1: case.expected[1]._replace(is_given=True)}
    assert ids(case._replace(expected=given_types)) == ["TOPIC_NOT_BRIDGED"]


def test_readers_in_dds_that_get_nothing_are_found() -> None:
    readers = (
        ReaderSeen("/fmu/out/vehicle_status", is_reliable=False, has_writer=False),
        ReaderSeen("/fmu/out/vehicle_attitude", is_reliable=False, has_writer=True),
        ReaderSeen("/fmu/out/sensor_gyro", is_reliable=False, has_writer=True),
    )
    case = seen(readers=readers)
    assert ids(case) == ["VERSION_WRONG"]
    assert texts(case).startswith("a reader in DDS gets nothing: '/fmu/out/vehicle_status' has another version suffix")


def test_a_selection_that_fits_no_vehicle_is_found() -> None:
    other = HEALTHY._replace(selection=Selection(namespace="uav_2"))
    assert ids(other) == ["NAMESPACE_WRONG"]
    assert "'uav_2', the vehicle that is there has no namespace: leave out --namespace, or start the" in texts(other)
    assert (
        diagnose(other).summary == "1 problem found: udp://127.0.0.1:8888, only the vehicle at 127.0.0.1:40123 (key 1)"
    )
    assert ids(HEALTHY._replace(selection=Selection(namespace=""))) == []
    assert ids(HEALTHY._replace(selection=Selection(key=1))) == []


# --- definitions


@given(st.sampled_from(ROUTES), st.integers(0, 0xFFFFFFFF))
def test_definitions_are_compared_by_their_hashes(route: Route, value: int) -> None:
    own = VEHICLE.hashes[route.ros_type]
    found = ids(vehicle(hashes={**VEHICLE.hashes, route.ros_type: value}))
    assert found == ([] if value == own else ["DEFINITION_DIFFERS"])


def test_only_the_named_topics_are_compared() -> None:
    differing = {**VEHICLE.hashes, ROUTES[0].ros_type: 1}
    assert ids(vehicle(hashes=differing)._replace(wanted=("vehicle_attitude",))) == []
    assert ids(vehicle(hashes=differing)._replace(wanted=("vehicle_status",))) == ["DEFINITION_DIFFERS"]


def test_a_vehicle_that_tells_no_hashes_is_not_judged_by_them() -> None:
    assert ids(vehicle(hashes={})) == []


def test_another_version_is_not_also_another_definition() -> None:
    routes = (ROUTES[0]._replace(name="/fmu/out/vehicle_status_v2"), *ROUTES[1:])
    topics = {**VEHICLE.topics, "/fmu/out/vehicle_status_v2": VEHICLE.topics[ROUTES[0].name]}
    assert ids(vehicle(routes=routes, topics=topics, hashes={ROUTES[0].ros_type: 1})) == ["VERSION_WRONG"]


def test_definitions_of_a_package_and_of_its_sources_are_the_same(px4_types: Any) -> None:
    built = expected_of(px4_types, "a package", is_given=True)
    catalog = expected_of_catalog(read_catalog(find_sources("v1.18")), "sources")
    assert len(built.messages) > 60
    assert built.messages.items() <= catalog.messages.items()
    assert {"/fmu/out/vehicle_status_v4", "/fmu/in/trajectory_setpoint"} <= {topic.name for topic in built.topics}
    assert "sensor_gyro" in built.uorb


# --- times and flow

EXCHANGE = ("source_protocol", "observed_offset", "estimated_offset", "round_trip_time")
EXCHANGES = st.lists(st.tuples(st.integers(-300_000, 300_000), st.integers(0, 100_000)), min_size=1, max_size=8)


@given(EXCHANGES, st.sampled_from([1, 2]))
def test_the_estimate_of_the_clocks_is_wrong_if_all_exchanges_say_so(
    exchanges: list[tuple[int, int]], protocol: int
) -> None:
    """An exchange is off by half of its round trip at most. Those about MAVLink say nothing."""
    case = example_of("CLOCK_UNSETTLED")
    (own,) = case.seen.vehicles
    ((sync, (sample,)),) = own.states.items()
    estimated = sample.values["estimated_offset"]
    samples = tuple(
        sample._replace(values=dict(zip(EXCHANGE, (protocol, estimated + error, estimated, round_trip), strict=True)))
        for error, round_trip in exchanges
    )
    least = min(max(0, abs(error) - round_trip / 2) for error, round_trip in exchanges)
    found = ids(changed_vehicle(case, states={sync: samples}))
    assert found == (["CLOCK_UNSETTLED"] if protocol == 2 and least > 20_000 else [])


def test_an_estimate_of_a_real_px4_that_lags_behind_is_found() -> None:
    """Exchanges of a simulated v1.18, 14 s after its first one: it runs 1 % slower than the clock."""
    case = example_of("CLOCK_UNSETTLED")
    (own,) = case.seen.vehicles
    ((sync, (sample,)),) = own.states.items()
    estimates = (-1795425084882422, -1795425084882678, -1795425084882954, -1795425084882954, -1795425084883236)
    errors, trips = (-27688, -33344, -39987, -58288, -42006), (4000, 0, 4000, 24000, 8000)
    samples = tuple(
        sample._replace(values=dict(zip(EXCHANGE, (2, estimate + error, estimate, trip), strict=True)))
        for estimate, error, trip in zip(estimates, errors, trips, strict=True)
    )
    case = changed_vehicle(case, states={sync: samples})
    assert ids(case) == ["CLOCK_UNSETTLED"]
    assert "sends times that are 26 ms too early" in texts(case)


@given(st.lists(st.floats(-1e9, 2e9), min_size=1, max_size=3))
def test_the_clock_is_judged_by_the_median_of_the_topics(ages: list[float]) -> None:
    topics = {name: topic._replace(age=age) for (name, topic), age in zip(VEHICLE.topics.items(), ages, strict=False)}
    middle = sorted(ages)[len(ages) // 2] if len(ages) % 2 else sum(ages) / 2
    is_boot = SEEN.now / 1e3 - middle * 1e6 < 1e15
    expected = ["TIME_NOT_SYNCED"] if is_boot else ["CLOCK_WRONG"] if abs(middle) > 1 else []
    assert ids(vehicle(topics=topics)) == expected


def test_samples_without_timestamps_tell_no_time() -> None:
    topics = {name: topic._replace(age=None) for name, topic in VEHICLE.topics.items()}
    assert ids(vehicle(topics=topics)) == []


@given(st.integers(1, 1000), st.floats(0, 20))
def test_rates_are_compared_with_half_of_the_limit(samples: int, seconds: float) -> None:
    topics = {name: topic._replace(samples=samples) for name, topic in VEHICLE.topics.items()}
    is_slow = samples + 1 < 25 * seconds
    assert ids(vehicle(topics=topics, seconds=seconds)) == (["RATE_LOW"] if is_slow else [])


def test_a_single_slow_topic_is_found_if_it_is_named() -> None:
    topics = {**VEHICLE.topics, ROUTES[1].name: TopicSeen(samples=10, size=52, age=0.0)}
    assert ids(vehicle(topics=topics)) == []
    assert ids(vehicle(topics=topics)._replace(wanted=("vehicle_attitude",))) == ["RATE_LOW"]


def test_topics_that_px4_publishes_rarely_have_no_rate() -> None:
    topics = {**VEHICLE.topics, ROUTES[0].name: TopicSeen(samples=2, size=52, age=0.0)}
    assert ids(vehicle(topics=topics)) == []
    assert ids(vehicle(topics=topics)._replace(wanted=("vehicle_status",))) == []


@given(st.integers(0, 3000), st.integers(0, 3000))
def test_losses_are_found_from_one_percent(lost: int, dropped: int) -> None:
    statistics = SEEN.statistics._replace(dropped=dropped)
    case = seen(statistics=statistics, vehicles=(VEHICLE._replace(lost=lost),))
    is_dropped = dropped >= 5 and dropped > 0.01 * (dropped + statistics.received)
    is_lost = lost >= 5 and lost > 0.01 * (lost + VEHICLE.samples)
    assert ids(case) == (["BUFFER_FULL"] if is_dropped else ["SAMPLES_LOST"] if is_lost else [])


@pytest.mark.parametrize(("received", "share"), [(100, 10), (50, 18), (10_000, 1)])
def test_lost_messages_are_compared_with_messages(received: int, share: int) -> None:
    """PX4 puts several samples into a message, and numbers the messages."""
    vehicles = (VEHICLE._replace(lost=11),)
    case = seen(statistics=SEEN.statistics._replace(received=received), vehicles=vehicles)
    assert f"has sent 11 messages that did not arrive ({share}%)" in texts(case)


def test_each_of_several_vehicles_has_its_share_of_the_messages() -> None:
    vehicles = tuple(
        VEHICLE._replace(remote=VEHICLE.remote._replace(number=n, key=n), lost=lost) for n, lost in ((1, 0), (2, 11))
    )
    case = seen(statistics=SEEN.statistics._replace(received=200), vehicles=vehicles)
    assert "has sent 11 messages that did not arrive (10%)" in texts(case)


def test_a_large_buffer_that_was_full_is_due_to_a_busy_computer() -> None:
    case = seen(statistics=SEEN.statistics._replace(dropped=100), buffer_limit=4 << 20)
    assert "this computer is too busy" in texts(case)


@given(st.integers(1, 5000), st.integers(12, 300), st.floats(0.1, 20))
def test_a_line_is_full_by_its_bytes(samples: int, size: int, seconds: float) -> None:
    topics = {name: TopicSeen(samples, size, 0.0) for name in VEHICLE.topics}
    case = vehicle(topics=topics, lost=2000, seconds=seconds)
    line = case.seen._replace(scheme="serial", link="serial:///dev/ttyUSB0?baud=57600", baud=57600)
    expected = "LINE_FULL" if sum(3 * [samples * (size + 14) / seconds]) / 5760 >= 0.85 else "SAMPLES_LOST"
    assert expected in ids(case._replace(seen=line))
    assert "LINE_FULL" not in ids(case)


def test_a_full_line_is_told_with_its_bytes_and_the_four_topics_that_cost_most() -> None:
    names = [f"/fmu/out/topic_{letter}" for letter in "abcde"]
    topics = {name: TopicSeen(samples, 86, 0.0) for name, samples in zip(names, (100, 300, 200, 50, 400), strict=True)}
    case = vehicle(topics=topics, seconds=10.0)
    line = case.seen._replace(scheme="serial", link="serial:///dev/ttyUSB0?baud=57600", baud=57600)
    assert (
        "sends 10,500 bytes a second, and 57600 baud carries 5,760: raise the speed, or lower rate_limit in "
        "dds_topics.yaml; most cost /fmu/out/topic_e 4,000, /fmu/out/topic_b 3,000, /fmu/out/topic_c 2,000, "
        "/fmu/out/topic_a 1,000"
    ) in texts(case._replace(seen=line))


def test_single_samples_have_no_rate() -> None:
    topics = {name: TopicSeen(1, 52, 0.0) for name in VEHICLE.topics}
    assert ids(vehicle(topics=topics, seconds=0.0)) == []


# --- sessions


def test_a_vehicle_that_connected_and_never_sent_is_silent() -> None:
    case = vehicle(heard=0, topics={})
    assert ids(case) == ["VEHICLE_SILENT"]
    assert "has sent nothing since it has connected" in texts(case)


@given(st.floats(0, 1e3))
def test_silence_counts_from_two_seconds(seconds: float) -> None:
    found = ids(vehicle(heard=SEEN.now - round(seconds * 1e9)))
    assert found == (["VEHICLE_SILENT"] if round(seconds * 1e9) / 1e9 > 2.0 else [])


@given(st.integers(0, 500), st.floats(0, 60))
def test_requests_for_the_time_are_found_if_they_are_repeated_slowly(timestamps: int, age: float) -> None:
    client = SEEN.clients[0]._replace(timestamps=timestamps, age=age, number=0)
    case = seen(vehicles=(), clients=(client,))
    assert ids(case) == (["NO_TIME_SYNC"] if 3 <= timestamps <= 1.5 * age + 1 else ["CLIENT_UNREADY"])


def test_a_client_that_has_restarted_is_not_told_to_lack_the_time() -> None:
    """A client that was synchronized and is gone asks for the time no more, however long ago it began."""
    gone = SEEN.clients[0]._replace(address="127.0.0.1:40125", number=0, age=30.0, silence=26.5, timestamps=23)
    newest = SEEN.clients[0]._replace(age=3.5)
    earlier = VEHICLE._replace(remote=VEHICLE.remote._replace(number=2), ended="the vehicle has begun another session")
    assert ids(seen(clients=(newest, gone), vehicles=(earlier, VEHICLE))) == ["VEHICLE_RESTARTS"]
    assert ids(seen(clients=(newest, gone))) == []


def test_a_client_that_starts_over_without_the_time_has_the_first_cause_only() -> None:
    deaf = SEEN.clients[0]._replace(age=9.0, timestamps=9)
    first = deaf._replace(address="127.0.0.1:40125", number=0, age=20.0, silence=9.0, timestamps=10)
    bare = VEHICLE._replace(routes=(), topics={}, hashes={}, heard=0)
    again = bare._replace(remote=VEHICLE.remote._replace(number=2))
    case = seen(clients=(deaf, first), vehicles=(again, bare))
    assert ids(case) == ["NO_TIME_SYNC"]
    assert texts(case).startswith("the client at 127.0.0.1:40123 (key 1) has asked for the time 9 times in 9 s")


DAMAGE = st.dictionaries(
    st.sampled_from(["wrong cookie", "too many clients", "message of an unknown session", "payload too short"]),
    st.integers(1, 200),
)


@given(DAMAGE)
def test_damaged_datagrams_are_found_from_one_percent(refused: dict[str, int]) -> None:
    statistics = SEEN.statistics._replace(refused=sum(refused.values()))
    damaged = refused.get("wrong cookie", 0) + refused.get("payload too short", 0)
    is_much = damaged >= 5 and damaged > 0.01 * (statistics.received + statistics.refused)
    assert ids(seen(refused=refused, statistics=statistics)) == (["DATAGRAMS_DAMAGED"] if is_much else [])


# --- setpoints: what must not be found


def steered(inputs: Mapping[str, InputSeen], **values: Any) -> Case:
    return changed_vehicle(STEERED, inputs=inputs, **values)


STEERING = STEERED.seen.vehicles[0].inputs
MODE, SETPOINT = "/fmu/in/offboard_control_mode", "/fmu/in/trajectory_setpoint"
ACK, COMMAND = "/fmu/out/vehicle_command_ack", "/fmu/in/vehicle_command_v1"


def changed(name: str, **values: Any) -> Case:
    """Return the case of a healthy program with other values of a message."""
    each = STEERING[name]
    last = (each.last[-1]._replace(values={**each.last[-1].values, **values}),)
    return steered({**STEERING, name: each._replace(last=last)})


@given(st.floats(0, 100), st.floats(0, 9))
def test_the_rate_of_the_control_mode_is_judged(rate: float, longest: float) -> None:
    found = ids(steered({**STEERING, MODE: STEERING[MODE]._replace(rate=rate, longest=longest)}))
    assert found == (["OFFBOARD_MODE_SLOW"] if longest > 1.0 or 0 < rate < 1.95 else [])


AXIS = st.sampled_from([math.nan, -1.0, 0.0])


@given(st.tuples(AXIS, AXIS, AXIS), st.tuples(AXIS, AXIS, AXIS), st.tuples(AXIS, AXIS, AXIS))
def test_an_axis_needs_a_number_in_one_of_three(position: Any, velocity: Any, acceleration: Any) -> None:
    case = changed(SETPOINT, position=position, velocity=velocity, acceleration=acceleration)
    is_open = any(all(map(math.isnan, axis)) for axis in zip(position, velocity, acceleration, strict=True))
    assert ids(case) == (["SETPOINT_EMPTY"] if is_open else [])


CONTROL_FIELDS = ["position", "velocity", "acceleration", "attitude", "body_rate", "thrust_and_torque"]


@given(st.dictionaries(st.sampled_from(CONTROL_FIELDS), st.booleans()))
def test_the_first_field_of_the_control_mode_selects(fields: dict[str, bool]) -> None:
    """The reference: trajectory_setpoint is the message of the first three."""
    first = next((name for name in CONTROL_FIELDS if fields.get(name)), "")
    fits = first in {"position", "velocity", "acceleration"}
    case = changed(MODE, **{"position": False, **fields})
    assert ids(case) == ([] if fits else ["SETPOINT_UNSELECTED"])


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_a_position_below_the_origin_and_the_vehicle_is_found(z: float, own: float) -> None:
    case = changed(SETPOINT, position=(0.0, 0.0, z))
    (vehicle,) = case.seen.vehicles
    place = "/fmu/out/vehicle_local_position"
    state = vehicle.states[place][0]
    states = {**vehicle.states, place: (state._replace(values={**state.values, "z": own}),)}
    case = changed_vehicle(case, states=states)
    assert ids(case) == (["SETPOINT_DOWNWARD"] if z > max(0.0, own) + 0.5 else [])


def test_a_mode_of_a_program_needs_no_control_mode() -> None:
    """It registers at PX4, and answers its arming checks."""
    own = STEERED.seen.vehicles[0]
    reply = "/fmu/in/arming_check_reply_v1"
    routes = (*own.routes, Route(reply, "px4_msgs/msg/VehicleStatus", "in", 1))
    status = own.states[ROUTES[0].name][0]
    states = {**own.states, ROUTES[0].name: (status._replace(values={**status.values, "nav_state": 23}),)}
    case = steered({SETPOINT: STEERING[SETPOINT], reply: STEERING[MODE]}, routes=routes, states=states)
    assert "OFFBOARD_MODE_MISSING" not in ids(case)
    assert "MODE_OTHER" not in ids(case)


def test_setpoints_are_not_judged_if_other_topics_are_meant() -> None:
    wrong = example_of("SETPOINT_EMPTY")
    assert ids(wrong) == ["SETPOINT_EMPTY"]
    assert ids(wrong._replace(wanted=("vehicle_attitude",))) == []
    assert ids(wrong._replace(wanted=("offboard_control_mode",))) == ["SETPOINT_EMPTY"]


def test_one_setpoint_before_the_watch_is_enough() -> None:
    once = STEERING[SETPOINT]._replace(samples=0, rate=0.0, programs=())
    assert ids(steered({MODE: STEERING[MODE], SETPOINT: once})) == []
    assert ids(steered({MODE: STEERING[MODE]})) == ["SETPOINT_UNSELECTED"]


def test_an_arming_that_was_accepted_since_is_no_refusal() -> None:
    refused = example_of("ARMING_REFUSED")
    (own,) = refused.seen.vehicles
    acks = own.states[ACK]
    later = acks[0]._replace(values={"command": 400, "result": 0})
    assert ids(changed_vehicle(refused, states={**own.states, ACK: (*acks, later)})) == ["CHECKS_FAIL"]


@given(st.floats(0, 1e5))
def test_a_refusal_counts_however_old_it_is(age: float) -> None:
    refused = example_of("ARMING_REFUSED")
    (own,) = refused.seen.vehicles
    (ack,) = own.states[ACK]
    earlier = ack._replace(time=SEEN.now - round(age * 1e9))
    case = changed_vehicle(refused, inputs={}, states={**own.states, ACK: (earlier,)})
    assert ids(case) == ["ARMING_REFUSED"]
    assert f"'temporarily rejected' {age:.1f} s ago" in texts(case)
    assert ids(case._replace(wanted=("vehicle_attitude",))) == []


IDS = st.integers(0, 255)


@given(
    st.lists(st.tuples(st.sampled_from([400, 176, 512]), IDS, IDS), min_size=1, max_size=8),
    IDS,
    IDS,
    st.sampled_from([(), (400, 176, 512)]),
)
def test_commands_for_others_are_found(
    commands: list[tuple[int, int, int]], system: int, component: int, acknowledged: tuple[int, ...]
) -> None:
    """The reference: PX4 takes what is for its own ids or for 0, and others acknowledge what is for them."""
    case = example_of("COMMAND_MISADDRESSED")
    (own,) = case.seen.vehicles
    names = ("command", "target_system", "target_component")
    samples = tuple(SampleSeen(SEEN.now, "0001", dict(zip(names, each, strict=True))) for each in commands)
    status = own.states[ROUTES[0].name][0]
    values = {**status.values, "system_id": system, "component_id": component}
    acks = tuple(SampleSeen(SEEN.now, "0001", {"command": each, "result": 0}) for each in acknowledged)
    states = {
        **own.states,
        ROUTES[0].name: (status._replace(values=values),),
        **({ACK: acks} if acks else {}),
    }
    inputs = {**own.inputs, COMMAND: own.inputs[COMMAND]._replace(last=samples)}
    ignored = set()
    for number in {number for number, _, _ in commands}:
        targets = [target for own_number, *target in commands if own_number == number]
        is_elsewhere = all(target not in (0, system) for target, _ in targets)
        is_unanswered = not acknowledged and all(target not in (0, component) for _, target in targets)
        if is_elsewhere or is_unanswered:
            ignored.add(number)
    found = texts(changed_vehicle(case, inputs=inputs, states=states))
    assert {number for number in (400, 176, 512) if f"has command {number} for " in found} == ignored
    assert ("but is not armed" in found) == (400 not in ignored)


def test_what_px4_sets_while_its_checks_pass_is_no_reason(px4_types: Any) -> None:
    """In flights of a real PX4 v1.18 without a remote id, whose COM_ARM_ODID does not ask for one."""
    names = {name: f"/fmu/out/{name}" for name in ("vehicle_status_v4", "failsafe_flags")}
    messages = {endpoint.ros_name: endpoint.message for endpoint in px4_types.topics.ENDPOINTS}
    routes = tuple(Route(each, "", "out", 0) for each in names.values())
    judged = 0
    for flight in flight_captures.names():
        newest: dict[str, tuple[SampleSeen, ...]] = {}
        for _, topic, data in flight_captures.load(flight).rows:
            if topic not in names.values():
                continue
            newest[topic] = (SampleSeen(0, data, _values(messages[topic].decode(bytes.fromhex(data)))),)
            seen = VEHICLE._replace(routes=routes, states=newest)
            status = seen.state("vehicle_status")
            if len(newest) == 2 and status["pre_flight_checks_pass"] and status["arming_state"] == 1:
                judged += 1
                assert arming._failing(seen) == [], flight
    assert judged > 100


@given(st.floats(0, 10), st.floats(0, 20))
def test_a_client_that_restarts_does_not_share_its_key(silence: float, age: float) -> None:
    """A client that is heard after another one began is another vehicle, a client that is not has a new port."""
    earlier = SEEN.clients[0]._replace(address="127.0.0.1:40125", silence=silence, age=age + 20, timestamps=0)
    newest = SEEN.clients[0]._replace(age=age, timestamps=0)
    found = ids(seen(clients=(newest, earlier)))
    assert found == (["KEY_SHARED"] if silence < age - 0.5 else [])


@given(st.floats(0, 10), st.floats(0, 20))
def test_a_client_at_the_address_of_another_one_is_the_same(silence: float, age: float) -> None:
    """The owner of a link may tell the newest age late: a session that has ended then seems to be heard after it."""
    earlier = SEEN.clients[0]._replace(silence=silence, age=age + 20, timestamps=0)
    assert ids(seen(clients=(SEEN.clients[0]._replace(age=age, timestamps=0), earlier))) == []


def test_no_client_is_not_told_if_somebody_else_has_it() -> None:
    empty: Mapping[str, Any] = {"vehicles": (), "clients": (), "statistics": Statistics(0, 0, 0, 0, 0, 0)}
    agent = AgentSeen("127.0.0.1:8889", (Process(1, "px4"),))
    assert ids(seen(**empty)) == ["NO_CLIENT"]
    assert ids(seen(**empty, agents=(agent,))) == ["AGENT_HAS_CLIENT"]
    assert ids(seen(**empty, agents=(agent._replace(clients=(), namespaces=("",)),))) == ["AGENT_HAS_CLIENT"]
    assert "use --link dds://0 beside it" in texts(seen(**empty, agents=(agent,)))
    other_domain = seen(**empty, agents=(agent,), link="dds://7", scheme="dds", has_asked_agents=True)
    assert ids(other_domain) == ["AGENT_HAS_CLIENT"]
    assert "its DDS domain is not that of dds://7: compare UXRCE_DDS_DOM_ID" in texts(other_domain)


@pytest.mark.parametrize(
    ("rule", "values"),
    [
        ("NO_TIME_SYNC", {"clients": (SEEN.clients[0]._replace(number=0, timestamps=7),)}),
        ("CLIENT_UNREADY", {"clients": (SEEN.clients[0]._replace(number=0, timestamps=0),)}),
        ("CLIENT_UNREADY", {"refused": {"message of an unknown session": 9}}),
        ("CLIENT_REFUSED", {"refused": {"address that is not allowed": 9}}),
    ],
)
def test_a_client_that_talks_here_is_named_and_not_one_elsewhere(rule: str, values: Mapping[str, Any]) -> None:
    nobody = {"vehicles": (), "clients": (), "statistics": Statistics(1, 0, 9, 0, 0, 0)}
    agent = AgentSeen("127.0.0.1:8889", (Process(1, "px4"),))
    others = {"senders": (Sender(Process(2, "px4"), "127.0.0.1:8890"),), "agents": (agent,)}
    assert ids(seen(**{**nobody, **values, **others})) == [rule]
    assert ids(seen(**{**nobody, **values, "agents": (agent._replace(clients=(), namespaces=()),)})) == [rule]


@given(st.integers(0, 11), st.floats(0.01, 11))
def test_a_client_that_gave_up_asking_for_the_time_lacks_it_in_its_next_session_too(asked: int, age: float) -> None:
    """PX4's client gives up after eleven requests, and begins another session from another port."""
    asked = min(asked, 1 + round(age))
    gone = SEEN.clients[0]._replace(
        address="127.0.0.1:40125", number=0, age=age + 11.5, silence=age + 0.5, timestamps=11
    )
    newest = SEEN.clients[0]._replace(number=0, age=age, timestamps=asked)
    bare = VEHICLE._replace(routes=(), topics={}, hashes={}, heard=0)
    sessions = (bare._replace(ended="the vehicle has ended the session"), bare._replace(remote=_other(2)))
    assert ids(seen(clients=(gone, newest), vehicles=sessions)) == ["NO_TIME_SYNC"]


def _other(number: int) -> Remote:
    return VEHICLE.remote._replace(number=number, address="127.0.0.1:40125")


def test_a_client_that_synchronizes_its_clock_needs_a_longer_wait() -> None:
    client = SEEN.clients[0]._replace(number=0, age=2.0, timestamps=160)
    case = seen(vehicles=(), clients=(client,))
    assert ids(case) == ["CLIENT_UNREADY"]
    assert "it synchronizes its clock, which takes about 6 s: run this again, with a longer --wait" in texts(case)


def test_a_vehicle_that_has_just_connected_is_not_judged_by_what_it_lacks() -> None:
    given_types = {1: HEALTHY.expected[1]._replace(is_given=True)}
    case = vehicle(heard=0, topics={}, routes=ROUTES[1:], since=SEEN.now - 1_000_000_000)._replace(expected=given_types)
    assert ids(case) == []
    later = case._replace(seen=case.seen._replace(now=SEEN.now + 2_000_000_000))
    assert ids(later) == ["VEHICLE_SILENT", "TOPIC_NOT_BRIDGED"]


@pytest.mark.parametrize(
    ("link", "scheme", "text"),
    [
        ("tap://127.0.0.1:8888?agent=127.0.0.1:8889", "tap", "no agent answers at 127.0.0.1:8889"),
        ("serial:///dev/ttyUSB0?baud=57600", "serial", "nothing has arrived from serial:///dev/ttyUSB0"),
        ("dds://7", "dds", "no vehicle is in DDS domain 7 in 3 s"),
    ],
)
def test_the_findings_of_other_links_name_what_they_have(link: str, scheme: str, text: str) -> None:
    case = seen(link=link, scheme=scheme, vehicles=(), clients=(), statistics=Statistics(0, 0, 0, 0, 0, 0))
    assert text in texts(case._replace(seen=case.seen._replace(has_asked_agents=True)))


def test_a_port_of_another_user_is_found_without_a_name() -> None:
    taken = seen(is_taken=True, vehicles=(), clients=(), statistics=Statistics(0, 0, 0, 0, 0, 0))
    assert "by a process of another user: `sudo ss -ulpn sport = :8888` shows it" in texts(taken)
    serial = taken.seen._replace(link="serial:///dev/ttyUSB0?baud=57600", scheme="serial")
    assert "`sudo fuser -v /dev/ttyUSB0` shows it" in texts(taken._replace(seen=serial))


# --- any observation

NAMES = st.text(max_size=12) | st.sampled_from([route.name for route in ROUTES])
VECTORS = st.tuples(*3 * [st.floats()])
VALUES = st.fixed_dictionaries(
    {},
    optional={
        **dict.fromkeys(("position", "velocity", "acceleration", "xyz", "thrust_body"), VECTORS),
        "q_d": st.tuples(*4 * [st.floats()]),
        "control": st.lists(st.floats(), min_size=1, max_size=3).map(tuple),
        **dict.fromkeys(("roll", "z"), st.floats()),
        **dict.fromkeys(("attitude", "failsafe", "xy_valid", "landed", "pre_flight_checks_pass"), st.booleans()),
        **dict.fromkeys(("result", "arming_state", "battery_warning"), st.integers(0, 9)),
        **dict.fromkeys(("nav_state", "nav_state_user_intention"), st.integers(0, 255)),
        "command": st.sampled_from([400, 176, 0]),
        **dict.fromkeys(("system_id", "component_id", "target_system", "target_component"), st.integers(0, 3)),
        "mode_req_offboard_signal": st.integers(0, 0xFFFFFFFF),
        "offboard_control_signal_lost": st.booleans(),
    },
)
SAMPLES = st.builds(SampleSeen, st.integers(0, 2 * SEEN.now), st.just("0001"), VALUES, st.sampled_from(["", "wrong"]))
STEERED_NAMES = NAMES | st.sampled_from([route.name for route in STEERED.seen.vehicles[0].routes])
PROGRAMS = st.builds(ProgramSeen, st.text(), st.integers(0, 9), st.integers(0, 9), st.floats(0, 1e3))
INPUTS = st.builds(
    InputSeen,
    programs=st.lists(PROGRAMS, max_size=2).map(tuple),
    samples=st.integers(0, 2),
    size=st.integers(0, 99),
    rate=st.floats(0, 1e3),
    longest=st.floats(0, 9),
    age=st.none() | st.floats(-1e9, 2e9),
    last=st.lists(SAMPLES, max_size=2).map(tuple),
).map(lambda each: each if each.last else each._replace(samples=0))
VEHICLES = st.builds(
    VehicleSeen,
    remote=st.builds(
        VEHICLE.remote._replace,
        number=st.sampled_from([1, 2]),
        key=st.integers(0, 3),
        namespace=st.sampled_from(["", "a"]),
    ),
    routes=st.lists(st.builds(Route, NAMES, NAMES, st.sampled_from(["in", "out"]), st.just(-1)), max_size=4).map(tuple)
    | st.just(STEERED.seen.vehicles[0].routes),
    topics=st.dictionaries(
        NAMES,
        st.builds(
            TopicSeen,
            st.integers(1, 9),
            st.integers(4, 99),
            st.none() | st.floats(-1e9, 2e9),
        ),
        max_size=4,
    ),
    hashes=st.dictionaries(NAMES, st.integers(0, 0xFFFFFFFF), max_size=3),
    release=st.sampled_from(["", "v1.18"]),
    lost=st.integers(0, 99),
    seconds=st.floats(0, 9),
    heard=st.just(0) | st.just(SEEN.now),
    ended=st.sampled_from(["", "gone"]),
    inputs=st.dictionaries(STEERED_NAMES, INPUTS, max_size=3),
    states=st.dictionaries(STEERED_NAMES, st.lists(SAMPLES, min_size=1, max_size=2).map(tuple), max_size=3),
)
OBSERVATIONS = st.builds(
    SEEN._replace,
    scheme=st.sampled_from(["udp", "tap", "dds", "serial"]),
    vehicles=st.lists(VEHICLES, max_size=3).map(tuple),
    clients=st.lists(st.builds(SEEN.clients[0]._replace, address=NAMES, silence=st.floats(0, 9)), max_size=2).map(
        tuple
    ),
    readers=st.lists(st.builds(ReaderSeen, NAMES, st.booleans(), st.booleans()), max_size=2).map(tuple),
    writers=st.lists(
        st.builds(WriterSeen, STEERED_NAMES, NAMES, st.lists(NAMES, max_size=1).map(tuple)), max_size=2
    ).map(tuple),
    hears_programs=st.booleans(),
    is_taken=st.booleans(),
    seconds=st.floats(0, 9),
    baud=st.integers(0, 99999),
)


@given(OBSERVATIONS, st.lists(NAMES, max_size=2).map(tuple), st.none() | st.integers(1, 3))
def test_any_observation_has_a_report(observation: Observation, wanted: tuple[str, ...], key: int | None) -> None:
    expected = {1: HEALTHY.expected[1], 2: STEERED.expected[1]}
    report = diagnose(Case(observation, expected, wanted, Selection(key=key)))
    assert report.summary.startswith(("no problem found: ", f"{len(report.findings)} problem"))
    order = [rule.id for rule in DOCTOR]
    places = [order.index(finding.rule.id) for finding in report.findings]
    assert places == sorted(places)
    assert len({astuple(finding.change) for finding in report.findings}) == len(report.findings)


_SENT = {"velocity": (0.0, 5.0, 0.0), "velocity_frame": 1, "velocity_variance": (0.01,) * 3, "q": (math.nan,) * 4}
_HERE = {
    **dict.fromkeys(("x", "y", "vx", "vy", "vz", "ax", "ay", "az", "heading"), 0.0),
    "eph": 0.1,
    "evh": 0.1,
    "evv": 0.1,
}


@pytest.mark.parametrize(
    ("flags", "sent", "told"),
    [
        ({"cs_gnss_pos": True}, _SENT, "is not fused (cs_ev_vel of estimator_status_flags is false): vy is 5 m/s"),
        ({"cs_ev_vel": True}, _SENT, "is rejected: vy is 5 m/s from the estimate, and EKF2 takes 0.42 m/s: raise its"),
        ({"cs_ev_vel": True}, {**_SENT, "velocity": (0.0, 0.4, 0.0)}, ""),
        ({}, _SENT, "is false): the bit 4 of EKF2_EV_CTRL (velocity) is probably not set"),
    ],
)
def test_measurements_that_are_far_from_the_estimate_are_found(
    flags: dict[str, bool], sent: dict[str, object], told: str
) -> None:
    case = example_of("MEASUREMENT_UNFUSED")
    (own,) = case.seen.vehicles
    (seen,) = (each for name, each in own.inputs.items() if name.endswith("visual_odometry"))
    values = {"position": (math.nan,) * 3, "timestamp_sample": seen.last[-1].values["timestamp_sample"], **sent}
    changed: dict[str, dict[str, Any]] = {"estimator_status_flags": {**flags}, "vehicle_local_position": _HERE}
    states = {
        name: (samples[-1]._replace(values={**samples[-1].values, **changed.get(uorb_name(name), {})}),)
        for name, samples in own.states.items()
    }
    inputs = {
        name: each._replace(last=(each.last[-1]._replace(values=values),)) if each is seen else each
        for name, each in own.inputs.items()
    }
    found = texts(changed_vehicle(case, states=states, inputs=inputs))
    assert told in found
    assert bool(told) == bool(found)
