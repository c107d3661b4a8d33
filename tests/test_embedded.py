"""The embedded set has the firmware's facts and our own words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import ROOT, shared

from msggen.firmware.catalog import read_catalog
from msggen.firmware.source import find_sources
from msggen.model import Catalog, Comment, Message

FIRMWARE = "firmware/v1.17"


def bridged(catalog: Catalog) -> Iterator[Message]:
    """Return the messages that cross the bridge, and what they nest."""
    names = {entry.message_name for entry in catalog.bridge}
    for message in [catalog.messages[f"px4_msgs/{name}"] for name in sorted(names)]:
        yield message
        yield from catalog.nested_all(message)


def test_it_has_all_messages_and_services_of_v1_17(embedded: Catalog) -> None:
    assert len(embedded.messages) == 235
    assert [service.name for service in embedded.services] == ["VehicleCommand"]
    assert len(embedded.bridge) == 66


def test_every_message_says_what_it_is_for(embedded: Catalog) -> None:
    assert [message.name for message in embedded.messages.values() if len(message.comment.split()) < 3] == []


def test_every_field_that_crosses_the_bridge_says_what_it_means(embedded: Catalog) -> None:
    silent = [
        f"{message.name}.{field.name}"
        for message in bridged(embedded)
        for field in message.fields
        if not field.comment.text
    ]
    assert silent == []


def test_every_timestamp_is_in_microseconds(embedded: Catalog) -> None:
    units = {
        message.fields[0].comment.unit
        for message in embedded.messages.values()
        if message.fields[0].name == "timestamp"
    }
    assert units == {"us"}


def test_enum_tags_name_constants_of_their_message(embedded: Catalog) -> None:
    lost = [
        f"{message.name}.{field.name}: {field.comment.enum}"
        for message in embedded.messages.values()
        for field in message.fields
        if field.comment.enum
        and not any(constant.name.startswith(tuple(field.comment.enum.split())) for constant in message.constants)
    ]
    assert lost == []


@pytest.fixture(scope="module")
def firmware() -> Catalog:
    return read_catalog(find_sources(str(shared(FIRMWARE))))


def test_constants_equal_the_firmware(embedded: Catalog, firmware: Catalog) -> None:
    def constants(catalog: Catalog) -> dict[str, list[object]]:
        return {
            key: [(c.name, c.type, c.value) for c in message.constants] for key, message in catalog.messages.items()
        }

    assert constants(embedded) == constants(firmware)


def test_files_lie_where_the_firmware_keeps_them() -> None:
    def names(root: Path) -> set[str]:
        found = {str(path.relative_to(root)) for path in [*root.glob("msg/**/*.msg"), *root.glob("srv/**/*.srv")]}
        return {name for name in found if "px4_msgs_old" not in name}

    assert names(ROOT) == names(shared(FIRMWARE))


def test_tags_are_those_of_the_firmware(embedded: Catalog, firmware: Catalog) -> None:
    """Where the firmware has a tag, it is the same here; where it has prose, there may be more."""
    differing = [
        f"{key}.{theirs.name}: {tag} {expected!r}, found {getattr(ours.comment, tag)!r}"
        for key, message in firmware.messages.items()
        for theirs, ours in zip(message.fields, embedded.messages[key].fields, strict=True)
        for tag, expected in tags(theirs.comment)
        if getattr(ours.comment, tag) != expected
    ]
    assert differing == []


SAID_DIFFERENTLY = {
    "microseconds": "us",
    "boolean": "",
    "bool": "",
    "0, 1": "",
    "-PI, PI": "",
    "0, 2PI": "",
    "enum": "",
    "FRD": "",
}
"""What stands in brackets at the front of a comment without being a unit, or with a shorter name."""


def tags(comment: Comment) -> Iterator[tuple[str, str]]:
    for tag in ("unit", "range", "enum", "invalid", "frame"):
        value = getattr(comment, tag)
        if value and not (tag == "unit" and value in SAID_DIFFERENTLY):
            yield tag, value


def test_no_sentence_is_the_firmware_s() -> None:
    """No comment of four words or more is the same, in any message."""

    def sentences(root: Path) -> dict[str, str]:
        found = {}
        for path in sorted(root.glob("msg/**/*.msg")):
            for line in path.read_text().splitlines():
                if "#" in line and not line.startswith("# TOPICS"):
                    words = re.findall(r"[a-z0-9]+", re.sub(r"\[[^\]]*\]", " ", line.split("#", 1)[1]).lower())
                    if len(words) >= 4 and set(words) != {"unused"}:
                        found[" ".join(words)] = f"{path.name}: {line}"
        return found

    ours, theirs = sentences(ROOT), sentences(shared(FIRMWARE))
    assert [ours[words] for words in ours.keys() & theirs.keys()] == []
