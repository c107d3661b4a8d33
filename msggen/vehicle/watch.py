"""A watch: all samples of a vehicle, undecoded, for programs that record, count or forward them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, TypeAlias

from msggen.link.link import Route
from msggen.vehicle.feed import run_callback, tell_callback_error

if TYPE_CHECKING:
    from typing_extensions import Self

Watcher: TypeAlias = Callable[[Route, bytes, int], object]
"""Gets the route of a sample, its payload with the encapsulation, and its arrival in ns since 1970."""


Direction: TypeAlias = Literal["out", "in", "both"]
"""`out` is what the vehicle publishes, `in` what the programs on a shared link send to it."""


class Watch:
    """Calls a function for each sample of a vehicle, until it is closed. `Vehicle.watch` returns one."""

    def __init__(self, watcher: Watcher, direction: Direction, detach: Callable[[Watch], None]) -> None:
        self._watcher, self._direction, self._detach = watcher, direction, detach
        self.errors = 0
        """The number of exceptions that the function raised."""
        self.is_closed = False

    def __repr__(self) -> str:
        return f"<Watch: {'closed' if self.is_closed else 'running'}, {self.errors} errors>"

    def takes(self, route: Route) -> bool:
        """Whether this watches the direction of a route."""
        return self._direction in {"both", route.direction}

    def of(self, route: Route, size: int | None = None) -> Callable[[bytes, int, object], None]:
        """Return a function that takes the samples of a route, in the thread of the link: their first `size` bytes."""

        def take(payload: bytes, time: int, _: object) -> None:
            error = None if self.is_closed else run_callback(self._watcher, route, payload[:size], time)
            if error is not None:
                self.errors += 1
                tell_callback_error(error, self.errors, f"a watcher, for a sample of '{route.name}'")

        return take

    def close(self) -> None:
        """End the watch. A call that runs in the thread of the link is not waited for. Can be repeated."""
        self.is_closed = True
        self._detach(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
