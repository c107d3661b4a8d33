"""A node of rclpy with the topics and the services of a vehicle."""

from __future__ import annotations

import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from msggen.base.qos import DEPTH
from msggen.link.link import LinkError, Route
from msggen.link.waiting import Waiting
from msggen.messages.names import stem_of
from msggen.ros.service import Server
from msggen.ros.standard import SOURCES, TYPES, Converter, filled
from msggen.ros.types import installed

if TYPE_CHECKING:
    from typing_extensions import Self

    from msggen.ros.plan import Plan, Row, Source
    from msggen.vehicle.refusals import Refusals
    from msggen.vehicle.vehicle import Vehicle

_SLICE = 0.2
"""The longest wait in s without a look at the end."""


@contextmanager
def interrupt_at_end() -> Iterator[Callable[[], bool]]:
    """Raise KeyboardInterrupt at the end of the block, not in it. Yield a function that returns whether it is due.

    rclpy makes an object for each sample. If an exception comes out of the constructor, its destructor prints a trace.
    A second Ctrl-C ends the process.
    """
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler):  # it is ignored
        yield lambda: False
        return
    is_due = False

    def note(*_: object) -> None:
        nonlocal is_due
        is_due = True
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: is_due
    finally:
        signal.signal(signal.SIGINT, handler)
        if is_due:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def started() -> Iterator[None]:
    """Start rclpy, and end it.

    Ctrl-C stays Python's: rclpy would only tell its own waits. rclpy reads the part of `sys.argv` after `--ros-args`.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    with ExitStack() as ends:
        with interrupt_at_end():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            ends.callback(rclpy.try_shutdown)
        yield


@contextmanager
def node(namespace: str) -> Iterator[Any]:
    """Make the node `msggen_relay` in the namespace of a vehicle, and end it."""
    import rclpy

    found = rclpy.create_node("msggen_relay", namespace=f"/{namespace}")
    try:
        yield found
    finally:
        found.destroy_node()


def profile(qos: Any) -> Any:
    """Return a QoS of an endpoint as rclpy has it. rclpy needs a depth, where PX4 leaves it to the middleware."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        reliability=ReliabilityPolicy[qos.reliability],
        durability=DurabilityPolicy[qos.durability],
        history=HistoryPolicy[qos.history],
        depth=max(qos.depth, 1),
    )


