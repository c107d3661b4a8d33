"""Tests of the relay with stand-ins for rclpy and for the link: what goes where, unchanged, with which QoS."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from msggen.link import age
from msggen.link.link import Remote, Route
from msggen.live import Vehicle
from msggen.ros import relay as module
from msggen.ros.plan import Topics, Wish, planned
from msggen.ros.relay import Relay
from msggen.ros.standard import Converter, Frames
from msggen.vehicle.refusals import Refusals
from support.fake_link import FakeLink, routes_of
from support.ros_types import px4_msgs_of

STAMP = 1_790_000_000_000_000


class FakeNode:
    """A node that keeps what it is asked for."""

    def __init__(self) -> None:
        self.published: list[tuple[str, Any]] = []
        self.profiles: dict[str, Any] = {}
        self.callbacks: dict[str, Callable[..., None]] = {}
        self.open: set[str] = set()

    def create_publisher(self, _: Any, name: str, profile: Any) -> Any:
        self.profiles[name] = profile
        self.open.add(name)
        return SimpleNamespace(name=name, publish=lambda value: self.published.append((name, value)))

    def create_subscription(self, _: Any, name: str, callback: Any, profile: Any, *, raw: bool) -> Any:
        assert raw
        self.profiles[name], self.callbacks[name] = profile, callback
        self.open.add(name)
        return SimpleNamespace(name=name)

    def destroy_publisher(self, made: Any) -> None:
        self.open.remove(made.name)

    destroy_subscription = destroy_publisher


@pytest.fixture(autouse=True)
def rclpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in for `rclpy.qos`, whose enums have the names of rclpy's."""
    qos = ModuleType("rclpy.qos")
    enums = {
        "DurabilityPolicy": "TRANSIENT_LOCAL VOLATILE",
        "HistoryPolicy": "KEEP_LAST KEEP_ALL",
        "ReliabilityPolicy": "RELIABLE BEST_EFFORT",
    }
    for name, members in enums.items():
        setattr(qos, name, Enum(name, members))
    setattr(qos, "QoSProfile", SimpleNamespace)  # noqa: B010 - mypy does not know the attribute
    subscription = ModuleType("rclpy.subscription")
    setattr(subscription, "Subscription", SimpleNamespace(CallbackType=None))  # noqa: B010
    monkeypatch.setitem(sys.modules, "rclpy", ModuleType("rclpy"))
    monkeypatch.setitem(sys.modules, "rclpy.subscription", subscription)
    monkeypatch.setitem(sys.modules, "rclpy.qos", qos)


@pytest.fixture
def bench(px4_types: Any) -> Iterator[SimpleNamespace]:
    """A vehicle on a link without sockets, a node, and the plan for all its topics."""
    link, node = FakeLink(px4_types), FakeNode()
    topics = Topics(routes_of(px4_types, "uav_1"), "uav_1", {}, (px4_types,))
    plan = planned(topics, Wish(), px4_msgs_of([endpoint.message for endpoint in px4_types.topics.ENDPOINTS]))
    with Vehicle(link, px4_types) as vehicle:
        remote = link.connect(namespace="uav_1")
        yield SimpleNamespace(
            link=link, node=node, topics=topics, plan=plan, vehicle=vehicle, remote=remote, refusals=Refusals()
        )


def published(ago: float) -> dict[str, Any]:
    """Return what rclpy tells of a sample that was published some s ago, by the clock of its publisher."""
    return {"source_timestamp": time.time_ns() - round(ago * 1e9)}


def test_samples_pass_unchanged_in_both_directions(px4_types: Any, bench: SimpleNamespace) -> None:
    status = px4_types.VehicleStatus(timestamp=5)
    setpoint = px4_types.TrajectorySetpoint(position=(1.0, 2.0, 3.0))
    with Relay(bench.node, bench.vehicle, bench.plan, bench.refusals) as relay:
        assert bench.node.open == {f"/uav_1{endpoint.ros_name}" for endpoint in px4_types.topics.ENDPOINTS}
        bench.link.sample(bench.remote, status)
        assert bench.node.published == [("/uav_1/fmu/out/vehicle_status_v4", status.encode())]
        bench.link.published.clear()
        bench.node.callbacks["/uav_1/fmu/in/trajectory_setpoint"](setpoint.encode() + b"\0\0", {})
        ((remote, route, payload),) = bench.link.published
        assert (remote, route.name, payload) == (bench.remote, "/uav_1/fmu/in/trajectory_setpoint", setpoint.encode())
        assert relay.to_ros == {"/uav_1/fmu/out/vehicle_status_v4": 1}
        assert relay.to_vehicle == {"/uav_1/fmu/in/trajectory_setpoint": 1}
    assert bench.node.open == set()
    bench.link.sample(bench.remote, status)
    assert len(bench.node.published) == 1


