"""Addresses of links: `udp://127.0.0.1:8888`."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import NamedTuple
from urllib.parse import parse_qsl, unquote

from msggen.base.diagnostics import suggestion
from msggen.live.link import LinkError

FORMS = {
    "udp": "udp://127.0.0.1:8888",
    "serial": "serial:///dev/ttyUSB0?baud=921600",
    "tap": "tap://127.0.0.1:8888?agent=127.0.0.1:8889",
    "dds": "dds://0",
}
"""An example for each scheme."""

QUERIES = {"udp": (), "serial": ("baud",), "tap": ("agent",), "dds": ()}
"""The keys that an address may have after `?`."""

PORT = 8888
"""The port of PX4's client by default (parameter UXRCE_DDS_PRT)."""

BAUD = 921600
"""The rate of TELEM2 in PX4's guide, in bit/s."""

_ARGUMENTS = ("key", "namespace", "address", "allow", "types", "queue", "isolated")
"""Arguments of Vehicle, which are not part of an address."""

_PLACE = r"(?:\[([^\]]+)\]|([\w.-]*))(?::([^:/]*))?"
"""A host or an IPv6 address in brackets, and a port."""

_HOST = r"[\w.-]*[a-zA-Z.][\w.-]*(:[0-9]+)?"
"""A host, and perhaps a port, but not a number alone."""

_PORTS = 65536
_DOMAINS = 233


class Address(NamedTuple):
    """A parsed address. Attributes that its scheme does not have keep their defaults."""

    scheme: str
    host: str = "127.0.0.1"
    port: int = PORT
    path: str = ""
    baud: int = BAUD
    agent: tuple[str, int] = ("127.0.0.1", PORT + 1)
    domain: int = 0

    def __str__(self) -> str:
        if self.scheme == "serial":
            return f"serial://{self.path}?baud={self.baud}"
        if self.scheme == "dds":
            return f"dds://{self.domain}"
        place = f"{self.scheme}://{_joined(self.host, self.port)}"
        return f"{place}?agent={_joined(*self.agent)}" if self.scheme == "tap" else place


def parse_address(text: str, schemes: Collection[str] = tuple(FORMS)) -> Address:
    """Return the parts of an address with one of some schemes. Raises LinkError, which names the nearest right form."""
    scheme, separator, rest = text.partition("://")
    if not separator or scheme not in schemes:
        raise LinkError(f"'{text}' is not the address of a link{_nearest_form(text, schemes)}")
    place, _, query = rest.partition("?")
    values = _query(text, scheme, query)
    if scheme == "serial":
        return _serial(text, unquote(place), values)
    if scheme == "dds":
        domain = _number(text, place or "0", "a DDS domain", _DOMAINS)
        return Address(scheme, domain=domain)
    host, port = _place(text, place.rstrip("/"), PORT)
    if scheme == "udp":
        return Address(scheme, host, port)
    agent = _place(text, values.get("agent", ""), PORT + 1)
    if agent == (host, port):
        raise LinkError(f"'{text}': the agent has the tap's own address: start the agent on another port, 8889")
    return Address(scheme, host, port, agent=agent)


def _joined(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _query(text: str, scheme: str, query: str) -> dict[str, str]:
    values = dict(parse_qsl(query, keep_blank_values=True))
    unknown = [key for key in values if key not in QUERIES[scheme]]
    if any(key in _ARGUMENTS for key in unknown):
        raise LinkError(f"'{text}': {_misplaced(text, values)}")
    if unknown:
        known = suggestion(unknown[0], QUERIES[scheme]) or f": expected an address such as '{FORMS[scheme]}'"
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


def _serial(text: str, path: str, values: Mapping[str, str]) -> Address:
    if not path:
        raise LinkError(f"'{text}' has no device: expected an address such as '{FORMS['serial']}'")
    if re.match(r"dev/|tty[A-Z]", path):
        front = "serial:///" if path.startswith("dev/") else "serial:///dev/"
        raise LinkError(f"'{text}' has no absolute path, did you mean '{front}{text.partition('://')[2]}'?")
    baud = _number(text, values.get("baud", str(BAUD)), "a baud rate", 1 << 31, least=1)
    return Address("serial", path=path, baud=baud)


def _place(text: str, place: str, port: int) -> tuple[str, int]:
    """Return host and port of `127.0.0.1:8888`, `[::1]:8888`, `127.0.0.1`, `8888` and ``."""
    if place.isdecimal():
        place = f":{place}"
    found = re.fullmatch(_PLACE, place)
    if found is None:
        scheme, other = text.partition("://")[0], re.sub(r"[;,/\s]+", ":", place)
        near = f"{scheme}://{other}" if f"://{place}" in text and re.fullmatch(_PLACE, other) else ""
        expected = f", did you mean '{near}'?" if near else f": expected an address such as '{FORMS[scheme]}'"
        raise LinkError(f"'{text}': '{place}' is not a host and a port{expected}")
    host = found[1] or found[2] or "127.0.0.1"
    number = _number(text, found[3], "a port", _PORTS, least=1) if found[3] is not None else port
    return host, number


def _number(text: str, number: str, noun: str, end: int, least: int = 0) -> int:
    if not re.fullmatch("[0-9]{1,10}", number) or not least <= int(number) < end:
        raise LinkError(f"'{text}': '{number}' is not {noun}: expected a number from {least} to {end - 1}")
    return int(number)


def _nearest_form(text: str, schemes: Collection[str]) -> str:
    """Return the end of an error about a text that is no address."""
    guess = _guess(text, schemes)
    if guess.partition("://")[0] in schemes:
        return f", did you mean '{guess}'?"
    return f": expected one of {', '.join(FORMS[scheme] for scheme in schemes)}"


def _guess(text: str, schemes: Collection[str]) -> str:
    from difflib import get_close_matches

    found = re.fullmatch("([A-Za-z]+)(?::/*|//+)(.*)", text)
    near = get_close_matches(found[1].lower(), schemes, n=1) if found else []
    if found and near:
        front = "/" if near[0] == "serial" and found[2].startswith("dev/") else ""
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
