"""Tests of what a link over Zenoh publishes, without Zenoh."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.link.age import OtherClock
from msggen.link.link import LinkError, Remote, Route
from msggen.link.zenoh import ZenohLink

REMOTE, ROUTE = Remote(1, "msggen_1", 1, "", continued=False), Route("/fmu/in/x", "px4_msgs/msg/X", "in", -1)


def test_a_clock_that_no_sample_can_tell_is_an_error_of_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    link, clock = ZenohLink(), OtherClock()
    clock.hear((1 << 64) - 1, "")
    monkeypatch.setattr(link, "_key_to", lambda *_: "0/fmu/in/x")
    monkeypatch.setattr(link, "_connection", Carried())
    monkeypatch.setattr(link._vehicles, "carried", lambda _: Carried(clock))
    with pytest.raises(LinkError, match="the clock of the process that carries the vehicle is not known"):
        link.publish(REMOTE, ROUTE, b"")


class Carried:
    """A connection, and a vehicle that is carried over it."""

    def __init__(self, clock: OtherClock | None = None) -> None:
        self.session: Any = self
        self.clock = clock
