"""Tests of keys, tokens, QoS and attachments: the rules of docs/zenoh.md, each with a test."""

from __future__ import annotations

import pytest

from msggen.link.rmw_zenoh.names import (
    NO_HASH,
    Attachment,
    Key,
    Qos,
    Token,
    parse_attachment,
    parse_key,
    parse_qos,
    parse_token,
    place_in,
    reversed_id,
)

HASH = "RIHS01_" + "573d6f1a6c3fafbced3ec730dc37f16e96ff0596b64cc651515b31b4b3507c6f"
STATUS = Key(0, "/fmu/out/vehicle_status", "px4_msgs/msg/VehicleStatus", HASH)
STATUS_KEY = f"0/fmu/out/vehicle_status/px4_msgs::msg::dds_::VehicleStatus_/{HASH}"
ZID, NODE = "0f" * 16, "px4_" + "0002" + "00" * 14
PX4_TOKEN = (
    f"@ros2_lv/0/{ZID}/0/11/MP/%/%/{NODE}/"
    f"%fmu%out%vehicle_status/px4_msgs::msg::dds_::VehicleStatus_/{HASH}/::,7:,:,:,,"
)


def test_a_key_has_domain_name_type_and_hash() -> None:
    assert parse_key(STATUS_KEY) == STATUS
    assert str(STATUS) == STATUS_KEY


def test_a_key_has_the_namespace_in_the_name() -> None:
    found = parse_key(STATUS_KEY.replace("0/fmu", "42/a/uav_1/fmu", 1))
    assert found is not None
    assert (found.domain, found.name) == (42, "/a/uav_1/fmu/out/vehicle_status")
    assert place_in(found.name) == ("a/uav_1", "out")


def test_a_key_without_hashes_says_so() -> None:
    found = parse_key(STATUS_KEY.replace(HASH, NO_HASH))
    assert found == STATUS._replace(type_hash="TypeHashNotSupported")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "fmu/out/vehicle_status",  # PX4 v1.16
        "rt/fmu/out/vehicle_status",  # PX4 v1.15, and DDS
        STATUS_KEY.replace("0/", "/", 1),
        STATUS_KEY.replace("0/", "-1/", 1),
        STATUS_KEY.replace("0/", f"{'9' * 10}/", 1),
        STATUS_KEY.replace("fmu/", "fmu//"),
        STATUS_KEY.replace("status", "sta tus"),
        STATUS_KEY.replace("vehicle_status", "*"),
        STATUS_KEY.replace("vehicle_status", "\x1b[2J"),
        STATUS_KEY.replace("vehicle_status", "v" * 250),
        STATUS_KEY.replace("dds_::", ""),
        STATUS_KEY[:-1],
        STATUS_KEY + "0",
        STATUS_KEY + "/x",
        STATUS_KEY[:-1] + "G",
        STATUS_KEY.upper(),
        STATUS_KEY + "\n",
        "0/" + "a/" * 100_000,
    ],
)
def test_other_keys_are_refused(text: str) -> None:
    assert parse_key(text) is None


def test_a_token_of_px4_is_read_and_written() -> None:
    token = Token(0, ZID, "MP", NODE, STATUS, Qos(depth=7))
    assert parse_token(PX4_TOKEN) == token
    assert str(token) == PX4_TOKEN


def test_a_token_of_a_node_has_no_topic() -> None:
    text = f"@ros2_lv/0/{ZID}/0/0/NN/%/%/{NODE}"
    assert parse_token(text) == Token(0, ZID, "NN", NODE)
    assert str(Token(0, ZID, "NN", NODE)) == text


@pytest.mark.parametrize("kind", ["MP", "MS", "SS", "SC"])
def test_a_token_tells_the_kind(kind: str) -> None:
    found = parse_token(PX4_TOKEN.replace("/MP/", f"/{kind}/"))
    assert found is not None
    assert found.kind == kind


def test_a_token_of_rmw_zenoh_has_ids_enclave_namespace_and_a_short_session_id() -> None:
    text = PX4_TOKEN.replace(ZID, "a3b1").replace("/0/11/", "/7/12/").replace("/%/%/", "/%enclave/%robot_1/")
    found = parse_token(text)
    assert found is not None
    assert (found.zid, found.key) == ("a3b1", STATUS)


