"""Ports of this computer that are free."""

from __future__ import annotations

import itertools
import os
import socket

_EACH = 500
_FIRST = 10_000 + _EACH * (os.getpid() % 40)
_PORTS = itertools.cycle(range(_FIRST, _FIRST + _EACH))
"""Ports below those that the system gives to sockets without one, of its own for each process that runs tests."""


def free_port() -> int:
    """Return a UDP port of the loopback interface that nothing uses, and another one for each call."""
    for port in itertools.islice(_PORTS, _EACH):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            try:
                sock.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
    raise OSError(f"no free port from {_FIRST} to {_FIRST + _EACH - 1}")
