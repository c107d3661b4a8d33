"""Tests with every supported Python on this machine: msggen runs, and its package reads and writes every vector."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from support.repository import ROOT, VECTORS

pytestmark = pytest.mark.tools

VERSIONS = ["3.10", "3.11", "3.12", "3.13"]

OWN = f"{sys.version_info.major}.{sys.version_info.minor}"

PROGRAM = """
import json, sys
sys.path.insert(0, sys.argv[1])
import dataclasses, pickle, px4_types
from px4_types import topics

for vector in json.load(open(sys.argv[2])):
    stale = bytes.fromhex(vector["hex"])
    clean = bytes(0 if index in vector["padding"] else byte for index, byte in enumerate(stale))
    message_type = getattr(px4_types, vector["type"])
    message = message_type.decode(b"\\0\\1\\0\\0" + stale)
    assert message.encode()[4:] == clean, vector["type"]
    assert pickle.loads(pickle.dumps(message)) == message == dataclasses.replace(message)
    assert px4_types.show(message) and len(px4_types.meaning.problems(message)) >= 0
    assert len(dataclasses.fields(message_type)) == len(dataclasses.asdict(message)) == len(vector["values"])
assert topics.ORB_ID.vehicle_odometry == topics.UORB["vehicle_odometry"].orb_id
print("all vectors")
"""


def interpreter(version: str) -> str:
    """Return the Python of this version from the PATH or from pyenv, or skip the test."""
    candidates = [shutil.which(f"python{version}"), *Path.home().glob(f".pyenv/versions/{version}.*/bin/python")]
    for candidate in candidates:
        if candidate:
            asked = [str(candidate), "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
            done = subprocess.run(asked, capture_output=True, text=True, check=False)
            if done.stdout.strip() == version:
                return str(candidate)
    pytest.skip(f"needs Python {version}")


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_the_generated_package_works_on(version: str) -> None:
    command = [
        interpreter(version),
        "-I",
        "-W",
        "error",
        "-c",
        PROGRAM,
        str(ROOT / "generated"),
        str(VECTORS / "cdr.json"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "all vectors\n", done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("version", [version for version in VERSIONS if version != OWN])
def test_the_tool_works_on(version: str, tmp_path: Path) -> None:
    environment = tmp_path / "environment"
    python = interpreter(version)
    run([python, "-m", "venv", str(environment)], tmp_path)
    run([str(environment / "bin" / "pip"), "install", "--quiet", str(ROOT)], tmp_path)
    run([str(environment / "bin" / "msggen"), "build", "--quiet"], tmp_path)
    committed = ROOT / "generated" / "px4_types"
    for path in committed.rglob("*.py"):
        made = tmp_path / "generated" / "px4_types" / path.relative_to(committed)
        assert made.read_bytes() == path.read_bytes()


def run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


MISSPELT = {
    "px4_types.escstatus": "module 'px4_types' has no attribute 'escstatus', did you mean 'EscStatus'?",
    "px4_types.msg.sensor_combined": "module 'px4_types.msg' has no message 'sensor_combined', "
    "did you mean 'SensorCombined'?",
    "px4_types.topics.out.vehicle_statuss": "no endpoint 'out.vehicle_statuss', did you mean 'out.vehicle_status'?",
    "px4_types.topics.out.trajectory_setpoint": "no endpoint 'out.trajectory_setpoint', "
    "did you mean 'in_.trajectory_setpoint'?",
}

SHOW_ERRORS = """
import sys
from px4_types import topics; import px4_types
for code in sys.argv[1:]:
    try:
        eval(code)
    except AttributeError:
        sys.excepthook(*sys.exc_info())
"""


@pytest.mark.parametrize("version", VERSIONS)
def test_an_attribute_error_has_one_suggestion(version: str) -> None:
    """Python itself appends a suggestion to the text of an AttributeError, unless the error names no object."""
    command = [interpreter(version), "-B", "-c", SHOW_ERRORS, *MISSPELT]
    done = subprocess.run(command, cwd=ROOT / "generated", capture_output=True, text=True, check=True)
    shown = [line for line in done.stderr.splitlines() if line.startswith("AttributeError: ")]
    assert shown == [f"AttributeError: {text}" for text in MISSPELT.values()]