def test_the_qos_is_that_of_px4(px4_types: Any, bench: SimpleNamespace) -> None:
    with Relay(bench.node, bench.vehicle, bench.plan, bench.refusals):
        for endpoint in px4_types.topics.ENDPOINTS:
            expected = endpoint.qos.writer if endpoint.direction == "out" else endpoint.qos.reader
            found = bench.node.profiles[f"/uav_1{endpoint.ros_name}"]
            names = (found.reliability.name, found.durability.name, found.history.name)
            assert names == (expected.reliability, expected.durability, expected.history)
            assert found.depth == max(expected.depth, 1)


def test_what_cannot_be_carried_is_counted_and_told_once(
    px4_types: Any, bench: SimpleNamespace, caplog: pytest.LogCaptureFixture
) -> None:
    setpoint, command = "/uav_1/fmu/in/trajectory_setpoint", "/uav_1/fmu/in/vehicle_command"
    with Relay(bench.node, bench.vehicle, bench.plan, bench.refusals) as relay:
        for size in range(3):
            bench.node.callbacks[setpoint](b"\0\1\0\0" + bytes(size), {})
        bench.link.disconnect(bench.remote)
        bench.node.callbacks[command](px4_types.VehicleCommand().encode(), {})
        assert not relay.to_vehicle
    assert bench.refusals.counts == {setpoint: 3, command: 1}
    assert bench.refusals.reasons[setpoint].startswith("TrajectorySetpoint")
    assert "disconnected" in bench.refusals.reasons[command]
    assert [record.name for record in caplog.records] == ["msggen.live.ros"] * 2


