"""Tests that a link is joined from another computer: through ssh, which forwards its socket."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from msggen.sim import Options, Simulator
from support.ports import free_port
from support.repository import ROOT
from support.served import end_owners

PATIENCE = 20.0
SSHD = shutil.which("sshd", path=f"{os.environ.get('PATH', '')}:/usr/sbin")

pytestmark = [
    pytest.mark.night,
    pytest.mark.tools("ssh", "ssh-keygen"),
    pytest.mark.skipif(SSHD is None, reason="needs sshd"),
]


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for keys and sockets, with a short name, where links are shared."""
    with TemporaryDirectory(prefix="ssh-") as name:
        monkeypatch.setenv("MSGGEN_RUNTIME", f"{name}/run")
        monkeypatch.delenv("MSGGEN_DIRECT")
        yield Path(name)
        end_owners()


@contextmanager
def server(folder: Path) -> Iterator[list[str]]:
    """Run a server of ssh on the loopback interface, for this user. Yield the command that logs in, and its host."""
    for name in ("host", "user"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / name], check=True)
    port = free_tcp_port()
    (folder / "config").write_text(f"""
ListenAddress 127.0.0.1
Port {port}
HostKey {folder}/host
AuthorizedKeysFile {folder}/user.pub
PidFile none
StrictModes no
UsePAM no
PermitRootLogin prohibit-password
""")
    if os.geteuid() == 0:  # where no service of the system has made it
        os.makedirs("/run/sshd", mode=0o755, exist_ok=True)
    program = [str(SSHD), "-D", "-f", str(folder / "config"), "-E", str(folder / "log")]
    options = ["StrictHostKeyChecking=no", f"UserKnownHostsFile={folder}/known", "BatchMode=yes"]
    named = [word for option in options for word in ("-o", option)]
    with subprocess.Popen(program) as process:
        try:
            wait_for(lambda: listens(port), folder / "log")
            yield ["ssh", "-F", "none", "-i", str(folder / "user"), "-p", str(port), *named, "127.0.0.1"]
        finally:
            process.terminate()


def free_tcp_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        return int(listening.getsockname()[1])


def listens(port: int) -> bool:
    with socket.socket() as own:
        return own.connect_ex(("127.0.0.1", port)) == 0


def wait_for(condition: Any, log: Path) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, log.read_text() if log.exists() else "no log"
        time.sleep(0.02)


def run(*words: str) -> str:
    """Run a command as a process, and return what it prints."""
    command = [sys.executable, "-m", "msggen", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_commands_join_a_link_through_ssh(folder: Path, px4_types: Any) -> None:
    url, here = f"udp://127.0.0.1:{free_port()}", folder / "vehicle.socket"
    with ExitStack() as stack:
        *ssh, host = stack.enter_context(server(folder))
        serving = stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", "msggen", "link", "serve", "--link", url],
                cwd=ROOT,
                stdout=subprocess.PIPE,
                text=True,
            )
        )
        stack.callback(serving.terminate)
        assert serving.stdout
        serving.stdout.readline()
        stack.enter_context(Simulator(px4_types, url, [Options(sync="short")]))
        (listed,) = json.loads(run("link", "list", "--json"))
        assert os.path.exists(listed["socket"])
        tunnel = stack.enter_context(subprocess.Popen([*ssh, "-N", "-L", f"{here}:{listed['socket']}", host]))
        stack.callback(tunnel.terminate)
        wait_for(here.exists, folder / "log")
        link = ("--link", f"unix://{here}")
        assert "/fmu/out/vehicle_status_v4" in run("topic", "list", *link)
        assert "arming_state: 1" in run("topic", "echo", "vehicle_status", "--once", *link)
        assert run("command", "arm", *link) == "COMPONENT_ARM_DISARM: ACCEPTED\n"
        assert run("doctor", "--for", "1", *link).startswith(f"no problem found: unix://{here}")
