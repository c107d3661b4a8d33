"""Tests of `msggen log` for what users type and programs read: spellings, fields, paths in messages, and JSON."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from support.commands import exit_code
from support.examples import by_day
from support.flights import TOPICS, write_flight
from support.log_files import Written, write_log
from support.recordings import START
from support.ulog import UlogWriter, write_ulog


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_ulog(tmp_path / "flight.ulg", version=0x011000FF)
    return tmp_path


@pytest.fixture
def flight(here: Path, px4_types: Any) -> Path:
    return write_flight(here / "flight.mcap", px4_types, 60)


def run(words: str) -> int:
    return exit_code(["log", *shlex.split(words)])


# --- what users type


def test_a_number_of_samples_is_as_in_topic_echo(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("show flight.ulg sensor_gps --count 2") == DONE
    expected = capsys.readouterr().out
    assert run("show flight.ulg sensor_gps -n 2") == DONE
    assert capsys.readouterr().out == expected
    assert expected.count("---\n") == 2


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("sensor_gps.fix_type", "sensor_gps --field fix_type"),
        ("EscStatus.counter", "esc_status --field counter"),
        ("'sensor_gps[1].fix_type'", "sensor_gps --instance 1 --field fix_type"),
        ("sensor_gps_1.fix_type", "sensor_gps --instance 1 --field fix_type"),
        ("'actuator_outputs.output[3]'", "actuator_outputs --field 'output[3]'"),
        ("'esc_status.esc[0].esc_rpm' --field counter", "esc_status --field 'esc[0].esc_rpm' --field counter"),
    ],
)
def test_a_path_is_a_topic_and_a_field_as_in_plot(path: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(f"show flight.ulg {words} -n 3") == DONE
    expected = capsys.readouterr()
    assert run(f"show flight.ulg {path} -n 3") == DONE
    assert capsys.readouterr() == expected


def test_a_topic_with_a_dot_in_its_name_is_a_topic(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    topic = Written("/arm.left", "demo/msg/Angle", "uint8 left\n", [(START, START, b"\0\1\0\0\7")])
    write_log(here / "arm.mcap", [topic])
    for name in ("/arm.left", "/arm.left --field left"):
        assert run(f"show arm.mcap {name}") == DONE
        assert capsys.readouterr().out == "# 0.000000 s\nleft: 7\n---\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            "show sensor_gps flight.ulg",
            "sensor_gps: R102 cannot be read: No such file or directory: the recording comes first, msggen log show f",
        ),
        ("info sensor_gps flight.ulg", "the recording comes first, msggen log info flight.ulg sensor_gps\n"),
        ("cut sensor_gps flight.ulg", "the recording comes first, msggen log cut flight.ulg sensor_gps\n"),
        ("convert sensor_gps flight.ulg", "the recording comes first, msggen log convert flight.ulg sensor_gps\n"),
        ("plot sensor_gps.eph flight.ulg", "the recording comes first, msggen log plot flight.ulg sensor_gps.eph\n"),
        ("merge flight.ulg fligth.ulg", "fligth.ulg: R102 cannot be read: No such file or directory, did you mean"),
        ("show flight.ulg", "`msggen log info flight.ulg` lists the topics\n"),
        ("show flight.ulg sensor_gps.fix_typ", "no field is called 'fix_typ', did you mean 'fix_type'?"),
        ("show flight.ulg sensor_gbs.fix_type", "no topic is called 'sensor_gbs', did you mean 'sensor_gps'?"),
        (
            "show flight.ulg 'sensor_gps[1].fix_type' --instance 0",
            "argument --instance: 0 contradicts sensor_gps[1]: give one of them",
        ),
        ("info flight.ulg sensor_gbs", "no topic is called 'sensor_gbs', did you mean 'sensor_gps'?"),
    ],
)
def test_errors_lead_to_the_right_words(words: str, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words) == FAILED
    assert expected in capsys.readouterr().err


FIELDS = """\
topic       sensor_gps 1
type        px4_msgs/msg/SensorGps
samples     200, 100.0 Hz, from 0.000 to 1.990 s
size        25 B each, 5.0 kB in all
fields
  name           type     unit  values
  timestamp      uint64   us
  time_utc_usec  uint64   us
  latitude_deg   float64  deg
  fix_type       uint8          1 NONE, 2 TYPE_2D, 3 TYPE_3D, 4 RTCM_CODE_DIFFERENTIAL and 3 more
