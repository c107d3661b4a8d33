"""Ports of this computer that are free."""

from __future__ import annotations

import socket


def free_port() -> int:
    """Return a UDP port of the loopback interface that nothing uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])
