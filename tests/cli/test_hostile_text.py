"""Tests that no command lets foreign text command a terminal, a CI server, a parser or a spreadsheet."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import struct
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from msggen.base.foreign import Styled, csv_text, escaped, guarded_output, safe_json
from msggen.cli import main
from msggen.cli.commands.log import progress
from support.commands import COMMANDS
from support.examples import by_day
from support.hostile_text import BYTES, NAME, ONE_LINE, PIECES, SURROGATES, HostileLink, check_json, check_shown
from support.log_files import Written, write_log
from support.ports import free_port
from support.repository import ROOT
from support.ulog import UlogWriter

TYPES = str(ROOT / "generated" / "px4_types")
FILE = SURROGATES
COMMENT = ONE_LINE.replace("\r", " ")

_LOGS = [["."], [f"{FILE}.mcap"], [f"{FILE}.ulg"], [f"{FILE}.cut.mcap"], [f"{FILE}.bad.mcap"], [f"{FILE}.bag"], [FILE]]
_FORMATS = [["--output-format", name] for name in ("full", "concise", "json", "github", "sarif", "junit")]


def _each(*words: str, of: Sequence[Sequence[str]] = ((),)) -> list[list[str]]:
    return [[*words, *more] for more in of]


CASES: dict[str, list[list[str]]] = {
    "breaking": [
        *_each("--px4", f"{FILE}.px4", "--against", f"{FILE}.old", of=_FORMATS),
        *_each("--px4", FILE, "--against", NAME, of=_FORMATS),
    ],
    "build": [
        ["--px4", f"{FILE}.px4", "-o", f"{FILE}.out"],
        ["--px4", f"{FILE}.px4", "-o", f"{FILE}.out", "--diff"],
        ["--px4", f"{FILE}.px4", "-o", f"{FILE}.out", "--list-outputs"],
        ["--px4", f"{FILE}.wrong", "-o", "out"],
        ["--px4", f"{FILE}.mcap"],
        ["--px4", FILE],
        [NAME],
        [f"--{NAME}"],
    ],
    "bump": [["Wind", "--px4", f"{FILE}.px4", "--diff"], [NAME, "--px4", f"{FILE}.px4"]],
    "call": [["vehicle_command", "{}", "--wait", "1", "--timeout", "0.1"], [NAME, NAME]],
    "check": [
        *_each(f"{FILE}.px4", f"{FILE}.old", of=_FORMATS),
        *_each(f"{FILE}.wrong", f"{FILE}.old", of=_FORMATS),
    ],
    "command": [["--list", NAME], ["NAV_TAKEOFF", f"{NAME}=1"], ["NAV_TAKEOFF", "--timeout", "0.1"]],
    "completion": [[NAME], ["bash"]],
    "docs": [
        ["--px4", f"{FILE}.px4", "-o", f"{FILE}.site"],
        ["--px4", f"{FILE}.wrong", "-o", f"{FILE}.site", "--diff"],
    ],
    "doctor": _each("--for", "0.5", NAME, of=_FORMATS),
    "explain": [[NAME]],
    "link list": [[], ["--json"], [NAME]],
    "link serve": [[NAME], ["--link", NAME], ["--link", f"unix:///{NAME}"], ["--link", f"serial:///{FILE}"]],
    "link stop": [[NAME], ["udp://127.0.0.1:9"], [f"serial:///{FILE}"]],
    "lint": [*_each("--px4", f"{FILE}.px4", of=_FORMATS), ["--px4", f"{FILE}.px4", "--select", NAME]],
    "log compact": [[f"{FILE}.fleet"], [FILE], [NAME], [NAME, "--json"]],
    "log compare": [
        *_each(f"{FILE}.ulg", of=_LOGS),
        *_each(f"{FILE}.ulg", "--json", of=_LOGS),
        [f"{FILE}.mcap", NAME],
    ],
    "log convert": [
        *[[*log, "-o", f"{FILE}.{number}", "--format", "csv"] for number, log in enumerate(_LOGS)],
        *[[*log, "-o", f"{FILE}.{number}", "--json"] for number, log in enumerate(_LOGS[1:3], 10)],
        *_each("-o", f"{FILE}.fleet", "--json", of=[["."]]),
        [f"{FILE}.mcap", NAME, "-o", "x.mcap"],
        [f"{FILE}.mcap", "-o", f"{FILE}/x/y.mcap"],
        [f"{FILE}.mcap", "-o", f"{FILE}.sql", "--format", "csv", "--sql-names"],
        [f"{FILE}.mcap", "-o", f"{FILE}.csv"],
        [f"{FILE}.mcap", "/fmu/out/rpm", "-o", f"{FILE}.arrow"],
        [f"{FILE}.mcap", "-o", f"{FILE}.xlsx"],
        [f"{FILE}.mcap", "-o", f"{FILE}.parquet"],
    ],
    "log cut": [*_each("-o", "cut.mcap", "--start", "0", of=_LOGS), [f"{FILE}.mcap", NAME, "--stop", "1"]],
    "log findings": [*_each("-v", of=_LOGS), *_each("--json", of=_LOGS)],
    "log info": [
        *_each(of=_LOGS),
        *_each("--json", of=_LOGS),
        *[[f"{FILE}.mcap", name] for name in (*PIECES, NAME)],
        [f"{FILE}.mcap", PIECES[0], "--json"],
    ],
    "log merge": [[f"{FILE}.mcap", f"{FILE}.cut.mcap", "-o", f"{FILE}.m.mcap"], [f"{FILE}.mcap", FILE]],
    "log plot": [
        [f"{FILE}.mcap", f"{PIECES[0]}.x", "-o", f"{FILE}.png"],
        [f"{FILE}.mcap", f"{NAME}.x", "-o", f"{FILE}.png"],
        [FILE, NAME, "-o", f"{FILE}.svg"],
    ],
    "log repair": _each("-o", f"{FILE}.repaired.mcap", of=_LOGS),
    "log report": [
        *_each("-o", f"{FILE}.html", of=_LOGS),
        *_each(f"{FILE}.ulg", "-o", f"{FILE}.html", of=_LOGS),
    ],
    "log show": [
        *[
            [f"{FILE}.mcap", name, *more]
            for name in (f"{PIECES[0]} ", f"{PIECES[4]} ", "/fmu/out/rpm", PIECES[3])
            for more in ([], ["--json"], ["--csv"], ["--csv", "--quote-formulas", "--sql-names"], ["--field", NAME])
        ],
        *[
            [f"{FILE}.ulg", *words]
            for words in (["--texts"], ["--texts", "--json"], ["--params"], ["--params", "--json"])
        ],
        *[[*log, NAME] for log in _LOGS],
    ],
    "mission check": [
        *_each(of=[[f"{FILE}.mission"], [f"{FILE}.mission", "--json"], [FILE], [NAME]]),
        *([f"{FILE}.mission", "--action", NAME], [f"{FILE}.mission", "--action", NAME, "--json"]),
    ],
    "play": [
        [f"{FILE}.mcap", "--to", "udp://127.0.0.1:9", "--for", "0.2"],
        [FILE],
        [f"{FILE}.ulg"],
        [f"{FILE}.play.mcap", NAME],
    ],
    "px4-generate": [["--headers", "-f", f"{FILE}.px4/msg/Rpm.msg", "-i", FILE, "-e", FILE, "-o", FILE], [NAME]],
    "record": [["--for", "0.3", "-o", f"{FILE}.rec.mcap"], ["--for", "0.3", "--json", "-o", f"{FILE}.j.mcap"], [NAME]],
    "lsp": [[NAME]],
    "mcp": [[NAME], [FILE, NAME]],
    "relay": [[NAME]],
    "releases": [[], [NAME]],
    "render": [
        ["--px4", f"{FILE}.px4", "--template", f"{FILE}.j2", "-o", f"{FILE}.rendered"],
        ["--px4", f"{FILE}.px4", "--template", f"{FILE}.j2", "-o", f"{FILE}.rendered", "--diff"],
        ["--px4", f"{FILE}.px4", "--template", FILE, "-o", "x"],
    ],
    "rules": [[], ["--output-format", "json"]],
    "settings": [[], ["--json"], ["--schema"], [NAME]],
    "sim": [
        *(["--namespace", NAME], ["--types", NAME], ["--wrong-hash", NAME], [NAME]),
        *(["--param", NAME], ["--param", f"RTL_MIN_DIST={NAME}"], ["--fault", NAME], ["--fault", f"1:{NAME}"]),
        *(["--fault", f"1:mode={NAME}"], ["--fault", f"1:battery={NAME}"], ["--speed", NAME]),
    ],
    "sync": [
        [f"{FILE}.ros", "--create", "--px4", f"{FILE}.px4", "--diff"],
        [FILE, "--create", "--px4", f"{FILE}.px4"],
        [FILE, "--px4", f"{FILE}.wrong"],
    ],
    "top": [["--once", "--window", "0.1"], ["--json", "--window", "0.1"]],
    "topic bw": [["-n", "1"], ["-n", "1", "--json"], [NAME, "-n", "1"]],
    "topic delay": [["-n", "1"], [NAME, "-n", "1"]],
    "topic echo": [
        *_each("message_format_response", "--once", of=[[], ["--json"], ["--csv"], ["--csv", "--quote-formulas"]]),
        *_each("message_format_response", "--once", "--field", "topic_name", of=[[], ["--csv"]]),
        *_each("--for", "0.2", of=[[name] for name in (NAME, PIECES[0])]),
        ["message_format_response", f"timestamp == '{NAME}'", "--once"],
        ["message_format_response", "--field", NAME, "--once"],
        ["message_format_response", "message_format_response", "--once"],
        ["message_format_response", PIECES[0], "--json", "--for", "0.2"],
        [NAME, "--filter", NAME, "--for", "0.2"],
    ],
    "topic find": [[f"{NAME}/msg/{NAME}"], [PIECES[0]]],
    "topic hz": [["-n", "1"], ["-n", "1", "--json"], [NAME, "-n", "1"]],
    "topic info": [[name] for name in (NAME, PIECES[0])] + [[PIECES[0], "--json"]],
    "topic list": [[], ["-t"], ["--json"], ["-v", "--window", "0.1"]],
    "topic plot": [
        [f"{NAME}.x", "--for", "0.2"],
        [NAME],
        [f"message_format_response.{NAME}", "--for", "0.2"],
        ["message_format_response.timestamp", "--for", "0.2"],
        ["message_format_response.timestamp", "--for", "0.2", "-o", f"{FILE}.svg"],
        ["message_format_response.topic_name", "-o", f"{FILE}.jpg"],
    ],
    "topic pub": [
        [NAME, "{}"],
        ["vehicle_command", f"{{x: '{NAME}'}}", "--once"],
        ["vehicle_command", "{}", "--for", "0.1"],
    ],
    "topic type": [[name] for name in (NAME, PIECES[0])],
    "view": [[f"{FILE}.mcap", "--port", "0", "--for", "0.1"], [f"{FILE}.bad.mcap"], ["--host", NAME, f"{FILE}.mcap"]],
}
LIVE = {"call", "command", "doctor", "record", "top", *(name for name in CASES if name.startswith("topic "))}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of hostile recordings and definitions."""
    folder = tmp_path_factory.mktemp("hostile")
    path = os.path.join(os.fsencode(folder), BYTES)

    def named(end: str) -> Path:
        return Path(os.fsdecode(path + end.encode()))

    definition = (
        f"# {COMMENT}\nuint64 timestamp\nfloat32 x  # [{COMMENT[12:30]}] [@frame {COMMENT}] {COMMENT}\nstring text\n"
    )
    text = ("=" + NAME).encode()
    sample = bytes([0, 1, 0, 0]) + struct.pack("<QfI", 1, 1.0, len(text) + 1) + text + b"\0"
    rows = [(number * 10**9, number * 10**9, sample) for number in range(1, 4)]
    topics = [Written(name, f"{NAME}/msg/{NAME}", "", rows) for name in (*PIECES, NAME)]
    topics += [Written(f"{name} ", "a/msg/A", definition, rows, {NAME: NAME}) for name in PIECES]
    topics += [Written("/fmu/out/rpm", "px4_msgs/msg/Rpm", definition, rows)]
    recording = write_log(named(".mcap"), topics)
    write_log(named(".play.mcap"), [Written(f"/fmu/out/{name}", "a/msg/A", definition, rows) for name in PIECES])
    named(".cut.mcap").write_bytes(recording.read_bytes()[:-900])
    named(".bad.mcap").write_bytes(b"\x89MCAP0\r\n" + BYTES)
    ulog = UlogWriter()
    for key in ("sys_name", "ver_hw", "ver_sw_branch", "ver_sw", NAME):
        ulog.information(f"char[{len(BYTES)}] {key}", BYTES)
    for name in (*PIECES, "MPC_X"):
        ulog.message("P", bytes([len(f"float {name}".encode())]) + f"float {name}".encode() + struct.pack("<f", 1.0))
    ulog.format("a", "uint64_t timestamp;float x")
    ulog.format("b", f"uint64_t timestamp;float {NAME}")
    ulog.subscribe(0, "a")
    ulog.subscribe(1, NAME)
    for time in range(3):
        ulog.sample(0, struct.pack("<Qf", time * 500_000, 1.0))
        ulog.message("L", bytes([51]) + struct.pack("<Q", time) + (text if time else text[1:]))
    ulog.write(named(".ulg"))
    bag = named(".bag")
    bag.mkdir()
    (bag / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths: ['{ONE_LINE!r}']\n")
    for end, field in ((".px4", "uint8 x"), (".old", "uint16 x"), (".wrong", f"uint8 {ONE_LINE}")):
        (named(end) / "msg" / "versioned").mkdir(parents=True)
        for name in ("Rpm.msg", "versioned/Wind.msg", *([os.fsdecode(BYTES) + ".msg"] if end == ".wrong" else [])):
            comment = f"# {COMMENT}\n    # ::error::{COMMENT} [@frame {COMMENT}] [@{COMMENT} x]\n"
            body = f"uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n{field}  # [m] {end} {comment}"
            (named(end) / "msg" / name).write_text(body, errors="surrogateescape")
    items = [{"type": NAME, NAME: NAME, "id": NAME}, {"type": "hold", NAME: 1, "id": NAME}]
    named(".mission").write_text(json.dumps({"version": 1, NAME: 1, "mission": {"items": items, NAME: NAME}}))
    named(".j2").write_text("{% for each in catalog.messages %}\n{{ each.comment }}::error::\t\x1b[35;45m{% endfor %}")
    return folder


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def here(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "here"
    shutil.copytree(files, folder, symlinks=True)
    monkeypatch.chdir(folder)
    monkeypatch.setattr("msggen.cli.link.PATIENCE", 2.0)
    return folder


def run(words: Sequence[str], kind: str) -> tuple[int, str, str]:
    """Run msggen as if it printed to a pipe or to a terminal."""
    out, err = (_Terminal() if kind == "terminal" else io.StringIO() for _ in range(2))
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main(list(words))
        except SystemExit as done:
            code = int(str(done.code))
    return code, out.getvalue(), err.getvalue()


def without_control_characters(text: str) -> str:
    return "".join(each for each in text if each.isprintable())


def test_every_command_has_a_case() -> None:
    assert CASES.keys() == COMMANDS.keys()


KINDS = ("pipe", "terminal")
"""What commands print to. Each run takes one for each command, in turns; the night both, and a pipe with colours."""
EACH = [
    (command, kind)
    for place, command in enumerate(CASES)
    for kind in (KINDS[place % 2], KINDS[(place + 1) % 2], "colours")
]


@pytest.mark.usefixtures("here")
@by_day(("command", "kind"), EACH, 3)
def test_no_command_prints_foreign_text_as_it_is(
    command: str, kind: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    if kind == "colours":
        monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)
    for module in ("msggen.vehicle.sharing", "msggen.doctor.watching"):
        monkeypatch.setattr(f"{module}.open_link", lambda *_, **__: HostileLink(px4_types))
    link = ["--link", f"udp://127.0.0.1:{free_port()}", *([] if command == "doctor" else ["--types", TYPES])]
    for words in CASES[command]:
        whole = [*command.split(), *words, *(link if command in LIVE else ())]
        code, out, err = run(whole, kind)
        assert code in (0, 1, 2), (whole, err)
        assert "Traceback" not in err
        has_commands = "github" in words
        if kind == "pipe" and "--diff" in words:  # a patch must apply: contents of files stay as they are
            lines = (without_control_characters(line) if line[:1] in "+- " else line for line in out.split("\n"))
            out = "\n".join(lines)
        check_shown(out, is_terminal=kind != "pipe", has_commands=has_commands)
        check_shown(err, is_terminal=kind != "pipe")
        if {"--json", "json", "sarif"} & {*words} and out:
            check_json(out)


@pytest.mark.parametrize("quotes", [False, True])
def test_csv_has_no_control_characters_and_quotes_formulas_if_asked(quotes: bool, here: Path) -> None:  # noqa: FBT001
    more = ["--quote-formulas"] if quotes else []
    for number, recording in enumerate((f"{FILE}.mcap", f"{FILE}.ulg")):
        run(["log", "convert", recording, "--format", "csv", "-o", f"out{number}", *more], "pipe")
        texts = [path.read_text() for path in (here / f"out{number}").iterdir()]
        assert texts
        for text in texts:
            check_shown(text.replace("##", "").replace("::", ""))
            cells = {cell for row in csv.reader(io.StringIO(text)) for cell in row}
            is_left = any(cell[:1] in ("=", "@", "+") for cell in cells)
            assert not (quotes and is_left)
        assert any(f"{''.join(chr(39) * quotes)}=::error::one" in text for text in texts)


# The functions


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/fmu/out/rpm é Ω 風 ש 🚁", "/fmu/out/rpm é Ω 風 ש 🚁"),
        ("a\x1b[31mb\x9b\x7f", r"a\x1b[31mb\x9b\x7f"),
        ("a\nb\tc\rd", r"a\nb\tc\rd"),
        ("\u202ea\u2028b\udcff", r"\u202ea\u2028b\udcff"),
        ("::error::a", r"\x3a:error::a"),
        (" \t::error::a ::b", r" \t::error::a ::b"),
        ("  ::a", r"  \x3a:a"),
        ("a ##[b] ##vso[c] ## [d] # [e]", r"a \x23#[b] \x23#vso[c] ## [d] # [e]"),
        (Styled("a\n ::b\r\n\tc\x1b[1md\x1b]0;e\x07"), "a\n \\x3a:b\r\n\tc\x1b[1md\\x1b]0;e\\x07"),
        (Styled("\x1b[1m::a\r\x1b[K::b"), "\x1b[1m\\x3a:a\r\x1b[K::b"),
    ],
)
def test_a_guarded_stream_escapes_what_is_foreign(text: str, shown: str, capsys: pytest.CaptureFixture[str]) -> None:
    with guarded_output():
        print(text)
        print(text, file=sys.stderr)
    assert capsys.readouterr() == (f"{shown}\n", f"{shown}\n")


def test_only_the_start_of_a_line_is_guarded_against_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with guarded_output():
        print("a", "::b", Styled("::c\n"), "::d")
        print(end="")
        print(" ", "::e")
    assert capsys.readouterr().out == "a ::b ::c\n \\x3a:d\n  \\x3a:e\n"


def test_the_guard_ends_with_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    before = sys.stdout, sys.stderr
    assert main(["releases"]) == 0
    assert (sys.stdout, sys.stderr) == before
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("text", [NAME, SURROGATES, "\\ud800", "\\\ud800🚁\udfff", "##[a]\x7f", '"\\##[', "é"])
def test_json_has_the_text_without_what_others_obey(text: str) -> None:
    made = safe_json(json.dumps({text: text}))
    assert made.isprintable()
    assert "##[" not in made
    known = text.encode(errors="backslashreplace").decode()
    assert json.loads(made) == {known: known}


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@x", " =1", "\t=1", "＝1"])  # noqa: RUF001 - a wide =
def test_a_formula_is_quoted_if_asked(text: str) -> None:
    assert csv_text(text, quotes_formulas=True) == f"'{escaped(text)}"
    assert csv_text(text) == escaped(text)
    assert csv_text(f"a{text}", quotes_formulas=True) == escaped(f"a{text}")
