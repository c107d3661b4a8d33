"""Where the processes that own a link are found: a folder of the user, with a socket and a lock for each link."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from contextlib import suppress
from hashlib import blake2b
from typing import NamedTuple

from msggen.link.address import Address
from msggen.link.link import LinkError

CAN_SHARE = sys.platform not in {"win32", "cygwin", "emscripten", "wasi"}
"""Whether this system has sockets that only programs of the same user can join."""

_LONGEST = 100
"""The bytes of the longest path of a socket: Linux takes 107, macOS 103."""


class Place(NamedTuple):
    """The files of a link, and of the process that owns it."""

    folder: str
    name: str
    """`udp-8888`: programs that name the same port or device mean the same link, however they spell it."""

    @property
    def socket(self) -> str:
        """The socket that programs join."""
        return os.path.join(self.folder, f"{self.name}.socket")

    @property
    def lock(self) -> str:
        """The file that the owner locks as long as it lives."""
        return os.path.join(self.folder, f"{self.name}.owner")

    @property
    def start(self) -> str:
        """The file that a program locks while it starts an owner."""
        return os.path.join(self.folder, f"{self.name}.start")

    @property
    def log(self) -> str:
        """The file with what the owner tells, whose size is bounded."""
        return os.path.join(self.folder, f"{self.name}.log")


def place_of(address: Address) -> Place:
    """Return the place of a link. Raises LinkError if the folder cannot be used."""
    if address.link_type.is_device:
        path = os.path.realpath(address.path)
        name = f"{address.scheme}-{os.path.basename(path)}-{blake2b(os.fsencode(path), digest_size=4).hexdigest()}"
    elif address.link_type.has_router:  # of this computer, or of another one
        name = f"{address.scheme}-{found_at(address)}-{address.port}"
    elif address.link_type.has_domain:
        name = f"{address.scheme}-{address.domain}"
    else:
        name = f"udp-{address.port}"
    place = Place(runtime_folder(), name)
    if len(os.fsencode(place.socket)) > _LONGEST:
        raise LinkError(
            f"the path of the socket of a link is too long, '{place.socket}': set MSGGEN_RUNTIME to a shorter folder, "
            "or own the link, MSGGEN_DIRECT=1"
        )
    return place


def found_at(address: Address) -> str:
    """Return the device or the IP address that the address of a link names. A host name can take long to look up."""
    if address.link_type.is_device:
        return os.path.realpath(address.path)
    import socket

    with suppress(OSError, UnicodeError):
        return socket.gethostbyname(address.host)
    return address.host


def runtime_folder() -> str:
    """Return the folder of the sockets of this user, which is made if it is missing.

    It is $MSGGEN_RUNTIME, or `msggen` in $XDG_RUNTIME_DIR, or `msggen-USER` in the folder for temporary files. Raises
    LinkError if it belongs to another user, or others may write to it.
    """
    folder = os.environ.get("MSGGEN_RUNTIME") or _default()
    cure = "set MSGGEN_RUNTIME to a folder of your own, or own the link, MSGGEN_DIRECT=1"
    try:
        os.makedirs(folder, mode=0o700, exist_ok=True)
        found = os.stat(folder) if "MSGGEN_RUNTIME" in os.environ else os.lstat(folder)
    except OSError as error:
        raise LinkError(f"the folder of the links, '{folder}', cannot be made: {error.strerror}: {cure}") from None
    if not stat.S_ISDIR(found.st_mode):
        raise LinkError(f"the folder of the links, '{folder}', is no folder: {cure}")
    if found.st_uid != os.getuid():
        raise LinkError(f"the folder of the links, '{folder}', belongs to another user: {cure}")
    if found.st_mode & 0o077:
        raise LinkError(f"the folder of the links, '{folder}', is open to others: chmod 700 '{folder}', or {cure}")
    return folder


def _default() -> str:
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    if os.path.isabs(runtime) and os.path.isdir(runtime):
        return os.path.join(runtime, "msggen")
    return os.path.join(tempfile.gettempdir(), f"msggen-{os.getuid()}")


def places() -> list[Place]:
    """Return the places in the folder that have a socket. Raises LinkError as `runtime_folder`."""
    folder = runtime_folder()
    names = (name.removesuffix(".socket") for name in os.listdir(folder) if name.endswith(".socket"))
    return [Place(folder, name) for name in sorted(names)]
