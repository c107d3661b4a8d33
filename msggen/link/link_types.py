"""The types of links: what their addresses look like, what opens them, and what a user can do without a vehicle."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.diagnostics import either

PORT = 8888
"""The port of PX4's client by default (parameter UXRCE_DDS_PRT)."""

AGENT_PORT = PORT + 1
"""The port of the agent behind a tap by default."""

BAUD = 921600
"""The rate of TELEM2 in PX4's guide, in bit/s."""


ROUTER_PORT = 7447
"""The port of a Zenoh router by default."""


class LinkType(NamedTuple):
    """A type of links. The module of `msggen.link` that is called as its scheme has it."""

    form: str
    """The address, with names in braces: `place` and `agent` are a host and a port, `path` is that of a device, and
    `config` that of a configuration of Zenoh."""
    link: str
    """The class in the module."""
    arguments: tuple[str, ...]
    """The attributes of an `Address` that are the positional arguments of the class."""
    options: tuple[str, ...]
    """The keywords of the class, of `allow`, `keys`, `records`, `agent` and `config`."""
    unheard: str = (
        "no client has sent anything to UDP port {port} {wait}: check that it sends to this computer "
        "(UXRCE_DDS_AG_IP) and port (UXRCE_DDS_PRT {port}), and the firewall; {status}. "
        "Without a vehicle, `msggen sim udp://127.0.0.1:{port}` simulates one"
    )
    """What the doctor says if nothing arrives, with `link`, `port`, `baud` and `domain` in braces, the time as `wait`,
    and `status` for how to see where PX4 sends."""
    silence: str = (
        "check that uxrce_dds_client runs on the vehicle, with this computer's address (UXRCE_DDS_AG_IP) and port "
        "(UXRCE_DDS_PRT), or on this serial line"
    )
    """What a program says if no vehicle connects."""
    has_clients: bool = False
    """Whether simulated vehicles and played recordings can connect to such an address."""
    is_shared: bool = True
    """Whether a process owns such a link for all programs of the user, because it can be opened once."""
    first_s: float = 5.0
    """The time in s after which a vehicle has been heard if there is one: PX4's client asks once a second."""

    @property
    def queries(self) -> tuple[str, ...]:
        """The keys that an address may have after `?`."""
        return tuple(re.findall(r"(\w+)=", self.form))

    @property
    def has_agent(self) -> bool:
        """Whether the address names an agent."""
        return "{agent}" in self.form

    @property
    def needs_agent(self) -> bool:
        """Whether there is no vehicle without an agent."""
        return self.has_agent or self.has_domain

    @property
    def has_port(self) -> bool:
        """Whether clients send datagrams to a UDP port of this computer."""
        return "{place}" in self.form and not self.has_router

    @property
    def has_router(self) -> bool:
        """Whether a Zenoh router is at the host and the port, or this program if that port of its computer is free."""
        return "{config}" in self.form

    @property
    def port(self) -> int:
        """The port without another one."""
        return ROUTER_PORT if self.has_router else PORT

    @property
    def can_be_free(self) -> bool:
        """Whether the system may choose the port: nobody else has to know it before the link is opened."""
        return self.has_port and not self.has_agent

    @property
    def is_device(self) -> bool:
        """Whether this is a line to one vehicle, with a device and a rate."""
        return "{baud}" in self.form

    @property
    def is_socket(self) -> bool:
        """Whether another process owns the link, at the path of its socket."""
        return "{path}" in self.form and not self.is_device

    @property
    def has_domain(self) -> bool:
        """Whether vehicles are found in a domain of DDS, behind an agent."""
        return "{domain}" in self.form

    @property
    def example(self) -> str:
        """An address."""
        place, agent = f"127.0.0.1:{self.port}", f"127.0.0.1:{AGENT_PORT}"
        path = "/dev/ttyUSB0" if self.is_device else "/run/user/1000/msggen/udp-8888.socket"
        return self.filled(place=place, path=path, baud=BAUD, agent=agent, domain=0)

    @property
    def usage(self) -> str:
        """The address for a help text: `udp://HOST:PORT`."""
        path = "DEVICE" if self.is_device else "/PATH"
        return self.filled(place="HOST:PORT", path=path, baud="N", agent="HOST:PORT", domain="DOMAIN")

    def filled(self, *, config: str = "", **values: object) -> str:
        """Return the address with values for the names in braces. Without a `config`, its key is left out."""
        return self.form.format(config=config, **values).removesuffix("?config=")


