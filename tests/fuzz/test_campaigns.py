"""Tests that run a fixed number of cases of each campaign, and that show that each campaign finds a planted error."""

from __future__ import annotations

import importlib
import itertools
import json
import os
import re
import shutil
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any

import pytest

from fuzz import __main__ as command
from fuzz import arguments, faults, missions, owners, payloads, recordings, runner, sessions, strangers
from fuzz.runner import NAMES, SEED, Failure, find, run
from msggen.base.disk import git
from msggen.base.disk.output import OutputPlan
from msggen.base.disk.record import Record, digest, read_record, write_record
from msggen.exports import writer
from msggen.link.xrce import inventory
from msggen.link.xrce.session import Session
from msggen.sources.tree import Snapshot
from msggen.vehicle.owned.records import event_of
from support import disk_tasks
from support.examples import by_day
from support.recordings import START
from support.scratch import scratch_root

ENOUGH = 3000
"""More cases than any campaign needs to find its planted error."""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs fork, links and limits of resources")


@pytest.fixture(autouse=True, scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Make the folders of cases in one place, and remove it at the end."""
    tmp_path_factory.getbasetemp()  # pytest makes its own folder when it is first needed, which may be here
    before, root = tempfile.tempdir, scratch_root()
    tempfile.tempdir = root
    yield
    tempfile.tempdir = before
    shutil.rmtree(root, ignore_errors=True)


@pytest.mark.slow
@pytest.mark.parametrize("share", [120, pytest.param(1, marks=pytest.mark.night)], ids=["some", "all"])
@pytest.mark.parametrize("name", NAMES)
def test_no_case_has_a_wrong_outcome(name: str, share: int) -> None:
    count = -(-find(name).COUNT // share)
    checked, failure = run(name, SEED, range(count))
    assert failure is None, f"{failure.trace}\nrepeat with: {failure.command}"
    assert checked == count


@pytest.mark.parametrize("given", owners.COMMANDS, ids=" ".join)
def test_commands_understand_an_owner_that_tells_nothing_wrong(
    given: tuple[str, ...], caplog: pytest.LogCaptureFixture
) -> None:
    outcome = owners.outcome_of(owners.Case(given, "right", 0))
    assert outcome.code == {"doctor": 1, "command": 1}.get(given[0], 0), outcome.stderr
    assert "what is no record" not in caplog.text


def test_an_owner_that_says_nothing_of_itself_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owners.Told, "answer", lambda _, number, _what: event_of("answer", number, None))
    for given in (("link", "list"), ("link", "list", "--json")):
        outcome = owners.outcome_of(owners.Case(given, "right", 0))
        assert (outcome.code, "it does not answer" in outcome.stdout) == (0, True), outcome.stderr


def write_in_place(folder: str, files: Mapping[str, str]) -> tuple[OutputPlan, Record]:
    """Write files one after the other, and follow links, as msggen must not."""
    removed = [name for name in read_record(folder).files if name not in files]
    record = Record({name: digest(text.encode()) for name, text in files.items()})
    for name, text in files.items():
        path = Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_fifo():
            with path.open("w", encoding="utf-8") as stream:
                stream.write(text)
    for name in removed:
        Path(folder, name).unlink(missing_ok=True)
    write_record(folder, record)
    return OutputPlan(folder, files, tuple(files), tuple(removed), ()), record


def read_carelessly(path: str) -> Snapshot:
    """Read an archive without expecting a damaged one."""
    with tarfile.open(path) as archive:
        files = {member.name: archive.extractfile(member) for member in archive if member.isfile()}
        return Snapshot(path, {name: stream.read() for name, stream in files.items() if stream}, {})


def without_field(_: Any, error: Exception) -> Exception:
    cdr: Any = importlib.import_module("px4_types.cdr")
    found: Exception = cdr.EncodeError(str(error))
    return found


def at_once(target: str, write: Callable[[str], Any]) -> Any:
    """Write a target in place, as msggen must not."""
    return write(target)


def fail(*_: object, **__: object) -> Any:
    raise KeyError


PLANTED: dict[str, tuple[str, Any]] = {
    "payloads": ("px4_types.encapsulation.SURPLUS", 4),
    "values": ("px4_types.explain.encode_error", without_field),
    "definitions": ("msggen.sources.catalog.decode_text", lambda data, _: (data.decode(), [])),
    "modules": ("msggen.generate.python.message.documentation", lambda text, *_, **__: f'"""{text}"""'),
    "readers": ("fuzz.readers.parse_record", json.loads),
    "archives": ("msggen.sources.tarball.read_archive", read_carelessly),
    "kills": ("msggen.base.disk.incremental.write_output", write_in_place),
    "faults": ("msggen.base.disk.incremental.write_output", write_in_place),
    "strangers": ("msggen.base.disk.incremental.write_output", write_in_place),
    "shadows": ("msggen.cli.packages.names_folder", lambda _: True),
    "settings": ("msggen.sources.settings.is_own", lambda _: True),
    "arguments": ("msggen.sources.catalog.decode_text", fail),
    "datagrams": ("msggen.link.xrce.wire.WireError", KeyError),
    "recordings": ("msggen.exports.writer.ChunkWriter.add_chunk", lambda *_: None),
    "conversions": ("msggen.exports.convert._whole", at_once),
    "fleets": ("msggen.exports.fleet.storage.check_links", lambda *_: None),
    "stores": ("msggen.exports.fleet.fleet.Fleet._left", lambda *_: []),
    "servers": ("msggen.recordings.stores.connections.Origin.leads_to", lambda *_: True),
    "structures": ("msggen.recordings.decode.schemas.too_large", lambda *_: iter(())),
    "sessions": ("msggen.link.xrce.session.REPLIES", 4096),
    "flights": ("msggen.flight.setpoints.Stream.stop", lambda _: None),
    "measurements": ("msggen.flight.measured._positive", lambda numbers, _: numbers),
    "stalls": ("msggen.link.xrce.streams.ReliableOutput.expire", lambda *_: 0),
    "events": ("msggen.recordings.decode.event_metadata._object", lambda value: value),
    "owners": ("msggen.vehicle.owned.unix.checked_event", lambda _, values: values),
    "mcp": ("msggen.mcp.places.Places._is_inside", lambda *_: True),
    "editors": ("msggen.lsp.project.State.is_whole", lambda *_: True),
    "findings": ("msggen.analysis.document.isfinite", lambda _: True),
    "missions": ("msggen.flight.missions.reading._Reading._is", lambda *_: True),
    "zenoh": ("msggen.link.rmw_zenoh.vehicles.MAX_VEHICLES", 1 << 30),
    "networks": ("msggen.link.waiting.Waiting.of", lambda *_: -(10**10)),
    "motions": ("msggen.analysis.response._usable", lambda column: column),
    "records": ("msggen.link.session_files._address", lambda value, _: tuple(value)),
}
"""An error for each campaign: the function or the number that is replaced, and by what."""


@pytest.mark.night
@pytest.mark.parametrize("name", NAMES)
def test_each_campaign_finds_a_planted_error(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    payloads.targets()  # imports the package
    for task in disk_tasks.TASKS:
        disk_tasks.ends(task)
    place, wrong = PLANTED[name]
    monkeypatch.setattr(place, wrong)
    _, failure = run(name, SEED, range(ENOUGH))
    assert failure is not None
    monkeypatch.undo()
    faults.calls_of.cache_clear()
    _, failure = run(name, SEED, [failure.index])
    assert failure is None, "it fails without the error too"


def slow_namespace(name: str) -> str:
    """Look for a namespace with an expression whose time is cubic."""
    found = re.fullmatch(r"/*([A-Za-z0-9_/]*?)/*px4_micro_xrce_dds", name)
    return found[1] if found else ""


def delete_slowly(self: inventory.Inventory, object_id: bytes) -> None:
    """Look for each part among all entities."""
    for part in [part for part, entity in self._entities.items() if inventory._parent(entity) == object_id]:
        delete_slowly(self, part)
    self._entities.pop(object_id, None)


def first_without_entities(sessions: Iterable[Session], *_: object) -> Session | None:
    """Let only clients give way that have few entities, or are silent."""
    return next((each for each in sessions if not each.is_vehicle or each.remote is None), None)


OLD = {
    "a cubic expression": ("name", "msggen.link.xrce.inventory._namespace", slow_namespace),
    "a quadratic deletion": ("storm", "msggen.link.xrce.inventory.Inventory.delete", delete_slowly),
    "any number of replies": ("ask", "msggen.link.xrce.session.REPLIES", 4096),
    "any number of repetitions": ("repeat", "msggen.link.xrce.session.REPETITIONS", 16),
    "numbers that are far away": ("displace", "msggen.link.xrce.session.NEAR", 0x8000),
    "any number of lost samples": ("jump", "msggen.link.xrce.session.LOSSES", 0x10000),
    "the oldest gives way": ("begin", "msggen.link.xrce.agent.find_least", lambda sessions, *_: next(iter(sessions))),
    "vehicles never give way": ("resemble", "msggen.link.xrce.agent.find_least", first_without_entities),
}
"""Errors that sessions had: the act that shows each, the function or the number that is replaced, and by what."""


@pytest.mark.slow
@by_day("error", OLD, 3)
def test_the_campaign_of_sessions_finds_what_was_wrong_before(error: str, monkeypatch: pytest.MonkeyPatch) -> None:
    act, place, wrong = OLD[error]
    cases = [sessions.case(Random(f"sessions {SEED} {index}")) for index in range(300)]  # noqa: S311
    indices = [index for index, case in enumerate(cases) if act in case.acts]
    indices.sort(key=lambda index: (-cases[index].clients, len(cases[index].acts)))  # the largest crowds first
    monkeypatch.setattr(place, wrong)
    _, failure = run("sessions", SEED, indices[:20])
    assert failure is not None
    monkeypatch.undo()
    _, failure = run("sessions", SEED, [failure.index])
    assert failure is None, "it fails without the error too"


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["fsmonitor", "clean", "uploadpack"])
def test_a_program_that_git_starts_is_found(setting: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (config,) = (text for text in strangers.GIT if f"{setting} =" in text)
    case = strangers.Case("sync", (strangers.Oddity("px4_msgs/.git/config", "git", config),))
    strangers.check(case)
    monkeypatch.setattr(git, "_WITHOUT_PROGRAMS", {})
    monkeypatch.setattr(git, "_OPTIONS", ())
    monkeypatch.setattr(git, "_without_filters", lambda _: [])
    with pytest.raises(AssertionError, match="outside/started"):
        strangers.check(case)


@pytest.mark.tools("git")
def test_a_command_that_prints_bytes_has_an_outcome() -> None:
    arguments.check(("render", "--px4", "PX4", "--template", "a.hpp.j2", "-o", "-"))


def test_a_recorder_that_is_killed_before_its_first_write_leaves_an_empty_file(monkeypatch: pytest.MonkeyPatch) -> None:
    def record(folder: Path, case: recordings.Case, told: int) -> None:
        made = writer.Writer(str(folder / "flight_0.mcap"))
        channel = made.add_channel(writer.Channel("/fmu/out/mine", "px4_msgs/msg/Mine", "uint64 timestamp\n", ""))
        made.write(channel, START, START, recordings._payload(0, case.size))
        made.close()
        (folder / "flight_1.mcap").touch()
        os.write(told, (1).to_bytes(8, "little"))
        time.sleep(60)

    monkeypatch.setattr(recordings, "_record", record)
    recordings.check(recordings.Case(0.0, "none", 0.0, 1, 60, 20_000))


@pytest.mark.parametrize("name", NAMES)
def test_a_case_follows_from_its_seed_and_index(name: str) -> None:
    campaign = find(name)
    cases = [repr(campaign.case(Random(f"{name} {seed}"))) for seed in (1, 1, 2, 3, 4)]  # noqa: S311 - no secret
    assert cases[0] == cases[1]
    assert len({*cases}) > 1


@pytest.fixture
def planted(monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """Return a campaign of the name `planted`, whose cases are numbers."""
    campaign = SimpleNamespace(COUNT=10, case=lambda chance: chance.randint(0, 9), check=lambda _: None)
    monkeypatch.setitem(sys.modules, "fuzz.planted", campaign)
    monkeypatch.setattr(command, "NAMES", ("planted",))
    return campaign


def spin(_: object) -> None:
    for _ in itertools.count():
        pass


def hang(_: object) -> None:
    reader, _writer = os.pipe()
    os.read(reader, 1)


@pytest.mark.parametrize(
    ("check", "error"),
    [
        (spin, "TooSlowError"),
        (hang, "TooSlowError"),
        pytest.param(
            lambda _: bytearray(2 * runner.MEMORY),
            "MemoryError",
            marks=pytest.mark.skipif(sys.platform != "linux", reason="the memory is limited on Linux only"),
        ),
        (lambda _: sys.exit(0), "SystemExit"),
    ],
    ids=["spins", "hangs", "takes memory", "exits"],
)
def test_a_case_that_exceeds_a_limit_fails(
    check: Callable[[object], object], error: str, planted: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "CPU_SECONDS", 0.2)
    monkeypatch.setattr(runner, "SECONDS", 0.5)
    planted.check = check
    count, failure = run("planted", SEED, range(10))
    assert count == 1
    assert failure is not None
    assert error in failure.trace


@pytest.mark.parametrize("processes", [1, 2])
def test_the_command_prints_counts_and_how_to_repeat_a_failure(
    processes: int, planted: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    monkeypatch.setattr(sys, "argv", ["fuzz", "--output", str(tmp_path), "--processes", str(processes)])
    assert command.main() == 0
    assert capsys.readouterr().out.split()[:3] == ["planted", "10", "cases"]
    planted.check = partial(divmod, 1)
    planted.case = lambda _: 0
    assert command.main() == 1
    out = capsys.readouterr().out
    assert "ZeroDivisionError" in out
    assert "python -m tests.fuzz planted --seed 1 --index 0" in out
    (saved, *_) = tmp_path.iterdir()
    assert "ZeroDivisionError" in saved.read_text()


def test_a_failure_names_the_command_that_repeats_it() -> None:
    assert Failure("kills", 3, 12, (), "").command == "python -m tests.fuzz kills --seed 3 --index 12"


def test_the_list_has_all_campaigns_their_counts_and_what_they_prove(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["fuzz", "--list"])
    assert command.main() == 0
    listed = capsys.readouterr().out
    rows = re.findall(r"^(\w+): ([\d,]+) cases at night\n    \w", listed, re.MULTILINE)
    assert [(name, int(count.replace(",", ""))) for name, count in rows] == [(name, find(name).COUNT) for name in NAMES]


def test_cases_of_missions_leave_alone_what_they_are_made_of() -> None:
    """Else a case depends on those before it, and a list can come to lie in itself."""
    before = repr(missions.ODD)
    for index in range(400):
        missions.case(Random(index))  # noqa: S311 - no secret
    assert repr(missions.ODD) == before
