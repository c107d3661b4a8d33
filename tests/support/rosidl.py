"""rosidl's verdicts on definitions, of its adapter and its parser, in a process, because they replace sys.stdout.

Its C generator and a compiler follow in ROS 2. They refuse a comment of a message or a constant that contains the end
of a comment of C, and one of a field that continues on the next line (tests/vectors/rosidl_comments.json).
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

YES, NO, COMPILER = "yes", "no", "not its compiler"


def ask_rosidl(definitions: Sequence[tuple[str, str]]) -> list[str]:
    """Return for each message, given as name and text, whether rosidl reads it, and whether its C can be compiled."""
    for module in ("rosidl_adapter.msg", "rosidl_parser.parser"):
        pytest.importorskip(module, reason="rosidl has wheels for Linux on x86-64 only")
    with tempfile.TemporaryDirectory() as folder:
        asked, answered = Path(folder, "asked.json"), Path(folder, "answered.json")
        asked.write_text(json.dumps(definitions))
        command = [sys.executable, "-m", "support.rosidl", str(asked), str(answered)]
        nowhere = subprocess.DEVNULL
        subprocess.run(command, cwd=Path(__file__).parents[1], stdout=nowhere, stderr=nowhere, check=True)
        verdicts: list[str] = json.loads(answered.read_text())
    return verdicts


def _verdict(name: str, text: str, folder: Path) -> str:
    from rosidl_adapter.msg import convert_msg_to_idl  # type: ignore[import-not-found,unused-ignore]
    from rosidl_parser.definition import IdlLocator, Message  # type: ignore[import-not-found,unused-ignore]
    from rosidl_parser.parser import parse_idl_file  # type: ignore[import-not-found,unused-ignore]

    (folder / f"{name}.msg").write_text(text, encoding="utf-8")
    try:
        convert_msg_to_idl(folder, "px4_msgs", Path(f"{name}.msg"), folder / "idl")
        idl = parse_idl_file(IdlLocator(folder, Path("idl", f"{name}.idl")))
    except (Exception, SystemExit):  # noqa: BLE001 - rosidl raises any exception, and ends the program
        return NO
    (message,) = idl.content.get_elements_of_type(Message)
    return YES if _compiles(message) else COMPILER


def _compiles(message: Any) -> bool:
    constants = message.constants.values() if hasattr(message.constants, "values") else message.constants
    blocks = [line for each in (message.structure, *constants) for line in each.get_comment_lines()]
    lines = [line for member in message.structure.members for line in member.get_comment_lines()]
    return not any("*/" in line for line in blocks) and not any(line.rstrip().endswith("\\") for line in lines)


def _answer(asked: Path, answered: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        verdicts = [_verdict(name, text, Path(folder)) for name, text in json.loads(asked.read_text())]
    answered.write_text(json.dumps(verdicts))


if __name__ == "__main__":
    _answer(*map(Path, sys.argv[1:]))
