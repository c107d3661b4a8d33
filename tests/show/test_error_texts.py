"""Tests of the texts about codes: each example is real, and the site and `msggen explain` show it."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from site_tables import with_tables

from msggen.base.diagnostics import CODES, Level
from msggen.cli import DONE, FAILED, main
from msggen.show.report.errors import error_texts
from support.examples import by_day
from support.repository import ROOT

TEXTS = error_texts()
STEP = re.compile(r"^\$ (.+)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
SUMMARY = re.compile(r"\d+ errors?(, nothing written)?")

needs_git = pytest.mark.skipif(not shutil.which("git"), reason="the example is in a git repository")


class Outcome(NamedTuple):
    """The exit code of a command, and the lines that it wrote to stderr except the summary."""

    code: int
    lines: list[str]


def run(command: str, capsys: pytest.CaptureFixture[str]) -> Outcome:
    """Run one command of an example: msggen in this process, any other in a shell."""
    if command.startswith("msggen "):
        capsys.readouterr()
        try:
            code = main(shlex.split(command)[1:])
        except SystemExit as error:  # argparse
            code = int(error.code or 0)
        told = capsys.readouterr().err
    else:
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, env=environment)
        code, told = done.returncode, done.stderr
    told = told.replace(str(Path.cwd()), "/home/me")
    told = re.sub(r"\S+ install -e '.*\[(\w+)\]'", r"pip install 'msggen[\1]'", told)  # as from the index
    return Outcome(code, [line for line in told.splitlines() if not SUMMARY.fullmatch(line)])


def play(example: str, folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> Outcome:
    """Create the files of an example and run its commands; return the outcome of the last one, run with `options`."""
    steps = STEP.findall(example)
    for command, shown in steps[:-1]:
        if command.startswith("cat "):
            target = folder / command.removeprefix("cat ")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(shown, encoding="utf-8")
        else:
            assert run(command, capsys) == (DONE, shown.splitlines())
    before = snapshot(folder)
    outcome = run(" ".join([steps[-1][0], *options]), capsys)
    if outcome.code == FAILED:
        assert snapshot(folder) == before
    return outcome


def snapshot(folder: Path) -> dict[str, bytes]:
    """Return the contents of all files except Python's caches."""
    paths = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def expected(example: str) -> list[str]:
    """Return the lines that an example shows for its last command."""
    return str(STEP.findall(example)[-1][1]).splitlines()


EXAMPLES = [
    pytest.param(
        code,
        id=code,
        marks=[needs_git] * ("git " in text.example) + [pytest.mark.night] * bool(place % 3),
    )
    for place, (code, text) in enumerate(TEXTS.items())
]
"""Two of three codes are for the night."""
WARNINGS = [code for code, level in CODES.items() if level is Level.WARNING]


def test_every_code_has_a_text_and_every_text_a_code() -> None:
    assert list(TEXTS) == list(CODES)


@pytest.mark.parametrize("code", EXAMPLES)
def test_the_example_prints_the_line_that_it_shows(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("msggen.sources.settings.is_own", lambda _: code != "C106")
    example, level = TEXTS[code].example, CODES[code]
    outcome = play(example, tmp_path, capsys)
    assert outcome.lines == expected(example)
    (line,) = outcome.lines
    word = "" if level is Level.ERROR else f"{level.value}: "
    assert re.match(rf"\S+: {code} {word}(?!warning|note)", line)
    assert outcome.code == (FAILED if level is Level.ERROR else DONE)


@by_day("code", WARNINGS, 2)
def test_strict_makes_an_error_of_a_warning(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    example = TEXTS[code].example
    assert play(example, tmp_path, capsys, "--strict") == (
        FAILED,
        [line.replace(" warning: ", " ") for line in expected(example)],
    )


@pytest.mark.parametrize("code", TEXTS)
def test_a_text_is_made_of_sentences_and_its_title_of_a_phrase(code: str) -> None:
    text = TEXTS[code]
    assert text.meaning.endswith(".")
    assert text.fix.endswith(".")
    assert text.fix[0].isupper()
    assert not text.title.endswith(".")


@pytest.mark.slow
@pytest.mark.parametrize("code", TEXTS)
def test_explain_prints_the_text(code: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", code.lower()]) == DONE
    printed = capsys.readouterr().out
    text = TEXTS[code]
    assert printed.startswith(f"{code} ({CODES[code].value}): {text.title}\n\n")
    assert all(f"    {line}\n" in printed for line in text.example.splitlines())
    words = re.sub(r"\]\([^)]+\)", "", f"{text.meaning} How to fix it: {text.fix}").replace("[", "").split()
    assert [word for word in words if word not in printed.replace("[", "")] == []


def test_the_page_of_the_site_has_an_entry_for_each_code() -> None:
    page = with_tables((ROOT / "docs" / "errors.md").read_text(encoding="utf-8"))
    for code, text in TEXTS.items():
        assert f"| [{code}](#{code.lower()}) | {CODES[code].value} | {text.title} |\n" in page
        entry = page.partition(f"\n### {code}\n")[2].partition("\n### ")[0]
        assert f"```console\n{text.example}```\n" in entry
        words = f"{text.meaning} {text.fix}".split()
        assert [word for word in words if word not in entry] == []
