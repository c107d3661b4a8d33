"""Tests of the pages on flights, missions and their tests: programs print what the pages show, on a simulated clock."""

from __future__ import annotations

import asyncio
import os
import re
import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

import msggen.flight
from msggen import recordings
from msggen.flight import BlockingFlight, Executor, Flight, Mode
from msggen.flight.pytest import SimVehicle
from msggen.generate.cache import package_of
from msggen.messages.measurements import GATES, HEIGHT, POSITION, VELOCITY, YAW
from msggen.messages.ranges import RANGES
from msggen.messages.setpoints import SENT, Kind
from msggen.sim import Options
from msggen.sim.loop import run
from msggen.sim.near import NearVehicle
from support.examples import by_day
from support.flown import Flown
from support.pages import check_outputs, outputs_of, reading, steps_of, variables_of
from support.repository import ROOT

BLOCK = re.compile(r"^```python\n(.*?)^```(?:\n\n```text\n(.*?)^```)?", re.MULTILINE | re.DOTALL)
MEASURE = runpy.run_path(str(ROOT / "docs" / "measure_flight_safety.py"))
BLOCKS = {"flight_safety": 1, "flight": 5, "flight_modes": 5, "missions": 2, "measurements": 4, "flight_vehicles": 5}
TEXTS = {name: (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in BLOCKS}
PARAMETERS = {"measurements": {"EKF2_EV_CTRL": 15.0, "EKF2_GPS_CTRL": 0.0}}
"""Those that the vehicle of a page has other values of."""
VEHICLES = {"flight_vehicles": ("plane", "vtol", "rover", "multicopter", "rover")}
"""The vehicles of the programs of a page, if they are not all multicopters."""


@by_day("page", [*TEXTS], 3)
def test_the_programs_print_what_the_page_shows(
    page: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The address of a vehicle, and `asyncio.run`, stand for a simulated one and its clock."""
    vehicles: list[NearVehicle] = []

    def flight(where: str | NearVehicle, types: Any = None, **options: Any) -> Flight:
        assert types is px4_types or isinstance(where, NearVehicle)
        return Flight(vehicles[-1] if isinstance(where, str) else where, **options)

    kinds = iter(VEHICLES.get(page, ()))

    def fly(main: Any) -> None:
        kind = next(kinds, "multicopter")
        vehicles.append(Flown(px4_types, Options(vehicle=kind, parameters=PARAMETERS.get(page, {}))))
        run(main, vehicles[-1])

    async def in_flight(program: Any) -> None:
        async with flight("", px4_types) as found:
            await program(found)

    monkeypatch.chdir(ROOT / "examples" / "flight")
    monkeypatch.setattr(msggen.flight, "Flight", flight)
    monkeypatch.setattr(asyncio, "run", fly)
    monkeypatch.setattr(
        msggen.flight,
        "BlockingFlight",
        lambda _, types: BlockingFlight(SimVehicle(types)) if types is px4_types else None,
    )
    names: dict[str, Any] = {}
    blocks = BLOCK.findall(TEXTS[page])
    assert len(blocks) == BLOCKS[page]
    for code, shown in blocks:
        names.pop("program", None)
        exec(code, names)  # noqa: S102 - the code of the page
        if "program" in names:
            fly(in_flight(names["program"]))
        assert capsys.readouterr().out == shown, code


def test_the_first_session_is_that_of_the_example() -> None:
    corners = re.findall(r"^at (\S+) (\S+)$", TEXTS["flight"].partition("```\n")[0], re.MULTILINE)
    text = (ROOT / "examples" / "flight" / "square.py").read_text(encoding="utf-8")
    assert f"CORNERS = [{', '.join(f'({north}, {east})' for north, east in corners)}]" in text


def test_the_session_of_measurements_is_that_of_the_example() -> None:
    corners = re.findall(r"^at (\S+) (\S+) (\S+)$", TEXTS["measurements"].partition("```\n")[0], re.MULTILINE)
    text = (ROOT / "examples" / "flight" / "indoor.py").read_text(encoding="utf-8")
    assert f"CORNERS = [{', '.join(f'({east}, {north}, {up})' for east, north, up in corners)}]" in text


def test_the_bits_on_the_page_are_those_of_the_list() -> None:
    rows = re.findall(
        r"^\| `(position|velocity|attitude)`.*\| ([^|]*) \| `EKF2_EV\w_NOISE`", TEXTS["measurements"], re.MULTILINE
    )
    bits = {name: [int(each) for each in re.findall(r"\b\d\b", cell)] for name, cell in rows}
    assert bits == {"position": [POSITION.bit, HEIGHT.bit], "velocity": [VELOCITY.bit], "attitude": [YAW.bit]}


def test_the_gates_on_the_page_are_those_of_the_list() -> None:
    rows = dict(
        re.findall(r"^\| ([\w ]+?)(?:, each axis)? \| ([\d.]+), `EKF2_\w+_GATE`", TEXTS["measurements"], re.MULTILINE)
    )
    assert {name: float(deviations) for name, deviations in rows.items()} == {
        part.name: gate.deviations for part, gate in GATES.items()
    }


def test_the_tables_of_setpoints_are_those_of_the_code() -> None:
    texts = TEXTS["flight_modes"] + TEXTS["flight_vehicles"]
    rows = dict(re.findall(r"^\| `([A-Z_]+)` \| `.*\| (\d+) Hz \|", texts, re.MULTILINE))
    kinds = {name: getattr(msggen.flight, name) for name in msggen.flight.__all__ if name in rows}
    assert {name: {f"{kind.rate:.0f}" for kind in each if isinstance(kind, Kind)} for name, each in grouped(kinds)} == {
        name: {rate} for name, rate in rows.items()
    }
    assert {kind for _, each in grouped(kinds) for kind in each} == {*SENT}


def test_the_table_of_ranges_has_those_of_the_code() -> None:
    section = TEXTS["flight_vehicles"].partition("## Ranges")[2].partition("\n## ")[0]
    rows = [line.split("|")[2:5] for line in section.splitlines() if re.search("`(?:FW|RO)_.*\\|$", line)]
    named = {tuple(re.findall(r"`(\w+)`", parameters)): (widest, usual) for widest, usual, parameters in rows}
    found = {each for fields in RANGES.values() for each in fields.values()}
    assert {frozenset(each) for each in named} == {
        frozenset({each.least.parameter, each.most.parameter}) for each in found
    }
    for each in found:
        (cells,) = (cells for names, cells in named.items() if each.most.parameter in names)
        for cell, bounds in zip(cells, ("extreme", "default"), strict=True):
            assert f"{abs(each.most.of(getattr(each.most, bounds))):.3g} {each.unit}".replace("^2", "²") in cell


def grouped(kinds: dict[str, Any]) -> list[tuple[str, tuple[Kind, ...]]]:
    """Return the kinds of setpoints behind each name."""
    return [(name, (value,) if isinstance(value, Kind) else value) for name, value in kinds.items()]


def test_the_names_of_msggen_on_the_page_exist() -> None:
    text = (ROOT / "tests" / "flight" / "compared.md").read_text(encoding="utf-8")
    table_of_names = text.partition("## Names elsewhere")[2].partition("\n## ")[0]
    ours = " ".join(line.split("|")[3] for line in table_of_names.splitlines() if line.startswith("| "))
    words = set(re.findall(r"`(?:await )?(?:async with )?(?:self\.|flight\.)?(\w+)", ours))
    known = {
        *dir(Mode),
        *dir(Executor),
        *dir(Flight),
        *msggen.flight.__all__,
        "name",
        "measure",
        "telemetry",
        "return",
        "msggen",
    }
    assert words - known == set()


@pytest.fixture(scope="module")
def measured(px4_types: Any) -> list[Any]:
    """The packages of the releases of the table."""
    return [px4_types if release == "v1.18" else package_of(release) for release in MEASURE["RELEASES"]]


@pytest.mark.night  # all cases take half a minute
def test_the_measured_times_are_those_of_the_page(measured: list[Any]) -> None:
    lines = MEASURE["table"](measured, MEASURE["RELEASES"])
    assert lines == table_of_the_page(), "stale: python docs/measure_flight_safety.py --write"


@pytest.mark.night  # as above
def test_the_measured_times_of_other_vehicles_are_those_of_the_page() -> None:
    packages = [package_of(release) for release in MEASURE["OF_OTHERS"]]
    lines = MEASURE["others"](packages, MEASURE["OF_OTHERS"])
    assert MEASURE["updated_others"](TEXTS["flight_safety"], lines) == TEXTS["flight_safety"], (
        "stale: python docs/measure_flight_safety.py --others --write"
    )


def test_the_page_has_a_row_for_each_case_of_other_vehicles() -> None:
    (block,) = re.findall(r"safety\.py --others\n(.*?)^```", TEXTS["flight_safety"], re.MULTILINE | re.DOTALL)
    head, *lines = block.splitlines()
    assert head.split() == ["seconds", *MEASURE["OF_OTHERS"], "then"]
    assert [line[:37].rstrip() for line in lines] == [text for text, *_ in MEASURE["OTHERS"]]


def test_the_page_has_a_row_for_each_measured_case() -> None:
    head, *lines = table_of_the_page()
    assert head.split() == ["seconds", *MEASURE["RELEASES"], "then"]
    assert [line[:37].rstrip() for line in lines] == [text for text, _ in MEASURE["CASES"]]
    assert MEASURE["updated"](TEXTS["flight_safety"], [head, *lines]) == TEXTS["flight_safety"]


def table_of_the_page() -> list[str]:
    """Return the lines of the table that docs/measure_flight_safety.py prints."""
    (block,) = re.findall(
        r"^\$ python docs/measure_flight_safety\.py\n(.*?)^```", TEXTS["flight_safety"], re.MULTILINE | re.DOTALL
    )
    return [*block.splitlines()]


def test_measured_times_are_put_on_the_page() -> None:
    lines = ["seconds", "the program hangs  1.00 to 1.00  1.50 to 1.75  then"]
    page = MEASURE["updated"](TEXTS["flight_safety"], lines)
    assert "\n".join(["```console", "$ python docs/measure_flight_safety.py", *lines, "```"]) in page
    assert page.count("\n") == TEXTS["flight_safety"].count("\n") - len(table_of_the_page()) + 2


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
