"""Tests of what links have in common."""

from __future__ import annotations

import socket

import pytest

from msggen.link.link import LinkError, Listener
from msggen.link.zenoh import ZenohLink


def test_a_link_that_could_not_be_opened_can_be_opened_later() -> None:
    pytest.importorskip("zenoh")
    with socket.create_server(("127.0.0.1", 0)) as other:
        link = ZenohLink("127.0.0.1", other.getsockname()[1])
        for _ in range(2):
            with pytest.raises(LinkError, match="in use by a program that is no Zenoh router"):
                link.start(Listener())
    link.start(Listener())
    with pytest.raises(LinkError, match="can be started once"):
        link.start(Listener())
    link.close()
    with pytest.raises(LinkError, match="can be started once"):
        link.start(Listener())
