"""Setpoints: their values and ranges, their configuration in PX4, and sending them at a steady rate."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from logging import getLogger
from types import MappingProxyType
from typing import Any, Final, Protocol, TypeAlias, TypeVar

from msggen.base.diagnostics import suggestion
from msggen.flight.errors import UnsupportedError
from msggen.flight.feeds import Connection, Feeds, Topics, filled
from msggen.messages.ranges import DEFAULTS, RANGES, Range
from msggen.messages.setpoints import FIXED_WING, GOTO, OTHER_FAILURE, TRAJECTORY, UNKNOWN_TYPE, UNSUPPORTED_TYPE, Kind

LOGGER = getLogger("msggen.flight")
_TIMEOUT_MS = 500
_LARGEST = 3.4e38
_HUNG = 0.5
"""The time in s without the event loop after which setpoints are not repeated."""
_SILENT = 1.6
"""The time in s without a VehicleStatus after which setpoints are not repeated. PX4 publishes it at 2 Hz or more."""
_IDLE = 0.1
"""The period in s of checks of the clock if there is no setpoint."""
_REPEATS = 3
"""How often a VehicleControlMode is sent, because PX4 does not confirm it before v1.18."""
_RENEWED = 1.0
"""The period in s of the messages that configure setpoints."""
_NONE: Final[Mapping[str, float]] = MappingProxyType({})
_ANOTHER: Final = "`Flight(..., parameters={{...}})` says what the vehicle has as {}"

Values: TypeAlias = Mapping[str, Mapping[str, Any]]
"""The fields of messages by their topics, in the order of sending."""
Messages: TypeAlias = Mapping[str, Any]
"""Messages by their topics."""

_Values = TypeVar("_Values", bound=Sequence[float])


def finite(values: _Values, what: str) -> _Values:
    """Return numbers that a float32 holds. Raises ValueError for NaN, infinity and larger ones."""
    if not all(abs(each) <= _LARGEST for each in values):
        raise ValueError(f"expected finite numbers for {what}, got {tuple(values)}")
    return values


def in_range(value: float, least: float, what: str) -> float:
    """Return a number from `least` to 1. Raises ValueError for another one."""
    if not least <= value <= 1.0:
        raise ValueError(f"expected {what} from {least:g} to 1, got {value:g}")
    return value


def check_seconds(seconds: float, what: str) -> None:
    """Raise ValueError for what is no time in s to wait, such as NaN: asyncio would wait for ever."""
    if not seconds >= 0.0:
        raise ValueError(f"expected {what} in s, got {seconds:g}")


class Configuration:
    """The configuration of the setpoints of a mode in PX4."""

    def __init__(self, connection: Connection, feeds: Feeds, mode: int) -> None:
        self._connection, self._feeds, self._mode = connection, feeds, mode
        self._topics = Topics(connection.package)
        self._has_replies = self._topics.has("in", "setpoint_config")
        self._left = 0
        """How often the configuration is still to be sent."""
        self._kind: Kind | None = None
        self._end = self._feeds["setpoint_config_reply"].call(self._take) if self._has_replies else None

    async def check(self, kinds: Iterable[Kind]) -> None:
        """Ask the vehicle whether it supports kinds of setpoints. Raises UnsupportedError and NoAnswerError.

        Before v1.18, PX4 cannot be asked.
        """
        if not self._has_replies:
            return
        for kind in dict.fromkeys(map(self._configured, kinds)):
            reply = await self._ask(kind)
            if reply.result:
                raise UnsupportedError(f"the vehicle does not support {kind.name} setpoints ({_WHY[reply.result]})")

    def apply(self, kind: Kind | None) -> None:
        """Let PX4 use a kind of setpoints in the mode from now on. None: the mode was left."""
        self._kind = None if kind is None else self._configured(kind)
        self._left = 0 if kind is None else 1 if self._has_replies else _REPEATS

    def send(self) -> None:
        """Send the configuration if PX4 has not confirmed it. Call this with each setpoint."""
        if not self._left or self._kind is None:
            return
        if self._has_replies:
            self._connection.publish("setpoint_config", self._request(self._kind, is_applied=True))
            return
        self._left -= 1
        flags = {f"flag_control_{name}_enabled": True for name in self._kind.controls}
        cls = self._topics.incoming("config_control_setpoints")
        self._connection.publish("config_control_setpoints", filled(cls, source_id=self._mode, **flags))

    def close(self) -> None:
        """Stop reading replies."""
        if self._end is not None:
            self._end()

    def _configured(self, kind: Kind) -> Kind:
        """Return the kind that PX4 is told.

        v1.18 refuses fixed-wing setpoints for a VTOL that hovers, and goto for one that flies forward. Trajectory
        setpoints control the same, it accepts them in each state, and it takes the other two with them.
        """
        status = self._feeds["vehicle_status"].latest
        is_same = kind in _SAME and status is not None and bool(status.is_vtol)
        return TRAJECTORY if is_same else kind

    def _take(self, reply: Any) -> None:
        kind = self._kind
        if kind is not None and reply.source_id == self._mode and reply.type == kind.number and not reply.result:
            self._left = 0

    def _request(self, kind: Kind, *, is_applied: bool) -> Any:
        cls = self._topics.incoming("setpoint_config")
        return cls(type=kind.number, source_id=self._mode, should_apply=is_applied, timeout_ms=_TIMEOUT_MS)

    async def _ask(self, kind: Kind) -> Any:
        return await self._feeds.answer(
            "setpoint_config_reply",
            lambda: self._connection.publish("setpoint_config", self._request(kind, is_applied=False)),
            lambda reply: bool(reply.source_id == self._mode and reply.type == kind.number),
            f"the vehicle has not answered whether it supports {kind.name} setpoints",
        )


_SAME = (GOTO, FIXED_WING)
"""The kinds that control the same as trajectory setpoints."""
_WHY = {
    OTHER_FAILURE: "the mode is not registered",
    UNSUPPORTED_TYPE: "not for this kind of vehicle",
    UNKNOWN_TYPE: "unknown to this firmware",
}


class Configured(Protocol):
    """What goes with setpoints."""

    def apply(self, kind: Kind | None) -> None:
        """Take the kind of the setpoints that follow, None once the mode is left."""

    def send(self) -> None:
        """Send what goes with each setpoint."""


class Stream:
    """Sends the setpoint of a mode at the rate of its kind, while the mode is active.

    It runs in the event loop of the program, so a program that hangs or has ended sends nothing. After a hang of 0.5 s,
    nothing is sent until the vehicle shows that the mode is still active, and nothing while the vehicle is not heard.
    """

    def __init__(
        self, connection: Connection, feeds: Feeds, configuration: Configured, shaped: Callable[[Messages], Messages]
    ) -> None:
        self._connection, self._configuration, self._shaped = connection, configuration, shaped
        self._status = feeds["vehicle_status"]
        self.is_alive: Callable[[], bool] = lambda: True
        """Whether the program runs, if that is not shown by the event loop."""
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._due = 0.0
        self.kind: Kind | None = None
        """The kind of the present setpoint, None without one."""
        self._make: Callable[[], Messages] = dict
        self._renewal = 0.0
        """When the messages that configure it are sent next."""
        self._is_late = False
        """Whether the program has not run for 0.5 s. The mode may have been left meanwhile."""
        self.is_active = False
        self.is_broken = False
        """Whether the last setpoint could not be sent. Not every vehicle stops without setpoints."""

    def start(self) -> None:
        """Begin: the mode is active."""
        self.is_active, self._is_late, self.is_broken = True, False, False
        self._wait(self._loop.time() + _IDLE)

    def confirm(self) -> None:
        """Send again after a hang: the mode is still active."""
        self._is_late = False

    def stop(self) -> None:
        """Send nothing from now on: the mode was left."""
        self.is_active = False
        self.pause()
        self._cancel()
        self._configuration.apply(None)

    def pause(self) -> None:
        """Send nothing until the next setpoint."""
        self.kind = None

    def set(self, kind: Kind, make: Callable[[], Messages]) -> None:
        """Repeat a setpoint until the next one: what a function returns each time, by topics and in this order.

        One of another kind is sent at once, others in their turn.
        """
        if not self.is_active:
            return
        is_new = self.kind != kind
        self.kind, self._make, self.is_broken = kind, make, False
        if is_new:
            self._renewal = 0.0
            self._configuration.apply(kind)
            self._cancel()
            self._tick()

    def _tick(self) -> None:
        now = self._loop.time()
        self._is_late = self._is_late or now > self._due + _HUNG
        interval = _IDLE
        try:
            if self.kind is not None and self._may_send():
                interval = 1.0 / self.kind.rate
                self._configuration.send()
                self._send(self._shaped(self._make()), now)
        except Exception:
            self.pause()  # told once, by who has called or by the event loop
            self.is_broken = True
            raise
        finally:
            base = min(self._due, now)  # a new setpoint comes before its time
            self._wait(max(base + interval, now))  # late setpoints do not come in a burst

    def _send(self, messages: Messages, now: float) -> None:
        is_due = now >= self._renewal
        if is_due:
            self._renewal = now + _RENEWED
        for topic, message in messages.items():
            if is_due or topic not in FIXED_WING.renewed:
                self._connection.publish(topic, message)

    def _may_send(self) -> bool:
        return not self._is_late and self._status.age <= _SILENT and self.is_alive()

    def _wait(self, due: float) -> None:
        self._due = due
        self._timer = self._loop.call_at(due, self._tick)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class Ranges:
    """The ranges of a vehicle. What the program does not say is as in PX4's documentation."""

    def __init__(self, parameters: Mapping[str, float] = _NONE) -> None:
        """Take the values of parameters that the vehicle has. Raises ValueError for others, and for wrong values."""
        for name, value in parameters.items():
            if name not in DEFAULTS:
                near = suggestion(name, DEFAULTS) or f": they are {', '.join(sorted(DEFAULTS))}"
                raise ValueError(f"{name!r} is no parameter that limits setpoints{near}")
            if not 0.0 < value < math.inf:
                raise ValueError(f"expected a value above 0 for {name}, got {value!r}")
        self._parameters = dict(parameters)
        self._told: set[str] = set()
        """The parameters that a warning has named."""

    def check(self, values: Values) -> None:
        """Raise ValueError for a value that the vehicle cannot follow, as far as the program has said.

        Without that, what is beyond the documented range of a parameter is an error, and what is beyond its default is
        a warning, which is given once.
        """
        for topic, fields in values.items():
            for name, found in RANGES.get(topic, {}).items():
                if name in fields:
                    self._check(found, fields[name])

    def _check(self, found: Range, value: float) -> None:
        bounds = found.least, found.most
        least, most = (each.of(self._parameters.get(each.parameter, each.extreme)) for each in bounds)
        if value < least or value > most:
            unknown = dict.fromkeys(each.parameter for each in bounds if each.parameter not in self._parameters)
            raise ValueError(
                f"expected {found.what} from {least:g} to {most:g} {found.unit}, got {value:g}, and nothing was sent"
                + (f". {_ANOTHER.format(' and '.join(unknown))}" if unknown else "")
            )
        usual_least, usual_most = (each.of(each.default) for each in bounds)
        if usual_least <= value <= usual_most or math.isnan(value):
            return
        bound, usual = (found.least, usual_least) if value < usual_least else (found.most, usual_most)
        if bound.parameter not in self._told | self._parameters.keys():
            self._told.add(bound.parameter)
            LOGGER.warning(
                "%s of %g %s is beyond %g, by which PX4 may replace it: %s is usually %g. %s",
                *(found.what, value, found.unit, usual, bound.parameter, bound.default),
                _ANOTHER.format(bound.parameter),
            )
