"""Tests that Neovim, without a plugin, changes and bumps a message by what `msggen lsp` offers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from msggen.cli import main
from support.firmware_trees import write_tree
from support.packages import committed

PROGRAM = Path(__file__).parent / "hour.lua"
ALL = "msg/translation_node/translations/all_translations.h"
SAID = """\
hover: **nav_state** `uint8` of VehicleStatus
problem: 4 VERSION_NOT_RAISED 'VehicleStatus' changed: expected MESSAGE_VERSION = 5, found 4, 1 topic
problem: {last} FIELD_ADDED 'uint8 added' at byte 83 is not in HEAD, 1 topic, silent for new readers
action: msggen bump VehicleStatus
line: uint32 MESSAGE_VERSION = 5
"""


@pytest.mark.slow
@pytest.mark.tools("nvim", "git")
def test_a_message_gets_its_next_version_in_neovim(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tree = write_tree(tmp_path / "px4", "v1.18", {ALL: "#pragma once\n\n#include <translation_util.h>\n"})
    (tree / "msg/px4_msgs_old/msg").mkdir(parents=True)
    committed(tree)
    last = (tree / "msg/versioned/VehicleStatus.msg").read_text().count("\n") + 1
    command = ["nvim", "--headless", "-u", "NONE", "-n", "-c", f"luafile {PROGRAM}"]
    places = {
        "TREE": str(tree),
        "PYTHON": sys.executable,
        "XDG_STATE_HOME": str(tmp_path),
        "XDG_DATA_HOME": str(tmp_path),
    }
    done = subprocess.run(
        command, env={**os.environ, **places}, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.stdout == SAID.format(last=last), done.stderr
    assert main(["bump", "VehicleStatus", "--px4", str(tree), "--check"]) == 0, capsys.readouterr()
    assert main(["build", "--px4", str(tree), "--archived", "-q", "-o", str(tmp_path / "made")]) == 0
