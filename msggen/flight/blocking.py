"""A vehicle for programs without asyncio: each call returns when it is done."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar, runtime_checkable

from msggen.flight.errors import FlightError
from msggen.flight.flight import Flight
from msggen.flight.measured import Measuring, Sample
from msggen.flight.measurements import Fusion, Measurements
from msggen.flight.offboard import Offboard
from msggen.flight.places import Frame
from msggen.flight.runners import CallerRunner, ThreadRunner
from msggen.flight.sending import Steered, Trajectory
from msggen.flight.setpoints import check_seconds
from msggen.flight.telemetry import Telemetry
from msggen.flight.usage import Hinted

if TYPE_CHECKING:
    from typing_extensions import Self

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_Own = TypeVar("_Own")


def _waiting(
    coroutine: Callable[Concatenate[Any, _Parameters], Coroutine[Any, Any, _Result]],
) -> Callable[Concatenate[Any, _Parameters], _Result]:
    """Return a method that calls the coroutine function of `_own` with the same arguments, and waits for its end."""

    @wraps(coroutine)
    def call(self: Any, /, *arguments: _Parameters.args, **options: _Parameters.kwargs) -> _Result:
        found: _Result = self._wait(getattr(self._own, coroutine.__name__)(*arguments, **options))
        return found

    return call


@runtime_checkable
class _OnItsClock(Protocol):
    """A connection whose time advances only while a program waits."""

    def new_loop(self) -> asyncio.AbstractEventLoop:
        """Return a loop on its clock."""


class BlockingFlight(Hinted):
    """A `Flight` for programs without asyncio. It takes the same arguments, and is used with `with`.

    Modes and executors are the same as those of `Flight`, and run in a separate thread. SIGTERM ends the block.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._arguments, self._options = arguments, options
        self._runner: CallerRunner | ThreadRunner | None = None
        self._flight: Flight | None = None
        self._restore: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        if self._runner is not None:
            raise FlightError("the flight has begun already")
        vehicle = self._arguments[0] if self._arguments else self._options.get("vehicle")
        self._restore = _ending_at_sigterm()
        if isinstance(vehicle, _OnItsClock):
            self._runner = CallerRunner(vehicle.new_loop())
        else:
            self._runner = ThreadRunner(self._leave)
        try:
            self._flight = self._wait(self._begin())
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._wait(self._leave())
        finally:
            self._end()

    @property
    def telemetry(self) -> BlockingTelemetry:
        """The telemetry of the vehicle."""
        return BlockingTelemetry(self._own.telemetry, self._wait)

    @property
    def measure(self) -> BlockingMeasurements:
        """The measurements for the estimator of the vehicle."""
        return BlockingMeasurements(self._own.measure, self._wait)

    @property
    def is_armed(self) -> bool:
        """Whether the vehicle is armed."""
        return self._own.is_armed

    @property
    def mode(self) -> str:
        """The name of the mode that flies the vehicle."""
        return self._own.mode

    @property
    def problem(self) -> str:
        """Why messages do not get through to the vehicle, "" if they do: see `Vehicle.problem`."""
        return self._own.problem

    arm = _waiting(Flight.arm)
    disarm = _waiting(Flight.disarm)
    takeoff = _waiting(Flight.takeoff)
    land = _waiting(Flight.land)
    return_home = _waiting(Flight.return_home)
    hold = _waiting(Flight.hold)
    set_mode = _waiting(Flight.set_mode)
    goto = _waiting(Flight.goto)
    set_home = _waiting(Flight.set_home)
    set_origin = _waiting(Flight.set_origin)
    to_fixed_wing = _waiting(Flight.to_fixed_wing)
    to_multicopter = _waiting(Flight.to_multicopter)
    set_actuators = _waiting(Flight.set_actuators)
    wait_armed = _waiting(Flight.wait_armed)
    wait_disarmed = _waiting(Flight.wait_disarmed)
    wait_for_status = _waiting(Flight.wait_for_status)
    add = _waiting(Flight.add)
    fly = _waiting(Flight.fly)

    def run(self) -> None:
        """Wait until Ctrl-C or SIGTERM."""
        self._wait(self._own.run())

    def sleep(self, seconds: float) -> None:
        """Wait. In Offboard mode, the setpoint is still sent. During `time.sleep`, it is sent for 0.5 s at most."""
        check_seconds(seconds, "a time")
        self._wait(asyncio.sleep(seconds))

    @contextmanager
    def offboard(self, frame: Frame = "ned") -> Iterator[BlockingOffboard]:
        """See `Flight.offboard`. No setpoint is sent if the program has not called msggen for 0.5 s."""
        context = self._own.offboard(frame)
        setpoint = self._wait(context.__aenter__())
        if self._runner is not None:
            setpoint.stream.is_alive = self._runner.is_alive
        try:
            yield BlockingOffboard(setpoint, self._wait)
        except BaseException as error:
            self._wait(_left(context, error))
            raise
        self._wait(context.__aexit__(None, None, None))

    # inside

    @property
    def _own(self) -> Flight:
        if self._flight is None:
            raise FlightError("the flight has not begun: use `with BlockingFlight(...) as flight`")
        return self._flight

    def _wait(self, coroutine: Coroutine[Any, Any, _Result]) -> _Result:
        if self._runner is None:
            coroutine.close()
            raise FlightError("the flight has not begun: use `with BlockingFlight(...) as flight`")
        return self._runner.run(coroutine)

    async def _begin(self) -> Flight:
        return await Flight(*self._arguments, **self._options).__aenter__()

    async def _leave(self) -> None:
        """Unregister everything. A second call does nothing."""
        flight, self._flight = self._flight, None
        if flight is not None:
            await flight.__aexit__(None, None, None)

    def _end(self) -> None:
        self._restore()
        if self._runner is not None:
            self._runner.close()


