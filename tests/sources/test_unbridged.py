"""Tests of the note about messages of one's own that do not cross the bridge."""

from __future__ import annotations

from pathlib import Path

import pytest

from msggen.base.diagnostics import Diagnostic
from msggen.base.location import Location
from msggen.cli import DONE, main
from msggen.sources.bridged import unbridged
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

STAMP = "uint64 timestamp\n"
YAML = "publications:\n- topic: /fmu/out/{}\n  type: px4_msgs::msg::{}\n"
TREE = {"fw/msg/Winch.msg": STAMP, "fw/msg/Reel.msg": STAMP, "fw/msg/Rpm.msg": STAMP, "fw/src/modules/x": ""}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, "no topic of Reel, Winch crosses the bridge"),
        ({"fw/msg/Winch.msg": f"{STAMP}Reel reel\n"}, "no topic of Winch crosses the bridge"),
        ({"fw/msg/Rpm.msg": f"{STAMP}Reel reel\nWinch winch\n"}, ""),
        ({"yaml": YAML.format("winch", "Winch")}, "no topic of Reel crosses the bridge"),
        ({"yaml": ""}, ""),
    ],
)
def test_messages_of_ones_own_without_a_topic_are_noted(
    changes: dict[str, str], told: str, working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {**TREE, **changes}
    yaml = files.pop("yaml", YAML.format("rpm", "Rpm"))
    place = "fw/src/modules/uxrce_dds_client/dds_topics.yaml"
    write_definitions(working_folder, {**files, place: yaml} if yaml else files)
    assert main(["build", "--px4", "fw"]) == DONE
    err = capsys.readouterr().err
    assert f"{place}: Y206 note: {told}" in err if told else "Y206" not in err
    assert main(["build", "--px4", "fw"]) == DONE
    assert "Y206" not in capsys.readouterr().err, "a build that changes nothing says nothing"


def test_a_firmware_that_is_newer_than_the_releases_has_messages_that_are_not_ones_own(working_folder: Path) -> None:
    write_definitions(working_folder, {**TREE, "fw/dds_topics.yaml": YAML.format("rpm", "Rpm")})
    catalog = read_catalog(find_sources("fw", topics="fw/dds_topics.yaml"))
    assert [note.code for note in unbridged(catalog)] == ["Y206"]
    newer = Diagnostic(Location("fw", 0), "S119", "newer than PX4 v1.18")
    assert [*unbridged(catalog._replace(notices=(newer,)))] == []


def test_the_releases_of_px4_have_none_of_ones_own(capsys: pytest.CaptureFixture[str], working_folder: Path) -> None:
    for release in ("v1.14", "v1.18"):
        assert main(["build", "--px4", release, "-o", str(working_folder)]) == DONE
    assert "Y206" not in capsys.readouterr().err