@pytest.mark.parametrize("text", [PX4_TOKEN, f"@ros2_lv/0/{ZID}/0/0/NN/%/%/{NODE}"])
def test_a_token_may_have_one_more_part_at_its_end(text: str) -> None:
    assert parse_token(f"{text}/more") == parse_token(text)
    assert parse_token(f"{text}/more/more") is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        "@ros2_lv",
        PX4_TOKEN.replace("@ros2_lv", "ros2_lv"),
        PX4_TOKEN.replace("/MP/", "/XX/"),
        PX4_TOKEN.replace("/MP/", "/NN/"),
        PX4_TOKEN.replace("%fmu", "fmu"),
        PX4_TOKEN.replace("%fmu", "%%fmu"),
        PX4_TOKEN.replace(ZID, "xyz"),
        PX4_TOKEN.replace(ZID, "0" * 33),
        PX4_TOKEN.replace("vehicle_status", "v" * 250),
        PX4_TOKEN.replace("::,7:,:,:,,", "::,x:,:,:,,"),
        PX4_TOKEN.replace("/::,7:,:,:,,", ""),
        PX4_TOKEN.replace(NODE, "\x1b[2J"),
        "@ros2_lv/" + "%/" * 100_000,
    ],
)
def test_other_tokens_are_refused(text: str) -> None:
    assert parse_token(text) is None


@pytest.mark.parametrize(
    ("text", "qos"),
    [
        ("::,7:,:,:,,", Qos(depth=7)),
        ("::,:,:,:,,", Qos()),
        ("2::,5:,:,:,,", Qos(is_reliable=False, depth=5)),
        (":1:,1:,:,:,,", Qos(is_transient_local=True, depth=1)),
        ("::2,:,:,:,,", Qos(keeps_all=True)),
    ],
)
def test_qos_tells_what_is_not_the_default(text: str, qos: Qos) -> None:
    assert parse_qos(text) == qos
    assert str(qos) == text


def test_deadline_lifespan_and_liveliness_are_accepted() -> None:
    assert parse_qos("1:2:1,10:1,0:2,500:1,3,4") == Qos(depth=10)


@pytest.mark.parametrize("text", ["", ":", "::,7", "9::,:,:,:,,", "::,7:,:,:,,,", "::,-1:,:,:,,"])
def test_other_qos_is_refused(text: str) -> None:
    assert parse_qos(text) is None


def test_an_attachment_has_33_bytes() -> None:
    attachment = Attachment(3, 1_000_000, bytes(range(16)))
    assert attachment.pack().hex() == "0300000000000000" + "40420f0000000000" + "10" + bytes(range(16)).hex()
    assert parse_attachment(attachment.pack()) == attachment


@pytest.mark.parametrize(
    "data",
    [
        None,
        b"",
        bytes(33),  # no 16 before the gid
        Attachment(1, 1, bytes(16)).pack()[:-1],
        Attachment(1, 1, bytes(16)).pack() + b"\0",
        Attachment(-1, 1, bytes(16)).pack(),
        Attachment(1, -1, bytes(16)).pack(),
    ],
)
def test_other_attachments_are_refused(data: bytes | None) -> None:
    assert parse_attachment(data) is None


def test_the_bytes_of_an_id_are_reversed() -> None:
    assert reversed_id("0102" + "00" * 14) == "00" * 14 + "0201"
    assert reversed_id("77c0") == "c077" + "00" * 14  # Zenoh leaves out zeros at the front
    assert reversed_id(reversed_id(ZID)) == ZID


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("/fmu/out/wind", ("", "out")),
        ("/uav_1/fmu/in/x", ("uav_1", "in")),
        ("/chatter", None),
        ("/fmu/out", None),
        ("/fmu/out/a/b", None),
        ("/xfmu/out/a", None),
    ],
)
def test_the_name_tells_whose_topic_it_is(name: str, place: object) -> None:
    assert place_in(name) == place
