"""The process that owns a link: started by the first program that needs it, or by `msggen link serve`."""

from __future__ import annotations

import json
import logging
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from logging.handlers import RotatingFileHandler
from typing import Any, TypeAlias

from msggen.base.foreign import escaped
from msggen.link.address import Address, parse_address
from msggen.link.aside import Aside
from msggen.link.link import LinkError
from msggen.vehicle.opening import open_link
from msggen.vehicle.owned.places import Place
from msggen.vehicle.owner.owner import LOGGER, Owner
from msggen.vehicle.owner.server import Server

IDLE = "MSGGEN_LINK_IDLE"
"""The variable with the time in s without a program after which an owner ends by itself."""

IDLE_S = 60.0
IDLE_WITH_VEHICLE_S = 600.0
"""The same while a vehicle is connected. The router of other sessions does not end by itself."""

_LOG_SIZE = 1 << 18
_LINES = 1000
_PATIENCE = 1.0
"""The longest wait in s for the log at the end."""


Setup: TypeAlias = Mapping[str, Any]
"""What a process is told of the link that it is to own."""


def main(join: Callable[[Setup, Place], AbstractContextManager[None]] = lambda *_: nullcontext()) -> None:
    """Run an owner, apart from the program that starts it. Its setup is JSON on the standard input.

    `join` opens what uses the link in this process, before other programs can join, and closes it at the end. Writes
    why it failed to the standard output, "" if programs can join it, with the number of the system's error, and
    closes it.
    """
    setup = json.loads(sys.stdin.buffer.read())
    if os.fork():  # the program that starts it waits for this one
        os._exit(0)
    os.setsid()
    output = os.fdopen(os.dup(1), "w")
    nothing = os.open(os.devnull, os.O_RDWR)
    for handle in range(3):
        os.dup2(nothing, handle)
    place = Place(*setup["place"])
    _log_to(place.log)

    def tell(problem: str = "", number: int | None = 0) -> None:
        with suppress(ValueError, OSError):  # it was closed
            output.write(json.dumps([problem, number]) + "\n")
            output.close()

    def ready(_owner: Owner) -> None:
        joining.enter_context(join(setup, place))
        tell()

    try:
        address = parse_address(setup["address"])
        with ExitStack() as joining:
            serve(place, address, setup["allow"], idle=never if setup["stays"] else idle, ready=ready)
    except LinkError as error:
        LOGGER.error("%s", error)
        cause = error.__cause__
        tell(str(error), cause.errno if isinstance(cause, OSError) else 0)
        sys.exit(1)
    except Exception:  # told to the log, because nobody sees the trace
        LOGGER.exception("the link failed")
        raise


def serve(
    place: Place,
    address: Address,
    allow: Sequence[str | int] = (),
    *,
    idle: Callable[[bool], float],
    ready: Callable[[Owner], None],
) -> None:
    """Own a link until no program needs it, or a signal ends this process.

    `ready` is called with the owner when programs can join. Raises LinkError if another process owns the link, or if it
    cannot be opened.
    """
    with _owned(place):
        link = open_link(address, allow)
        server = Server(link, address, allow, idle)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: server.end())
        link.start(server.owner)
        try:
            with _listening(place) as listening:
                LOGGER.info("%s is open, process %d", address, os.getpid())
                ready(server.owner)
                server.serve(listening)
        finally:
            link.close()


@contextmanager
def _owned(place: Place) -> Iterator[None]:
    """Be the only owner of a link. Raises LinkError."""
    import fcntl

    with open(place.lock, "a+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LinkError(
                "another process owns this link: `msggen link list` shows it, `msggen link stop` ends it"
            ) from None
        yield


@contextmanager
def _listening(place: Place) -> Iterator[socket.socket]:
    """Listen where programs join. The socket of an owner that was killed is replaced."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        with suppress(FileNotFoundError):
            os.unlink(place.socket)
        before = os.umask(0o177)
        try:
            listening.bind(place.socket)
        finally:
            os.umask(before)
        listening.listen(64)
        try:
            yield listening
        finally:
            with suppress(FileNotFoundError):
                os.unlink(place.socket)


def idle(has_vehicle: bool) -> float:  # noqa: FBT001
    """Return the time in s without a program after which an owner ends."""
    with suppress(KeyError, ValueError):
        return max(0.0, float(os.environ[IDLE]))
    return IDLE_WITH_VEHICLE_S if has_vehicle else IDLE_S


def never(has_vehicle: bool) -> float:  # noqa: ARG001, FBT001
    """Return the time after which an owner ends that stays until it is stopped."""
    return float("inf")


class Soon(logging.Handler):
    """Gives what is logged to another handler, in a thread of its own: no link waits for the disk.

    If the disk stands still, at most `_LINES` lines wait for it.
    """

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__()
        self._handler = handler
        self._aside = Aside("msggen-log", _LINES, lambda _: None)  # a handler tells its errors itself

    def emit(self, record: logging.LogRecord) -> None:
        """Log soon."""
        record.msg, record.args = record.getMessage(), None  # its arguments may change
        self._aside.do(lambda: self._handler.handle(record))

    def close(self) -> None:
        """Log what is left, and close the other handler."""
        self._aside.do(self._handler.close)
        self._aside.close(_PATIENCE)
        super().close()


class _Escaping(logging.Formatter):
    """Writes each message in one line: names of programs and vehicles can have any characters."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - a method of the standard library
        record.message = escaped(record.message)
        return super().formatMessage(record)


def _log_to(path: str) -> None:
    """Write what is told to a file of bounded size, or nowhere if it cannot be written."""
    with suppress(OSError):
        handler = RotatingFileHandler(path, maxBytes=_LOG_SIZE, backupCount=1, encoding="utf-8")
        handler.setFormatter(_Escaping("%(asctime)s %(levelname)s %(message)s"))
        LOGGER.addHandler(Soon(handler))
    LOGGER.setLevel(logging.INFO)
    LOGGER.propagate = False
