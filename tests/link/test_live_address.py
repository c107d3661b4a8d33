"""Tests of addresses: what each form means, and the nearest right form of a wrong one."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from msggen.base.diagnostics import printable
from msggen.doctor.connecting import _STATUS
from msggen.link.address import Address, parse_address
from msggen.link.link_types import LINK_TYPES, type_named
from msggen.live import LinkError
from msggen.vehicle.opening import open_link
from support.repository import ROOT


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udp://127.0.0.1:8888", Address("udp", "127.0.0.1", 8888)),
        ("udp://0.0.0.0", Address("udp", "0.0.0.0", 8888)),  # noqa: S104 - it is only parsed
        ("udp://:9000/", Address("udp", "127.0.0.1", 9000)),
        ("udp://", Address("udp", "127.0.0.1", 8888)),
        ("udp://[::1]:9", Address("udp", "::1", 9)),
        ("serial:///dev/ttyUSB0", Address("serial", path="/dev/ttyUSB0", baud=921600)),
        ("serial:///dev/tty%20A?baud=57600", Address("serial", path="/dev/tty A", baud=57600)),
        ("serial://COM3?baud=115200", Address("serial", path="COM3", baud=115200)),
        ("tap://127.0.0.1:8888?agent=10.0.0.2:8889", Address("tap", agent=("10.0.0.2", 8889))),
        ("tap://", Address("tap", agent=("127.0.0.1", 8889))),
        ("tap://127.0.0.1:8888?agent=8908", Address("tap", agent=("127.0.0.1", 8908))),
        ("udp://9000", Address("udp", "127.0.0.1", 9000)),
        ("udp://127.0.0.1:0", Address("udp", "127.0.0.1", 0)),
        ("udp://0", Address("udp", "127.0.0.1", 0)),
        ("dds://0", Address("dds", domain=0)),
        ("dds://232", Address("dds", domain=232)),
        ("dds://", Address("dds", domain=0)),
        ("zenoh://", Address("zenoh", port=7447)),
        ("zenoh://10.41.10.1", Address("zenoh", "10.41.10.1", 7447)),
        ("zenoh://7448", Address("zenoh", port=7448)),
        ("zenoh://[::1]:7448?config=/etc/a.json5", Address("zenoh", "::1", 7448, config="/etc/a.json5")),
    ],
)
def test_an_address_is_read(text: str, expected: Address) -> None:
    assert parse_address(text) == expected
    assert parse_address(str(expected)) == expected


@pytest.mark.parametrize("scheme", LINK_TYPES)
def test_the_example_of_a_type_is_an_address(scheme: str) -> None:
    example = LINK_TYPES[scheme].example
    found = parse_address(example)
    assert str(found) == example
    assert found.scheme == scheme
    assert found.link_type is LINK_TYPES[scheme]


@pytest.mark.parametrize("scheme", LINK_TYPES)
def test_the_name_of_a_link_tells_its_type(scheme: str) -> None:
    """The name is the address, or the class of a link that was made by the user."""
    row = LINK_TYPES[scheme]
    assert type_named(row.example) is type_named(row.link) is row
    assert type_named("MyLink 0x7f00") is LINK_TYPES["udp"]


def test_the_page_of_links_has_all_types() -> None:
    page = (ROOT / "docs/links.md").read_text(encoding="utf-8")
    assert all(f"{scheme}://" in page for scheme in LINK_TYPES)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("127.0.0.1:8888", "is not the address of a link, did you mean 'udp://127.0.0.1:8888'?"),
        ("--help", "'--help' is not the address of a link: expected one of udp://127.0.0.1:8888"),
        ("udp:/127.0.0.1:8888", "is not the address of a link, did you mean 'udp://127.0.0.1:8888'?"),
        ("upd://127.0.0.1:8888", "is not the address of a link, did you mean 'udp://127.0.0.1:8888'?"),
        ("UDP://host", "is not the address of a link, did you mean 'udp://host'?"),
        ("/dev/ttyUSB0", "is not the address of a link, did you mean 'serial:///dev/ttyUSB0'?"),
        ("serial:/dev/ttyACM0", "is not the address of a link, did you mean 'serial:///dev/ttyACM0'?"),
        ("COM3", "is not the address of a link, did you mean 'serial://COM3'?"),
        ("0", "is not the address of a link, did you mean 'dds://0'?"),
        ("8888", "is not the address of a link, did you mean 'udp://127.0.0.1:8888'?"),
        ("ttyUSB0", "is not the address of a link, did you mean 'serial:///dev/ttyUSB0'?"),
        ("localhost:8888", "is not the address of a link, did you mean 'udp://localhost:8888'?"),
        ("udp//localhost:8888", "is not the address of a link, did you mean 'udp://localhost:8888'?"),
        ("http://127.0.0.1:8888/?a=b", "is not the address of a link, did you mean 'udp://127.0.0.1:8888'?"),
        ("http://1?!", "is not the address of a link: expected one of udp://127.0.0.1:8888, serial:///dev"),
        (
            "",
            f"is not the address of a link: expected one of {', '.join(each.example for each in LINK_TYPES.values())}",
        ),
        ("serial://dev/ttyUSB0", "has no absolute path, did you mean 'serial:///dev/ttyUSB0'?"),
        ("serial://ttyUSB0", "has no absolute path, did you mean 'serial:///dev/ttyUSB0'?"),
        ("serial://", f"has no device: expected an address such as '{LINK_TYPES['serial'].example}'"),
        ("serial:///dev/a?baud=fast", "'fast' is not a baud rate: expected a number from 1 to 2147483647"),
        ("serial:///dev/a?bauds=9600", "unknown key 'bauds', did you mean 'baud'?"),
        ("udp://127.0.0.1:88888", "'88888' is not a port: expected a number from 1 to 65535"),
        ("tap://127.0.0.1:0", "'0' is not a port: expected a number from 1 to 65535"),
        ("udp://127.0.0.1:", "'' is not a port: expected a number from 1 to 65535"),
        ("udp://a:b:c", "'a:b:c' is not a host and a port: expected an address such as 'udp://127.0.0.1:8888'"),
        ("udp://127.0.0.1,8888", "is not a host and a port, did you mean 'udp://127.0.0.1:8888'?"),
        ("udp://h/8888", "is not a host and a port, did you mean 'udp://h:8888'?"),
        ("udp://h:1?key=1", "'key' is not part of an address: give it to Vehicle, Vehicle('udp://h:1', key=1)"),
        ("udp://h?namespace=uav_1&x=2&queue=9", ": give it to Vehicle, Vehicle('udp://h', namespace='uav_1', queue=9)"),
        ("tap://h?agent=1&types=px4_types", "'types' is not part of an address: give it to Vehicle"),
        ("dds://0?allow=10.8.0.0/24", "Vehicle('dds://0', allow='10.8.0.0/24')"),
        ("udp://127.0.0.1:8888?baud=1", "unknown key 'baud': expected an address such as 'udp://127.0.0.1:8888'"),
        ("tap://127.0.0.1:8889", "the agent has the tap's own address: start the agent on another port, 8889"),
        ("dds://233", "'233' is not a DDS domain: expected a number from 0 to 232"),
        ("dds://zero", "'zero' is not a DDS domain: expected a number from 0 to 232"),
    ],
)
def test_a_wrong_address_names_the_right_one(text: str, error: str) -> None:
    with pytest.raises(LinkError) as raised:
        parse_address(text)
    assert error in str(raised.value)


@given(st.text(max_size=30) | st.from_regex(r"(udp|serial|tap|dds|zenoh)://[\w:/?=.\[\]]{0,20}", fullmatch=True))
@example("zenoh://1?config=a+b%26c%3F d")
def test_any_text_is_an_address_or_an_error(text: str) -> None:
    try:
        found = parse_address(text)
    except LinkError:
        return
    assert parse_address(str(found)) == found


@pytest.mark.parametrize("scheme", ["tap", "tcp", "dds"])
def test_an_address_with_another_scheme_is_suggested_with_one_that_fits(scheme: str) -> None:
    with pytest.raises(LinkError, match=r"is not the address of a link, did you mean 'udp://127\.0\.0\.1:8888'"):
        parse_address(f"{scheme}://127.0.0.1:8888?agent=127.0.0.1:8889", ("udp", "serial"))


@pytest.mark.parametrize("scheme", LINK_TYPES)
def test_what_to_do_when_nothing_arrives_is_told_in_full(scheme: str) -> None:
    found = LINK_TYPES[scheme]
    place, path = "255.255.255.255:65535", "/dev/serial/by-id/usb-Auterion_PX4_FMU_v6X.x_0-if00"
    config = "/etc/zenoh/vehicle.json5"
    link = found.filled(place=place, path=path, baud=921600, agent=place, domain=232, config=config)
    text = found.unheard.format(link=link, port=65535, baud=921600, domain=232, wait="in 11 s", status=_STATUS)
    assert printable(text) == text


def test_keys_and_addresses_are_only_for_links_that_have_them() -> None:
    with pytest.raises(LinkError, match="'dds://0' has no keys that allow= could name"):
        open_link(parse_address("dds://0"), [1])


def test_an_import_is_cheap() -> None:
    """`import msggen.live` imports nothing slow, and `Vehicle` neither numpy nor asyncio nor a transport."""
    source = """
import sys
import msggen.live
few = {name for name in sys.modules if name.startswith("msggen")}
assert few == {"msggen", "msggen.live"}, few
assert not {"threading", "logging", "asyncio", "numpy", "typing"} & set(sys.modules)
from msggen.live import Vehicle
slow = {"asyncio", "numpy", "socket", "dataclasses", "inspect", "jinja2", "yaml", "json", "subprocess"}
slow |= {"msggen.definitions.model"}
assert not slow & set(sys.modules), slow & set(sys.modules)
"""
    subprocess.run([sys.executable, "-I", "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{source}"], check=True)
