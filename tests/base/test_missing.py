"""Tests of the command that installs what is missing: from where this msggen is, into its own environment."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
import sysconfig
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from msggen.base import missing
from msggen.base.missing import installing
from support.repository import ROOT

GIT = {"vcs": "git", "commit_id": "0123abc"}
URL = "https://host/me/msggen"


def test_a_checkout_installs_from_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert installing("recordings", "pandas").endswith(f"pip install -e '{ROOT}[recordings]' pandas")
    monkeypatch.chdir(ROOT)
    assert installing("dds").endswith("pip install -e '.[dds]'")


@pytest.mark.parametrize(
    ("record", "expected"),
    [
        (None, "msggen[dds]"),
        ({"url": f"{URL}/a.whl", "archive_info": {}}, f"msggen[dds] @ {URL}/a.whl"),
        ({"url": URL, "vcs_info": GIT}, f"msggen[dds] @ git+{URL}@0123abc"),
        ({"url": URL, "vcs_info": {**GIT, "requested_revision": "main"}}, f"msggen[dds] @ git+{URL}@main"),
        ({"url": "file:///gone/msggen-0.1.0.whl", "archive_info": {}}, "msggen[dds]"),
        ({"url": "file://FOLDER/my%20clone", "dir_info": {}}, "FOLDER/my clone[dds]"),
    ],
)
def test_a_copy_installs_from_where_it_is_from(
    record: dict[str, Any] | None, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my clone").mkdir()
    installed = tmp_path / "msggen-0.1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Name: msggen\n")
    if record is not None:
        text = json.dumps(record).replace("FOLDER", tmp_path.as_posix())
        (installed / "direct_url.json").write_text(text)
    monkeypatch.setattr(metadata, "distribution", lambda _: metadata.PathDistribution(installed))
    monkeypatch.setattr(missing, "checkout", lambda: None)
    words = shlex.split(installing("dds"))
    assert words[1:] == ["install", expected.replace("FOLDER", str(tmp_path))]


def test_a_copy_without_metadata_installs_from_the_index(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", absent)
    monkeypatch.setattr(missing, "checkout", lambda: None)
    assert shlex.split(installing("dds"))[1:] == ["install", "msggen[dds]"]


@pytest.mark.skipif(sys.platform == "win32", reason="programs have a suffix")
def test_pip_is_that_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("own", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "pip").touch(0o755)
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path / "own"))
    own = str(tmp_path / "own" / "pip")
    for path, expected in ((["own", "other"], "pip"), (["other", "own"], own), ([], own)):
        monkeypatch.setenv("PATH", os.pathsep.join(str(tmp_path / name) for name in path))
        assert installing("dds").startswith(f"{expected} install ")
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))  # an environment without pip
    assert installing("dds").startswith("pip install ")


@pytest.mark.parametrize(
    ("files", "place", "expected"),
    [
        ({"pipx_metadata.json": "{}"}, "msggen", "pipx install --force 'msggen[dds]' --preinstall pandas"),
        ({"uv-receipt.toml": ""}, "msggen", "uv tool install 'msggen[dds]' --with pandas"),
        ({"pyvenv.cfg": "uv = 0.9\n"}, "archive-v0/xyz", "uvx --with pandas --from 'msggen[dds]' msggen"),
        ({"pyvenv.cfg": "home = /\nuv = 0.9\n"}, ".venv", "uv pip install --python PREFIX 'msggen[dds]' pandas"),
        ({"pyvenv.cfg": "home = /\nuv = 0.9\n", "scripts/pip": ""}, ".venv", "PIP install 'msggen[dds]' pandas"),
        ({"pyvenv.cfg": "home = /\n"}, ".venv", "pip install 'msggen[dds]' pandas"),
        ({}, ".venv", "pip install 'msggen[dds]' pandas"),
    ],
    ids=["pipx", "uv tool", "uvx", "uv venv", "uv venv --seed", "venv --without-pip", "a folder"],
)
def test_the_command_is_that_of_the_program_that_made_the_environment(
    files: dict[str, str], place: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prefix = tmp_path / place
    for name, text in files.items():
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        (prefix / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(sys, "prefix", str(prefix))
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(prefix / "scripts"))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(missing, "checkout", lambda: None)
    monkeypatch.setattr(missing, "_record", dict)
    shown = {"PREFIX": str(prefix), "PIP": str(prefix / "scripts" / "pip")}
    for name, path in shown.items():
        expected = expected.replace(name, shlex.quote(path))
    assert installing("dds", "pandas") == expected
    if place == ".venv" and expected.startswith("uv"):
        monkeypatch.setenv("VIRTUAL_ENV", str(prefix))
        assert installing("dds") == "uv pip install 'msggen[dds]'"


def test_no_other_module_writes_such_a_command() -> None:
    files = [path for path in (ROOT / "msggen").rglob("*") if path.suffix in (".py", ".yaml")]
    command = re.compile(r"pip install [^\n]*msggen\[")
    found = {path.name for path in files if command.search(path.read_text(encoding="utf-8"))}
    assert found == {"errors.yaml"}  # the example of L111, which the tests of these texts run
