"""The sockets of an owner: programs that come, ask and go."""

from __future__ import annotations

import errno
import os
import selectors
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from msggen.link.address import Address
from msggen.link.link import Link
from msggen.vehicle.owner.owner import LOGGER, Owner
from msggen.vehicle.owner.program import Program
from msggen.vehicle.owner.requests import EndOfOwner, obey

GATHER_S = 0.002
"""How long samples are gathered, in s, when many arrive."""
_TICK_S = 0.2
_CHUNK = 1 << 16
_FULL = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
_PAUSE_S = 1.0
"""How long no program is taken when there are no descriptors for more, in s."""


class Server:
    """Serves the programs of a link, in the thread that calls `serve`."""

    def __init__(self, link: Link, address: Address, allow: Sequence[str | int], idle: Callable[[bool], float]) -> None:
        """Make a server. `idle` gets whether a vehicle is connected, and returns the time in s without a program after
        which `serve` returns.
        """
        self.owner = Owner(link, address, allow, self.wake)
        self._idle = idle
        self._selector = selectors.DefaultSelector()
        self._wake, self._woken = socket.socketpair()
        self._wake.settimeout(0.0)
        self._woken.settimeout(0.0)
        self._is_over = False
        self._is_woken = False
        self._used_at = time.monotonic()
        self._full_until: float | None = None
        """Until when no further programs are taken, because this process has no descriptor for them."""

    def serve(self, listening: socket.socket) -> None:
        """Serve programs that connect to a socket, until `end` is called, the link fails, or no program is left."""
        listening.settimeout(0.0)
        self._listen(listening)
        self._selector.register(self._woken, selectors.EVENT_READ, self._drain)
        try:
            while not (self._is_over or self.owner.failure):
                for key, _ in self._selector.select(_TICK_S):
                    key.data()
                self._look()
                if self._full_until is not None and time.monotonic() >= self._full_until:
                    self._full_until = None
                    self._listen(listening)
        finally:
            self._close()

    def _listen(self, listening: socket.socket) -> None:
        self._selector.register(listening, selectors.EVENT_READ, lambda: self._accept(listening))

    def end(self) -> None:
        """Let `serve` return. From any thread, and from a handler of signals."""
        self._is_over = True
        self.wake()

    def wake(self) -> None:
        """Let the thread that serves look around. From any thread, and from a handler of signals: without a lock."""
        if not self._is_woken:
            self._is_woken = True
            with suppress(OSError):
                self._wake.send(b"\0")

    def _drain(self) -> None:
        with suppress(BlockingIOError):
            self._woken.recv(64)
        if self.owner.is_gathering:
            time.sleep(GATHER_S)
        self._is_woken = False  # before the look at the programs: what comes later wakes again

    def _look(self) -> None:
        """Send what was gathered, watch the sockets that were full, and forget the programs that are gone."""
        owner, now = self.owner, time.monotonic()
        with owner.lock:
            for program in tuple(owner.programs):
                if not program.is_blocked:
                    program.flush()
                if program.is_gone:
                    self._selector.unregister(program)
                    owner.remove(program)
                else:
                    self._watch(program)
            owner.look()
        if owner.programs:
            self._used_at = now
        elif now - self._used_at <= self._idle(bool(owner.vehicles)):
            pass
        elif owner.link.serves_others():
            self._used_at = now
        else:
            LOGGER.info("no program uses the link any more")
            self._is_over = True

    def _watch(self, program: Program) -> None:
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if program.is_blocked else 0)
        key = self._selector.get_key(program)
        if key.events != events:
            self._selector.modify(program, events, key.data)

    def _accept(self, listening: socket.socket) -> None:
        try:
            accepted, _ = listening.accept()
        except OSError as error:
            if error.errno in _FULL:  # the socket stays readable: without a pause, this thread would do nothing else
                self._selector.unregister(listening)
                self._full_until = time.monotonic() + _PAUSE_S
                LOGGER.warning("no program can join for %g s: %s", _PAUSE_S, error.strerror)
            return  # else it is gone again
        accepted.settimeout(0.0)
        self._take(accepted)

    def _take(self, accepted: socket.socket) -> None:
        program = Program(accepted)
        if program.uid not in {-1, os.getuid()}:
            program.close()
            return
        self._selector.register(program, selectors.EVENT_READ, lambda: self._receive(program))
        with self.owner.lock:
            self.owner.programs[program] = None

    def _receive(self, program: Program) -> None:
        """Take what a program has sent, and send what has waited for it."""
        with self.owner.lock:
            if program.is_blocked:
                program.flush()
        try:
            chunk = program.socket.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            chunk = b""
        program.is_gone |= not chunk
        try:
            for record in program.reader.add(chunk):
                obey(self.owner, program, record)
        except EndOfOwner as reason:
            LOGGER.info("%s", reason)
            self._is_over = True
        except Exception as error:  # noqa: BLE001 - whatever it sends, the others go on
            LOGGER.warning("pid %d sent what is no record: %s: %s", program.pid, type(error).__name__, error)
            program.is_gone = True

    def _close(self) -> None:
        with self.owner.lock:
            for program in tuple(self.owner.programs):
                program.flush()
                self.owner.remove(program)
        self._selector.close()
        self._wake.close()
        self._woken.close()
