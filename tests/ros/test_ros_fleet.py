"""Tests of a relay for several vehicles of one link: which ones it carries, when, and with which definitions."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from msggen.cli import main
from msggen.generate.cache import package_of
from msggen.link.link import Remote
from msggen.ros import plan as plans
from msggen.sim import Options, Simulator
from msggen.vehicle.fleet import clash, sort
from support.ports import free_port
from support.ros_types import px4_msgs_of

FIRST = Remote(1, "127.0.0.1:40001", 1, "uav_1", continued=False)
SECOND = Remote(2, "127.0.0.1:40002", 2, "uav_2", continued=False)
PLAIN = Remote(3, "127.0.0.1:40003", 3, "", continued=False)


def test_each_namespace_is_carried_once() -> None:
    assert sort((), [PLAIN, SECOND, FIRST]) == ((FIRST, SECOND, PLAIN), ())
    assert sort([FIRST], [FIRST, SECOND]) == ((SECOND,), ())
    again = FIRST._replace(number=4, address="127.0.0.1:40004")
    assert sort([FIRST], [again]) == ((), ()), "the same vehicle, which has connected again"
    for one in (FIRST, PLAIN):
        other = one._replace(number=5, key=7)
        assert sort([one], [other, one]) == ((), ((other, clash(one, other)),))
        assert sort((), [other, one]) == ((one,), ((other, clash(one, other)),))


def test_a_refused_vehicle_gets_a_cure() -> None:
    text = clash(PLAIN, PLAIN._replace(number=5, key=7, address="127.0.0.1:40005"))
    assert text == (
        "the vehicle at 127.0.0.1:40003 (key 3) and the vehicle at 127.0.0.1:40005 (key 7) both have no namespace: "
        "give each one its own, `uxrce_dds_client start -n uav_1` or UXRCE_DDS_NS_IDX, or select one with --key 7"
    )


class Ros:
    """A stand-in for rclpy: nodes that note the names of their topics, and the samples that they publish."""

    def __init__(self) -> None:
        self.nodes: dict[str, set[str]] = {}
        self.published: set[str] = set()
        self.services: set[str] = set()

    def create_node(self, _: str, namespace: str) -> Any:
        topics = self.nodes[namespace] = set()

        def create(_: Any, name: str, *_arguments: Any, **_options: Any) -> Any:
            topics.add(name)
            return SimpleNamespace(name=name, publish=lambda _: self.published.add(name))

        def destroy(made: Any) -> None:
            topics.discard(made.name)
            self.published.discard(made.name)

        return SimpleNamespace(
            create_publisher=create,
            create_subscription=create,
            destroy_publisher=destroy,
            destroy_subscription=destroy,
            destroy_node=lambda: self.nodes.pop(namespace),
        )


class Executor:
    """A stand-in for an executor, which has nothing to do."""

    def add_node(self, _: Any) -> None:
        """Do nothing."""

    def remove_node(self, _: Any) -> None:
        """Do nothing."""

    def shutdown(self) -> None:
        """Do nothing."""

    def spin_once(self, timeout_sec: float) -> None:
        time.sleep(timeout_sec / 10)


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch, px4_types: Any) -> Ros:
    """A stand-in for rclpy, and a px4_msgs of v1.18."""
    made = Ros()

    class Names:
        """Enums of rclpy, of which only the names of members count."""

        def __class_getitem__(cls, name: str) -> str:
            return name

    modules: dict[str, dict[str, Any]] = {
        "rclpy": {"init": lambda **_: None, "try_shutdown": lambda: None, "create_node": made.create_node},
        "rclpy.signals": {"SignalHandlerOptions": SimpleNamespace(NO=None)},
        "rclpy.executors": {"SingleThreadedExecutor": Executor},
        "rclpy.subscription": {"Subscription": object},
        "rclpy.qos": {
            "QoSProfile": SimpleNamespace,
            **dict.fromkeys(("DurabilityPolicy", "HistoryPolicy", "ReliabilityPolicy"), Names),
        },
        "px4_msgs": {},
        "px4_msgs.msg": {},
    }
    for name, values in modules.items():
        module = ModuleType(name)
        vars(module).update(values)
        monkeypatch.setitem(sys.modules, name, module)
    find = px4_msgs_of([endpoint.message for endpoint in px4_types.topics.ENDPOINTS])
    monkeypatch.setattr(plans, "planned", partial(plans.planned, find=find))
    return made


def until(condition: Callable[[], bool], what: str) -> None:
    """Wait until something is true."""
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.05)


def relayed(steps: Callable[[], None], *arguments: str) -> int:
    """Run the command while a thread does the steps of a test, and end it by Ctrl-C. Return its exit code."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            steps()
        except BaseException as error:  # noqa: BLE001 - raised in the thread of the test
            errors.append(error)
        finally:
            os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        code = main(["relay", "--direct", *arguments])
    finally:
        thread.join()
    if errors:
        raise errors[0]
    return code


def test_vehicles_of_two_releases_come_and_go(
    px4_types: Any, ros: Ros, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    address = f"udp://127.0.0.1:{free_port()}"
    status, old = "/uav_1/fmu/out/vehicle_status_v4", "/uav_2/fmu/out/vehicle_odometry"
    earlier = package_of("v1.17")

    def steps() -> None:
        one = Options(key=1, namespace="uav_1", sync="off")
        two = Options(key=2, namespace="uav_2", sync="off")
        with Simulator(px4_types, address, [one]):
            until(lambda: status in ros.published, "the first vehicle")
            with Simulator(earlier, address, [two]):
                until(lambda: old in ros.published, "a vehicle that comes later")
                with Simulator(px4_types, address, [Options(key=3, sync="off")]):
                    until(lambda: "/fmu/out/vehicle_odometry" in ros.published, "one without a namespace")
                with Simulator(px4_types, address, [Options(key=4, namespace="uav_2", sync="off")]):
                    until(lambda: "both have the" in "".join(printed()), "one with a namespace that is taken")
                ros.published.clear()
                until(lambda: {status, old} <= ros.published, "the others go on")
            ros.published.clear()
            with Simulator(earlier, address, [two]):
                until(lambda: {status, old} <= ros.published, "the second one, again")

    read: list[str] = []

    def printed() -> list[str]:
        read.append("".join(capfd.readouterr()))
        return read

    assert relayed(steps, "--link", address) == 0
    text = "".join(printed())
    assert not ros.nodes
    assert "\nnot carried: the vehicle at " in text
    assert "both have the namespace 'uav_2': give each one its own" in text
    assert "/uav_2/fmu/out/vehicle_status_v1 is not carried: the vehicle has version 1" in text
    assert "v1.17 on " in text
    assert "is ignored" not in text + caplog.text


def test_two_vehicles_without_a_namespace_are_refused(
    px4_types: Any, ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    address = f"udp://127.0.0.1:{free_port()}"
    vehicles = [Options(key=key, sync="off") for key in (1, 2)]
    with Simulator(px4_types, address, vehicles):
        assert main(["relay", "--direct", "--link", address]) == 2
    assert "both have no namespace: give each one its own" in capfd.readouterr().err
    assert not ros.nodes
