"""A connection to Zenoh at an address, whose session is opened anew if the router there has ended."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from ipaddress import ip_address
from typing import TYPE_CHECKING, Final

from msggen.base.missing import installing
from msggen.link.link import LinkError

if TYPE_CHECKING:
    from msggen.link.rmw_zenoh.session import Session

_LOST: Final = "its connection has ended"
_ALONE_S: Final = 3.0
"""The time without a router after which a client tries to be the router."""


class Connection:
    """A session, and the next one. It is the router itself if the port is free, and else a client of the router."""

    def __init__(self, host: str, port: int, config: str, began: Callable[[Session], None]) -> None:
        """Make it. `config` is the path of a configuration of Zenoh. `began` gets each new session."""
        self._place, self._config, self._began = (host, port), config, began
        self._routed_at = 0.0
        self.session: Session | None = None
        """None while there is no router."""
        self._problem = _LOST
        """Why there is none."""

    @property
    def is_router(self) -> bool:
        """Whether this program is the router."""
        return self.session is not None and self.session.is_router

    @property
    def has_others(self) -> bool:
        """Whether this program is the router of other sessions."""
        session = self.session
        return session is not None and session.is_router and session.has_others

    @property
    def has_router(self) -> bool:
        """Whether this program is the router, or is connected to it."""
        return self.session is not None and self.session.has_router

    @property
    def role(self) -> str:
        """What this program is on the network, for people."""
        if not self.has_router:
            return f"no router: {self._problem}"
        return "this process is the router" if self.is_router else "a client of the router there"

    def open(self) -> None:
        """Open a session. Raises LinkError."""
        try:
            from msggen.link.rmw_zenoh.session import open_session
        except ImportError as error:
            raise LinkError(f"the package eclipse-zenoh is not installed: {installing('zenoh')}") from error
        self.session = session = open_session(*self._place, self._config)
        self._routed_at = time.monotonic()
        try:
            self._began(session)
        except LinkError:
            self.close()
            raise

    def warning(self, danger: str) -> str:
        """Return what the user should know of a router that others can reach, "" if they cannot. `danger` is theirs."""
        if not self.is_router or _is_loopback(self._place[0]):
            return ""
        from msggen.link.rmw_zenoh.session import is_guarded

        if is_guarded(self._config):
            return ""
        cure = f"add some to '{self._config}'" if self._config else "name a configuration with access control, config="
        return (
            f"listening on {self._place[0]}:{self._place[1]}: Zenoh has no access control here, so whoever can connect "
            f"to this port can {danger}; {cure}"
        )

    def look(self) -> None:
        """Open another session if there is no router, and has been none for some time."""
        now = time.monotonic()
        if self.has_router:
            self._routed_at, self._problem = now, _LOST
        elif now - self._routed_at > _ALONE_S:
            self._routed_at = now
            self.close()
            try:
                self.open()
            except LinkError as error:  # until it is possible
                self._problem = str(error)

    def close(self) -> None:
        """End the session. Can be repeated."""
        session, self.session = self.session, None
        if session is not None:
            session.close()


def _is_loopback(host: str) -> bool:
    """Whether a host is this computer, for itself only."""
    with suppress(ValueError):
        return ip_address(host).is_loopback
    return host == "localhost"
