"""Tests of the embedded releases: they hold the facts of the firmware, in comments of our own.

`tests/vectors` has the results of the firmware's own tools; the firmware's definitions are read from `../shared` if it
exists.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from msggen.check.run import breaking, check
from msggen.cli import main
from msggen.cli.commands import releases
from msggen.definitions.identity import endpoints, uorb_topics
from msggen.definitions.model import Catalog, Comment, Conventions, Message
from msggen.definitions.tags import INHERITED
from msggen.definitions.unit import normalized_unit
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import ARCHIVED, EMBEDDED, LISTS, PREFIX, comments_in, embedded_tree
from msggen.sources.finding import Sources, find_sources, with_archived
from msggen.sources.inferred import with_inferred
from support import embed, facts
from support.catalogs import write_definitions
from support.examples import by_day
from support.identities import assert_same_endpoints, dds_of, rihs01_of, uorb_of
from support.repository import ROOT, VECTORS, shared

NEWEST, *EARLIER = EMBEDDED
ARCHIVING = [release for release in EMBEDDED if embedded_tree(release).names(ARCHIVED)]
"""The releases that keep earlier versions of messages."""

NEXT = re.sub(r"\d+$", lambda number: str(int(number[0]) + 1), NEWEST)
"""The release after the newest one."""

UNKNOWN = f"{EMBEDDED[0]}1"
"""A release that is not embedded, and whose name is near that of the newest one."""
SERVICES = {release: ["VehicleCommand"] for release in EMBEDDED} | {"v1.14": []}

every_release = pytest.mark.parametrize("release", EMBEDDED)


@cache
def sources_of(release: str) -> Sources:
    return find_sources(PREFIX + release)


@cache
def catalog_of(release: str) -> Catalog:
    return read_catalog(sources_of(release))


@cache
def measured(release: str) -> Any:
    """Return the measured values: messages by name, and endpoints, with named columns."""
    vectors = json.loads((VECTORS / f"{release}.json").read_text())
    columns = vectors["message_columns"]
    messages = {name: dict(zip(columns, row, strict=True)) for name, row in vectors["messages"].items()}
    endpoints = [dict(zip(vectors["endpoint_columns"], row, strict=True)) for row in vectors["endpoints"]]
    return messages, endpoints


def facts_of(release: str) -> dict[str, facts.Facts]:
    """Return the facts in the definitions of a release, read by a reader that shares no code with msggen."""
    files = [file for file in sources_of(release).messages if file.tree]
    return {file.stem: facts.facts_in(file.tree.read(file.name).decode(), file.stem) for file in files if file.tree}


# Facts


@pytest.mark.slow
@every_release
def test_messages_are_those_that_were_measured(release: str) -> None:
    catalog = catalog_of(release)
    uorb, hashes = uorb_of(catalog)["messages"], rihs01_of(catalog)
    found = {
        name: {
            "message_hash": each["message_hash"],
            "cdr_size": each["cdr_size"],
            "struct_size": each["struct_size_no_padding"],
            "queue_length": each["queue_length"],
            "type_hash": hashes[name],
            "orb_ids": each["orb_ids"],
        }
        for name, each in uorb.items()
    }
    expected = {
        name: {column: value for column, value in row.items() if column != "constants"}
        for name, row in measured(release)[0].items()
    }
    assert found == expected
    assert {name: each["topics"] for name, each in uorb.items()} == {
        name: list(row["orb_ids"]) for name, row in expected.items()
    }


@every_release
def test_constants_are_those_that_were_measured(release: str) -> None:
    known = {
        message.name: facts.Facts([], [(str(each.type), each.name, each.value) for each in message.constants], [])
        for message in catalog_of(release).messages.values()
    }
    found = {name: facts.constants_digest(known, name) for name in known}
    assert found == {name: row["constants"] for name, row in measured(release)[0].items()}


@every_release
def test_endpoints_are_those_that_were_measured(release: str) -> None:
    assert_same_endpoints(dds_of(catalog_of(release)), measured(release)[1])


@every_release
def test_services_are_those_of_the_release(release: str) -> None:
    assert [service.name for service in catalog_of(release).services] == SERVICES[release]


@pytest.mark.slow
@every_release
def test_a_second_reader_computes_what_was_measured(release: str) -> None:
    """The second reader replaces the firmware's tools where they were not run: v1.15, and the type hashes of v1.14."""
    messages, endpoints = measured(release)
    known, bridge = facts_of(release), sources_of(release).bridge
    assert bridge is not None
    assert bridge.tree is not None
    assert facts.messages(known) == messages
    computed = facts.endpoints(known, bridge.tree.read(bridge.name).decode(), release)
    assert computed == [{column: row[column] for column in computed[0]} for row in endpoints]


