"""Keys, liveliness tokens, QoS and attachments in the form of rmw_zenoh (docs/zenoh.md, "The form").

Everybody on the network can write any key and token, so a text that is not exactly of the form is refused: None.
"""

from __future__ import annotations

import re
import struct
from functools import lru_cache
from hashlib import blake2b
from typing import Final, Literal, NamedTuple, TypeAlias, cast

ADMIN_SPACE: Final = "@ros2_lv"
BEATS: Final = "@msggen/"
"""The front of the keys of `beat_of`."""
NO_HASH: Final = "TypeHashNotSupported"
"""The hash in keys and tokens of a firmware without CONFIG_ZENOH_KEY_TYPE_HASH, and of ROS 2 Humble."""
GID_SIZE: Final = 16

Kind: TypeAlias = Literal["NN", "MP", "MS", "SS", "SC"]
"""A node, a publisher, a subscription, a service, or a client of one."""

_LONGEST: Final = 600
"""The characters of the longest key or token that is looked at. A name has at most 255, a type as many."""
_LONGEST_NAME: Final = 255

_NAME: Final = r"[A-Za-z0-9_]+(?:/[A-Za-z0-9_]+)*"
_TYPE: Final = r"[A-Za-z0-9_]+::(?:msg|srv)::dds_::[A-Za-z0-9_]+_"
_HASH: Final = rf"RIHS01_[0-9a-f]{{64}}|{NO_HASH}"
_NUMBER: Final = r"[0-9]{1,9}"
_KEY: Final = re.compile(rf"({_NUMBER})/({_NAME})/({_TYPE})/({_HASH})")
_PART: Final = r"[A-Za-z0-9_%.:~{}-]+"
_NODE: Final = re.compile(
    rf"{ADMIN_SPACE}/({_NUMBER})/([0-9a-f]{{1,32}})/({_NUMBER})/({_NUMBER})/(NN|MP|MS|SS|SC)"
    rf"/({_PART})/({_PART})/([A-Za-z0-9_]{{1,{_LONGEST_NAME}}})(?:/(.*))?"
)
_TOPIC: Final = re.compile(rf"(%(?:[A-Za-z0-9_]+%)*[A-Za-z0-9_]+)/({_TYPE})/({_HASH})/([0-9:,]+)(?:/{_PART})?")
_FMU: Final = re.compile(r"/(?:(.+)/)?fmu/(in|out)/[^/]+")
_CARRIER: Final = re.compile("msggen_(0|[1-9][0-9]{0,9})")
_QOS: Final = re.compile(
    rf"([0-3]?):([0-3]?):([0-3]?),({_NUMBER}|):{':'.join([r'[0-9]*,[0-9]*'] * 2)}:[0-9]*,[0-9]*,[0-9]*"
)
_YEAR_2001: Final = 10**18
_ATTACHMENT: Final = struct.Struct("<qqB16s")


class Key(NamedTuple):
    """The key of the samples of a topic: `0/fmu/out/vehicle_status/px4_msgs::msg::dds_::VehicleStatus_/RIHS01_...`."""

    domain: int
    """ROS_DOMAIN_ID, or ZENOH_DOMAIN_ID of PX4."""
    name: str
    """The name in ROS 2, with the namespace: `/fmu/out/vehicle_status`. The version of the message is not in it."""
    ros_type: str
    """`px4_msgs/msg/VehicleStatus`."""
    type_hash: str
    """`RIHS01_` and 64 hexadecimal digits, or `NO_HASH`."""

    def __str__(self) -> str:
        return f"{self.domain}{self.name}/{_dds_type(self.ros_type)}/{self.type_hash}"


class Qos(NamedTuple):
    """The QoS in a token, as far as it tells. A value that is left out is the default of rmw_zenoh."""

    is_reliable: bool = True
    is_transient_local: bool = False
    keeps_all: bool = False
    depth: int = 42

    def __str__(self) -> str:
        """Return it as in a token: `::,7:,:,:,,`."""
        reliability, durability = ("" if self.is_reliable else "2"), ("1" if self.is_transient_local else "")
        history, depth = ("2" if self.keeps_all else ""), ("" if self.depth == Qos().depth else self.depth)
        return f"{reliability}:{durability}:{history},{depth}:,:,:,,"


PX4_QOS: Final = Qos(depth=7)
"""What PX4 tells of each of its endpoints."""


class Token(NamedTuple):
    """A liveliness token: a node is there, or an endpoint of it."""

    domain: int
    zid: str
    """The id of the session. PX4 writes its bytes as they are in memory, others reversed: `reversed_id`."""
    kind: Kind
    node: str
    """The name of the node: that of PX4 is `px4_` and the 32 digits of its guid."""
    key: Key | None = None
    """The key of the endpoint's topic, None for a node."""
    qos: Qos = Qos()
    ids: tuple[int, int] | None = None
    """Those of the node and the entity, None for PX4's: 0 for the node, and 11 for each endpoint. They are not read."""
    namespace: str = ""
    """That of the node, without slashes at both ends. It is not read."""

    def __str__(self) -> str:
        """Return the token."""
        node, entity = self.ids or (0, 11 if self.key else 0)
        place = f"%{self.namespace}".replace("/", "%")
        front = f"{ADMIN_SPACE}/{self.domain}/{self.zid}/{node}/{entity}/{self.kind}/%/{place}/{self.node}"
        if self.key is None:
            return front
        mangled, ros_type = self.key.name.replace("/", "%"), _dds_type(self.key.ros_type)
        return f"{front}/{mangled}/{ros_type}/{self.key.type_hash}/{self.qos}"