"""


def test_info_lists_the_fields_of_a_topic(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info flight.ulg 'sensor_gps[1]'") == DONE
    assert capsys.readouterr().out == FIELDS
    assert run("info flight.ulg sensor_gps_1 --json") == DONE
    document = json.loads(capsys.readouterr().out)
    assert (document["name"], document["instance"], document["samples"]) == ("sensor_gps", 1, 200)
    assert document["fields"][3]["name"] == "fix_type"
    assert document["fields"][3]["values"]["3"] == "TYPE_3D"


@pytest.mark.usefixtures("flight")
@pytest.mark.parametrize("topic", ["esc_status", "battery_status", "texts"])
def test_listed_fields_are_those_of_the_option(topic: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(f"info flight.mcap {topic} --json") == DONE
    for field in json.loads(capsys.readouterr().out)["fields"]:
        if "[]" not in field["name"]:
            assert run(f"show flight.mcap {topic} -n 1 --field '{field['name']}'") == DONE
            assert f"\n{field['name']}" in capsys.readouterr().out


@pytest.mark.usefixtures("flight")
def test_a_pattern_takes_what_can_be_decoded_and_tells_the_rest(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("convert flight.mcap '*s*' -o made") == FINDINGS
    assert sorted(path.stem for path in (here / "made").iterdir()) == sorted((*TOPICS, "texts"))
    assert capsys.readouterr().err.startswith("flight.mcap: /json is not decoded: ")
    assert run("convert flight.mcap 'esc*' -o other") == DONE
    assert run("convert flight.mcap json -o none") == FAILED
    assert "error: /json cannot be decoded: samples in 'json', expected cdr" in capsys.readouterr().err


# --- which recording


def test_messages_of_merge_name_the_recording(
    here: Path, flight: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.mcap", "b.mcap"):
        (here / name).write_bytes(flight.read_bytes()[:60_000])
    payload = px4_types.VehicleStatus().encode()
    bare = Written("/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "", [(START, START, payload)])
    unknown = Written("/other", "our_msgs/msg/Other", "", [(START, START, payload)])
    write_log(here / "bare.mcap", [bare, unknown])
    assert run("merge a.mcap b.mcap bare.mcap") == FINDINGS
    told = capsys.readouterr()
    fronts = [line.partition(": ")[0] for line in told.err.splitlines()]
    assert set(fronts) == {"a.mcap", "b.mcap", "bare.mcap", "merged.mcap"}
    assert fronts.count("a.mcap") == fronts.count("b.mcap") > 0
    assert "merged.mcap: /other has no definition as ros2msg, and is written without one\n" in told.err
    assert run("merge a.mcap b.mcap bare.mcap -o again.mcap --json") == FINDINGS
    document = json.loads(capsys.readouterr().out)
    assert {each["path"] for each in document["problems"]} == {"a.mcap", "b.mcap", "again.mcap"}
    assert {note.partition(": ")[0] for note in document["notes"]} == {"bare.mcap"}


def test_repair_tells_if_nothing_is_missing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("cut flight.ulg sensor_gps -o whole.mcap -q") == DONE
    assert run("repair whole.mcap") == DONE
    told = capsys.readouterr()
    assert told.out.endswith("\nwhole.mcap: nothing is missing\n")
    assert told.err == ""
    assert run("repair whole.mcap -o b.mcap -q") == DONE
    assert capsys.readouterr() == ("", "")
    (here / "cut.mcap").write_bytes((here / "whole.mcap").read_bytes()[:-3000])
    assert run("repair cut.mcap") == DONE
    assert "nothing is missing" not in capsys.readouterr().out


def test_repair_of_nothing_is_a_finding(here: Path, flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "front.mcap").write_bytes(flight.read_bytes()[:200])
    assert run("repair front.mcap") == FINDINGS
    assert "front.repaired.mcap is not written: there are no samples\n" in capsys.readouterr().err


# --- JSON


def no_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


OUTCOMES = [
    ("info {}", DONE),
    ("info {} nothing", FAILED),
    ("info nothing.ulg", FAILED),
    ("show {} nothing", FAILED),
    ("show nothing.ulg esc_status", FAILED),
    ("show {}", FAILED),
    ("show {} esc_status --start x", FAILED),
    ("show {} esc_status --nothing", FAILED),
    ("convert {} -o made", None),
    ("convert {} -o made --start 90", FINDINGS),
    ("convert {} -o no/made", FAILED),
    ("convert {} -o a.csv", FAILED),
    ("convert . -o fleet --jobs 1", None),
    ("convert no -o fleet", FAILED),
    ("cut {} esc_status -o a.mcap", DONE),
    ("cut {} esc_status --start 90 -o a.mcap", FINDINGS),
    ("cut {}", FAILED),
    ("merge {} {} -o a.mcap", FAILED),
    ("merge flight.ulg flight.mcap -o a.mcap", None),
    ("merge {} nothing.ulg -o a.mcap", FAILED),
    ("merge {}", FAILED),
    ("repair {} -o a.mcap", DONE),
    ("repair nothing.ulg", FAILED),
]
"""Arguments of `msggen log`, and the exit code: None for any but that of an error."""


@pytest.mark.usefixtures("flight")
@by_day(
    ("words", "code", "name"),
    [(*each, name) for each in OUTCOMES for name in ("flight.ulg", "flight.mcap")],
    3,
)
def test_json_has_errors_too(words: str, code: int | None, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = run(words.replace("{}", name) + " --json")
    assert found == code or (code is None and found in (DONE, FINDINGS))
    document = json.loads(capsys.readouterr().out, parse_constant=no_constant)
    assert ("errors" in document) == (found == FAILED)
    if found == FAILED:
        assert document["errors"][0]["message"]


def test_json_of_samples_and_parameters_is_a_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    for words, code in (("esc_status --start 90", FINDINGS), ("esc_status -n 3", DONE), ("--params", DONE)):
        assert run(f"show flight.ulg {words} --json") == code
        for line in capsys.readouterr().out.splitlines():
            assert json.loads(line, parse_constant=no_constant)


def test_numbers_that_are_not_finite_are_null(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = UlogWriter()
    log.format("odd", "uint64_t timestamp;float value")
    log.information("float nan", b"\0\0\xc0\x7f")
    log.information("float[2] both", b"\0\0\x80\x7f\0\0\x80\x3f")
    log.parameter("NAN", float("nan"))
    log.parameter("NAN", float("inf"), default=1)
    log.subscribe(0, "odd")
    log.sample(0, bytes(12))
    log.parameter("NAN", float("-inf"))
    log.write(here / "odd.ulg")
    assert run("info odd.ulg --json") == DONE
    document = json.loads(capsys.readouterr().out, parse_constant=no_constant)
    assert document["information"] == {"nan": None, "both": [None, 1.0]}
    assert run("show odd.ulg --params --json") == DONE
    lines = [json.loads(line, parse_constant=no_constant) for line in capsys.readouterr().out.splitlines()]
    assert [each["value"] for each in lines] == [None, None]


def test_a_module_that_is_no_generated_package_is_an_error(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "some_types").mkdir()
    for name in ("__init__", "topics"):
        (here / "some_types" / f"{name}.py").write_text("")
    for words in ("info flight.ulg --types json", "convert flight.ulg -o made --types ./some_types"):
        assert run(words) == FAILED
        assert " L103 not a package that msggen has generated" in capsys.readouterr().err
