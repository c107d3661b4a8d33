"""Tests of links that programs share, where the system has sockets for it."""

from __future__ import annotations

from msggen.live.links.places import CAN_SHARE

collect_ignore_glob = [] if CAN_SHARE else ["test_*.py"]
