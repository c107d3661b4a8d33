"""Tests of the generated package with every supported Python on this machine: it reads and writes every vector."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from support.examples import by_day, some
from support.interpreters import VERSIONS, interpreter
from support.repository import ROOT, VECTORS

pytestmark = pytest.mark.tools

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


@pytest.mark.slow
@by_day("version", VERSIONS, 3)
def test_the_generated_package_works_on(version: str, tmp_path: Path) -> None:
    """By day with one or two of the five samples of each message."""
    samples = tmp_path / "samples.json"
    samples.write_text(json.dumps(some(json.loads((VECTORS / "cdr.json").read_text()), 3)))
    command = [interpreter(version), "-I", "-W", "error", "-c", PROGRAM, str(ROOT / "generated"), str(samples)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "all vectors\n", done.stderr


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


@by_day("version", VERSIONS, 3)
def test_an_attribute_error_has_one_suggestion(version: str) -> None:
    """Python itself appends a suggestion to the text of an AttributeError, unless the error names no object."""
    command = [interpreter(version), "-B", "-c", SHOW_ERRORS, *MISSPELT]
    done = subprocess.run(command, cwd=ROOT / "generated", capture_output=True, text=True, check=True)
    shown = [line for line in done.stderr.splitlines() if line.startswith("AttributeError: ")]
    assert shown == [f"AttributeError: {text}" for text in MISSPELT.values()]
