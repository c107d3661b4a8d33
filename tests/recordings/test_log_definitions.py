"""Tests of the definitions of a recording as a source of `msggen check` and `msggen build`, and of ULogs' own ones."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.cli import main
from msggen.messages.firmware import releases
from support.examples import by_day
from support.log_files import Written, definition_in, write_log, write_ulog_of
from support.repository import ROOT
from support.ulog import snake

START = 1_790_000_000_000_000_000
NAMES = ("VehicleAttitude", "EscStatus", "VehicleStatus", "SensorGps", "BatteryStatus", "AirspeedValidated")


def mcap(path: str, release: str, names: tuple[str, ...] = NAMES, *others: Written) -> str:
    """Write a recording with the definitions of a release, and return its path."""
    topics = [Written(f"/{name}", f"px4_msgs/msg/{name}", definition_in(release, name)) for name in names]
    return str(write_log(Path(path), [*topics, *others]))


def ulog(path: str, release: str, names: tuple[str, ...] = NAMES) -> str:
    """Write a ULog with the definitions of a release, and return its path."""
    return write_ulog_of(release, names, Path(path))


def check(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Run `msggen check`, and return the exit code, and what it printed."""
    code = main(["check", *arguments])
    told = capsys.readouterr()
    return code, told.out, told.err


WRITERS = pytest.mark.parametrize(("write", "name"), [(mcap, "flight.mcap"), (ulog, "flight.ulg")])


@WRITERS
@by_day("release", ["v1.14", "v1.16", "v1.18"], 2)
@pytest.mark.usefixtures("working_folder")
def test_a_recording_matches_its_release(
    capsys: pytest.CaptureFixture[str], write: Any, name: str, release: str
) -> None:
    code, out, err = check(capsys, write(name, release), release)
    count = len(NAMES) + 1  # EscReport
    text = f"the embedded PX4 {release} matches {name}: {count} messages, 0 services\n"
    assert (code, out, err) == (0, text, "")
    with recordings.open(name) as log:
        assert release in log.release().releases
        assert log.release().differing == ()


@WRITERS
@pytest.mark.usefixtures("working_folder")
def test_the_differences_are_those_of_the_releases(capsys: pytest.CaptureFixture[str], write: Any, name: str) -> None:
    code, out, _ = check(capsys, write(name, "v1.16"), "v1.18", "--output-format", "json")
    found = {(each["rule"], each["subject"], each["message"]) for each in json.loads(out)["findings"]}
    assert main(["check", "v1.16", "v1.18", "--output-format", "json"]) == code == 1
    every = json.loads(capsys.readouterr().out)["findings"]
    wire = {"FIELD_ADDED", "FIELD_REMOVED", "FIELD_MOVED", "FIELD_RETYPED", "ARRAY_LENGTH_CHANGED", "FIELD_RENAMED"}
    expected = {
        (each["rule"], each["subject"], each["message"].replace("the embedded PX4 v1.16", name))
        for each in every
        if each["subject"] in (*NAMES, "EscReport")
    }
    if write is mcap:
        assert found == expected
    else:  # a ULog does not tell the order of fields, so fields that were renamed are new ones
        assert {each[1] for each in found if each[0] in wire} == {each[1] for each in expected if each[0] in wire}
        assert {each[1] for each in found} <= {*NAMES, "EscReport"}


@pytest.mark.usefixtures("working_folder")
def test_other_sides(capsys: pytest.CaptureFixture[str]) -> None:
    """A recording can be on both sides, alone, and be compared with a generated package."""
    old, new = mcap("old.mcap", "v1.16", NAMES), mcap("new.mcap", "v1.18", NAMES[:2])
    code, out, _ = check(capsys, old, new, "--output-format", "concise")
    assert code == 1
    assert {line.split(" ")[0].partition(":")[0] for line in out.splitlines()[:-1]} == {
        f"new.mcap/msg/{name}.msg" for name in ("EscReport", "EscStatus")
    }
    code, out, err = check(capsys, new)
    assert (code, out) == (0, "new.mcap matches the embedded PX4 v1.18: 3 messages, 0 services\n")
    assert err.startswith("new.mcap: S126 note: compared with the embedded PX4 v1.18")
    package = str(ROOT / "generated" / "px4_types")
    assert check(capsys, new, package) == (0, "px4_types matches new.mcap: 3 messages, 0 services\n", "")
    code, out, _ = check(capsys, old, package, "--output-format", "sarif")
    assert code == 1
    assert "px4_types/msg/VehicleStatus.msg" in out


@WRITERS
@pytest.mark.usefixtures("working_folder")
def test_a_recording_matches_a_package_of_its_release(
    capsys: pytest.CaptureFixture[str], write: Any, name: str
) -> None:
    """On either side: a ULog takes the constants and the order of fields from the package, as from a release."""
    path, package = write(name, "v1.18"), str(ROOT / "generated" / "px4_types")
    end = f"{len(NAMES) + 1} messages, 0 services\n"
    for arguments in ((path, package), (package, "--px4", path)):
        assert check(capsys, *arguments) == (0, f"px4_types matches {name}: {end}", "")
    assert check(capsys, package, path) == (0, f"{name} matches px4_types: {end}", "")
    assert check(capsys, "v1.18", "--px4", path) == (0, f"the embedded PX4 v1.18 matches {name}: {end}", "")
    other = write(f"other_{name}", "v1.16")
    assert check(capsys, other, package)[0] == 1
    assert check(capsys, other, path)[0] == 1


