"""Tests of docs/stores.md: its commands and its code, against moto's server of S3."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from botocore.session import Session

from support.commands import run
from support.fleet_logs import write_logs
from support.moto import moto_server
from support.object_server import set_credentials
from support.repository import ROOT
from support.written import write_recording

if TYPE_CHECKING:
    import pytest

PAGE = (ROOT / "docs" / "stores.md").read_text(encoding="utf-8")
COMMANDS = [
    each
    for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    for each in re.findall(r"\$ msggen (.*)\n((?:[^$].*\n|\n)*)", block)
]
_FIGURES = re.compile(r"in [\d.]+ s|[\d.]+ kB")


def test_the_commands_and_the_code_print_what_the_page_shows(
    px4_types: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    battery, odometry = px4_types.BatteryStatus, px4_types.VehicleOdometry
    samples = [("/fmu/out/battery_status_v1", number / 2, battery(voltage_v=16 - number / 64)) for number in range(240)]
    samples += [("/fmu/out/vehicle_odometry", number / 50, odometry(timestamp=number)) for number in range(6000)]
    write_recording(tmp_path / "flight.mcap", sorted(samples, key=lambda each: each[1]))
    write_logs(tmp_path / "logs")
    with moto_server() as url:
        set_credentials(monkeypatch, url)
        Session().create_client("s3", region_name="us-east-1").create_bucket(Bucket="flights")
        assert len(COMMANDS) == 7
        for command, shown in COMMANDS:
            outcome = run(shlex.split(command))
            printed = outcome.stdout + outcome.stderr
            assert _FIGURES.sub("#", printed) == _FIGURES.sub("#", shown)
        names: dict[str, Any] = {}
        outputs = []
        for code in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
            exec(code, names)  # noqa: S102 - the code of the page
            outputs.append(capsys.readouterr().out)
        assert outputs == re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