@every_release
def test_an_embedded_release_has_its_conventions(release: str) -> None:
    assert catalog_of(release).conventions.release == release


@pytest.mark.slow
@pytest.mark.parametrize("release", ARCHIVING)
def test_archived_versions_are_read(release: str) -> None:
    archived = read_catalog(with_archived(sources_of(release))).archived
    assert len(archived) == len(embedded_tree(release).names(ARCHIVED))


def test_conditional_messages_are_messages() -> None:
    listed = re.findall(r"(\w+)\.msg", (ROOT / "msg" / "CMakeLists.txt").read_text())
    assert len(listed) == 10
    assert set(listed) <= {message.name for message in catalog_of(NEWEST).messages.values()}


# Comments


def bridged(catalog: Catalog) -> Iterator[Message]:
    """Yield the messages that cross the bridge, and the messages nested in them."""
    names = {entry.message_name for entry in catalog.bridge}
    for message in [catalog.messages[f"px4_msgs/{name}"] for name in sorted(names)]:
        yield message
        yield from catalog.nested_all(message)


@every_release
def test_every_message_says_what_it_is_for(release: str) -> None:
    messages = catalog_of(release).messages.values()
    assert [message.name for message in messages if len(message.comment.split()) < 3] == []


@every_release
def test_every_field_that_crosses_the_bridge_says_what_it_means(release: str) -> None:
    silent = [
        f"{message.name}.{field.name}"
        for message in bridged(catalog_of(release))
        for field in message.fields
        if not field.comment.text
    ]
    assert silent == []


@every_release
def test_every_timestamp_is_in_microseconds(release: str) -> None:
    firsts = [message.fields[0] for message in catalog_of(release).messages.values()]
    assert {field.comment.unit for field in firsts if field.name == "timestamp"} == {"us"}


@every_release
def test_enum_tags_name_constants_of_their_message(release: str) -> None:
    lost = [
        f"{message.name}.{field.name}: {field.comment.tag('enum')}"
        for message in catalog_of(release).messages.values()
        for field in message.fields
        if field.comment.tag("enum")
        and not any(
            constant.name.startswith(tuple(field.comment.tag("enum").split())) for constant in message.constants
        )
    ]
    assert [each for each in lost if "VTE_FUSION_STATUS" not in each] == []  # PX4 does not define this enum either


# Comparison with the firmware's own definitions


@cache
def firmware(release: str) -> Catalog:
    sources = find_sources(str(shared(f"firmware/{release}")))
    return with_inferred(read_catalog(sources), sources)


@pytest.mark.slow
@every_release
def test_definitions_equal_the_firmware(release: str) -> None:
    def definitions(catalog: Catalog) -> dict[str, object]:
        return {
            key: (
                [(field.name, field.type) for field in message.fields],
                [(constant.name, constant.type, constant.value) for constant in message.constants],
                message.topic_names,
            )
            for key, message in catalog.messages.items()
        }

    assert definitions(catalog_of(release)) == definitions(firmware(release))


@every_release
def test_files_lie_where_the_firmware_keeps_them(release: str) -> None:
    root = shared(f"firmware/{release}")
    theirs = {str(path.relative_to(root)) for path in [*root.glob("msg/**/*.msg"), *root.glob("srv/**/*.srv")]}
    files = embed.files_of(embedded_tree(release))
    assert {path for name, (path, _) in files.items() if name not in LISTS} == theirs


@pytest.mark.parametrize("release", ARCHIVING)
def test_archived_versions_equal_the_firmware(release: str) -> None:
    root, tree = shared(f"firmware/{release}"), embedded_tree(release)
    for name in tree.names(ARCHIVED):
        path = ARCHIVED + name
        assert embed.lines_of(tree.read(path).decode()) == embed.lines_of((root / path).read_text()), path


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
"""Text in brackets at the front of a comment that is not a unit, or is a longer name of one."""