class _Inside(Hinted, Generic[_Own]):
    """A part of a flight. It waits as the flight does."""

    def __init__(self, own: _Own, wait: Callable[[Coroutine[Any, Any, Any]], Any]) -> None:
        self._own, self._wait = own, wait


class BlockingTelemetry(_Inside[Telemetry]):
    """The telemetry of a vehicle, as in `Telemetry`."""

    local_position = _waiting(Telemetry.local_position)
    global_position = _waiting(Telemetry.global_position)
    attitude = _waiting(Telemetry.attitude)
    battery = _waiting(Telemetry.battery)
    home = _waiting(Telemetry.home)
    land = _waiting(Telemetry.land)
    sticks = _waiting(Telemetry.sticks)
    airspeed = _waiting(Telemetry.airspeed)
    wind = _waiting(Telemetry.wind)
    vtol = _waiting(Telemetry.vtol)
    vehicle = _waiting(Telemetry.vehicle)


class BlockingMeasurements(_Inside[Measurements], Measuring):
    """The measurements for the estimator of a vehicle, as in `Measurements`."""

    fused = _waiting(Measurements.fused)

    @property
    def time(self) -> int:
        """See `Measurements.time`."""
        return self._own.time

    @property
    def state(self) -> tuple[Fusion, ...]:
        """See `Measurements.state`."""
        return self._own.state

    def _send(self, sample: Sample) -> bool:
        stamped = sample if sample.time is not None else sample._replace(time=self.time)

        async def send() -> bool:
            return self._own._send(stamped)  # noqa: SLF001 - the same method, in the thread of the flight

        return bool(self._wait(send()))


class BlockingOffboard(_Inside[Offboard], Steered):
    """The setpoint of Offboard mode, as in `Offboard`."""

    goto = _waiting(Offboard.goto)
    position = _waiting(Offboard.position)

    def _steer(self, found: Trajectory) -> None:
        async def change() -> None:
            self._own.trajectory(**found._asdict())

        self._wait(change())


async def _left(context: Any, error: BaseException) -> None:
    """Leave a context with an exception of another thread. Ctrl-C and SIGTERM become a cancellation."""
    told = error if isinstance(error, Exception) else asyncio.CancelledError()
    try:
        await context.__aexit__(type(told), told, told.__traceback__)
    except (Exception, asyncio.CancelledError) as left:
        if left is not told:
            raise


def _ending_at_sigterm() -> Callable[[], None]:
    """Let SIGTERM end the program like sys.exit, unless it has a handler. Return a function that undoes this."""
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        return lambda: None

    def end(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    def restore() -> None:
        if signal.getsignal(signal.SIGTERM) is end:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)

    signal.signal(signal.SIGTERM, end)
    return restore
