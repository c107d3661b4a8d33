"""Access to Zenoh through the package eclipse-zenoh: a session that is the router itself, or a client of one.

Import this module only if eclipse-zenoh is installed. Facts about it that shape this module:

- The error of a session that cannot be opened is a text, which ends with the number of the system's error.
- A client connects again by itself when its router is back, and declares all that it had declared.
- It calls each function in a Python thread of its own, which is a daemon if the thread that declared it is one. Python
  waits for all others at its end, before anything is closed there. A daemon that is still there when Python ends aborts
  the program, so `Session.close` waits for it.
- Multicast scouting would tell the network of this program. It is always off, also if a configuration has it.
"""

from __future__ import annotations

import errno
import json
import os
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Final, TypeAlias

import zenoh

from msggen.link.link import LinkError
from msggen.link.rmw_zenoh.names import reversed_id

TOKENS: Final = "@ros2_lv/**"
_CONNECT_MS: Final = 3000
"""How long a router may take to answer."""
_ENDING_S: Final = 1.0
"""How long the functions that are called may take to return when the session is closed."""
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

_GUARDS: Final = ("access_control/enabled", "transport/auth/usrpwd/dictionary_file")

_CALLS: Final = "(pyo3-closure)"
"""The end of the name of a thread in which Zenoh calls a function."""

OnSample: TypeAlias = Callable[[str, bytes, bytes | None], None]
_AT_ONCE: Final[Mapping[str, Any]] = {
    "congestion_control": zenoh.CongestionControl.DROP,
    "priority": zenoh.Priority.REAL_TIME,
    "express": True,
}
"""How samples are published: none waits, and what the connection does not take is dropped."""


class Declared:
    """What a session has declared."""

    def __init__(self, made: Any) -> None:
        self._made = made

    def withdraw(self) -> None:
        """Withdraw it. Can be repeated, also after the end of the session."""
        with suppress(zenoh.ZError):
            self._made.undeclare()


class Publisher(Declared):
    """A publisher of a session."""

    def __init__(self, made: Any, listener: Any) -> None:
        super().__init__(made)
        self._listener = listener

    @property
    def is_heard(self) -> bool:
        """Whether somebody on the network subscribes to its key."""
        with suppress(zenoh.ZError):
            return bool(self._made.matching_status.matching)
        return False

    def put(self, payload: bytes, attachment: bytes) -> None:
        """Publish a sample at once, or drop it if the connection takes no more. Raises LinkError."""
        try:
            self._made.put(payload, attachment=attachment)
        except zenoh.ZError as error:  # no context manager, for speed
            raise LinkError(f"Zenoh cannot publish: {reason_of(error)}") from error


class Question:
    """What a program asks about a key."""

    def __init__(self, query: Any) -> None:
        self._query = query

    def reply(self, payload: bytes, attachment: bytes) -> None:
        """Answer it, once."""
        with suppress(zenoh.ZError):
            self._query.reply(self._query.key_expr, payload, attachment=attachment)

    def close(self) -> None:
        """Let the program that asks know that no further answer comes."""
        with suppress(zenoh.ZError):
            self._query.drop()


