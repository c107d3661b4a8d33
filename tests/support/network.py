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


if __name__ == "__main__":
    start_loopback()
    os.execvp(sys.argv[1], sys.argv[1:])  # noqa: S606 - the command of a test
