"""A vehicle for programs without asyncio: each call returns when it is done."""

from __future__ import annotations

import asyncio
import math
import signal
import threading
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from msggen.flight.elsewhere import Hinted
from msggen.flight.errors import FlightError
from msggen.flight.executor import Executor
from msggen.flight.feeds import Condition
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.flight.offboard import Offboard
from msggen.flight.places import GlobalPlace
from msggen.flight.runners import CallerRunner, Runner, ThreadRunner
from msggen.flight.setpoints import FREE
from msggen.flight.space import Frame, Vector
from msggen.flight.telemetry import Attitude, Battery, GlobalPosition, Home, Land, LocalPosition, Telemetry
from msggen.flight.usage import BY_NAME, LOCAL, ON_EARTH, explained

if TYPE_CHECKING:
    from typing_extensions import Self

_Result = TypeVar("_Result")


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
        self._runner: Runner | None = None
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

    # Actions

    def arm(self) -> None:
        """See `Flight.arm`."""
        self._wait(self._own.arm())

    def disarm(self) -> None:
        """See `Flight.disarm`."""
        self._wait(self._own.disarm())

    def takeoff(self, altitude: float | None = None) -> None:
        """See `Flight.takeoff`."""
        self._wait(self._own.takeoff(altitude))

    def land(self) -> None:
        """See `Flight.land`."""
        self._wait(self._own.land())

    def return_home(self) -> None:
        """See `Flight.return_home`."""
        self._wait(self._own.return_home())

    def hold(self) -> None:
        """See `Flight.hold`."""
        self._wait(self._own.hold())

    def set_mode(self, mode: str | int | type[Mode | Executor] | Mode | Executor) -> None:
        """See `Flight.set_mode`."""
        self._wait(self._own.set_mode(mode))

    @explained(ON_EARTH)
    def goto(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
        heading_deg: float = math.nan,
    ) -> None:
        """See `Flight.goto`."""
        self._wait(
            self._own.goto(place, latitude=latitude, longitude=longitude, altitude=altitude, heading_deg=heading_deg)
        )

    @explained(ON_EARTH)
    def set_home(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
    ) -> None:
        """See `Flight.set_home`."""
        self._wait(self._own.set_home(place, latitude=latitude, longitude=longitude, altitude=altitude))

    @explained(ON_EARTH)
    def set_origin(
        self,
        place: GlobalPlace | None = None,
        *,
        latitude: float | None = None,
        longitude: float | None = None,
        altitude: float | None = None,
    ) -> None:
        """See `Flight.set_origin`."""
        self._wait(self._own.set_origin(place, latitude=latitude, longitude=longitude, altitude=altitude))

    def wait_armed(self) -> None:
        """See `Flight.wait_armed`."""
        self._wait(self._own.wait_armed())

    def wait_disarmed(self) -> None:
        """See `Flight.wait_disarmed`."""
        self._wait(self._own.wait_disarmed())

    def wait_for_status(self, condition: Condition, seconds: float) -> None:
        """See `Flight.wait_for_status`."""
        self._wait(self._own.wait_for_status(condition, seconds))

    # Modes

    def add(self, *parts: type[Mode | Executor] | Mode | Executor) -> None:
        """See `Flight.add`."""
        self._wait(self._own.add(*parts))

    def fly(self, part: type[Mode | Executor] | Mode | Executor) -> None:
        """See `Flight.fly`."""
        self._wait(self._own.fly(part))

    def run(self) -> None:
        """Wait until Ctrl-C or SIGTERM."""
        self._wait(self._own.run())

    def sleep(self, seconds: float) -> None:
        """Wait. In Offboard mode, the setpoint is still sent. During `time.sleep`, it is sent for 0.5 s at most."""
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


class BlockingTelemetry(Hinted):
    """The telemetry of a vehicle, as in `Telemetry`."""

    def __init__(self, telemetry: Telemetry, wait: Callable[[Coroutine[Any, Any, Any]], Any]) -> None:
        self._telemetry, self._wait = telemetry, wait

    def local_position(self) -> LocalPosition:
        """See `Telemetry.local_position`."""
        found: LocalPosition = self._wait(self._telemetry.local_position())
        return found

    def global_position(self) -> GlobalPosition:
        """See `Telemetry.global_position`."""
        found: GlobalPosition = self._wait(self._telemetry.global_position())
        return found

    def attitude(self) -> Attitude:
        """See `Telemetry.attitude`."""
        found: Attitude = self._wait(self._telemetry.attitude())
        return found

    def battery(self) -> Battery:
        """See `Telemetry.battery`."""
        found: Battery = self._wait(self._telemetry.battery())
        return found

    def home(self) -> Home:
        """See `Telemetry.home`."""
        found: Home = self._wait(self._telemetry.home())
        return found

    def land(self) -> Land:
        """See `Telemetry.land`."""
        found: Land = self._wait(self._telemetry.land())
        return found


class BlockingOffboard(Hinted):
    """The setpoint of Offboard mode, as in `Offboard`."""

    def __init__(self, setpoint: Offboard, wait: Callable[[Coroutine[Any, Any, Any]], Any]) -> None:
        self._setpoint, self._wait = setpoint, wait

    @explained(BY_NAME)
    def trajectory(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        *,
        position: Sequence[float] = FREE,
        velocity: Sequence[float] = FREE,
        acceleration: Sequence[float] = FREE,
        heading: float | None = None,
        heading_deg: float | None = None,
        turn_rate: float = math.nan,
    ) -> None:
        """See `Offboard.trajectory`."""

        async def change() -> None:
            self._setpoint.trajectory(
                position=position,
                velocity=velocity,
                acceleration=acceleration,
                heading=heading,
                heading_deg=heading_deg,
                turn_rate=turn_rate,
            )

        self._wait(change())

    def position(self) -> Vector:
        """See `Offboard.position`."""
        found: Vector = self._wait(self._setpoint.position())
        return found

    @explained(LOCAL)
    def goto(
        self, place: Sequence[float] | GlobalPlace, *, heading_deg: float | None = None, within: float = 0.5
    ) -> None:
        """See `Offboard.goto`."""
        self._wait(self._setpoint.goto(place, heading_deg=heading_deg, within=within))


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
