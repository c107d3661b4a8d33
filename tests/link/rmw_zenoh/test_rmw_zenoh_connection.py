"""Tests of what is told of a router that others can reach, of certificates, and of failures, without sockets."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.link.link import LinkError
from msggen.link.rmw_zenoh.connection import Connection
from support.ports import free_port

zenoh = pytest.importorskip("zenoh")

from msggen.link.rmw_zenoh.session import Session  # noqa: E402 - it needs eclipse-zenoh


def configuration(folder: Path, **settings: Any) -> str:
    path = folder / "zenoh.json5"
    path.write_text(json.dumps(settings), encoding="utf-8")
    return str(path)


def warned(host: str, config: str) -> str:
    connection = Connection(host, 7447, config, lambda _: None)
    session: Any = SimpleNamespace(is_router=True)
    connection.session = session
    return connection.warning("command the vehicles")


@pytest.mark.parametrize(
    "settings",
    [
        {"transport": {"link": {"tx": {"queue": {"size": {"data": 4}}}}}},
        {"access_control": {"enabled": False}},
        {"transport": {"link": {"tls": {"enable_mtls": True}}}},  # without certificates, the link has no TLS
        {"transport": {"link": {"tls": {"listen_certificate": __file__, "listen_private_key": __file__}}}},
    ],
)
def test_a_configuration_that_lets_everybody_in_is_a_warning(tmp_path: Path, settings: Any) -> None:
    config = configuration(tmp_path, **settings)
    assert "whoever can connect to this port can command the vehicles; add some to '" in warned("10.41.10.1", config)
    assert not warned("127.0.0.1", config)


@pytest.mark.parametrize(
    "settings",
    [
        {"access_control": {"enabled": True, "default_permission": "deny"}},
        {"transport": {"auth": {"usrpwd": {"dictionary_file": "/users.txt"}}}},
        {
            "transport": {
                "link": {
                    "tls": {"enable_mtls": True, "listen_certificate": __file__, "listen_private_key": __file__},
                }
            }
        },
    ],
)
def test_a_configuration_that_lets_only_some_in_is_none(tmp_path: Path, settings: Any) -> None:
    assert not warned("10.41.10.1", configuration(tmp_path, **settings))


def test_without_a_configuration_the_warning_names_one() -> None:
    assert warned("10.41.10.1", "").endswith("name a configuration with access control, config=")


@pytest.mark.parametrize(
    ("tls", "error"),
    [
        (
            {"listen_certificate": "{file}", "listen_private_key": "{file}"},
            "PEM files, a key and its certificate: listen_private_key is {file}, listen_certificate is {file}",
        ),
        ({"root_ca_certificate": "{file}"}, "listen_private_key is missing, listen_certificate is missing"),
        (None, "is no configuration of Zenoh: invalid type: null, expected an object"),
    ],
)
def test_a_file_that_is_no_certificate_is_named(tmp_path: Path, tls: dict[str, str] | None, error: str) -> None:
    file = tmp_path / "x.pem"
    file.write_text("no certificate", encoding="utf-8")
    named = tls and {name: text.format(file=file) for name, text in tls.items()}
    config = configuration(tmp_path, transport={"link": {"tls": named}})
    with pytest.raises(LinkError) as raised:
        Connection("127.0.0.1", free_port(), config, lambda _: None).open()
    assert error.format(file=file) in str(raised.value)
    assert "rights of root" not in str(raised.value)


class Failing:
    """A session of Zenoh that closes within a declaration, once the thread of the function has begun."""

    def __init__(self) -> None:
        self.info = SimpleNamespace(zid=lambda: "0a")
        self.threads: list[threading.Thread] = []
        self._closing = threading.Event()

    def liveliness(self) -> Any:
        return self

    def declare_publisher(self, _: str, **_options: Any) -> Any:
        return self

    def declare_matching_listener(self, _: Callable[[Any], None]) -> None:
        self._fail()

    def declare_subscriber(self, *_: Any, **_options: Any) -> None:
        self._fail()

    def close(self) -> None:
        """Close it. A function that is called just now goes on."""
        self._closing.set()

    def _fail(self) -> None:
        self.threads.append(threading.Thread(target=self._call, name="Thread-1 (pyo3-closure)"))
        self.threads[-1].start()
        raise zenoh.ZError("session closed")

    def _call(self) -> None:
        self._closing.wait(30)
        time.sleep(0.1)


@pytest.mark.parametrize(
    "declare",
    [
        lambda session: session.publisher("a/b", lambda _: None),
        lambda session: session.subscribe("a/b", lambda *_: None),
        lambda session: session.tokens(lambda *_: None),
    ],
    ids=["publisher", "subscribe", "tokens"],
)
def test_a_session_waits_for_threads_of_declarations_that_fail(declare: Callable[[Session], object]) -> None:
    failing = Failing()
    session = Session(failing, is_router=False)
    with pytest.raises(LinkError, match="session closed"):
        declare(session)
    (thread,) = failing.threads
    assert thread.is_alive()
    session.close()
    assert not thread.is_alive()
