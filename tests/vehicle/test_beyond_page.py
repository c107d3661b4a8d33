"""Tests of what docs/links.md says needs MAVLink: the output of its command, and what the bridge lacks."""

from __future__ import annotations

import shlex
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.cli import main
from support.repository import ROOT

if TYPE_CHECKING:
    import pytest

PAGE = (ROOT / "docs" / "links.md").read_text(encoding="utf-8").partition("\n## What needs MAVLink\n")[2]


def test_the_command_prints_what_the_page_shows(capsys: pytest.CaptureFixture[str]) -> None:
    command, _, shown = PAGE.partition("```console\n$ ")[2].partition("```")[0].partition("\n")
    assert main(shlex.split(command)[1:]) == 0
    assert capsys.readouterr().out == shown


def test_the_bridge_has_no_parameters_no_mission_items_and_no_files(px4_types: ModuleType) -> None:
    names = {endpoint.message_name for endpoint in px4_types.topics.ENDPOINTS}
    assert not {name for name in names if name.startswith(("Parameter", "Mission", "Ulog", "LogMessage"))}