@pytest.mark.usefixtures("working_folder")
def test_what_is_not_compared_is_named(capsys: pytest.CaptureFixture[str], px4_types: Any) -> None:
    known = {"topic_type_hash": px4_types.Wind.__msg__.type_hash}
    others = (
        Written("/nothing", "px4_msgs/msg/Mine", ""),
        Written("/known", "px4_msgs/msg/Wind", "", metadata=known),
        Written("/unknown", "px4_msgs/msg/Cpuload", "", metadata=known),
        Written("/second", "px4_msgs/msg/VehicleStatus", definition_in("v1.16", "VehicleStatus")),
        Written("/imu", "sensor_msgs/msg/Imu", "float64 x\n"),
    )
    code, out, err = check(capsys, mcap("flight.mcap", "v1.18", NAMES, *others), "v1.18")
    assert (code, out) == (0, "the embedded PX4 v1.18 matches flight.mcap: 8 messages, 0 services\n")
    front, end = "flight.mcap: R141 warning: ", ": not compared"
    assert [line.removeprefix(front).removesuffix(end) for line in err.splitlines()] == [
        "'/nothing' (px4_msgs/msg/Mine) has no definition",
        "'/second' has another definition of VehicleStatus than '/VehicleStatus'",
        "'/unknown' (px4_msgs/msg/Cpuload) has another type hash, and no definition",
    ]
    assert check(capsys, "flight.mcap", "v1.18", "--strict")[0] == 2


@pytest.mark.usefixtures("working_folder")
def test_damage_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(ulog("flight.ulg", "v1.18"))
    content = path.read_bytes()
    path.write_bytes(content[:-5])
    told = (
        "flight.ulg: R142 warning: a part of the recording cannot be read, and may have other definitions: the file is"
    )
    package = str(ROOT / "generated" / "px4_types")
    for sides in (("flight.ulg", "v1.18"), ("v1.18", "flight.ulg"), ("flight.ulg", package), (package, "flight.ulg")):
        code, out, err = check(capsys, *sides)
        assert (code, out.endswith(f"{len(NAMES) + 1} messages, 0 services\n")) == (0, True)
        assert [line.startswith(told) for line in err.splitlines()] == [True]
    assert check(capsys, "flight.ulg", "v1.18", "--strict")[0] == 2
    path.write_bytes(content[:30])
    code, _, err = check(capsys, "flight.ulg", "v1.18")
    assert (code, err.startswith(told), "S102 the recording has no definitions" in err) == (2, True, True)


@pytest.mark.usefixtures("working_folder")
def test_files_that_cannot_be_compared_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    Path("broken.mcap").write_bytes(b"nothing")
    assert check(capsys, "broken.mcap", "v1.18")[0] == 2
    write_log(Path("empty.mcap"), [])
    code, _, err = check(capsys, "empty.mcap", "v1.18")
    assert (code, err.splitlines()[0]) == (2, "empty.mcap: S102 the recording has no definitions of PX4's messages")


@WRITERS
@pytest.mark.usefixtures("working_folder")
def test_a_package_of_a_recording_reads_it(write: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(name, "v1.16")
    package_name = f"recorded_{name.partition('.')[2]}"
    assert main(["build", "-q", "--px4", path, "--package", package_name, "-o", "."]) == 0
    monkeypatch.syspath_prepend(str(Path.cwd()))
    package: Any = importlib.import_module(package_name)
    with recordings.open(path) as log:
        assert all(each.is_same for each in log.compare(package))
        for each in NAMES:
            assert len(list(log.messages(getattr(package, each)))) == (3 if write is ulog else 0)
    sys.modules.pop(package_name)


def test_messages_of_a_ulog_have_its_values(px4_types: Any, tmp_path: Path) -> None:
    names = tuple(
        name for name in px4_types.msg.__all__ if name in {row.message for row in releases()["v1.18"].values()}
    )[:40]
    assert len(names) == 40
    path = ulog(str(tmp_path / "flight.ulg"), "v1.18", names)
    with recordings.open(path) as log:
        for each in log.compare(px4_types):
            assert each.is_same, str(each)
        for name in names:
            cls = getattr(px4_types, name)
            messages = list(log.messages(cls))
            found = px4_types.batch.columns(cls.decode_batch([message.encode() for message in messages]))
            columns = log.columns(snake(name))
            assert found.keys() == columns.keys()
            for column, values in columns.items():
                np.testing.assert_array_equal(found[column], values)
            assert len(messages) == 3


def test_a_ulog_of_another_release_is_refused(px4_types: Any, tmp_path: Path) -> None:
    path = ulog(str(tmp_path / "flight.ulg"), "v1.16")
    with recordings.open(path) as log:
        compared = {each.topic.name: each for each in log.compare(px4_types)}
        assert {name for name, each in compared.items() if not each.is_same} == {
            snake(name) for name in NAMES if definition_in("v1.16", name) != definition_in("v1.18", name)
        } - {"vehicle_attitude"}
        with pytest.raises(recordings.RecordingError, match=r"has another definition than px4_types\.SensorGps"):
            log.messages(px4_types.SensorGps)
