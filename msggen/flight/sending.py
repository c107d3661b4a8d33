"""What a mode sends setpoints with: its connection to the vehicle, once it is registered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Protocol

from msggen.flight.actions import Actions
from msggen.flight.feeds import Feeds, Topics
from msggen.flight.limits import Fence
from msggen.flight.overrides import Overrides
from msggen.flight.setpoints import Values
from msggen.flight.space import Frame
from msggen.flight.usage import Hinted
from msggen.messages.setpoints import Kind


class Registered(Protocol):
    """The connection of a registered mode to the vehicle."""

    feeds: Feeds
    topics: Topics
    fence: Fence
    overrides: Overrides
    actions: Actions

    @property
    def is_active(self) -> bool:
        """Whether the mode flies the vehicle."""

    def send(self, kind: Kind, **values: Any) -> None:
        """Send a setpoint of one message from now on."""

    def send_each(self, kind: Kind, values: Values) -> None:
        """Send a setpoint of several messages from now on."""

    def guide(self, kind: Kind, make: Callable[[], Values]) -> None:
        """Send a setpoint from now on whose values a function returns each time."""

    def hold(self) -> None:
        """Hold the place where the vehicle is. Raises UnsupportedError."""

    async def change(self, *, is_forward: bool, seconds: float) -> None:
        """Let a VTOL change to forward flight, or to hovering."""


class Sends(Hinted):
    """Sends setpoints."""

    frame: ClassVar[Frame] = "ned"
    """The frame of its places and velocities."""

    @property
    def _own(self) -> Registered:
        """The connection. Raises FlightError unless it is registered."""
        raise NotImplementedError
