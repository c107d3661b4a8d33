"""An example for each rule: a healthy vehicle with one thing changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from msggen.check.finding import Report, Rule
from msggen.doctor.case import Case
from msggen.doctor.diagnose import diagnose
from msggen.doctor.expected import Definition, Expected, ExpectedTopic
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
)
from msggen.link.link import Client, Remote, Route, Statistics
from msggen.link.rmw_zenoh.vehicle import old_form
from msggen.messages.commands import ARM_DISARM, SET_MODE, TEMPORARILY_REJECTED
from msggen.messages.measurements import NED, PARTS
from msggen.messages.names import uorb_name
from msggen.messages.nav_states import ARMED, DISARMED, HOLD, LAND, OFFBOARD
from msggen.messages.vehicle_types import ROTARY_WING
from msggen.vehicle.selection import Selection

_NOW = 1_767_225_600_000_000_000  # 2026-01-01
_STATUS, _COMMAND = "px4_msgs/msg/VehicleStatus", "px4_msgs/msg/VehicleCommand"
_ROUTES = (
    Route("/fmu/out/vehicle_status_v1", _STATUS, "out", 241),
    Route("/fmu/out/vehicle_attitude", "px4_msgs/msg/VehicleAttitude", "out", 216),
    Route("/fmu/out/sensor_combined", "px4_msgs/msg/SensorCombined", "out", 233),
    Route("/fmu/in/vehicle_command_v1", _COMMAND, "in", 2050),
)
_HASHES = {route.ros_type: 0x5EED0000 + route.object_id for route in _ROUTES}
_VERSIONS = {_STATUS: 1, _COMMAND: 1}
_EXPECTED = Expected(
    "PX4 v1.16",
    is_given=False,
    messages={
        name.rpartition("/")[2]: Definition(value, _VERSIONS.get(name, 0), is_stamped=True)
        for name, value in _HASHES.items()
    },
    topics=tuple(ExpectedTopic(route.name, route.direction, 0.02) for route in _ROUTES),
    uorb=frozenset({"vehicle_status", "vehicle_attitude", "sensor_combined", "vehicle_command", "sensor_gyro"}),
)
_TOPIC = TopicSeen(samples=250, size=52, age=0.001)
_REMOTE = Remote(1, "127.0.0.1:40123", 1, "", continued=False)
_VEHICLE = VehicleSeen(
    _REMOTE,
    _ROUTES,
    {route.name: _TOPIC for route in _ROUTES if route.direction == "out"},
    _HASHES,
    "v1.16",
    lost=0,
    seconds=5.0,
    heard=_NOW,
)
_CLIENT = Client("127.0.0.1:40123", 1, 1, age=8.0, silence=0.0, timestamps=30)
_STATISTICS = Statistics(received=760, sent=40, refused=0, dropped=0, lost=0, receive_buffer=212992)
_SEEN = Observation(
    link="udp://127.0.0.1:8888",
    scheme="udp",
    port=8888,
    baud=921600,
    waited=3.0,
    seconds=5.0,
    now=_NOW,
    vehicles=(_VEHICLE,),
    clients=(_CLIENT,),
    statistics=_STATISTICS,
    buffer_limit=212992,
)
HEALTHY = Case(_SEEN, {1: _EXPECTED, 2: _EXPECTED})
"""A vehicle in which nothing is found."""

_SYNC = "/fmu/out/timesync_status"
_EXCHANGE = {
    "source_protocol": 2,
    "observed_offset": -_NOW // 1000 + 60_000_000,
    "estimated_offset": -_NOW // 1000 + 60_041_500,
    "round_trip_time": 2000,
}
_SERIAL = _SEEN._replace(link="serial:///dev/ttyUSB0?baud=57600", scheme="serial", baud=57600)
_ZENOH = _SEEN._replace(link="zenoh://127.0.0.1:7447", scheme="zenoh", port=7447)
_GUID = "000200000000303339343932510d002d"
_NOTHING: Mapping[str, Any] = {"vehicles": (), "clients": (), "statistics": Statistics(0, 0, 0, 0, 0, 212992)}
_AGENT, _PX4 = Process(4711, "MicroXRCEAgent"), Process(4712, "px4")
_LATER = VehicleSeen(_REMOTE._replace(number=2, address="127.0.0.1:40124"), *_VEHICLE[1:])


def _with(**values: Any) -> Case:
    """Return the healthy case with other facts of the link."""
    return HEALTHY._replace(seen=_SEEN._replace(**values))


def _vehicle(**values: Any) -> Case:
    """Return the healthy case with other facts of the vehicle."""
    return _with(vehicles=(_VEHICLE._replace(**values),))


def _all_topics(**values: Any) -> Case:
    """Return the healthy case with other facts of all topics."""
    return _vehicle(topics={name: topic._replace(**values) for name, topic in _VEHICLE.topics.items()})


def _asked(*names: str) -> Case:
    return HEALTHY._replace(wanted=names)


# A vehicle in Offboard mode, and a program that sends setpoints to it

_NAN = math.nan
_PROGRAM, _OTHER = ProgramSeen("offboard.py", 4713, 250, 50.0), ProgramSeen("teleop.py", 4714, 50, 10.0)
_MODE, _SETPOINT = "/fmu/in/offboard_control_mode", "/fmu/in/trajectory_setpoint"
_ATTITUDE_SETPOINT = "/fmu/in/vehicle_attitude_setpoint_v1"
_ACK, _FLAGS, _PLACE = "/fmu/out/vehicle_command_ack", "/fmu/out/failsafe_flags", "/fmu/out/vehicle_local_position"
_SEES, _FUSED = "/fmu/in/vehicle_visual_odometry", "/fmu/out/estimator_status_flags"
_STEERED_ROUTES = (
    *_ROUTES,
    *(
        Route(name, f"px4_msgs/msg/{message}", "in" if "/in/" in name else "out", number)
        for number, (name, message) in enumerate(
            {
                _MODE: "OffboardControlMode",
                _SETPOINT: "TrajectorySetpoint",
                _ATTITUDE_SETPOINT: "VehicleAttitudeSetpoint",
                _ACK: "VehicleCommandAck",
                _FLAGS: "FailsafeFlags",
                _PLACE: "VehicleLocalPosition",
                _SEES: "VehicleOdometry",
                _FUSED: "EstimatorStatusFlags",
            }.items(),
            400,
        )
    ),
)
_STEERED_VALUES: Mapping[str, Mapping[str, Any]] = {
    _ROUTES[0].name: {
        "arming_state": ARMED,
        "nav_state": OFFBOARD,
        "nav_state_user_intention": OFFBOARD,
        "failsafe": False,
        "pre_flight_checks_pass": True,
        "vehicle_type": ROTARY_WING,
        "system_id": 1,
        "component_id": 1,
    },
    _FLAGS: {"mode_req_offboard_signal": 1 << OFFBOARD, "mode_req_local_position": 1 << OFFBOARD, "battery_warning": 0},
    _PLACE: {"xy_valid": True, "z_valid": True, "v_xy_valid": True, "v_z_valid": True, "z": -5.0},
    _FUSED: {part.flag: False for part in PARTS} | {"cs_tilt_align": True, "cs_yaw_align": True},
}


def _sample(values: Mapping[str, Any], age: float = 0.02) -> SampleSeen:
    return SampleSeen(_NOW - round(age * 1e9), "0001", values)


def _input(values: Mapping[str, Any], **others: Any) -> InputSeen:
    """Return what a healthy program sends, with some of it changed."""
    seen = InputSeen((_PROGRAM,), 250, 68, 50.0, 0.021, 0.0, (_sample(values),))
    return seen._replace(**others)


_POSITION = {"position": (0.0, 0.0, -5.0), "velocity": (_NAN,) * 3, "acceleration": (_NAN,) * 3}
_MODE_INPUT, _SETPOINT_INPUT = _input({"position": True}), _input(_POSITION)
_INPUTS = {_MODE: _MODE_INPUT, _SETPOINT: _SETPOINT_INPUT}
_UPSIDE_DOWN = {**_POSITION, "position": (0.0, 0.0, 5.0)}
_UNCONTROLLED = {**_POSITION, "position": (_NAN,) * 3}


def _steered(inputs: Mapping[str, InputSeen] | None = None, **values: Mapping[str, Any]) -> Case:
    """Return the case of a vehicle that is steered, with other inputs and other values of topics of the state."""
    states = {name: {**known, **values.get(uorb_name(name), {})} for name, known in _STEERED_VALUES.items()}
    samples = {name: (_sample(each),) for name, each in states.items()}
    ack = values.get("vehicle_command_ack")
    messages = {route.ros_type.rpartition("/")[2]: Definition(0, 0, is_stamped=True) for route in _STEERED_ROUTES}
    versions = {"VehicleStatus": 1, "VehicleCommand": 1, "VehicleAttitudeSetpoint": 1}
    expected = _EXPECTED._replace(
        messages={
            **{name: each._replace(version=versions.get(name, 0)) for name, each in messages.items()},
            **_EXPECTED.messages,
        },
        topics=tuple(ExpectedTopic(route.name, route.direction) for route in _STEERED_ROUTES),
    )
    vehicle = _VEHICLE._replace(
        routes=_STEERED_ROUTES,
        topics={**_VEHICLE.topics, **dict.fromkeys((_FLAGS, _PLACE, _FUSED), _TOPIC)},
        inputs=_INPUTS if inputs is None else inputs,
        states=samples if ack is None else {**samples, _ACK: (_sample(ack, 2.0),)},
    )
    return HEALTHY._replace(seen=_SEEN._replace(vehicles=(vehicle,), hears_programs=True), expected={1: expected})


STEERED = _steered()
"""A vehicle in Offboard mode that follows the setpoints of a program. Nothing is found in it."""
_DISARMED = {"arming_state": DISARMED}
_SEEN_PLACE = {
    "timestamp_sample": _NOW // 1000 - 50_000,
    "position": (0.0, 0.0, -5.0),
    "pose_frame": NED,
    "velocity": (_NAN,) * 3,
    "q": (_NAN,) * 4,
}


def _sees(values: Mapping[str, Any], **others: Any) -> Case:
    """Return the case of a vehicle that is steered, and gets measurements."""
    return _steered({**_INPUTS, _SEES: _input({**_SEEN_PLACE, **values}, **others)})


_SETPOINT_EXAMPLES: Mapping[str, Callable[[], Case]] = {
    "MEASUREMENT_DROPPED": lambda: _sees({"position": (1.0, 2.0, _NAN)}),
    "MEASUREMENT_TIME": lambda: _sees({"timestamp_sample": _NOW // 1000 - 420_000}),
    "MEASUREMENT_SLOW": lambda: _sees({}, rate=3.0),
    "MEASUREMENT_UNFUSED": lambda: _sees({}),
    "INPUT_UNPUBLISHED": lambda: _steered({})._replace(wanted=("trajectory_setpoint",)),
    "INPUT_UNREADABLE": lambda: _steered(
        {
            **_INPUTS,
            _SETPOINT: _input(
                {}, last=(SampleSeen(_NOW, "0001", problem="it has 60 bytes, and TrajectorySetpoint has 64"),)
            ),
        }
    ),
    "COMMAND_MISADDRESSED": lambda: _steered(
        {**_INPUTS, _ROUTES[3].name: _input({"command": ARM_DISARM, "target_system": 3, "target_component": 1})},
        vehicle_status=_DISARMED,
    ),
    "SETPOINT_CONTESTED": lambda: _steered({**_INPUTS, _SETPOINT: _input(_POSITION, programs=(_PROGRAM, _OTHER))}),
    "SETPOINT_OLD": lambda: _steered({**_INPUTS, _SETPOINT: _input(_POSITION, age=1_767_225_541.2)}),
    "OFFBOARD_MODE_MISSING": lambda: _steered({_SETPOINT: _SETPOINT_INPUT}),
    "OFFBOARD_MODE_SLOW": lambda: _steered({**_INPUTS, _MODE: _MODE_INPUT._replace(rate=0.8, longest=1.3)}),
    "SETPOINT_UNSELECTED": lambda: _steered(
        {_MODE: _MODE_INPUT, _ATTITUDE_SETPOINT: _input({"q_d": (1.0, 0.0, 0.0, 0.0), "thrust_body": (0.0, 0.0, -0.7)})}
    ),
    "SETPOINT_EMPTY": lambda: _steered({**_INPUTS, _SETPOINT: _input(_UNCONTROLLED)}),
    "SETPOINT_DOWNWARD": lambda: _steered({**_INPUTS, _SETPOINT: _input(_UPSIDE_DOWN)}),
    "POSITION_MISSING": lambda: _steered(vehicle_local_position={"xy_valid": False, "v_xy_valid": False}),
    "FAILSAFE_ACTIVE": lambda: _steered(
        vehicle_status={"failsafe": True, "nav_state": LAND}, failsafe_flags={"offboard_control_signal_lost": True}
    ),
    "ARMING_REFUSED": lambda: _steered(
        vehicle_status={**_DISARMED, "pre_flight_checks_pass": False},
        failsafe_flags={"battery_warning": 2},
        vehicle_command_ack={"command": ARM_DISARM, "result": TEMPORARILY_REJECTED},
    ),
    "CHECKS_FAIL": lambda: _steered(
        vehicle_status={**_DISARMED, "pre_flight_checks_pass": False}, failsafe_flags={"battery_unhealthy": True}
    ),
    "NOT_ARMED": lambda: _steered(vehicle_status=_DISARMED),
    "MODE_REFUSED": lambda: _steered(
        vehicle_status={"nav_state": HOLD, "nav_state_user_intention": HOLD},
        vehicle_command_ack={"command": SET_MODE, "result": TEMPORARILY_REJECTED},
    ),
    "MODE_OTHER": lambda: _steered(vehicle_status={"nav_state": HOLD, "nav_state_user_intention": HOLD}),
}

_EXAMPLES: Mapping[str, Callable[[], Case]] = {
    "PORT_TAKEN": lambda: _with(**_NOTHING, is_taken=True, owners=(_AGENT,)),
    "AGENT_HAS_CLIENT": lambda: _with(
        **_NOTHING, is_taken=True, owners=(_AGENT,), agents=(AgentSeen("127.0.0.1:8888", (_PX4,)),)
    ),
    "AGENT_WITHOUT_CLIENT": lambda: _with(**_NOTHING, agents=(AgentSeen("127.0.0.1:8889", (), ()),)),
    "AGENT_MISSING": lambda: _with(**_NOTHING, link="dds://0", scheme="dds", has_asked_agents=True),
    "CLIENT_ELSEWHERE": lambda: _with(**_NOTHING, senders=(Sender(_PX4, "127.0.0.1:8890"),)),
    "LINE_GARBLED": lambda: HEALTHY._replace(
        seen=_SERIAL._replace(
            **_NOTHING,
            warnings=("2100 bytes arrived from /dev/ttyUSB0, but no intact frame: check that 57600 baud is the speed",),
        )
    ),
    "NO_CLIENT": lambda: _with(**_NOTHING),
    "CLIENT_REFUSED": lambda: _with(
        vehicles=(),
        clients=(),
        statistics=Statistics(0, 0, 12, 0, 0, 212992),
        refused={"address that is not allowed": 12},
        warnings=("refused 10.0.0.3: only allowed addresses may connect; add it to allow=",),
    ),
    "NO_TIME_SYNC": lambda: _with(
        vehicles=(_VEHICLE._replace(routes=(), topics={}, hashes={}, heard=0),),
        clients=(_CLIENT._replace(timestamps=7),),
    ),
    "CLIENT_UNREADY": lambda: _with(vehicles=(), clients=(), refused={"message of an unknown session": 760}),
    "KEY_SHARED": lambda: _with(
        vehicles=(_VEHICLE, _LATER), clients=(_CLIENT, _CLIENT._replace(address="127.0.0.1:40124", number=2))
    ),
    "KEY_WRONG": lambda: HEALTHY._replace(selection=Selection(key=2)),
    "ZENOH_LIMITED": lambda: HEALTHY._replace(
        seen=_ZENOH._replace(
            vehicles=(),
            clients=(),
            statistics=Statistics(0, 0, 250, 0, 0, 0),
            refused={"samples of PX4 before v1.17": 250},
            warnings=(old_form("fmu/out/vehicle_status"),),
        )
    ),
    "STACK_SMALL": lambda: HEALTHY._replace(
        seen=_ZENOH._replace(
            vehicles=(
                _VEHICLE._replace(
                    remote=Remote(1, _GUID, 0, "", continued=False, guid=_GUID),
                    inputs={"/fmu/in/arming_check_reply_v1": InputSeen()},
                ),
            ),
            clients=(),
        )
    ),
    "VEHICLE_RESTARTS": lambda: _with(
        vehicles=(_VEHICLE._replace(ended="the vehicle has begun another session"), _LATER)
    ),
    "VEHICLE_SILENT": lambda: _vehicle(heard=_NOW - 3_400_000_000),
    "NAMESPACE_WRONG": lambda: _asked("/uav_1/fmu/out/vehicle_attitude"),
    "NAMESPACE_SHARED": lambda: _with(
        vehicles=(_VEHICLE, _LATER._replace(remote=_LATER.remote._replace(key=2))),
        clients=(_CLIENT, _CLIENT._replace(address="127.0.0.1:40124", key=2, number=2)),
    ),
    "VERSION_WRONG": lambda: _asked("/fmu/out/vehicle_status"),
    "TOPIC_NOT_BRIDGED": lambda: _asked("/fmu/out/sensor_gyro"),
    "TOPIC_UNKNOWN": lambda: _asked("/fmu/out/vehicle_atitude"),
    "TOPIC_UNPUBLISHED": lambda: _vehicle(
        topics={name: topic for name, topic in _VEHICLE.topics.items() if "status" not in name}
    )._replace(wanted=("vehicle_status",)),
    "READER_RELIABLE": lambda: _with(readers=(ReaderSeen("/fmu/out/vehicle_attitude", True, True),)),  # noqa: FBT003
    "RELEASE_DIFFERS": lambda: _vehicle(
        routes=(
            *_ROUTES,
            *(Route(f"/fmu/out/new_{number}", f"px4_msgs/msg/New{number}", "out", 0) for number in "12345"),
        )
    ),
    "TYPE_UNKNOWN": lambda: _vehicle(
        routes=(*_ROUTES, Route("/fmu/out/wheel_slip", "px4_msgs/msg/WheelSlip", "out", 300))
    ),
    "DEFINITION_DIFFERS": lambda: _vehicle(hashes={**_HASHES, _STATUS: 0xBADC0DE}),
    "TIME_NOT_SYNCED": lambda: _all_topics(age=_NOW / 1e9 - 63.5),
    "CLOCK_WRONG": lambda: _all_topics(age=3.2),
    "CLOCK_UNSETTLED": lambda: _vehicle(
        routes=(*_ROUTES, Route(_SYNC, "px4_msgs/msg/TimesyncStatus", "out", 240)),
        states={_SYNC: (_sample(_EXCHANGE),)},
    )._replace(
        expected={
            1: _EXPECTED._replace(messages={**_EXPECTED.messages, "TimesyncStatus": Definition(0, 0, is_stamped=True)})
        }
    ),
    "DATAGRAMS_DAMAGED": lambda: _with(
        statistics=_STATISTICS._replace(refused=96),
        refused={"submessage longer than its message": 60, "unknown version of the protocol": 36},
    ),
    "LINE_FULL": lambda: HEALTHY._replace(seen=_SERIAL),
    "BUFFER_FULL": lambda: _with(statistics=_STATISTICS._replace(dropped=96, lost=90)),
    "SAMPLES_LOST": lambda: _vehicle(lost=84),
    "RATE_LOW": lambda: _all_topics(samples=10),
    **_SETPOINT_EXAMPLES,
}


def case_of(rule: Rule) -> Case:
    """Return the case that is the example of a rule."""
    return _EXAMPLES[rule.id]()


def example_of(rule: Rule) -> Report:
    """Return the finding of a rule in its example."""
    return diagnose(case_of(rule), (rule,))
