"""Addresses of links: `udp://127.0.0.1:8888`."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from typing import NamedTuple
from urllib.parse import parse_qsl, quote, unquote

from msggen.base.diagnostics import suggestion
from msggen.link.link import LinkError
from msggen.link.link_types import AGENT_PORT, BAUD, LINK_TYPES, PORT, LinkType

_ARGUMENTS = ("key", "namespace", "address", "allow", "types", "queue", "direct")
"""Arguments of Vehicle, which are not part of an address."""

_PLACE = r"(?:\[([^\]]+)\]|([\w.-]*))(?::([^:/]*))?"
"""A host or an IPv6 address in brackets, and a port."""

_HOST = r"(?!-)[\w.-]*[a-zA-Z.][\w.-]*(:[0-9]+)?"
"""A host, and perhaps a port, but not a number alone, and not an option such as `--help`."""

_PORTS = 65536
_DOMAINS = 233


class Address(NamedTuple):
    """A parsed address. Attributes that its scheme does not have keep their defaults."""

    scheme: str
    host: str = "127.0.0.1"
    port: int = PORT
    path: str = ""
    baud: int = BAUD
    agent: tuple[str, int] = ("127.0.0.1", AGENT_PORT)
    domain: int = 0
    config: str = ""

    def __str__(self) -> str:
        place, agent = _joined(self.host, self.port), _joined(*self.agent)
        values = {"path": self.path, "baud": self.baud, "domain": self.domain}
        return self.link_type.filled(config=quote(self.config), place=place, agent=agent, **values)

    @property
    def has_free_port(self) -> bool:
        """Whether the system chooses the port when the link is opened."""
        return self.link_type.has_port and self.port == 0

    @property
    def link_type(self) -> LinkType:
        """The type of the link."""
        return LINK_TYPES[self.scheme]


def parse_address(text: str, schemes: Collection[str] = tuple(LINK_TYPES)) -> Address:
    """Return the parts of an address with one of some schemes. Raises LinkError, which names the nearest right form."""
    scheme, separator, rest = text.partition("://")
    if not separator or scheme not in schemes:
        raise LinkError(f"'{text}' is not the address of a link{_nearest_form(text, schemes)}")
    place, _, query = rest.partition("?")
    values = _query(text, scheme, query)
    link_type = LINK_TYPES[scheme]
    if link_type.is_device:
        return _device(text, unquote(place), values)
    if link_type.is_socket:
        if not place.startswith("/"):
            raise LinkError(f"'{text}' has no absolute path: expected an address such as '{link_type.example}'")
        return Address(scheme, path=unquote(place))
    if link_type.has_domain:
        domain = _number(text, place or "0", "a DDS domain", _DOMAINS)
        return Address(scheme, domain=domain)
    host, port = _place(text, place.rstrip("/"), link_type.port, can_be_free=link_type.can_be_free)
    if link_type.has_router:
        config = values.get("config", "")
        return Address(scheme, host, port, config=os.path.abspath(config) if config else "")
    if not link_type.has_agent:
        return Address(scheme, host, port)
    agent = _place(text, values.get("agent", ""), AGENT_PORT)
    if agent == (host, port):
        own = "the agent has the tap's own address"
        raise LinkError(f"'{text}': {own}: start the agent on another port, {AGENT_PORT}")
    return Address(scheme, host, port, agent=agent)


def _joined(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _query(text: str, scheme: str, query: str) -> dict[str, str]:
    values = dict(parse_qsl(query, keep_blank_values=True))
    link_type = LINK_TYPES[scheme]
    unknown = [key for key in values if key not in link_type.queries]
    if any(key in _ARGUMENTS for key in unknown):
        raise LinkError(f"'{text}': {_misplaced(text, values)}")
    if unknown:
        known = suggestion(unknown[0], link_type.queries) or f": expected an address such as '{link_type.example}'"
        raise LinkError(f"'{text}': unknown key '{unknown[0]}'{known}")
    return values


def _misplaced(text: str, values: Mapping[str, str]) -> str:
    """Return the error about arguments of Vehicle in the query of an address."""
    given = {key: value for key, value in values.items() if key in _ARGUMENTS}
    shown = [f"{key}={value if value.isdecimal() or key == 'types' else repr(value)}" for key, value in given.items()]
    place = text.partition("?")[0]
    return (
        f"'{next(iter(given))}' is not part of an address: give it to Vehicle, Vehicle('{place}', {', '.join(shown)})"
    )


def _device(text: str, path: str, values: Mapping[str, str]) -> Address:
    scheme, _, rest = text.partition("://")
    if not path:
        raise LinkError(f"'{text}' has no device: expected an address such as '{LINK_TYPES[scheme].example}'")
    if re.match(r"dev/|tty[A-Z]", path):
        front = "/" if path.startswith("dev/") else "/dev/"
        raise LinkError(f"'{text}' has no absolute path, did you mean '{scheme}://{front}{rest}'?")
    baud = _number(text, values.get("baud", str(BAUD)), "a baud rate", 1 << 31, least=1)
    return Address(scheme, path=path, baud=baud)


def _place(text: str, place: str, port: int, *, can_be_free: bool = False) -> tuple[str, int]:
    """Return host and port of `127.0.0.1:8888`, `[::1]:8888`, `127.0.0.1`, `8888` and ``, and of `0` if it can be."""
    if place.isdecimal():
        place = f":{place}"
    found = re.fullmatch(_PLACE, place)
    if found is None:
        scheme, other = text.partition("://")[0], re.sub(r"[;,/\s]+", ":", place)
        near = f"{scheme}://{other}" if f"://{place}" in text and re.fullmatch(_PLACE, other) else ""
        expected = (
            f", did you mean '{near}'?" if near else f": expected an address such as '{LINK_TYPES[scheme].example}'"
        )
        raise LinkError(f"'{text}': '{place}' is not a host and a port{expected}")
    host = found[1] or found[2] or "127.0.0.1"
    if can_be_free and re.fullmatch("0+", found[3] or ""):
        return host, 0
    return host, _number(text, found[3], "a port", _PORTS, least=1) if found[3] is not None else port


def _number(text: str, number: str, noun: str, end: int, least: int = 0) -> int:
    if not re.fullmatch("[0-9]{1,10}", number) or not least <= int(number) < end:
        raise LinkError(f"'{text}': '{number}' is not {noun}: expected a number from {least} to {end - 1}")
    return int(number)


def _nearest_form(text: str, schemes: Collection[str]) -> str:
    """Return the end of an error about a text that is no address."""
    guess = _guess(text, schemes)
    if guess.partition("://")[0] in schemes:
        return f", did you mean '{guess}'?"
    return f": expected one of {', '.join(LINK_TYPES[scheme].example for scheme in schemes)}"


def _guess(text: str, schemes: Collection[str]) -> str:
    from difflib import get_close_matches

    found = re.fullmatch("([A-Za-z]+)(?::/*|//+)(.*)", text)
    near = get_close_matches(found[1].lower(), schemes, n=1) if found else []
    if found and near:
        front = "/" if LINK_TYPES[near[0]].is_device and found[2].startswith("dev/") else ""
        return f"{near[0]}://{front}{found[2]}"
    if "://" in text:
        place = text.partition("://")[2].partition("?")[0].rstrip("/")
        return f"udp://{place}" if re.fullmatch(_HOST, place) else ""
    if text.startswith("/dev/") or re.fullmatch("COM[0-9]+", text):
        return f"serial://{text}"
    if re.fullmatch("[0-9]{1,5}", text):
        return f"dds://{text}" if int(text) < _DOMAINS else f"udp://127.0.0.1:{text}"
    front = "serial:///dev/" if re.match("tty[A-Z]", text) else "udp://"
    return f"{front}{text}" if re.fullmatch(_HOST, text) else ""