class Session:
    """A session of Zenoh. Its callbacks are called by threads of Zenoh."""

    def __init__(self, session: Any, *, is_router: bool) -> None:
        self._session = session
        self.is_router = is_router
        printed = str(session.info.zid())
        self._ids = {printed, printed.zfill(32), reversed_id(printed)}
        self._declared: list[Any] = []
        self._threads: set[threading.Thread] = set()
        """Those in which functions are called."""

    def is_own(self, zid: str) -> bool:
        """Whether a token with this id of a session is of this one."""
        return zid in self._ids

    @property
    def has_router(self) -> bool:
        """Whether this is the router, or is connected to it."""
        return self.is_router or bool(self._session.info.routers_zid())

    @property
    def has_others(self) -> bool:
        """Whether other sessions are connected to this one."""
        with suppress(zenoh.ZError):
            return bool(self._session.info.transports())
        return False

    @property
    def zid(self) -> str:
        """The id of this session, as Zenoh prints it."""
        return str(self._session.info.zid())

    def tokens(self, on_token: Callable[[str, bool], None]) -> None:
        """Call a function for each token that is there, that comes or goes. Again, to be told all anew.

        Raises LinkError.
        """
        alive = zenoh.SampleKind.PUT

        def token(sample: Any) -> None:
            on_token(str(sample.key_expr), sample.kind == alive)

        made: list[Any] = []

        def declare() -> None:
            made.append(self._session.liveliness().declare_subscriber(TOKENS, token, history=True))

        with self._declaring("subscribe to tokens"):
            _by_daemon(declare)
        for each in self._declared:  # not before: no token goes unseen
            Declared(each).withdraw()
        self._declared = made

    def declare(self, token: str) -> Declared:
        """Declare a token. It is there until it is withdrawn. Raises LinkError."""
        with _errors(f"declare '{token}'"):
            return Declared(self._session.liveliness().declare_token(token))

    def subscribe(self, key: str, on_sample: OnSample) -> Declared:
        """Call a function with the key, the payload and the attachment of each sample. Raises LinkError."""

        def data(sample: Any) -> None:
            attachment = sample.attachment
            on_sample(str(sample.key_expr), bytes(sample.payload), bytes(attachment) if attachment else None)

        with self._declaring(f"subscribe to '{key}'"):
            return Declared(self._session.declare_subscriber(key, data))

    def publisher(self, key: str, on_matching: Callable[[bool], None]) -> Publisher:
        """Return a publisher. It tells when the first subscriber on the network comes, and the last one goes.

        Raises LinkError.
        """
        with self._declaring(f"publish '{key}'"):
            made = self._session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)
            listener = made.declare_matching_listener(lambda status: on_matching(status.matching))
        return Publisher(made, listener)

    def put(self, key: str, payload: bytes, attachment: bytes) -> None:
        """Publish a sample at once, or drop it if the connection takes no more. Raises LinkError."""
        with _errors(f"publish '{key}'"):
            self._session.put(key, payload, attachment=attachment, **_AT_ONCE)

    def answer(self, key: str, answer: Callable[[Question], None]) -> Declared:
        """Call a function for each question about a key. Raises LinkError."""

        def ask(query: Any) -> None:
            answer(Question(query))

        with self._declaring(f"answer about '{key}'"):
            return Declared(self._session.declare_queryable(key, ask))

    def ask(self, key: str, seconds: float) -> Iterator[tuple[bytes, bytes]]:
        """Yield payload and attachment of each answer to a question about a key that comes in time."""
        with suppress(zenoh.ZError):
            for reply in self._session.get(key, timeout=seconds):
                if reply.ok is not None and reply.ok.attachment is not None:
                    yield bytes(reply.ok.payload), bytes(reply.ok.attachment)

    def close(self) -> None:
        """End the session, and wait for the functions that are called just now."""
        with suppress(zenoh.ZError):
            self._session.close()
        self._declared.clear()
        end = time.monotonic() + _ENDING_S
        for thread in self._threads - {threading.current_thread()}:
            thread.join(max(end - time.monotonic(), 0))
        self._threads.clear()

    @contextmanager
    def _declaring(self, what: str) -> Iterator[None]:
        """Keep the threads in which what is declared is called, and raise LinkError for an error of Zenoh."""
        before = {*threading.enumerate()}
        try:
            with _errors(what):
                yield
        finally:  # a declaration that fails can have started some, too
            begun = {each for each in threading.enumerate() if each.name.endswith(_CALLS)} - before
            self._threads = {each for each in self._threads if each.is_alive()} | begun


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
            cure = _certificate(settings) or "check host and port; ports below 1024 need the rights of root"
            raise LinkError(f"Zenoh cannot listen on {place}: {reason_of(error)}; {cure}") from error
    client: dict[str, object] = {"mode": "client", "connect/endpoints": [locator], "connect/timeout_ms": _CONNECT_MS}
    try:
        return Session(_open(configuration, client), is_router=False)
    except zenoh.ZError:
        if number == errno.EADDRINUSE:
            text = f"TCP port {port} of {host} is in use by a program that is no Zenoh router"
            cure = f"`ss -tlpn sport = :{port}` shows it, end it, or use another port here and in zenoh/net.txt of PX4"
            cure += f"; {_authority(settings) or 'a router with TLS needs its certificate, config= in the address'}"
            raise LinkError(f"{text}: {cure}") from OSError(errno.EADDRINUSE, text)
        text = f"no Zenoh router answers at {place}, which is no address of this computer"
        raise LinkError(
            f"{text}: start a router there (zenohd, rmw_zenohd or `msggen link serve`), check host and port, "
            f"{_authority(settings, end=', ')}or give an address of this computer, where msggen is the router itself"
        ) from None


