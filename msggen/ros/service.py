"""The service of a vehicle as a service of rclpy: a thread of its own takes the calls, one after the other.

PX4's client keeps one request, so that a second call has to wait in any case. Calls wait in DDS until the thread takes
them. The executor, which takes samples for the vehicle, has no part in it.
"""

from __future__ import annotations

import threading
from collections import Counter
from typing import TYPE_CHECKING, Any, Final

from msggen.link.link import LinkError, NotConnectedError
from msggen.link.waiting import Waiting

if TYPE_CHECKING:
    from msggen.ros.plan import ServiceRow
    from msggen.vehicle.refusals import Refusals
    from msggen.vehicle.vehicle import Vehicle

WAIT_S: Final = 5.0
"""How long a caller waits in s, as far as the relay knows: ROS does not tell. It is the time-out of `Vehicle.call`."""
WAITING: Final = 16
"""The number of calls that DDS keeps for the thread."""
NOT_SENT: Final = "TEMPORARILY_REJECTED"
"""The result of a call that did not reach the vehicle."""
NOT_ANSWERED: Final = "FAILED"
"""The result of a call without an answer: no module of PX4 has acknowledged it in time. The vehicle may have acted."""
_PERIOD_S = 0.01
"""The time between two looks for calls. rclpy waits for calls in executors only, which do not tell how old they are."""


class Server:
    """Answers the calls of a service, until it is closed."""

    def __init__(self, node: Any, vehicle: Vehicle, row: ServiceRow, refusals: Refusals) -> None:
        self._node, self._vehicle, self._row, self._refusals = node, vehicle, row, refusals
        self.answered: Counter[str] = Counter()
        """The calls that the vehicle has answered, by the name of the service."""
        self._is_closed = threading.Event()
        self._lock = threading.Lock()
        """Held while the service of rclpy is used, so that it is not removed meanwhile."""
        self._waiting = Waiting()
        self._made = node.create_service(
            row.ros, row.service.name, _never, qos_profile=_profile(), callback_group=_group()
        )
        self._thread = threading.Thread(target=self._serve, name=f"relay {row.service.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Remove the service from the node. A call that waits for the vehicle gets no answer."""
        self._is_closed.set()
        with self._lock:
            self._node.destroy_service(self._made)

    def _serve(self) -> None:
        while not self._is_closed.wait(_PERIOD_S):
            found = self._take()
            while found is not None:
                self._answer(*found)
                found = self._take()

    def _take(self) -> tuple[Any, Any] | None:
        """Return a request and its header, None if none waits."""
        with self._lock:
            if self._is_closed.is_set():
                return None
            with self._made.handle:
                request, header = self._made.handle.service_take_request(self._row.ros.Request)
        return None if header is None else (request, header)

    def _answer(self, request: Any, header: Any) -> None:
        """Answer a call. An error of rclpy, as when the caller has gone, ends this call alone."""
        try:
            response = self._response(request, header.source_timestamp)
            with self._lock:
                if response is not None and not self._is_closed.is_set():
                    self._made.send_response(response, header)
        except Exception as error:  # noqa: BLE001 - rclpy has errors of its own, and other calls follow
            self._refusals.add(self._row.service.name, error)

    def _response(self, request: Any, published: int) -> Any:
        """Return the answer of the vehicle, or one that says that there is none. None if the service cannot say so."""
        from rclpy.serialization import deserialize_message, serialize_message

        row, name = self._row, self._row.service.name
        message, result = row.request.decode(serialize_message(request)), NOT_SENT
        try:
            left = WAIT_S - self._waited(published)
            result = NOT_ANSWERED
            answer = self._vehicle.call(message, left)
            self.answered[name] += 1
        except (LinkError, ValueError) as error:
            if self._is_closed.is_set():  # the vehicle has begun another session, or Ctrl-C came
                return None
            self._refusals.add(name, error)
            self._node.get_logger().warning(f"{name}: {error}")
            answer = row.failure(message, result)
        return None if answer is None else deserialize_message(answer.encode(), row.ros.Response)

    def _waited(self, published: int) -> float:
        """Return the time in s that a call has waited, which its caller published. Raises LinkError if it is not sent.

        rclpy does not tell which caller that was.
        """
        if not self._vehicle.is_connected:
            raise NotConnectedError("the vehicle is not connected: not sent")
        return self._waiting.since((self._row.service.name, b""), published, round(WAIT_S * 1e9))


def _never(_request: Any, response: Any) -> Any:
    """Answer for an executor, which never has the service."""
    return response


def _group() -> Any:
    """Return a callback group whose services no executor takes."""
    from rclpy.callback_groups import CallbackGroup

    class Apart(CallbackGroup):  # type: ignore[misc]
        """A group that leaves its services to a thread."""

        def can_execute(self, _entity: Any) -> bool:
            return False

        def beginning_execution(self, _entity: Any) -> bool:
            return False

        def ending_execution(self, _entity: Any) -> None:
            """Do nothing: nothing has begun."""

    return Apart()


def _profile() -> Any:
    """Return the QoS of services in ROS, with room for calls that wait."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=WAITING,
    )
