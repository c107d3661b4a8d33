"""Tests that the tests on docs/flight_tests.md pass and fail as it shows."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest

from msggen import recordings
from msggen.sim import Options
from support.pages import check_outputs, outputs_of, reading, steps_of, variables_of
from support.repository import ROOT

FILE = re.compile(r"# (\w+\.py)\n")
LONG = re.compile(r"(?<=s) \(\d+:\d\d:\d\d\)")
"""What pytest adds to a time of more than a minute."""
MEASURED = re.compile(r"(?<![\w.])-?\d+\.\d+(?= s\b|s$| m\b)", re.MULTILINE)


@pytest.mark.night  # a pytest for each command of the page
@pytest.mark.tools("bash", "sed")
def test_a_reader_who_copies_the_page_gets_what_it_shows(tmp_path: Path) -> None:
    steps = steps_of("flight_tests")
    for step in steps:
        name = FILE.match(step.code)
        if step.kind == "python" and name and name[1] != "test_options.py":
            (tmp_path / name[1]).write_text(step.code)
    options = next(step.code for step in steps if step.code.startswith("# test_options.py"))
    home = tmp_path / "home"
    variables = variables_of(Path(sys.executable).parent, home)
    paths = os.pathsep.join([str(ROOT), str(ROOT / "generated")])
    variables |= {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1", "PYTEST_ADDOPTS": "-q -p no:cacheprovider"}
    variables["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # a reader has not the plugins of our tests
    with reading(tmp_path, variables) as reader:
        outputs = []
        for step, output in outputs_of([each for each in steps if each.kind == "console"], reader):
            outputs.append((step._replace(shown=_plain(step.shown)), _plain(output)))
            (tmp_path / "test_options.py").write_text(options) if "sed" in step.code else None
            for path in re.findall(r"^recording: (.+)$", output, re.MULTILINE):
                with recordings.open(path) as log:
                    assert log.topics
    check_outputs(outputs)


def _plain(text: str) -> str:
    """Return an output without times, places and the folders of a user."""
    return re.sub(r"/\S+/pytest-of-\w+/pytest-\d+/", "FOLDER/", MEASURED.sub("N", LONG.sub("", text)))


def test_the_page_has_all_faults_and_answers() -> None:
    from msggen.flight.pytest import SimVehicle
    from msggen.flight.pytest.faults import Faults

    page = (ROOT / "docs" / "flight_tests.md").read_text(encoding="utf-8")
    names = [name for name in vars(Faults) if not name.startswith("_") and name not in {"advance", "loses"}]
    own = {name for name in vars(SimVehicle) if not name.startswith("_")}
    told = {"advance", "close", "loses", "new_loop", "publish", "recording", "restart", "run_coroutine", "state"}
    assert [name for name in names if f"`{name}(" not in page] == []
    assert [name for name in own - told if not re.search(rf"`(sim_vehicle\.)?{name}[`(]", page)] == []
    assert set(re.findall(r"^\| `(\w+)` \| .*$", page.partition("| option |")[2], re.MULTILINE)) <= {
        "types",
        "limit",
        *Options._fields,
    }
