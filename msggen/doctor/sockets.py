"""The UDP sockets of this computer, and who has them. Known on Linux, from /proc; elsewhere there are none."""

from __future__ import annotations

import os
import socket
import struct
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

from msggen.doctor.observation import OWNER, Process
from msggen.link.address import Address

_TABLES = ("/proc/net/udp", "/proc/net/udp6")
_TCP = ("/proc/net/tcp", "/proc/net/tcp6")
_MAPPED = bytes(10) + b"\xff\xff"
"""The start of an IPv4 address in IPv6."""


class Socket(NamedTuple):
    """A UDP socket. An address that is not bound or connected has the port 0, or the host 0.0.0.0 or ::."""

    local: tuple[str, int]
    remote: tuple[str, int]
    inode: int


def sockets(tables: Sequence[str] = _TABLES) -> list[Socket]:
    """Return the sockets of this computer, those of UDP by default."""
    found: list[Socket] = []
    for table in tables if sys.platform == "linux" else ():
        with suppress(OSError), open(table, encoding="ascii") as file:
            found += parse_sockets(file.read())
    return found


def parse_sockets(text: str) -> Iterator[Socket]:
    """Yield the sockets of a table of the kernel, /proc/net/udp (proc_net(5)). Lines that are none are left out."""
    for line in text.splitlines()[1:]:
        words = line.split()
        with suppress(ValueError, IndexError, struct.error):
            yield Socket(_place(words[1]), _place(words[2]), int(words[9]))


def _place(text: str) -> tuple[str, int]:
    """Return host and port. The kernel writes an address as words of the machine's order."""
    words, _, port = text.partition(":")
    numbers = [int(words[at : at + 8], 16) for at in range(0, len(words), 8)]
    packed = struct.pack(f"={len(numbers)}I", *numbers)
    packed = packed.removeprefix(_MAPPED) if len(packed) == 16 else packed  # noqa: PLR2004 - IPv6
    family = socket.AF_INET if len(packed) == 4 else socket.AF_INET6  # noqa: PLR2004 - IPv4
    return socket.inet_ntop(family, packed), int(port, 16)


def owners_of(address: Address) -> tuple[Process, ...]:
    """Return the processes that have the port or the device of a link, as far as this user may know."""
    if address.link_type.is_device:
        return owners_of_device(address.path)
    return owners_of_port(address.port, _TCP if address.link_type.has_router else _TABLES)


def owners_of_port(port: int, tables: Sequence[str] = _TABLES) -> tuple[Process, ...]:
    """Return the processes that have a port, one of UDP by default, as far as this user may know."""
    return owners(f"socket:[{each.inode}]" for each in sockets(tables) if each.local[1] == port)


def owners_of_device(path: str) -> tuple[Process, ...]:
    """Return the processes that have a device open, as far as this user may know."""
    return owners([os.path.realpath(path)])


def owners(targets: Iterator[str] | Collection[str]) -> tuple[Process, ...]:
    """Return the processes with one of some files open, as /proc names these."""
    wanted = frozenset(targets)
    return tuple(Process(pid, _name_or_role(pid)) for pid in processes(wanted.__contains__)) if wanted else ()


def _name_or_role(pid: int) -> str:
    """Return the name of a process, or OWNER: the name of that one would be `python`."""
    words = words_of(pid)
    is_serving = any(os.path.basename(program) == "msggen" for program in words) and "serve" in words
    return OWNER if is_serving or any("msggen.vehicle.owner.process" in word for word in words) else name_of(pid)


def processes(is_wanted: Callable[[str], bool]) -> Iterator[int]:
    """Yield the ids of the processes with a file open whose name in /proc is wanted."""
    for entry in os.listdir("/proc") if sys.platform == "linux" else ():
        if entry.isdecimal():
            with suppress(OSError):  # it has ended, or belongs to another user
                if any(map(is_wanted, _files(entry))):
                    yield int(entry)


def _files(entry: str) -> Iterator[str]:
    folder = f"/proc/{entry}/fd"
    for number in os.listdir(folder):
        with suppress(OSError):
            yield os.readlink(f"{folder}/{number}")


def name_of(pid: int) -> str:
    """Return the name of a process, as `ps -o comm` shows it."""
    with suppress(OSError), open(f"/proc/{pid}/comm", encoding="utf-8", errors="replace") as file:
        return file.read().strip()
    return "?"


def words_of(pid: int) -> list[str]:
    """Return the command line of a process, nothing if it cannot be known."""
    with suppress(OSError), open(f"/proc/{pid}/cmdline", encoding="utf-8", errors="replace") as file:
        return file.read().split("\0")
    return []


def senders_to(address: tuple[str, int]) -> tuple[Process, ...]:
    """Return the processes with a socket that is connected to an address, as that of PX4's client is."""
    return owners(f"socket:[{each.inode}]" for each in sockets() if each.remote == address)


def buffer_limit() -> int:
    """Return the largest receive buffer that the kernel grants, 0 if it is not known."""
    with suppress(OSError, ValueError), open("/proc/sys/net/core/rmem_max", encoding="ascii") as file:
        return int(file.read())
    return 0
