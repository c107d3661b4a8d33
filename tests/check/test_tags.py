"""Tests that the parser, the model, the views of `render`, the rules and `__msg__` follow the table of tags."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from msggen.check.compare.rules import RULES
from msggen.definitions.parse.comment import parse_comment
from msggen.definitions.tags import ATTRIBUTES, COMPARED, NAMES, TAGS
from msggen.generate.render.views import ConstantView, FieldView
from support.catalogs import write_definitions
from support.repository import ROOT

LAST_ROW = '    Tag("uncontrolled"'
NEW_ROW = '    Tag("since", "Release that brought the field.", "a field is said to be of another release"),\n'
SIDES = {
    f"{side}/msg/Rpm.msg": f"uint64 timestamp\nfloat32 rpm # [rpm] [@frame NED] [@since {release}] Speed.\n"
    for side, release in (("previous", "v1.18"), ("current", "v1.19"))
}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tool with one more row in the table, for `[@since ...]`."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("msggen", "templates", "releases", "msg", "srv"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "dds_topics.yaml", folder)
    table = folder / "msggen" / "definitions" / "tags.py"
    text = table.read_text(encoding="utf-8")
    assert text.count(LAST_ROW) == 1
    table.write_text(text.replace(LAST_ROW, NEW_ROW + LAST_ROW), encoding="utf-8")
    write_definitions(folder, SIDES)
    return folder


def run(checkout: Path, *arguments: str, status: int = 0) -> str:
    """Run Python with the copy of the tool; return its output."""
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=checkout,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(checkout)},
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_a_new_tag_is_read_without_a_warning_and_kept_by_the_model(checkout: Path) -> None:
    program = """
import sys
from msggen.definitions.parse.definition import parse_message
message, found = parse_message(open(sys.argv[1]).read(), sys.argv[1], "Rpm", "px4_msgs")
comment = message.fields[1].comment
print(found, comment.tag("since"), comment.tags, comment, sep=";")
"""
    assert run(checkout, "-c", program, "current/msg/Rpm.msg") == (
        "[];v1.19;(('frame', 'NED'), ('since', 'v1.19'));[rpm] [@frame NED] [@since v1.19] Speed.\n"
    )


@pytest.mark.slow
def test_a_template_knows_a_new_tag(checkout: Path) -> None:
    template = "{% for field in message.fields %}{{ field.name }}:{{ field.since }};{% endfor %}"
    (checkout / "since.txt.j2").write_text(template, encoding="utf-8")
    run(checkout, "-m", "msggen", "render", "--template", "since.txt.j2", "--msg-dir", "current/msg", "-o", "out")
    assert (checkout / "out" / "rpm.txt").read_text(encoding="utf-8").strip() == "timestamp:;rpm:v1.19;"


@pytest.mark.slow
def test_a_rule_compares_a_new_tag(checkout: Path) -> None:
    found = run(checkout, "-m", "msggen", "breaking", "--against", "previous", "--px4", "current", status=1)
    assert "current/msg/Rpm.msg:2:1: SINCE_CHANGED the since of 'rpm' is v1.19, but v1.18 in previous\n" in found
    assert "M107" not in found
    assert "SINCE_CHANGED" in run(checkout, "-m", "msggen", "rules")


@pytest.mark.slow
def test_the_description_of_a_field_has_a_new_tag(checkout: Path) -> None:
    run(checkout, "-m", "msggen", "build", "--msg-dir", "current/msg", "--output", "built", "-q")
    program = "from px4_types import Rpm; print(Rpm.__msg__.fields[1].since)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=checkout / "built", capture_output=True, text=True, check=False
    )
    assert done.stdout == "v1.19\n", done.stderr


def test_the_known_names_are_those_of_the_table_without_the_unit() -> None:
    assert tuple(tag.name for tag in TAGS if tag.name != "unit") == NAMES
    assert len({tag.name for tag in TAGS}) == len(TAGS)


def test_every_attribute_has_a_rule_in_the_order_of_ranks_and_a_name_in_templates() -> None:
    of_tags = [rule for rule in RULES if rule.category.name == "SEMANTIC"]
    assert [(rule.id, rule.purpose) for rule in of_tags] == [
        (f"{tag.name.upper()}_CHANGED", tag.purpose) for tag in COMPARED
    ]
    assert [tag.rank for tag in COMPARED] == sorted(tag.rank for tag in ATTRIBUTES)
    for tag in ATTRIBUTES:
        assert {tag.name} <= {*dir(FieldView)} & {*dir(ConstantView)}


def test_tags_are_listed_in_the_order_of_the_table_and_unknown_ones_behind() -> None:
    names = [*NAMES, "later", "another"]
    comment = parse_comment([" ".join(f"[@{name} {name}s]" for name in reversed(names))])
    assert [name for name, _ in comment.tags] == [*NAMES, "another", "later"]
    assert [comment.tag(name) for name in names] == [f"{name}s" for name in names]