SPELLINGS = {"°C": "degC", "Gs": "Gauss", "(m/s)^2": "m^2/s^2"}
"""Units that two releases spell differently: the embedded releases share one comment."""


@every_release
def test_tags_are_those_of_the_firmware(release: str) -> None:
    """Each tag of the firmware is the same here; text that the firmware has in prose may be an additional tag here."""
    differing = [
        f"{message.name}.{theirs.name}: {tag} {expected!r}, found {ours.comment.tag(tag)!r}"
        for key, message in firmware(release).messages.items()
        for theirs, ours in zip(message.fields, catalog_of(release).messages[key].fields, strict=True)
        for tag, expected in tags(theirs.comment)
        if plain(ours.comment.tag(tag)) != plain(expected)
    ]
    assert differing == []


MISSPELT = {"FollowTargetEstimator.acc_est"}
"""Fields whose comment in the firmware gives another unit than the code: this acceleration is in m^2/s there."""


@pytest.mark.slow
@by_day("release", EMBEDDED, 4)
def test_nothing_differs_from_the_firmware_in_meaning(release: str) -> None:
    ours, theirs = sources_of(release), find_sources(str(shared(f"firmware/{release}")))
    for report in (check(ours, theirs), check(theirs, ours), breaking(ours, theirs)):
        found = {f"{each.change.subject}.{each.change.message.split(chr(39))[1]}" for each in report.findings}
        assert found == MISSPELT
        assert {each.rule.id for each in report.findings} == {"UNIT_CHANGED"}


@every_release
def test_units_in_sentences_of_the_firmware_are_those_of_the_embedded_definitions(release: str) -> None:
    """The firmware's comments were written without msggen, and ours without its reader of sentences."""
    read, differing = 0, set()
    for key, message in firmware(release).messages.items():
        for theirs, ours in zip(message.fields, catalog_of(release).messages[key].fields, strict=True):
            if theirs.comment.origin("unit") == "prose":
                read += 1
                if normalized_unit(theirs.comment.tag("unit")) != normalized_unit(ours.comment.unit):
                    differing.add(f"{message.name}.{theirs.name}")
    assert read > 450
    assert differing == MISSPELT


@every_release
def test_a_firmware_takes_its_tags_from_its_own_release(release: str) -> None:
    """Afterwards every field has the unit, the enum, the frame and the invalid value of the embedded definition."""
    origins = set()
    for key, message in firmware(release).messages.items():
        for theirs, ours in zip(message.fields, catalog_of(release).messages[key].fields, strict=True):
            for tag in INHERITED:
                origins.add(theirs.comment.origin(tag.name))
                known = theirs.comment.tag(tag.name)
                if f"{message.name}.{theirs.name}" not in MISSPELT:
                    assert known == ours.comment.tag(tag.name) or theirs.comment.origin(tag.name) in (
                        "tag",
                        "prose",
                        "name",
                    )
    assert origins <= {"", "tag", "prose", "name", f"embedded {release}"}
    assert f"embedded {release}" in origins


def tags(comment: Comment) -> Iterator[tuple[str, str]]:
    for tag, value in comment.attributes:
        if comment.origin(tag) == "tag" and not (tag == "unit" and value in SAID_DIFFERENTLY):
            yield tag, value


def plain(tag: str) -> str:
    return re.sub(r",\s*", ",", SPELLINGS.get(tag, tag))


@pytest.mark.slow
def test_no_sentence_is_the_firmware_s() -> None:
    """No comment of four words or more is the same in any message of any release."""

    def sentences(paths: Iterator[Path]) -> dict[str, str]:
        found = {}
        for path in paths:
            for line in path.read_text().splitlines():
                if "#" in line and not line.startswith("# TOPICS"):
                    words = re.findall(r"[a-z0-9]+", re.sub(r"\[[^\]]*\]", " ", line.split("#", 1)[1]).lower())
                    if len(words) >= 4 and set(words) != {"unused"}:
                        found[" ".join(words)] = f"{path.name}: {line}"
        return found

    ours = sentences(ROOT.glob("msg/**/*.msg")) | sentences(ROOT.glob("releases/*.msgs"))
    ours |= sentences(ROOT.glob("*_topics.yaml"))
    theirs = sentences(shared("firmware").glob("**/*.msg")) | sentences(shared("firmware").glob("**/*.yaml"))
    assert [ours[words] for words in ours.keys() & theirs.keys()] == []


