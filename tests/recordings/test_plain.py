"""Tests of the comparison of definitions by their lines: equal if and only if the parsed definitions are."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from random import Random

import pytest

from msggen import recordings
from msggen.recordings.decode.schemas import content_of, definitions_in, key_of, read_schema
from msggen.recordings.definitions.release import plain_content
from msggen.recordings.source.source import SchemaError
from msggen.sources import released
from msggen.sources.embedded import EMBEDDED, all_releases
from support.examples import by_day
from support.log_files import Written, definition_in, write_log

NAMES = sorted(
    name.removesuffix(".msg")
    for name in all_releases().names(EMBEDDED[-1])
    if name.endswith(".msg") and "V" not in name
)


def plain(ros_type: str, definition: str) -> frozenset[object] | None:
    texts = definitions_in(ros_type, definition)
    return plain_content(lambda key: texts.get(key, ""), key_of(ros_type))


def parsed(ros_type: str, definition: str) -> frozenset[object] | None:
    try:
        schema = read_schema(ros_type, definition)
    except SchemaError:
        return None
    return content_of(schema.catalog, schema.message)


def definitions_of(name: str) -> list[str]:
    return [definition_in(each, name) for each in EMBEDDED if all_releases().stored(each, f"{name}.msg")[1]]


@by_day("release", EMBEDDED, 4)
def test_the_definitions_of_a_release_need_no_parser(release: str) -> None:
    for name in NAMES:
        if all_releases().stored(release, f"{name}.msg")[1]:
            assert plain(f"px4_msgs/msg/{name}", definition_in(release, name)) is not None, name


@by_day("part", range(3), 3)
def test_releases_differ_by_their_lines_as_by_the_parser(part: int) -> None:
    for name in NAMES[part::3]:
        ros_type = f"px4_msgs/msg/{name}"
        for one, other in combinations(definitions_of(name), 2):
            same = parsed(ros_type, one) == parsed(ros_type, other)
            assert (plain(ros_type, one) == plain(ros_type, other)) is same, name


@pytest.mark.parametrize("seed", range(40))
def test_changed_definitions_are_equal_only_if_the_parser_says_so(seed: int) -> None:
    random = Random(seed)  # noqa: S311 - no secret
    name = random.choice(NAMES)
    ros_type, definition = f"px4_msgs/msg/{name}", random.choice(definitions_of(name))
    own = parsed(ros_type, definition)
    for _ in range(40):
        lines = definition.split("\n")
        place = random.randrange(len(lines))
        line = lines[place]
        lines[place : place + 1] = random.choice(
            [
                [],
                [line, line],
                [line, "uint8 added"],
                [line.replace("uint8", "char")],
                [line.replace("float32", "float64")],
                [line.replace("[", "[0")],
                [line.replace("[", "[<=")],
                [line.replace(" ", "\t  ") + " # note"],
                [line.replace(" ", " a", 1)],
                [f"{line}[3]"],
                [f"{line} = 3"],
                ["uint8 LAST = 3", line],
                ['string TEXT = "# uint8 x"', line],
                ["string<=8 text", line],
                [f"{name} itself", line],
                ["Absent nested", line],
            ]
        )
        changed = "\n".join(lines)
        content, expected = plain(ros_type, changed), parsed(ros_type, changed)
        if content is not None and expected is not None:
            assert (content == plain(ros_type, definition)) is (expected == own), changed


@pytest.mark.parametrize(
    "definition",
    [
        "",
        "uint8",
        "uint8 x 3",
        "uint8[<=3] x",
        "uint8 x\nuint8 x",
        "string<=3 x",
        "uint8[0] x",
        "uint8 é",
        "A a",
        "Own a",
    ],
)
def test_what_needs_a_parser_has_no_plain_content(definition: str) -> None:
    assert plain("px4_msgs/msg/Own", definition) is None


@pytest.mark.parametrize("levels", [40, 5000])
def test_messages_that_nest_others_twice_are_read_once_or_left_to_the_parser(levels: int) -> None:
    parts = [f"M{number} a\nM{number} b\n{'=' * 80}\nMSG: x/M{number}\n" for number in range(1, levels)]
    assert (plain("x/msg/M0", "".join([*parts, "uint8 x\n"])) is None) is (levels > 40)


def test_a_log_without_a_version_is_compared_without_a_parser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [name for name in NAMES if all_releases().stored("v1.16", f"{name}.msg")[1]]
    written = [Written(f"/{name}", f"px4_msgs/msg/{name}", definition_in("v1.16", name)) for name in names]
    path = write_log(tmp_path / "flight.mcap", written)

    def parse(*_: object, **__: object) -> None:
        raise AssertionError("a definition was parsed")

    monkeypatch.setattr(released, "_parsed", parse)
    with recordings.open(path) as log:
        found = log.release()
    assert (found.releases, len(found.messages), found.differing) == (("v1.16",), len(names), ())