LINK_TYPES: Mapping[str, LinkType] = MappingProxyType(
    {
        "udp": LinkType("udp://{place}", "UdpLink", ("host", "port"), ("allow", "keys", "records"), has_clients=True),
        "serial": LinkType(
            "serial://{path}?baud={baud}",
            "SerialLink",
            ("path", "baud"),
            ("keys", "records"),
            unheard="nothing has arrived from {link} {wait}: check the wires, that uxrce_dds_client runs on this port "
            "(UXRCE_DDS_CFG) with {baud} baud; {status}",
            has_clients=True,
        ),
        "tap": LinkType("tap://{place}?agent={agent}", "TapLink", ("host", "port"), ("agent", "allow")),
        "dds": LinkType(
            "dds://{domain}",
            "DdsLink",
            ("domain",),
            (),
            unheard="no vehicle is in DDS domain {domain} {wait}: check UXRCE_DDS_DOM_ID of the vehicle and "
            "ROS_DOMAIN_ID, and that its agent runs on this computer",
            silence="check that an agent runs in this domain (UXRCE_DDS_DOM_ID), and uxrce_dds_client on the vehicle",
            is_shared=False,  # DDS shares by itself
            first_s=10.0,  # discovery takes longer
        ),
        "zenoh": LinkType(
            "zenoh://{place}?config={config}",
            "ZenohLink",
            ("host", "port"),
            ("config",),
            unheard="no vehicle is on Zenoh at {link} {wait}: check `zenoh start` of PX4 v1.17 or later, with this "
            "computer's address in zenoh/net.txt, client;tcp/10.41.10.1:{port}; a router drops v1.15 without a word "
            "(protocol 0x07). On a network, check `msggen link serve --zenoh`. Without a vehicle, `msggen sim --zenoh "
            "tcp/127.0.0.1:{port}` simulates one",
            silence="check that PX4 v1.17 or later runs `zenoh start` (ZENOH_ENABLE 1), and that zenoh/net.txt on its "
            "card has the address of this router; v1.15 cannot talk to it. On a network, check `msggen link serve "
            "--zenoh` where the vehicle is",
            first_s=11.0,  # PX4 asks for a router every 5 s, and may wait 5 s for its network before
        ),
        "unix": LinkType(
            "unix://{path}",
            "UnixLink",
            ("path",),
            (),
            unheard="no vehicle is connected to the process that owns the link {wait}: `msggen link list` shows it; "
            "{status}",
            is_shared=False,
        ),
    }
)
"""The types by the schemes of their addresses."""

DEFAULT = LINK_TYPES["udp"].example
"""The address without another one."""

CLIENTS = tuple(scheme for scheme, each in LINK_TYPES.items() if each.has_clients)
"""The schemes of the addresses to which simulated vehicles and played recordings connect."""


SIMULATED = (*CLIENTS, *(scheme for scheme, each in LINK_TYPES.items() if each.has_router))
"""The schemes of the addresses to which simulated vehicles connect."""


def usages(schemes: Iterable[str] = LINK_TYPES) -> str:
    """Return the addresses with some schemes for a help text."""
    return either([LINK_TYPES[scheme].usage for scheme in schemes])


def type_named(name: str) -> LinkType:
    """Return the type of a link by its address or the name of its class; that of UDP for another class."""
    found = (each for scheme, each in LINK_TYPES.items() if name.lower().startswith(scheme))
    return next(found, LINK_TYPES["udp"])
