"""Representations of entities: captured ones, XML, references, and refusals."""

from __future__ import annotations

import contextlib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.xrce import entities, wire
from msggen.link.xrce.entities import Endpoint, Entity, Group, Participant, RefusedError, Replier, TopicEntity
from support import xrce_reference as reference
from support.xrce_captures import expected, sent

NUMBERS = st.integers(0, entities.LARGEST_NUMBER)
TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=40)
PARENTS = st.binary(min_size=2, max_size=2)


def creates(name: str) -> list[wire.Create]:
    """Return the CREATEs of a capture that are not in fragments."""
    parts = [part for data in sent(name, "client") for part in wire.submessages(data[4:])]
    return [wire.Create.unpack(part.payload, part.flags) for part in parts if part.id == wire.CREATE]


@pytest.mark.parametrize("name", ["session-udp", "session-namespace", "session-service"])
def test_captured_entities_equal_the_reference(name: str) -> None:
    for create in creates(name):
        entity = entities.parse(create)
        fields = reference.entity(create.request_id + create.object_id + create.representation)
        if isinstance(entity, Participant):
            assert fields["text"] == f"<dds><participant><rtps><name>{entity.name}</name></rtps></participant></dds>"
            assert fields["domain"] == entity.domain
            continue
        ours: dict[str, Any] = entity._asdict()
        assert {key: fields[key] for key in ours if key in fields} == {key: ours[key] for key in ours if key in fields}
        assert set(ours) - set(fields) == set()


def test_captured_entities_are_those_of_the_other_decoder() -> None:
    found = creates("session-udp")
    assert [create.object_id.hex() for create in found] == [entity["object_id"] for entity in expected()["entities"]]
    for create, other in zip(found, expected()["entities"], strict=True):
        entity = entities.parse(create)
        assert entities.object_number(create.object_id) == other["id"]
        if isinstance(entity, TopicEntity):
            assert entity[:2] == (other["name"], other["type"])


@pytest.mark.parametrize("name", ["session-udp", "session-namespace"])
def test_a_captured_entity_is_packed_with_the_same_bytes_but_padding(name: str) -> None:
    for create in creates(name):
        packed = entities.parse(create).pack()
        assert len(packed) == len(create.representation)
        different = [at for at, byte in enumerate(packed) if byte != create.representation[at]]
        assert all(packed[at] == 0 for at in different)
        assert len(different) <= 8
        assert entities.parse(create._replace(representation=packed)) == entities.parse(create)


ENTITIES: st.SearchStrategy[tuple[int, Entity]] = st.one_of(
    st.tuples(st.just(1), st.builds(Participant, TEXTS, st.integers(-(2**15), 2**15 - 1))),
    st.tuples(st.just(2), st.builds(TopicEntity, TEXTS, TEXTS, PARENTS)),
    st.tuples(st.just(3), st.builds(Group, st.just(3), PARENTS)),
    st.tuples(st.just(4), st.builds(Group, st.just(4), PARENTS)),
    st.tuples(st.just(5), st.builds(Endpoint, st.just(5), PARENTS, PARENTS, st.integers(0, 63), st.none())),
    st.tuples(st.just(6), st.builds(Endpoint, st.just(6), PARENTS, PARENTS, st.integers(0, 63), st.integers(0, 65535))),
    st.tuples(st.just(8), st.builds(Replier, TEXTS, TEXTS, TEXTS, TEXTS, TEXTS, PARENTS)),
)


@given(ENTITIES, NUMBERS)
def test_an_entity_returns_what_was_packed(case: tuple[int, Entity], number: int) -> None:
    kind, entity = case
    create = wire.Create(b"\0\1", entities.object_id(number, kind), entity.pack())
    assert entities.parse(create) == entity
    assert (entities.object_number(create.object_id), entities.object_kind(create.object_id)) == (number, kind)


def by_text(kind: int, form: int, text: str) -> wire.Create:
    data = text.encode() + b"\0"
    representation = bytes((kind, form, 0, 0)) + len(data).to_bytes(4, "little") + data
    return wire.Create(b"\0\1", entities.object_id(1, kind), representation + b"\0" * (len(data) % 2) + b"\0\x11")


def test_xml_is_read() -> None:
    topic = "<topic><kind>NO_KEY</kind><name>rt/a&amp;b</name><dataType>x::dds_::Y_</dataType></topic>"
    assert entities.parse(by_text(2, 2, f"<dds>{topic}</dds>"))[:2] == ("rt/a&b", "x::dds_::Y_")
    for kind, tag in ((5, "data_writer"), (6, "data_reader")):
        entity = entities.parse(by_text(kind, 2, f"<dds><{tag}>{topic}</{tag}></dds>"))
        assert isinstance(entity, Endpoint)
        assert entity.topic == ("rt/a&b", "x::dds_::Y_")
    assert isinstance(entities.parse(by_text(3, 2, "")), Group)