# Storage


@pytest.mark.slow
def test_each_release_is_stored_as_what_differs_from_the_next() -> None:
    """`tests/support/embed.py` writes exactly the files in `releases/`, so running it does not change them."""
    newer = embed.files_of(embedded_tree(NEWEST))
    known: dict[str, list[str]] = {}
    for release in EARLIER:
        older = embed.files_of(embedded_tree(release))
        stored = (ROOT / "releases" / f"{release}.msgs").read_text()
        assert embed.earlier_release(release, older, newer, known) == stored
        newer = older


def test_a_new_release_is_embedded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fields that stay keep their comments; the previously newest release and all earlier ones read as before."""
    root = tmp_path / "embedded"
    before = {
        "msg/Rpm.msg": "# Speed of a rotor.\n\nuint64 timestamp  # [us] Time since boot.\n\n"
        "# Values\n\nfloat32 speed  # [rpm] Revolutions.\nuint8 kind  # Source.\nuint8 KIND_MOTOR = 1  # A motor.\n",
        "msg/Gone.msg": "# Nothing of use.\n\nuint64 timestamp  # [us] Time since boot.\n",
        "dds_topics.yaml": "# Topics.\npublications: []\n",
        "zenoh_topics.yaml": "# Topics.\npublications: []\n",
        "releases/v1.17.msgs": "# What.\n\n=== msg/Gone.msg\n\n=== msg/Rpm.msg\nuint64 timestamp\nfloat64 speed\n",
    }
    after = {
        "msg/versioned/Rpm.msg": "uint32 MESSAGE_VERSION=0 # x\nuint64 timestamp\nfloat32 speed # x\nbool   reverse\n"
        "uint8 KIND_MOTOR = 1\n# TOPICS rpm  rpms\n",
        "src/modules/uxrce_dds_client/dds_topics.yaml": "publications:\n"
        "  - {topic: /fmu/out/rpm, type: px4_msgs::msg::Rpm, rate_limit: 5.}\nsubscriptions:\n",
    }
    write_definitions(root, before)
    write_definitions(tmp_path / "firmware", after)
    monkeypatch.setattr(embed, "ROOT", root)
    monkeypatch.setattr("msggen.sources.embedded.embedded_root", lambda: str(root))
    monkeypatch.setattr("msggen.sources.embedded.EMBEDDED", (NEWEST, EARLIER[0]))
    monkeypatch.setattr(embed, "EMBEDDED", (NEWEST, EARLIER[0]))
    older = {release: embed.files_of(embedded_tree(release)) for release in (NEWEST, EARLIER[0])}

    found = embed.files_of_firmware(str(tmp_path / "firmware"), NEXT)
    missing = embed.uncommented(embed.store(embed.files_of(embedded_tree(NEWEST)), found, NEXT))

    monkeypatch.setattr("msggen.sources.embedded.EMBEDDED", (NEXT, NEWEST, EARLIER[0]))
    assert (root / "msg/versioned/Rpm.msg").read_text() == (
        "# Speed of a rotor.\n\nuint32 MESSAGE_VERSION = 0\nuint64 timestamp  # [us] Time since boot.\n\n"
        "# Values\n\nfloat32 speed  # [rpm] Revolutions.\nbool reverse\nuint8 KIND_MOTOR = 1  # A motor.\n"
        "# TOPICS rpm rpms\n"
    )
    assert missing == ["msg/versioned/Rpm.msg: uint32 MESSAGE_VERSION = 0", "msg/versioned/Rpm.msg: bool reverse"]
    assert not (root / "msg/Gone.msg").exists()
    bridge = (root / "dds_topics.yaml").read_text()
    entry = "  - topic: /fmu/out/rpm\n    type: px4_msgs::msg::Rpm\n    rate_limit: 5\n"
    assert bridge.endswith(f"publications:\n{entry}\nsubscriptions: []\n")
    for release, expected in older.items():
        found = embed.files_of(embedded_tree(release))
        assert {name: path for name, (path, _) in found.items()} == {name: path for name, (path, _) in expected.items()}
        for name in found.keys() - {*LISTS}:
            assert comments_in(found[name][1]) == comments_in(expected[name][1]), (release, name)
            assert embed.lines_of(found[name][1]) == embed.lines_of(expected[name][1]), (release, name)


@pytest.mark.parametrize("release", ["v1.16", "v1.15", "v1.14"])
def test_the_identities_of_a_release_are_written_as_they_were(release: str) -> None:
    """Those of later releases were measured, and have columns that the firmware's tools alone compute."""
    assert embed.vectors(embed.files_of(embedded_tree(release)), release) == (VECTORS / f"{release}.json").read_text()