def is_guarded(configuration: str) -> bool:
    """Whether a configuration lets only some do all: by access control, by certificates of clients or by passwords."""
    if not configuration:
        return False
    made, settings = zenoh.Config.from_file(configuration), _read(configuration)
    has_certificates = settings.get("enable_mtls") and _protocol(settings, configuration) == "tls"
    return bool(has_certificates) or any(json.loads(made.get_json(key)) for key in _GUARDS)


def reason_of(error: Exception) -> str:
    """Return the text of an error of Zenoh, without places in its source."""
    text = re.sub(r"\.? ?\bat /\S+?\.rs:\d+\.?", "", str(error)).strip(" .[]!")
    found = re.search(r'msg: "([^"]*)"', text)  # of JSON5, with the place as an object of Rust behind it
    text = re.sub(r"expected struct \w+", "expected an object", found[1] if found else text)
    text = text.replace("unit value", "null")
    return text[:1].lower() + text[1:]


def _by_daemon(declare: Callable[[], None]) -> None:
    """Declare what calls a function in a daemon thread, so that Python does not wait for that of the function."""
    caught: list[zenoh.ZError] = []

    def run() -> None:
        try:
            declare()
        except zenoh.ZError as error:
            caught.append(error)

    thread = threading.Thread(target=run, name="msggen-zenoh-declare", daemon=True)
    thread.start()
    thread.join()
    if caught:
        raise caught[0]


@contextmanager
def _errors(what: str) -> Iterator[None]:
    """Raise LinkError for an error of Zenoh."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"Zenoh cannot {what}: {reason_of(error)}") from error


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


def _certificate(settings: Any) -> str:
    """Return what to check so that a router can use TLS, "" without it."""
    if not any(settings.get(name) for name in _FILES):
        return ""
    found = [f"{name} is {settings.get(name) or 'missing'}" for name in ("listen_private_key", "listen_certificate")]
    return f"check host and port, and that these are PEM files, a key and its certificate: {', '.join(found)}"


def _authority(settings: Any, end: str = "") -> str:
    """Return what to check so that a client can use TLS, "" without it."""
    name = settings.get("root_ca_certificate")
    return f"check that root_ca_certificate, {name}, has signed the router's certificate{end}" if name else ""


def _open(configuration: str, settings: dict[str, object]) -> Any:
    made = zenoh.Config.from_file(configuration) if configuration else zenoh.Config()
    ours = {"scouting/multicast/enabled": False, "scouting/delay": 0}
    for key, value in {**settings, **ours}.items():
        made.insert_json5(key, json.dumps(value))
    return zenoh.open(made)


def _number_of(error: Exception) -> int:
    found = re.search(r"\(os error (\d+)\)", str(error))
    return int(found[1]) if found else 0