@pytest.mark.parametrize("create", [by_text(1, 1, "px4_participant"), by_text(1, 3, "\0")])
def test_a_participant_by_reference_or_in_binary_may_have_no_name(create: wire.Create) -> None:
    participant = entities.parse(create)
    assert isinstance(participant, Participant)
    assert participant.name == ""


def test_a_participant_in_binary_may_have_a_name() -> None:
    """The bytes of Micro XRCE-DDS Client 2.4.3."""
    payload = "000a001101030000210000000001000019000000" + b"uav_1/px4_micro_xrce_dds\0".hex() + "000000"
    create = wire.Create.unpack(bytes.fromhex(payload), wire.LITTLE_ENDIAN)
    assert entities.parse(create) == Participant("uav_1/px4_micro_xrce_dds")
    both = "0100000002000000610001000200000062000000"  # a domain named "a", and the name "b"
    parsed = entities.parse(create._replace(representation=bytes.fromhex("0103000012000000" + both)))
    assert parsed == Participant("b")


REPLIER_XML = (
    '<dds><replier profile_name="rp" service_name="vehicle_command" request_type="px4_msgs::srv::dds_::A_Request_" '
    'reply_type="px4_msgs::srv::dds_::A_Response_"><request_topic_name>rq/uav_1/fmu/aRequest</request_topic_name>'
    "<reply_topic_name>rr/uav_1/fmu/aReply</reply_topic_name></replier></dds>"
)


def test_a_replier_in_xml_is_read() -> None:
    types = "px4_msgs::srv::dds_::A_Request_", "px4_msgs::srv::dds_::A_Response_"
    replier = entities.parse(by_text(8, 2, REPLIER_XML))
    assert isinstance(replier, Replier)
    assert replier[:5] == ("vehicle_command", *types, "rq/uav_1/fmu/aRequest", "rr/uav_1/fmu/aReply")


@pytest.mark.parametrize("name", ["replier ", "service_name", "reply_type=", "<request_topic_name>", "</reply_"])
def test_a_replier_in_xml_needs_all_names(name: str) -> None:
    with pytest.raises(wire.WireError, match="XML without a name or a type"):
        entities.parse(by_text(8, 2, REPLIER_XML.replace(name, "", 1)))


@pytest.mark.parametrize("kind", [2, 5, 6, 8])
def test_other_entities_by_reference_are_refused(kind: int) -> None:
    with pytest.raises(RefusedError, match="entity by reference") as raised:
        entities.parse(by_text(kind, 1, "profile"))
    assert raised.value.status == wire.ERR_DDS_ERROR


@pytest.mark.parametrize(
    "text", ["", "<dds>", "<name>a</name>", "<rtps><name>a<b></name>", "<rtps><name>", "<topic><name>a</name></topic>"]
)
def test_xml_without_a_name_is_refused(text: str) -> None:
    with pytest.raises(wire.WireError, match="XML without a name or a type"):
        entities.parse(by_text(1, 2, text))


def test_a_kind_that_differs_from_the_object_id_is_refused() -> None:
    create = wire.Create(b"\0\1", entities.object_id(1, 3), Group(4, b"\0\x11").pack())
    with pytest.raises(wire.WireError, match="differs from its object id"):
        entities.parse(create)


@pytest.mark.parametrize("kind", [7, 9, 15])
def test_an_unknown_kind_in_binary_is_refused(kind: int) -> None:
    create = wire.Create(b"\0\1", entities.object_id(1, kind), Group(kind, b"\0\x11").pack())
    with pytest.raises(RefusedError):
        entities.parse(create)


@given(st.binary(max_size=80), st.integers(0, 15), st.integers(1, 3))
def test_any_bytes_are_an_entity_or_an_error(data: bytes, kind: int, form: int) -> None:
    create = wire.Create(b"\0\1", entities.object_id(1, kind), bytes((kind, form, 0, 0)) + data)
    with contextlib.suppress(wire.WireError, RefusedError):
        entities.parse(create)


def test_every_cut_of_a_captured_entity_is_an_error_or_shorter() -> None:
    for create in creates("session-service")[-6:]:
        for end in range(len(create.representation)):
            with pytest.raises(wire.WireError):
                entities.parse(create._replace(representation=create.representation[:end]))