@pytest.mark.night  # each run embeds a release in a smaller set
def test_a_release_is_added_by_embedding_it_alone(tmp_path: Path) -> None:
    """A copy of this checkout knows the next release, with a new message and another default, without another edit."""
    copy, tree = tmp_path / "copy", tmp_path / "PX4-Autopilot"
    for folder in ("msggen", "templates", "msg", "srv", "releases", "tests/support", "tests/vectors"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    client, zenoh = (tree / "src" / "modules" / name for name in ("uxrce_dds_client", "zenoh"))
    for name, place in zip(LISTS, (client, zenoh), strict=True):
        place.mkdir(parents=True)
        shutil.copy(ROOT / name, copy)
        shutil.copy(ROOT / name, place / embed.BRIDGE)
    for folder in ("msg", "srv"):
        shutil.copytree(ROOT / folder, tree / folder)
    (client / "dds_topics.h.em").write_text("#define UXRCE_DEFAULT_POLL_INTERVAL_MS 7\n['publish_interval_ms']")
    (client / "utilities.hpp").write_text("")
    (tree / "msg" / "Novelty.msg").write_text("uint64 timestamp\n")

    def run(*words: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(copy)}
        return subprocess.run(
            [sys.executable, *words], cwd=copy, env=environment, capture_output=True, text=True, check=False
        ).stdout

    missing = run("tests/support/embed.py", str(tree), NEXT).splitlines()
    assert [line for line in missing if "Novelty.msg:" in line] == [
        "msg/Novelty.msg: what the message is for",
        "msg/Novelty.msg: uint64 timestamp",
    ]
    assert [line for line in missing if not line.startswith(("msg/", "srv/"))] == [
        f"msggen/sources/conventions.py: a row, if {NEXT} changed {', '.join(Conventions._fields[1:])}",
        f"msggen/sources/conventions.py: a row for {NEXT} with {{'default_interval_ms': 7}}",
        "tests/vectors/cdr.json: the firmware's samples of Novelty.msg",
    ]
    heading, newest, second, *_ = run("-m", "msggen", "releases").splitlines()
    assert heading.split()[0] == "release"
    known = catalog_of(NEWEST)
    messages = len(known.messages)
    counts = [messages, len(known.services), len(uorb_topics(known)), len(endpoints(known))]
    assert second.split() == [NEWEST, *map(str, counts)]
    assert newest.split() == [
        NEXT,
        *(str(count + more) for count, more in zip(counts, (1, 0, 1, 0), strict=True)),
        "default",
    ]
    assert f"from the embedded PX4 {NEXT}: {messages + 1} messages" in run(
        "-m", "msggen", "build", "--px4", NEXT, "-o", "new"
    )
    assert f"the embedded PX4 {NEWEST}: {messages} messages" in run(
        "-m", "msggen", "build", "--px4", NEWEST, "-o", "old"
    )
    assert f"the embedded PX4 {NEXT} does not break the embedded PX4 {NEWEST}" in run(
        "-m", "msggen", "breaking", "--px4", NEXT, "--against", NEWEST
    )
    table = json.loads((copy / "msggen/messages/releases.json").read_text())
    assert list(table) == [NEXT, *EMBEDDED]
    assert table[NEXT].keys() == table[NEWEST].keys()
    lists = (ROOT / "msg/CMakeLists.txt").read_text()
    assert (copy / "msg/CMakeLists.txt").read_text().split("\n")[1] == lists.split("\n")[1]
    vectors = json.loads((copy / f"tests/vectors/{NEXT}.json").read_text())
    assert len(vectors["messages"]) == messages + 1


# Command line


Capture = pytest.CaptureFixture[str]


@pytest.mark.usefixtures("working_folder")
class TestNames:
    def test_a_release_is_built_by_its_name(self, capsys: Capture) -> None:
        assert main(["build", "--px4", "v1.14", "-o", "out"]) == 0
        assert "from the embedded PX4 v1.14: 184 messages, 0 services, 243 uORB topics, 26 e" in capsys.readouterr().out
        assert main(["build", "--px4", "embedded:v1.14", "-o", "out"]) == 0
        assert "up to date" in capsys.readouterr().out

    def test_archived_versions_come_along(self, capsys: Capture) -> None:
        assert main(["build", "--px4", "v1.16", "--archived", "-o", "out"]) == 0
        assert "226 messages, 1 archived version, 1 service" in capsys.readouterr().out
        assert main(["build", "--px4", "v1.15", "--archived", "-o", "out"]) == 2
        assert "S117 the embedded PX4 v1.15 has no archived versions" in capsys.readouterr().err

    def test_both_sides_of_a_check_are_named(self, capsys: Capture) -> None:
        assert main(["check", "v1.16", "embedded:v1.16"]) == 0
        assert capsys.readouterr().out == (
            "the embedded PX4 v1.16 matches the embedded PX4 v1.16: 226 messages, 1 service\n"
        )
        assert main(["sync", "-q", "--px4", "v1.15", "--create", "px4_msgs"]) == 0
        assert main(["check", "--px4", "v1.15", "px4_msgs"]) == 0
        assert "PX4 v1.15, embedded in msggen" in Path("px4_msgs/README.md").read_text()
        assert main(["check", "--px4", "v1.14", "px4_msgs", "--output-format", "concise"]) == 1
        assert "differs from the embedded PX4 v1.14" in capsys.readouterr().out

    def test_breaking_names_both_sides(self, capsys: Capture) -> None:
        assert main(["breaking", "--px4", "v1.17", "--against", "v1.16", "--output-format", "concise"]) == 1
        out = capsys.readouterr().out
        assert "v1.17:msg/versioned/BatteryStatus.msg:4:1: VERSION_NOT_ARCHIVED" in out
        assert "VERSION_NOT_TRANSLATED" not in out
        assert "TOPIC_RENAMED handled" in out
        assert "the embedded PX4 v1.17 breaks the embedded PX4 v1.16: " in out

    @pytest.mark.tools("git")
    def test_a_revision_of_that_name_wins(self, capsys: Capture) -> None:
        write_definitions(Path("fw"), {"msg/Wheel.msg": "uint64 timestamp\n", "src/modules/x": ""})
        who = ["-c", "user.name=Someone", "-c", "user.email=someone@example.org", "-c", "commit.gpgsign=false"]
        for command in (["init", "-q"], ["add", "-A"], [*who, "commit", "-q", "-m", "State."], ["branch", "v1.16"]):
            subprocess.run(["git", *command], cwd="fw", check=True)
        assert main(["breaking", "--px4", "fw", "--against", "v1.16"]) == 0
        out, err = capsys.readouterr()
        assert out == "fw does not break v1.16: 1 message, 0 services\n"
        assert err == (
            "--against: S120 note: 'v1.16': the revision of fw is read, not the embedded release 'embedded:v1.16'\n"
        )
        assert main(["breaking", "--px4", "fw", "--against", "v1.17", "--output-format", "concise"]) == 1
        assert "fw breaks the embedded PX4 v1.17" in capsys.readouterr().out

    def test_a_template_is_rendered_with_a_release(self, capsys: Capture) -> None:
        Path("one.txt.j2").write_text("{{ message.name }}")
        assert main(["render", "--template", "one.txt.j2", "--px4", "v1.16", "-o", "out"]) == 0
        assert "from the embedded PX4 v1.16: 226 messages" in capsys.readouterr().out

    def test_a_setting_names_a_release_from_a_folder_below(
        self, capsys: Capture, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        Path("pyproject.toml").write_text('[tool.msggen]\npx4 = "v1.15"\n')
        Path("below").mkdir()
        monkeypatch.chdir("below")
        assert main(["build", "--px4", "v1.14", "-o", "out"]) == 0
        assert main(["build", "-o", "out"]) == 0
        assert "from the embedded PX4 v1.15" in capsys.readouterr().out
        Path("../pyproject.toml").write_text('[tool.msggen]\npx4 = "v2.0"\n')
        assert main(["build", "-o", "out"]) == 2
        assert capsys.readouterr().err.startswith("../pyproject.toml:2:1: S105 'v2.0': neither a folder nor an emb")

    @by_day("name", ["v1.16", "v1.18"], 2)
    def test_a_folder_of_that_name_wins(self, name: str, capsys: Capture) -> None:
        Path(name, "msg").mkdir(parents=True)
        Path(name, "msg", "Wheel.msg").write_text("uint64 timestamp\n")
        assert main(["build", "--px4", name, "-o", "out"]) == 0
        out, err = capsys.readouterr()
        assert f"px4_types from {name}: 1 message" in out
        assert err == f"{name}: S120 note: this path is read, not the embedded release 'embedded:{name}'\n"
        assert main(["build", "--px4", f"embedded:{name}", "-o", "out"]) == 0
        assert f"from the embedded PX4 {name}" in capsys.readouterr().out

    def test_a_folder_without_definitions_is_not_passed_over(self, capsys: Capture) -> None:
        Path("v1.16").mkdir()
        assert main(["build", "--px4", "v1.16"]) == 2
        assert "v1.16: S102 " in (err := capsys.readouterr().err)
        assert "; the embedded release is 'embedded:v1.16'" in err

    @pytest.mark.parametrize(
        ("name", "told"),
        [
            (UNKNOWN, f"{UNKNOWN}: S105 neither a folder nor an embedded release, did you mean '{EMBEDDED[0]}'?"),
            ("v2.0", f"v2.0: S105 neither a folder nor an embedded release: expected {', '.join(EMBEDDED)}"),
            (
                f"embedded:{UNKNOWN}",
                f"embedded:{UNKNOWN}: S105 no such embedded release, did you mean '{EMBEDDED[0]}'?",
            ),
            ("embedded:", f"embedded:: S105 no such embedded release: expected {', '.join(EMBEDDED)}"),
        ],
    )
    @pytest.mark.parametrize(
        "command", [("build", "--px4"), ("check", "v1.18"), ("breaking", "--against", "v1.18", "--px4")]
    )
    def test_other_releases_are_errors(self, command: tuple[str, ...], name: str, told: str, capsys: Capture) -> None:
        assert main([*command, name]) == 2
        assert capsys.readouterr().err.splitlines()[0] == told

    def test_an_unknown_release_to_compare_with_is_an_error(self, capsys: Capture) -> None:
        assert main(["breaking", "--px4", "v1.18", "--against", UNKNOWN]) == 2
        nor = f"nor an embedded release, did you mean '{EMBEDDED[0]}'?"
        text = f"'{UNKNOWN}' is neither a folder, a revision of v1.18 {nor}"
        assert capsys.readouterr().err.splitlines()[0] == f"--against: S108 {text}"

    def test_a_release_that_is_given_rules_the_conventions(self, capsys: Capture) -> None:
        assert main(["build", "--px4", "v1.18", "--release", "v1.14", "-o", "out"]) == 0
        assert "DDS names of v1.14" in capsys.readouterr().out

    def test_releases_are_listed(self, capsys: Capture) -> None:
        assert main(["releases"]) == 0
        heading, *rows = capsys.readouterr().out.splitlines()
        assert heading.split() == ["release", "messages", "services", "topics", "endpoints"]
        for release, row in zip(EMBEDDED, rows, strict=True):
            messages, endpoints = measured(release)
            topics = sum(len(each["orb_ids"]) for each in messages.values())
            numbers = map(str, (len(messages), len(SERVICES[release]), topics, len(endpoints)))
            assert row.split() == [release, *numbers, *(["default"] if release == NEWEST else [])]


@pytest.mark.parametrize("release", EMBEDDED)
def test_the_listed_numbers_of_a_release_are_those_of_its_catalog(release: str) -> None:
    """`msggen releases` counts lines, and reads no definitions."""
    catalog = read_catalog(find_sources(PREFIX + release))
    topics = sum(len(message.topic_names) for message in catalog.uorb_messages)
    expected = len(catalog.uorb_messages), len(catalog.own_services), topics, len(catalog.bridge)
    assert releases.counts(release) == expected
