"""Access to Zenoh through the package eclipse-zenoh: a session that is the router itself, or a client of one.

Import this module only if eclipse-zenoh is installed. Facts about it that shape this module:

- The error of a session that cannot be opened is a text, which ends with the number of the system's error.
- A client connects again by itself when its router is back, and declares all that it had declared.
- Multicast scouting would tell the network of this program. It is always off, also if a configuration has it.
"""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import zenoh

from msggen.link.link import LinkError
from msggen.link.rmw_zenoh.names import reversed_id

TOKENS: Final = "@ros2_lv/**"
SAMPLES: Final = "**/fmu/out/**"
_CONNECT_MS: Final = 3000
"""How long a router may take to answer."""
_BLOCKED_US: Final = 1_000_000
"""How long a program that does not read may hold up all others, until the router ends its connection. Zenoh has 5 s,
after which a vehicle would count as silent. It holds them up if PX4's list has `cc: block` for a topic."""
_ELSEWHERE: Final = {errno.EADDRINUSE, errno.EADDRNOTAVAIL}
_FILES: Final = (
    "root_ca_certificate",
    "listen_private_key",
    "listen_certificate",
    "connect_private_key",
    "connect_certificate",
)


class Session:
    """A session of Zenoh. Its callbacks are called by threads of Zenoh."""

    def __init__(self, session: Any, *, is_router: bool) -> None:
        self._session = session
        self.is_router = is_router
        printed = str(session.info.zid())
        self._ids = {printed, printed.zfill(32), reversed_id(printed)}
        self._declared: list[Any] = []

    def is_own(self, zid: str) -> bool:
        """Whether a token with this id of a session is of this one."""
        return zid in self._ids

    @property
    def has_router(self) -> bool:
        """Whether this is the router, or is connected to it."""
        return self.is_router or bool(self._session.info.routers_zid())

    def listen(
        self, on_token: Callable[[str, bool], None], on_sample: Callable[[str, bytes, bytes | None], None]
    ) -> None:
        """Call functions for each token that is there, that comes or goes, and for each sample of a vehicle."""
        alive = zenoh.SampleKind.PUT

        def token(sample: Any) -> None:
            on_token(str(sample.key_expr), sample.kind == alive)

        def data(sample: Any) -> None:
            attachment = sample.attachment
            on_sample(str(sample.key_expr), bytes(sample.payload), bytes(attachment) if attachment else None)

        self._declared += [
            self._session.liveliness().declare_subscriber(TOKENS, token, history=True),
            self._session.declare_subscriber(SAMPLES, data),
        ]

    def put(self, key: str, payload: bytes, attachment: bytes) -> None:
        """Publish a sample at once, or drop it if the connection takes no more. Raises LinkError."""
        try:
            self._session.put(
                key,
                payload,
                attachment=attachment,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.REAL_TIME,
                express=True,
            )
        except zenoh.ZError as error:
            raise LinkError(f"Zenoh cannot publish '{key}': {reason_of(error)}") from error

    def close(self) -> None:
        """End the session."""
        with suppress(zenoh.ZError):
            self._session.close()
        self._declared.clear()


def open_session(host: str, port: int, configuration: str = "") -> Session:
    """Return a session: the router at an address of this computer whose port is free, or a client of the router there.

    `configuration` is the path of a configuration of Zenoh, such as one with TLS. Raises LinkError.
    """
    place = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    settings = _read(configuration)
    locator = f"{_protocol(settings, configuration)}/{place}"
    router: dict[str, object] = {"mode": "router", "listen/endpoints": [locator]}
    if not configuration:
        router["transport/link/tx/queue/congestion_control/block/wait_before_close"] = _BLOCKED_US
    try:
        return Session(_open(configuration, router), is_router=True)
    except zenoh.ZError as error:
        number = _number_of(error)
        if number not in _ELSEWHERE:
            cure = "check host and port; ports below 1024 need the rights of root"
            raise LinkError(f"Zenoh cannot listen on {place}: {reason_of(error)}; {cure}") from error
    client: dict[str, object] = {"mode": "client", "connect/endpoints": [locator], "connect/timeout_ms": _CONNECT_MS}
    try:
        return Session(_open(configuration, client), is_router=False)
    except zenoh.ZError:
        if number == errno.EADDRINUSE:
            text = f"TCP port {port} of {host} is in use by a program that is no Zenoh router"
            cure = f"`ss -tlpn sport = :{port}` shows it, end it, or use another port here and in zenoh/net.txt of PX4"
            cure += "; a router with TLS needs its certificate, config= in the address"
            raise LinkError(f"{text}: {cure}") from OSError(errno.EADDRINUSE, text)
        text = f"no Zenoh router answers at {place}, which is no address of this computer"
        raise LinkError(
            f"{text}: start a router there (zenohd, rmw_zenohd or `msggen link serve`), check host and port, or give "
            "an address of this computer, where msggen is the router itself"
        ) from None


def reason_of(error: Exception) -> str:
    """Return the text of an error of Zenoh, without places in its source."""
    text = re.sub(r"\.? ?\bat /\S+?\.rs:\d+\.?", "", str(error)).strip(" .[]!")
    found = re.search(r'msg: "([^"]*)"', text)  # of JSON5, with the place as an object of Rust behind it
    text = found[1] if found else text
    return text[:1].lower() + text[1:]


def _read(path: str) -> Any:
    """Return the settings of TLS of a configuration, by name. Raises LinkError."""
    if not path:
        return {}
    if not os.path.isfile(path):
        raise LinkError(f"there is no configuration of Zenoh '{path}': correct config= in the address")
    try:
        settings: Any = json.loads(zenoh.Config.from_file(path).get_json("transport/link/tls"))
    except (zenoh.ZError, ValueError) as error:
        raise LinkError(f"'{path}' is no configuration of Zenoh: {reason_of(error)}") from None
    return settings


def _protocol(settings: Any, path: str) -> str:
    """Return tls if a configuration has certificates, which must be there, or else tcp. Raises LinkError."""
    named = {name: settings[name] for name in _FILES if settings.get(name)}
    for name, file in named.items():
        if not os.path.isfile(file):
            raise LinkError(f"there is no file '{file}', the {name} of '{path}': correct it, or create the certificate")
    return "tls" if named else "tcp"


def _open(configuration: str, settings: dict[str, object]) -> Any:
    made = zenoh.Config.from_file(configuration) if configuration else zenoh.Config()
    ours = {"scouting/multicast/enabled": False, "scouting/delay": 0}
    for key, value in {**settings, **ours}.items():
        made.insert_json5(key, json.dumps(value))
    return zenoh.open(made)


def _number_of(error: Exception) -> int:
    found = re.search(r"\(os error (\d+)\)", str(error))
    return int(found[1]) if found else 0
