"""The errors of a vehicle. Each is a LinkError, whose text names the cure."""

from __future__ import annotations

from msggen.live.link import LinkError


class NotConnectedError(LinkError):
    """No vehicle is connected, or the vehicle has ended its session."""


class LinkTimeoutError(LinkError, TimeoutError):
    """The vehicle did not connect, publish or reply within the given time."""


class TopicError(LinkError):
    """A name that no endpoint has, or a message that is not that of the topic."""


class FormatError(LinkError):
    """The vehicle's definition of a message differs from that of the given types."""
