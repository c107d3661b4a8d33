"""A listener that survives its own errors."""

from __future__ import annotations

import traceback

from msggen.live.link import Listener, Remote, Route, Service

TOLD = 100
"""The number of different errors of a listener that are told."""


class Guard:
    """A listener that passes everything on to another one, and tells the errors that it raises.

    An error is told by `warned`, once for each line of code that raises one. The link goes on.
    """

    def __init__(self, listener: Listener) -> None:
        self._listener = listener
        self._told: set[str] = set()

    def connected(self, remote: Remote) -> None:
        """Pass on."""
        try:
            self._listener.connected(remote)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Pass on."""
        try:
            self._listener.opened(remote, route)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def disconnected(self, remote: Remote, reason: str) -> None:
        """Pass on."""
        try:
            self._listener.disconnected(remote, reason)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        """Pass on."""
        try:
            self._listener.sample(remote, route, payload, time)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:
        """Pass on."""
        try:
            self._listener.replied(remote, service, number, payload)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def lost(self, remote: Remote, count: int) -> None:
        """Pass on."""
        try:
            self._listener.lost(remote, count)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def warned(self, text: str) -> None:
        """Pass on. An error of `warned` itself cannot be told by it, and is printed."""
        try:
            self._listener.warned(text)
        except Exception:  # noqa: BLE001 - the code of the user
            if len(self._told) < TOLD:
                self._told.add(f"warned {len(self._told)}")
                traceback.print_exc()

    def failed(self, reason: str) -> None:
        """Pass on."""
        try:
            self._listener.failed(reason)
        except Exception as error:  # noqa: BLE001 - the code of the user
            self._tell(error)

    def _tell(self, error: Exception) -> None:
        trace = traceback.extract_tb(error.__traceback__)
        place = f"{trace[-1].filename}:{trace[-1].lineno}"
        if place not in self._told and len(self._told) < TOLD:
            self._told.add(place)
            self.warned(f"error in a callback, at {place}: {type(error).__name__}: {error}")