def test_what_waited_in_ros_is_dropped_and_counted(
    px4_types: Any, bench: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A relay that stood still gets what has waited in DDS, with the times at which it was published."""
    topic, sample = "/uav_1/fmu/in/trajectory_setpoint", px4_types.TrajectorySetpoint().encode()
    monkeypatch.setattr(time, "time_ns", lambda: STAMP * 1000)
    left: list[int] = []
    publish = bench.link.publish

    def note(remote: Remote, route: Route, payload: bytes, until: int) -> None:
        left.append(until - age.now())
        publish(remote, route, payload, until)

    monkeypatch.setattr(bench.link, "publish", note)
    with Relay(bench.node, bench.vehicle, bench.plan, bench.refusals) as relay:
        for waited in (5.0, 0.51, 0.4, 0.0, -3.0):
            bench.node.callbacks[topic](sample, published(waited))
        bench.node.callbacks[topic](sample, {"source_timestamp": 0})
        assert relay.to_vehicle == {topic: 3}
    assert bench.refusals.counts == {topic: 3}
    assert "waited for more than 0.5 s" in bench.refusals.reasons[topic]
    assert len(bench.link.published) == 3
    assert left[0] <= 0.1e9, "what it has waited in ROS counts on the link"
    assert all(each <= 0.5e9 for each in left)


def test_a_clock_that_is_ahead_hides_no_late_sample(px4_types: Any, bench: SimpleNamespace) -> None:
    """A node on a computer whose clock is ahead: its samples look younger than they are."""
    topic, sample = "/uav_1/fmu/in/trajectory_setpoint", px4_types.TrajectorySetpoint().encode()
    other = {"publisher_gid": {"implementation_identifier": "rmw_fastrtps_cpp", "data": bytes(16)}}
    with Relay(bench.node, bench.vehicle, bench.plan, bench.refusals) as relay:
        take = bench.node.callbacks[topic]
        take(sample, published(4.0 - 5.0))
        assert not relay.to_vehicle
        assert "s ahead of this one" in bench.refusals.reasons[topic]
        for _ in range(5):
            take(sample, {**published(-0.4), **other})
        assert relay.to_vehicle == {topic: 5}
        take(sample, {**published(0.3), **other})
        assert relay.to_vehicle == {topic: 5}, "it has waited for 0.7 s"
        take(sample, {**published(0.3), "publisher_gid": None})
        assert relay.to_vehicle == {topic: 6}, "of another computer"
        for ahead in (*[0.6] * 5, *[0.4] * 5, 0.0, -0.3):
            take(sample, {**published(-ahead), "publisher_gid": None})
        assert relay.to_vehicle == {topic: 13}, "a clock that is ahead holds up nobody whose gid is unknown, too"


def test_an_rclpy_without_times_gives_samples_alone(
    px4_types: Any, bench: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["rclpy.subscription"], "Subscription", object)
    topic = "/uav_1/fmu/in/trajectory_setpoint"
    with Relay(bench.node, bench.vehicle, bench.plan, bench.refusals) as relay:
        bench.node.callbacks[topic](px4_types.TrajectorySetpoint().encode())
        assert relay.to_vehicle == {topic: 1}


def test_standard_messages_whose_types_are_installed(
    px4_types: Any, bench: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    types = {"sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix"}
    monkeypatch.setattr(module, "installed", lambda name: SimpleNamespace if name in types else None)
    monkeypatch.setattr(module, "filled", lambda _cls, values, _find: values)
    converter = Converter(px4_types, Frames().inside("uav_1"), bench.refusals)
    plan = planned(bench.topics, Wish(is_standard=True), lambda _: None)
    with Relay(bench.node, bench.vehicle, plan, bench.refusals, converter) as relay:
        assert relay.standard == [("fix", "sensor_msgs/msg/NavSatFix"), ("imu", "sensor_msgs/msg/Imu")]
        bench.link.sample(bench.remote, px4_types.SensorCombined(timestamp=STAMP))
        bench.link.sample(bench.remote, px4_types.VehicleOdometry(timestamp=STAMP))
        ((topic, values),) = bench.node.published
        assert (topic, values["header"]["frame_id"]) == ("imu", "uav_1/base_link")
        assert relay.to_ros == {"imu": 1}


class Half:
    """An object whose destructor needs what the constructor sets, as those of rclpy do."""

    def __init__(self) -> None:
        signal.raise_signal(signal.SIGINT)
        self.made = True

    def __del__(self) -> None:
        assert self.made


@pytest.mark.parametrize("handler", [signal.default_int_handler, signal.SIG_IGN])
def test_ctrl_c_leaves_no_object_of_rclpy_half_made(handler: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal arrives at the start of rclpy, and while a sample is carried."""
    calls: list[str] = []
    ignored: list[Any] = []

    class Executor:
        def __init__(self) -> None:
            self.add_node = self.remove_node = lambda _: None
            self.shutdown = lambda: calls.append("executor ended")

        def spin_once(self, timeout_sec: float) -> None:
            assert timeout_sec < 1
            Half()
            calls.append("spun")

    def init(**_: Any) -> None:
        Half()
        calls.append("rclpy started")

    def create_node(name: str, namespace: str) -> Any:
        calls.append(f"{namespace}/{name}")
        return SimpleNamespace(destroy_node=lambda: calls.append("node ended"))

    modules: dict[str, Any] = {
        "rclpy": SimpleNamespace(init=init, create_node=create_node, try_shutdown=lambda: calls.append("rclpy ended")),
        "rclpy.signals": SimpleNamespace(SignalHandlerOptions=SimpleNamespace(NO=None)),
        "rclpy.executors": SimpleNamespace(SingleThreadedExecutor=Executor),
    }
    for name, value in modules.items():
        monkeypatch.setitem(sys.modules, name, value)
    monkeypatch.setattr(sys, "unraisablehook", ignored.append)
    vehicle: Any = SimpleNamespace(watch=lambda _: SimpleNamespace(close=lambda: calls.append("relay closed")))
    empty: Any = SimpleNamespace(rows=(), sources={}, services=())
    before = signal.signal(signal.SIGINT, handler)
    is_ignored = handler is signal.SIG_IGN
    try:
        expected = nullcontext() if is_ignored else pytest.raises(KeyboardInterrupt)
        with expected, module.started(), module.node("uav_1"):
            calls.append("made")
        made = ["/uav_1/msggen_relay", "made", "node ended"] if is_ignored else []
        assert calls == ["rclpy started", *made, "rclpy ended"]
        calls.clear()
        with (
            nullcontext() if is_ignored else pytest.raises(KeyboardInterrupt),
            module.interrupt_at_end() as is_interrupted,
            Relay(None, vehicle, empty, Refusals()) as relay,
        ):
            relay.spin(lambda: is_interrupted() or len(calls) > 1)
        spun = ["spun", "spun"] if is_ignored else ["spun"]
        assert calls == [*spun, "executor ended", "relay closed"]
        assert signal.getsignal(signal.SIGINT) is handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert not ignored
