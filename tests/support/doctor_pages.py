"""Sessions on pages in which a simulated vehicle runs in the background, and a command looks at it."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from typing import NamedTuple

from msggen.cli import main
from support.ports import free_port
from support.repository import ROOT

DEFAULT = "udp://127.0.0.1:8888"
PACKAGE = str(ROOT / "generated" / "px4_types")
_SESSION = re.compile(r"```console\n\$ (msggen sim .*) &\n\$ (msggen .*)\n((?:.*\n)*?)```")
_DEFINITIONS = {"--px4", "--types"}


class Session(NamedTuple):
    """A simulated vehicle, a command, and what the page shows below it."""

    simulation: str
    command: str
    shown: str


def sessions(text: str) -> list[Session]:
    """Return the sessions of a page."""
    return [Session(*found) for found in _SESSION.findall(text)]


def plain(text: str, url: str = DEFAULT) -> str:
    """Return an output without the numbers that differ from run to run."""
    text = text.replace(url, DEFAULT)
    text = re.sub(r"(127\.0\.0\.1):(?!8888\b)\d+", r"\1:PORT", text)
    text = re.sub(r"\d+ times in [\d.]+ s", "N times in T s", text)
    text = re.sub(r"published '(\S+)' in [\d.]+ s", r"published '\1' in T s", text)
    return re.sub(r"\d+ samples in [\d.]+ s", "N samples in T s", text)


def run_session(session: Session) -> tuple[int, str]:
    """Run the command beside the vehicle, on a port of their own, and return its exit code and the link."""
    url = f"udp://127.0.0.1:{free_port()}"
    words = [*shlex.split(session.simulation)[1:], url]
    if not _DEFINITIONS & {*words}:
        words += ["--types", PACKAGE]  # which starts faster
    with subprocess.Popen(
        [sys.executable, "-m", "msggen", *words], env={**os.environ, "PYTHONPATH": str(ROOT)}
    ) as program:
        try:
            return main([*shlex.split(session.command)[1:], "--link", url]), url
        finally:
            program.kill()
