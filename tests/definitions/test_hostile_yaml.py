"""YAML that is legal, but that no dds_topics.yaml has: every command reads it in the same way, within bounds."""

from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from msggen.base.diagnostics import InputError
from msggen.cli import DONE, FAILED, main
from msggen.definitions.parse.bridge import parse_bridge
from msggen.definitions.parse.yaml_nodes import read_yaml, value_of
from support.examples import by_day, examples

ENTRY = "topic: /fmu/out/gripper, type: 'px4_msgs::msg::Gripper'"
VALUES = (
    "9" * 400,
    "9" * 5000,
    "-" + "9" * 400,
    "1.0e-320",
    "!!float ''",
    "!!int ''",
    "!!int '0b'",
    "!!bool maybe",
    "!!timestamp later",
    "!!timestamp 2001-99-99",
    "!!binary '%'",
    "1" + ":59" * 3000,
    "!!null x",
    "!!map x",
    "!other x",
    "{1: 2}",
    "[[1]]",
    "? [a]\n",
    "*a",
)
MERGES = "a0: &a0 {k0: 0}\n" + "".join(
    f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}], k{n}: 0}}\n" for n in range(1, 30)
)
LAUGHS = "a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 30))
CHAIN = "a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 5000))
DOCUMENTS = (MERGES, LAUGHS, CHAIN, "<<: 1", "&a {<<: *a}", "&a [*a]", "a: &a {<<: *a}", "? *a", "%YAML 9.9\n---\n")


KEYS = ("rate_limit", "instance", "options", "other", "topic", "'<<'", "<<")


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("msg").mkdir()
    Path("msg/Gripper.msg").write_text("uint64 timestamp\n")
    Path("dds_topics.h.em").write_text("@[for p in publications]@(p['topic'])@[end for]")
    Path("generate_dds_topics.py").write_text("")


@by_day(("value", "key"), [(value, key) for key in KEYS for value in VALUES], 3)
def test_no_value_is_a_trace(key: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("dds_topics.yaml").write_text(f"publications:\n- {{{ENTRY}, {key}: {value}}}\n")
    assert_told(capsys)


@pytest.mark.parametrize("text", DOCUMENTS)
def test_no_document_is_a_trace(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("dds_topics.yaml").write_text(text)
    assert_told(capsys)


def assert_told(capsys: pytest.CaptureFixture[str]) -> None:
    for command in (
        ["build", "--px4", "."],
        ["px4-generate", "-y", "dds_topics.yaml", "-t", "dds_topics.h.em", "-u", "o"],
    ):
        code = main(command)
        said = capsys.readouterr().err
        assert code in (DONE, FAILED)
        assert code == DONE or "dds_topics.yaml:" in said, said


@pytest.mark.parametrize("text", [MERGES, LAUGHS])
def test_merges_and_aliases_are_bounded(text: str) -> None:
    found = parse_bridge(text.encode(), "a.yaml").found
    assert [each.code for each in found][-1:] == ["Y101"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [("a: &a [{}]\nb: *a\n", "aliases that stand for too much"), ("b: {{<<: {{{}}}}}\n", "merges of too many keys")],
)
def test_the_bounds_are_exact(text: str, problem: str) -> None:
    """An alias of a list of n values stands for n + 1 nodes."""
    is_alias = "*" in text
    for count, is_refused in ((10_000, False), (10_001, True)):
        parts = ["1"] * (count - 1) if is_alias else [f"k{number}: 1" for number in range(count)]
        document = text.format(", ".join(parts)).encode()
        if is_refused:
            with pytest.raises(InputError, match=f"{problem}: more than 10000"):
                read_yaml(document, "a.yaml")
        else:
            assert read_yaml(document, "a.yaml") is not None


@pytest.mark.parametrize("value", ["9" * 400, "1.0e-320", "!!float ''"])
def test_a_rate_that_no_number_has_is_an_error_with_its_place(value: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("dds_topics.yaml").write_text(f"publications:\n- {{{ENTRY}, rate_limit: {value}}}\n")
    assert main(["px4-generate", "-y", "dds_topics.yaml", "-t", "dds_topics.h.em", "-u", "o"]) == FAILED
    assert "dds_topics.yaml:2:" in capsys.readouterr().err


scalars = st.sampled_from(
    ["a", "1", "0x1f", "1.5", "true", "off", "~", "2001-01-01", "'x'", ".inf", "1_000", "12:30:45"]
)
keys = st.sampled_from(["a", "b", "c", "d"])
flow = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]")
        | st.dictionaries(keys, inner, max_size=3).map(lambda pairs: f"{{{', '.join(map(': '.join, pairs.items()))}}}")
    ),
    max_leaves=8,
)


@settings(
    max_examples=examples(100, by_day=15), suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(
    st.lists(st.dictionaries(keys, flow, max_size=3), min_size=1, max_size=4),
    st.lists(st.integers(0, 3), max_size=3),
)
def test_values_merges_and_aliases_are_those_of_pyyaml(anchored: list[dict[str, str]], merged: list[int]) -> None:
    lines = [f"m{n}: &m{n} {{{', '.join(map(': '.join, pairs.items()))}}}" for n, pairs in enumerate(anchored)]
    known = [f"*m{n}" for n in merged if n < len(anchored)]
    text = "\n".join([*lines, f"all: {{<<: [{', '.join(known)}], a: own, again: *m0}}"])
    root = read_yaml(text.encode(), "a.yaml")
    assert root is not None
    assert value_of(root) == yaml.safe_load(text)


def test_an_error_names_its_place() -> None:
    with pytest.raises(InputError) as caught:
        read_yaml(b"a: 1\nb: {<<: 1}\n", "a.yaml")
    assert str(caught.value) == "a.yaml:2:9: Y101 not YAML: expected a mapping to merge"