class Attachment(NamedTuple):
    """What comes with a sample."""

    sequence: int
    """Counts the samples of a publisher, from 1."""
    time: int
    """When it was sent, in ns since 1970. PX4 tells us since boot, and msggen `age.now` of who carries a vehicle."""
    gid: bytes
    """Identifies the publisher. PX4 has one for all topics: its guid."""

    def pack(self) -> bytes:
        """Return the bytes on the wire."""
        return _ATTACHMENT.pack(self.sequence, self.time, GID_SIZE, self.gid)


def carrier_of(key: int) -> str:
    """Return the name of the node that carries a vehicle with a key (UXRCE_DDS_KEY) over the network."""
    return f"msggen_{key}"


def key_of_carried(node: str) -> int | None:
    """Return the key of the vehicle that a node carries, None for the node of another program."""
    found = _CARRIER.fullmatch(node)
    return int(found[1]) if found and int(found[1]) < 1 << 32 else None


def beat_of(zid: str, domain: int, namespace: str) -> str:
    """Return the key on which the program of a session tells all the time that it carries a vehicle.

    `**` of other programs does not match it, because of its `@`.
    """
    place = f"%{namespace}".replace("/", "%")
    return f"{BEATS}{zid}/{domain}/{place}"


def gid_of(token: str) -> bytes:
    """Return the gid of a publisher of msggen: from its token, so that its samples can be told from those of others."""
    return blake2b(token.encode(), digest_size=GID_SIZE).digest()


def parse_key(text: str) -> Key | None:
    """Return the parts of a key, None if it is not of the form."""
    found = _KEY.fullmatch(text) if len(text) <= _LONGEST else None
    if found is None or len(found[2]) >= _LONGEST_NAME:
        return None
    return Key(int(found[1]), f"/{found[2]}", _ros_type(found[3]), found[4])


def parse_token(text: str) -> Token | None:
    """Return the parts of a token, None if it is not of the form. One more part at its end is accepted."""
    found = _NODE.fullmatch(text) if len(text) <= _LONGEST else None
    if found is None:
        return None
    domain, zid, kind, node, rest = int(found[1]), found[2], cast("Kind", found[5]), found[8], found[9]
    if kind == "NN":
        is_whole = rest is None or re.fullmatch(_PART, rest) is not None
        return Token(domain, zid, kind, node) if is_whole else None
    topic = _TOPIC.fullmatch(rest or "")
    qos = parse_qos(topic[4]) if topic else None
    if topic is None or qos is None or len(topic[1]) > _LONGEST_NAME:
        return None
    key = Key(domain, topic[1].replace("%", "/"), _ros_type(topic[2]), topic[3])
    return Token(domain, zid, kind, node, key, qos)


def parse_qos(text: str) -> Qos | None:
    """Return the QoS of a token, such as `::,7:,:,:,,`, None if it is not of the form."""
    found = _QOS.fullmatch(text)
    if found is None:
        return None
    reliability, durability, history, depth = found.groups()
    return Qos(reliability != "2", durability == "1", history == "2", int(depth) if depth else Qos().depth)


def parse_attachment(data: bytes | None) -> Attachment | None:
    """Return the parts of an attachment, None if it is not of the form."""
    if data is None or len(data) != _ATTACHMENT.size:
        return None
    sequence, time, size, gid = _ATTACHMENT.unpack(data)
    return Attachment(sequence, time, gid) if size == GID_SIZE and sequence >= 0 and time >= 0 else None


def is_since_1970(time: int) -> bool:
    """Whether a time in ns can be one since 1970: all others tell times since boot, of less than 31 years."""
    return time >= _YEAR_2001


@lru_cache(maxsize=4096)
def place_in(name: str) -> tuple[str, Literal["in", "out"]] | None:
    """Return the namespace and the direction of a topic of PX4, None for the topic of another program.

    >>> place_in("/uav_1/fmu/out/wind")
    ('uav_1', 'out')
    """
    found = _FMU.fullmatch(name)
    return (found[1] or "", cast("Literal['in', 'out']", found[2])) if found else None


def reversed_id(zid: str) -> str:
    """Return the id of a session with its bytes in the other order. Zenoh leaves out zeros at the front."""
    return bytes.fromhex(zid.zfill(32))[::-1].hex()


def _ros_type(dds_type: str) -> str:
    package, kind, _, name = dds_type.split("::")
    return f"{package}/{kind}/{name[:-1]}"


def _dds_type(ros_type: str) -> str:
    package, kind, name = ros_type.split("/")
    return f"{package}::{kind}::dds_::{name}_"
