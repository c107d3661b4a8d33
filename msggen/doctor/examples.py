"""An example for each rule: a healthy vehicle with one thing changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from msggen.check.finding import Report, Rule
from msggen.doctor.case import Case
from msggen.doctor.diagnose import diagnose
from msggen.doctor.expected import Definition, Expected, ExpectedTopic
from msggen.doctor.observation import AgentSeen, Observation, Process, ReaderSeen, Sender, TopicSeen, VehicleSeen
from msggen.live.link import Remote, Route, Statistics
from msggen.live.vehicle.selection import Selection
from msggen.live.xrce.agent import Client

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

_SERIAL = _SEEN._replace(link="serial:///dev/ttyUSB0?baud=57600", scheme="serial", baud=57600)
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
    "VEHICLE_RESTARTS": lambda: _with(
        vehicles=(_VEHICLE._replace(ended="the vehicle has begun another session"), _LATER)
    ),
    "VEHICLE_SILENT": lambda: _vehicle(heard=_NOW - 3_400_000_000),
    "NAMESPACE_WRONG": lambda: _asked("/uav_1/fmu/out/vehicle_attitude"),
    "VERSION_WRONG": lambda: _asked("/fmu/out/vehicle_status"),
    "TOPIC_NOT_BRIDGED": lambda: _asked("/fmu/out/sensor_gyro"),
    "TOPIC_UNKNOWN": lambda: _asked("/fmu/out/vehicle_atitude"),
    "TOPIC_UNPUBLISHED": lambda: _vehicle(
        topics={name: topic for name, topic in _VEHICLE.topics.items() if "status" not in name}
    )._replace(wanted=("vehicle_status",)),
    "READER_RELIABLE": lambda: _with(readers=(ReaderSeen("/fmu/out/vehicle_attitude", True, True),)),  # noqa: FBT003
    "TYPE_UNKNOWN": lambda: _vehicle(
        routes=(*_ROUTES, Route("/fmu/out/wheel_slip", "px4_msgs/msg/WheelSlip", "out", 300))
    ),
    "DEFINITION_DIFFERS": lambda: _vehicle(hashes={**_HASHES, _STATUS: 0xBADC0DE}),
    "TIME_NOT_SYNCED": lambda: _all_topics(age=_NOW / 1e9 - 63.5),
    "CLOCK_WRONG": lambda: _all_topics(age=3.2),
    "LINE_FULL": lambda: HEALTHY._replace(seen=_SERIAL),
    "BUFFER_FULL": lambda: _with(statistics=_STATISTICS._replace(dropped=96, lost=90)),
    "SAMPLES_LOST": lambda: _vehicle(lost=84),
    "RATE_LOW": lambda: _all_topics(samples=10),
}


def case_of(rule: Rule) -> Case:
    """Return the case that is the example of a rule."""
    return _EXAMPLES[rule.id]()


def example_of(rule: Rule) -> Report:
    """Return the finding of a rule in its example."""
    return diagnose(case_of(rule), (rule,))
