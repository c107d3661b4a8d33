"""Tests of `msggen mcp` as assistants start it: a process that speaks on its standard streams."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.cli import main
from msggen.sim import Options, Simulator
from support.assistant import text
from support.lazy import Lazy
from support.ports import free_port

mcp = Lazy("mcp")
COMMAND = str(Path(sys.executable).with_name("msggen"))
HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}},
}


def asked(words: list[str], calls: list[tuple[str, dict[str, Any]]]) -> list[Any]:
    """Return the answers of a process to some calls."""
    started = mcp.StdioServerParameters(command=COMMAND, args=["mcp", *words], env=dict(os.environ))

    async def called() -> list[Any]:
        async with mcp.Client(mcp.stdio_client(started)) as client:
            return [await client.call_tool(*each) for each in calls]

    return asyncio.run(called())


def test_a_process_answers_on_its_standard_streams(tmp_path: Path, px4_types: Any) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    calls: list[tuple[str, dict[str, Any]]] = [
        ("explain", {"name": "GPS_JAMMED"}),
        ("recordings", {}),
        ("doctor", {"topics": ["vehicle_stats"], "seconds": 1}),
        ("log_info", {"path": "/etc/passwd"}),
    ]
    with Simulator(px4_types, url, [Options(sync="short")]):
        explained, listed, found, refused = asked([str(tmp_path), "--link", url, "--direct"], calls)
    assert "Reported by log findings as a warning." in text(explained).replace("\n", " ")
    assert json.loads(text(listed)) == {"recordings": [], "has_more": False}
    assert [each["rule"] for each in json.loads(text(found))["findings"]] == ["TOPIC_UNKNOWN"]
    assert refused.is_error
    assert "Traceback" not in text(refused)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of other systems")
@pytest.mark.parametrize(
    ("ends", "code"), [pytest.param("eof", 0, marks=pytest.mark.night), ("signal", -signal.SIGINT)]
)
def test_a_process_ends_with_its_input_or_by_ctrl_c(ends: str, code: int) -> None:
    with subprocess.Popen(
        [COMMAND, "mcp"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as run:
        assert run.stdin
        assert run.stdout
        run.stdin.write(json.dumps(HELLO).encode() + b"\n")
        run.stdin.flush()
        assert json.loads(run.stdout.readline())["result"]["serverInfo"]["name"] == "msggen"
        if ends == "signal":
            run.send_signal(signal.SIGINT)
            assert run.wait(60) == code
        _, shown = run.communicate(timeout=60)
        assert run.returncode == code
        assert b"Traceback" not in shown


def test_a_folder_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mcp", "none"]) == 2
    assert capsys.readouterr().err.startswith("none: R102 cannot be read: there is no such folder")
