"""Tests that editors complete the names of msggen and of a generated package, wherever README and pages use them.

jedi completes in vim, Emacs, Spyder, IPython and Jupyter; basedpyright's server in VS Code, Neovim and Zed. A place is
completed if an editor offers its name either as the last word of the text so far, or within the whole text.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import pytest

import msggen
from msggen import live, recordings
from msggen.live import Vehicle
from support.checkers import GENERATED
from support.completion import cell_of, names, script_of
from support.examples import by_day
from support.fake_link import FakeLink
from support.language_server import LanguageServer, language_server
from support.page_code import PAGES, Place, code_of, cut_code, places_of
from support.repository import ROOT

UNKNOWN = {
    "fleet.md": "found lowest rows scan voltages",
    "frames.md": "pose",
    "package.md": "OffboardControlMode cls make_reader px4_msgs re schema self super",
    "recordings.md": "figure",
    "versions.md": "newer old subscribed",
}
"""Names on pages that are parameters without types, or of other libraries, or of packages with other definitions."""

ONLY_BASEDPYRIGHT = {
    # the type of an element, where an attribute is annotated as a tuple
    "doctor.md": {"each.remote", "each.remote.number", "finding.rule", "finding.rule.id"},
    "library.md": {
        "catalog.messages['px4_msgs/BatteryStatus'].fields[2].comment",
        "catalog.messages['px4_msgs/BatteryStatus'].fields[2].comment.unit",
        "endpoint.message",
        "field.name",
        "field.type",
        "field.type.array",
        "field.type.name",
    },
    # the parameters of a lambda
    "vehicle.md": {"message.ARMING_STATE_DISARMED", "message.arming_state", "route.name"},
    # the name of the second loop of a comprehension
    "versions.md": {"endpoint.dds_name", "endpoint.message"},
}
"""What jedi does not find. docs/vehicle.md shows what to write instead."""

ONLY_JEDI = {
    # pyarrow has no types; jedi imports it
    "reading.md": {"log.table('battery_status').schema"},
}

NEITHER = {
    # of pyarrow, which does not tell what its functions return
    "reading.md": {
        "log.table('battery_status').schema.field",
        "log.table('battery_status').schema.field('voltage_v').metadata",
    },
}


def known(page: str) -> list[Place]:
    """Return the places on a page whose values have types."""
    unknown = UNKNOWN.get(page, "").split()
    return [each for each in places_of(page) if re.split(r"\W", each.expression)[0] not in unknown]


CODED = [page for page in PAGES if code_of(page).strip()]


def left_out(page: str, *tables: dict[str, set[str]]) -> set[str]:
    return set().union(*(table.get(page, set()) for table in tables))


def completed(code: str) -> set[str]:
    return names(script_of(code, paths=(ROOT,)))


@pytest.mark.parametrize("page", CODED)
def test_the_programs_of_a_page_tell_the_type_of_the_flight(page: str) -> None:
    """Without it, editors complete none of its names."""
    assert re.findall(r"def \w+\((?:\w+, )*flight[,)].*", code_of(page)) == []


@pytest.mark.night
def test_the_pages_use_many_names() -> None:
    assert sum(len(known(page)) for page in CODED) > 400


@pytest.mark.night  # by day, jedi completes programs
@pytest.mark.parametrize("page", CODED)
def test_jedi_completes_what_a_page_uses(page: str) -> None:
    whole = script_of(code_of(page), paths=(ROOT,))
    left = [place for place in known(page) if place.name not in names(whole, place.line, place.column)]
    missing = {place.expression for place in left if place.name not in completed(cut_code(page, place))}
    assert missing == left_out(page, ONLY_BASEDPYRIGHT, NEITHER)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LanguageServer]:
    """A session of basedpyright, as an editor has it."""
    with language_server(tmp_path_factory.mktemp("editor"), (ROOT, GENERATED)) as session:
        yield session


def offered(server: LanguageServer, code: str, line: int, column: int, folder: Path) -> set[str]:
    path = folder / f"line_{line}_{column}_{len(code)}.py"
    path.write_text(code)
    with server.opened(path):
        return server.completions(path, line, column)


@pytest.mark.night  # by day, jedi completes programs, and mypy checks the types
@pytest.mark.parametrize("page", CODED)
def test_basedpyright_completes_what_a_page_uses(page: str, server: LanguageServer, tmp_path: Path) -> None:
    whole = tmp_path / "page.py"
    whole.write_text(code_of(page))
    with server.opened(whole):
        left = [each for each in known(page) if each.name not in server.completions(whole, each.line, each.column)]
    missing = {
        place.expression
        for place in left
        if place.name not in offered(server, cut_code(page, place), place.line, place.column, tmp_path)
    }
    assert missing == left_out(page, ONLY_JEDI, NEITHER)


HEAD = """
from msggen import live, recordings
from msggen.live import Vehicle
from px4_types import VehicleStatus, srv, topics
import msggen
vehicle = Vehicle("udp://127.0.0.1:8888")
log = recordings.open("flight.mcap")
"""
FIELDS = {"nav_state", "arming_state", "ARMING_STATE_ARMED", "NavigationState"}
COMPLETED: list[tuple[str, Collection[str]]] = [
    ("msggen.", {*msggen.__all__}),
    ("live.", {*live.__all__}),
    ("recordings.", {*recordings.__all__}),
    ("vehicle.", {"subscribe", "publish", "every", "call", "firmware", "wait_connected", "routes"}),
    ("with Vehicle() as one:\n    one.", {"subscribe", "publish"}),
    ("vehicle.firmware.", {"release", "differing"}),
    ("vehicle.wait_connected().", {"address", "key", "namespace"}),
    ("vehicle.routes[0].", {"name", "ros_type"}),
    ("vehicle.every(10, VehicleStatus()).", {"jitter", "close", "error"}),
    ("vehicle.subscribe(VehicleStatus).", {"latest", "wait_for", "timed", "drain", "received", "dropped"}),
    ("vehicle.subscribe(topics.out.vehicle_status).", {"latest", "wait_for"}),
    ("vehicle.subscribe('vehicle_status').", {"latest", "wait_for"}),
    ("for m in vehicle.subscribe(VehicleStatus):\n    m.", FIELDS),
    ("with vehicle.subscribe(VehicleStatus) as samples:\n    for m in samples:\n        m.", FIELDS),
    ("for m, time in vehicle.subscribe(VehicleStatus).timed():\n    m.", FIELDS),
    ("for m, time in vehicle.subscribe(VehicleStatus).arrived():\n    m.", FIELDS),
    ("async def read():\n    async for m in vehicle.subscribe(VehicleStatus):\n        m.", FIELDS),
    ("vehicle.subscribe(VehicleStatus).latest().", FIELDS),
    ("vehicle.subscribe(VehicleStatus).wait_for(bool, timeout=1).", FIELDS),
    ("m: VehicleStatus | None = vehicle.subscribe(topics.out.vehicle_status).latest()\nm.", FIELDS),
    ("m: VehicleStatus\nfor m in vehicle.subscribe(topics.out.vehicle_status):\n    m.", FIELDS),
    ("def is_armed(m: VehicleStatus) -> bool:\n    return m.", FIELDS),
    ("response: srv.VehicleCommand.Response = vehicle.call(srv.VehicleCommand.Request())\nresponse.reply.", {"result"}),
    ("field: msggen.Field = msggen.read().messages['a/B'].fields[0]\nfield.", {"name", "type", "comment"}),
    ("log.", {"topics", "samples", "messages", "table", "frame", "align", "duration"}),
    ("log.topics[0].", {"name", "count"}),
    ("log.samples('vehicle_status').", {"array", "columns", "table", "frame", "log_times"}),
    ("log['vehicle_status'].", {"dtype", "shape"}),
    ("log.frame('vehicle_status').", {"to_parquet", "columns"}),
    ("log.frame('vehicle_status', 'polars').", {"with_columns", "to_pandas"}),
    ("log.columns('vehicle_status')['nav_state'].", {"mean", "dtype"}),
    ("log.align('a', 'b', tolerance=0.1).", {"times", "frame", "unmatched"}),
    ("for m in log.messages(VehicleStatus):\n    m.", FIELDS),
    ("for time, m in log.messages(VehicleStatus, times=True):\n    m.", FIELDS),
]
"""What a user writes at the end of a program, and some of the names that editors offer there."""
IDS = [code.replace("\n", " ") for code, _ in COMPLETED]


@by_day(("code", "expected"), COMPLETED, 8, ids=IDS)
def test_jedi_completes_programs(code: str, expected: set[str]) -> None:
    assert expected <= completed(HEAD + code)


def test_jedi_completes_tables() -> None:
    assert {"schema", "to_pandas"} <= completed(f"{HEAD}log.table('vehicle_status').")


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("vehicle.", {"subscribe", "publish", "firmware"}),
        ("samples.", {"latest", "wait_for"}),
        ("newest.", FIELDS),
        ("for m in vehicle.subscribe(VehicleStatus):\n    m.", FIELDS),
        ("m: VehicleStatus | None = samples.latest()\nm.", FIELDS),
    ],
)
def test_jedi_completes_the_values_of_a_notebook(code: str, expected: set[str], px4_types: Any) -> None:
    """In IPython and Jupyter, jedi has the values of earlier cells."""
    link = FakeLink(px4_types)
    with Vehicle(link, px4_types) as vehicle:
        samples = vehicle.subscribe(px4_types.VehicleStatus)
        link.sample(link.connect(), px4_types.VehicleStatus())
        cells = {"vehicle": vehicle, "samples": samples, "newest": samples.latest()}
        assert expected <= names(cell_of(code, {**cells, "VehicleStatus": px4_types.VehicleStatus}))


@pytest.mark.night
@pytest.mark.parametrize(("code", "expected"), COMPLETED, ids=IDS)
def test_basedpyright_completes_programs(code: str, expected: set[str], server: LanguageServer, tmp_path: Path) -> None:
    lines = (HEAD + code).splitlines()
    assert expected <= offered(server, HEAD + code, len(lines), len(lines[-1]), tmp_path)
