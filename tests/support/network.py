"""A network for a program alone: the loopback interface and nothing else.

Run as a program, this starts the interface and then the command in its arguments.
"""

from __future__ import annotations

import os
import shutil
import socket
import struct
import subprocess
import sys

_UNSHARE = ("unshare", "--net", "--pid", "--fork", "--kill-child", "--mount-proc")
"""Namespaces for network and processes: the processes end with the first one, and that one with `unshare`."""
_SET_FLAGS = 0x8914
"""SIOCSIFFLAGS of Linux."""
_IS_UP = 1
_SET_TUNNEL = 0x400454CA
"""TUNSETIFF of Linux."""
_PLAIN_PACKETS = 0x1001
"""IFF_TUN and IFF_NO_PI."""
_IPV4 = 4


def isolated(*command: str) -> list[str]:
    """Return the command line that runs a command in a network of its own. Skips the test where there is none."""
    import pytest

    from support.programs import required

    if sys.platform != "linux" or os.geteuid():
        pytest.skip("needs Linux and root, for a network namespace")
    is_there = shutil.which("unshare") and not subprocess.run([*_UNSHARE, "true"], check=False).returncode
    required("network namespaces", is_there=bool(is_there))
    return [*_UNSHARE, sys.executable, "-I", __file__, *command]


def start_loopback() -> None:
    """Start the loopback interface, which a new namespace has, but not in use."""
    import fcntl

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sH22x", b"lo", _IS_UP))


def lossy_interface(own: str, share: float) -> list[int]:
    """Start an interface that returns what is sent to other addresses of its network to its own, and loses a share.

    Return a list of the sizes of lost packets, which grows. Needs root, and a network namespace.
    """
    import fcntl
    import random
    import threading

    tunnel = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(tunnel, _SET_TUNNEL, struct.pack("16sH22x", b"tun0", _PLAIN_PACKETS))
    subprocess.run(["ip", "address", "add", f"{own}/24", "dev", "tun0"], check=True)
    subprocess.run(["ip", "link", "set", "tun0", "up"], check=True)
    chance, lost = random.Random(1), []  # noqa: S311 - a network, not a secret

    def carry() -> None:
        while True:
            packet = os.read(tunnel, 65_535)
            if packet[0] >> 4 != _IPV4:
                continue
            if chance.random() < share:
                lost.append(len(packet))
            else:  # with its addresses exchanged, which keeps the checksum
                os.write(tunnel, packet[:12] + packet[16:20] + packet[12:16] + packet[20:])

    threading.Thread(target=carry, daemon=True).start()
    return lost


if __name__ == "__main__":
    start_loopback()
    os.execvp(sys.argv[1], sys.argv[1:])  # noqa: S606 - the command of a test