class Relay:
    """Carries samples and calls between a vehicle and a node of rclpy, until it is closed.

    The thread of the link publishes in ROS. Samples from ROS arrive while `spin` runs, and calls in other threads.
    """

    def __init__(
        self,
        node: Any,
        vehicle: Vehicle,
        plan: Plan,
        refusals: Refusals,
        converter: Converter | None = None,
    ) -> None:
        """Make the topics of `plan`, and with `converter` those with standard messages."""
        self._node, self._vehicle, self._refusals = node, vehicle, refusals
        self._sources, self._converter = plan.sources, converter
        self._waiting = Waiting()
        self.to_ros: Counter[str] = Counter()
        """The samples by their topics in ROS."""
        self.to_vehicle: Counter[str] = Counter()
        self._rows: dict[str, list[tuple[Row, Callable[[bytes], None]]]] = {}
        self._made: list[Callable[[], object]] = []
        self._lock = threading.Lock()
        """Held while the thread of the link publishes, so that no publisher is removed meanwhile."""
        for row in plan.rows:
            self._add(row)
        self._servers = [Server(node, vehicle, row, refusals) for row in plan.services]
        self._standard = self._publishers() if converter else {}
        self._watch = vehicle.watch(self._take)

    @property
    def standard(self) -> list[tuple[str, str]]:
        """The topics with standard messages, and their types."""
        return [(topic, TYPES[topic]) for topic in self._standard]

    @property
    def answered(self) -> Counter[str]:
        """The calls that the vehicle has answered, by the names of the services."""
        return sum((server.answered for server in self._servers), Counter())

    def spin(self, is_over: Callable[[], bool]) -> None:
        """Carry samples from ROS until `is_over` is true. It is asked several times in a second."""
        from rclpy.executors import SingleThreadedExecutor

        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        try:
            while not is_over():
                executor.spin_once(timeout_sec=_SLICE)
        finally:
            executor.remove_node(self._node)
            executor.shutdown()

    def close(self) -> None:
        """Remove topics and services from the node."""
        self._watch.close()
        for server in self._servers:
            server.close()
        with self._lock:
            self._rows.clear()
            self._sources = {}
            for destroy in self._made:
                destroy()
            self._made.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _add(self, row: Row) -> None:
        if row.route.direction == "out":
            self._rows.setdefault(row.route.name, []).append(
                (row, self._publisher(row.ros, row.name, profile(row.qos)))
            )
            return

        def send(payload: bytes, info: Mapping[str, Any]) -> None:
            self._send(row, bytes(payload), info)

        def send_undated(payload: bytes) -> None:
            send(payload, {})

        take = send if _is_dated() else send_undated
        made = self._node.create_subscription(row.ros, row.name, take, profile(row.qos), raw=True)
        self._made.append(lambda: self._node.destroy_subscription(made))

    def _publisher(self, ros: Any, name: str, qos: Any) -> Callable[[Any], None]:
        made = self._node.create_publisher(ros, name, qos)
        self._made.append(lambda: self._node.destroy_publisher(made))
        publish: Callable[[Any], None] = made.publish
        return publish

    def _publishers(self) -> dict[str, tuple[Any, Callable[[Any], None]]]:
        """Return type and publisher of each topic with standard messages whose type is installed."""
        made = {}
        wanted = {topic for source in self._sources.values() for topic in SOURCES[source.name]}
        for topic in sorted(wanted | ({"/tf_static"} if "/tf" in wanted else set())):
            ros = installed(TYPES[topic])
            if ros is not None:
                made[topic] = ros, self._publisher(ros, topic, _standard_profile(is_kept=topic == "/tf_static"))
        return made

    # the thread of the link

    def _take(self, route: Route, payload: bytes, time: int) -> None:
        try:
            with self._lock:
                for row, publish in self._rows.get(route.name, ()):
                    publish(row.to_ros(payload))
                    self.to_ros[row.name] += 1
                source = self._sources.get(route.name)
                if source is not None and self._converter is not None:
                    self._take_source(source, payload, time, self._converter)
        except ValueError as error:  # not a sample of the message
            self._refusals.add(route.name, error)

    def _take_source(self, source: Source, payload: bytes, time: int, converter: Converter) -> None:
        if "/tf_static" in self._standard and not self.to_ros["/tf_static"]:
            self._publish(*converter.static(time))
        for output in converter.convert(source.name, source.message.decode(payload), time):
            self._publish(*output)

    def _publish(self, topic: str, values: Any) -> None:
        if topic in self._standard:
            ros, publish = self._standard[topic]
            publish(filled(ros, values, installed))
            self.to_ros[topic] += 1

    # the thread of `spin`

    def _send(self, row: Row, payload: bytes, info: Mapping[str, Any]) -> None:
        """Give a sample of ROS to the vehicle, unless it is late.

        It is decoded and encoded, because PX4 takes one encapsulation only. Not every rclpy tells the publisher.
        """
        gid = (info.get("publisher_gid") or {}).get("data", b"")
        try:
            waited = self._waiting.since((row.name, gid), info.get("source_timestamp", 0))
            self._vehicle.publish(row.to_vehicle(payload), stem_of(row.route.name), waited=waited)
        except (LinkError, ValueError) as error:
            self._refusals.add(row.name, error)
        else:
            self.to_vehicle[row.name] += 1


def _is_dated() -> bool:
    """Whether rclpy tells when a sample was published: since version 3.4, that is after ROS 2 Humble."""
    from rclpy.subscription import Subscription

    return hasattr(Subscription, "CallbackType")


def _standard_profile(*, is_kept: bool) -> Any:
    """Return the QoS of topics with standard messages: RELIABLE, which readers of both kinds accept."""
    from rclpy.qos import DurabilityPolicy, QoSProfile

    durability = DurabilityPolicy.TRANSIENT_LOCAL if is_kept else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=DEPTH, durability=durability)
