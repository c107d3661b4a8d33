"""Tests of completion: what msggen proposes for a command line, and that bash, zsh and fish show it."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.writer import Writer

from support.catalogs import write_definitions
from support.examples import by_day
from support.packages import committed, git
from support.repository import ROOT
from support.ulog import write_ulog

FILES = {
    "fw/msg/versioned/HomePosition.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n",
    "fw/msg/Bulb.msg": "uint64 timestamp\n",
    "fw/boards/px4/sitl/default.px4board": "",
    "fw/boards/px4/fmu-v6x/default.px4board": "",
    "fw/src/modules/README": "",
    "odd/msg/Bulb.msg": "\0",
    "template.j2": "",
}
TYPES = ROOT / "generated" / "px4_types"
CASES = {
    "msggen bre": ["breaking"],
    "msggen build --px4 v1.": ["v1.18", "v1.17", "v1.16", "v1.15", "v1.14"],
    "msggen build --px4 f": ["flight.ulg", "fw/"],
    "msggen build --px4 ins": ["installed"],
    "msggen check fw ins": ["installed"],
    "msggen build --release ma": ["main"],
    "msggen build --px4 fw --board px4_s": ["px4_sitl_default"],
    "msggen breaking --px4 fw --against v1.1": ["v1.18", "v1.17", "v1.16", "v1.15", "v1.14", "v1.16-mine"],
    "msggen breaking --px4 fw --against topic": ["topic/wheel"],
    "msggen breaking --px4 fw --against templ": ["template.j2"],
    "msggen bump --px4 fw --against topic": ["topic/wheel"],
    "msggen bump --px4 fw ": ["HomePosition"],
    "msggen bump --px4 nowhere Ho": [],
    "msggen explain M30": ["M301", "M302", "M303", "M304", "M305", "M306", "M307"],
    "msggen breaking --select WIRE,FIELD_MO": ["WIRE,FIELD_MOVED"],
    "msggen lint --select TAG,UNIT_U": ["TAG,UNIT_UNKNOWN"],
    "msggen lint --px4 fw B": ["Bulb"],
    "msggen check --output-format s": ["sarif"],
    "msggen check f": ["flight.ulg", "fw/"],
    "msggen render --each en": ["endpoint"],
    "msggen render --template t": ["template.j2"],
    "msggen render --px4 fw --message B": ["Bulb"],
    "msggen render --message HomePosi": ["HomePosition"],
    "msggen sync --creat": ["--create"],
    "msggen completion z": ["zsh"],
    "msggen topic ec": ["echo"],
    "msggen topic echo --types TYPES vehicle_st": ["vehicle_status"],
    "msggen topic echo --types TYPES vehicle_comm": ["vehicle_command_ack"],
    "msggen topic info --types TYPES vehicle_command": [
        "vehicle_command_ack",
        "vehicle_command",
        "vehicle_command_mode_executor",
    ],
    "msggen topic hz --types TYPES wind /fmu/out/vehicle_st": ["/fmu/out/vehicle_status_v4"],
    "msggen topic find --types TYPES VehicleSt": ["VehicleStatus"],
    "msggen topic echo --types TYPES vehicle_status --field armi": ["arming_state"],
    "msggen topic echo --types TYPES vehicle_odometry --field velocity[": [
        r"velocity\[0\]",
        r"velocity\[1\]",
        r"velocity\[2\]",
    ],
    "msggen topic echo --types TYPES vehicle_status 'arming_state == A": ["arming_state == ARMED"],
    "msggen topic echo --types TYPES vehicle_status 'failsafe and armi": ["failsafe and arming_state"],
    "msggen topic echo --types nowhere vehicle_st": [],
    "msggen topic plot --types TYPES wi": [
        "wind.timestamp",
        "wind.timestamp_sample",
        "wind.windspeed_north",
        "wind.windspeed_east",
        "wind.variance_north",
        "wind.variance_east",
        "wind.tas_innov",
        "wind.tas_innov_var",
        "wind.beta_innov",
        "wind.beta_innov_var",
    ],
    "msggen topic plot --types TYPES wind.x vehicle_odometry.velocity[": [
        r"vehicle_odometry.velocity\[0\]",
        r"vehicle_odometry.velocity\[1\]",
        r"vehicle_odometry.velocity\[2\]",
    ],
    "msggen topic plot --types TYPES VehicleStatus.armi": ["VehicleStatus.arming_state"],
    "msggen topic plot --types TYPES nothing.armi": [],
    "msggen topic pub --types TYPES vehicle_command": ["vehicle_command", "vehicle_command_mode_executor"],
    "msggen topic pub --types TYPES trajectory_setpoint '{position: [0, 0, 1], ya": [
        "{position: [0, 0, 1], yaw:",
        "{position: [0, 0, 1], yawspeed:",
    ],
    "msggen topic pub --types TYPES vehicle_command 'command: NAV_TAKEO": ["command: NAV_TAKEOFF"],
    "msggen call --types TYPES vehicle_command '{request: {command: NAV_TAKEO": ["{request: {command: NAV_TAKEOFF"],
    "msggen command --types TYPES dis": ["disarm"],
    "msggen log show flight.ulg sensor_g": ["sensor_gps", r"sensor_gps\[1\]"],
    "msggen log show flight.ulg 'sensor_gps[1]' --field fix": ["fix_type"],
    "msggen log plot flight.ulg sensor_gps.f": ["sensor_gps.fix_type"],
    "msggen log plot flight.ulg sensor_gps[1].f": [r"sensor_gps\[1\].fix_type"],
    "msggen log plot flight.ulg spectru": ["spectrum"],
    "msggen log plot flight.ulg spectrum gy": ["gyro"],
    "msggen log plot flight.ulg thrust sensor_g": [],
    "msggen log show flight.ulg sensor_gps --field fix": ["fix_type"],
    "msggen log cut flight.ulg vehicle_": ["vehicle_gps_position"],
    "msggen log show nothing.ulg sensor_g": [],
    "msggen command --types TYPES NAV_TAKEO": ["NAV_TAKEOFF"],
    "msggen command --types TYPES NAV_TAKEOFF alt": ["altitude="],
    "msggen command --types TYPES VEHICLE_CMD_NAV_TAKEOFF alt": ["altitude="],
    "msggen command --types TYPES arm arm": [],
    "msggen command --types TYPES DO_CHANGE_SPEED speed=A": ["speed=AIRSPEED"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a firmware, and with a program `msggen` in `bin`."""
    made = write_definitions(tmp_path_factory.mktemp("completion"), FILES)
    committed(made / "fw")
    git(made / "fw", "tag", "v1.16-mine")
    git(made / "fw", "branch", "topic/wheel")
    write_ulog(made / "flight.ulg")
    program = made / "bin" / "msggen"
    program.parent.mkdir()
    start = f"import sys; sys.path.insert(0, {str(ROOT)!r})\nfrom msggen.__main__ import main\nsys.exit(main())\n"
    program.write_text(f"#!{sys.executable}\n{start}")
    program.chmod(0o755)
    return made


def environment(folder: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("_ARGCOMPLETE", "PYTHON"))}
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return {**kept, "PATH": path, "HOME": str(folder), "TERM": "xterm"}


def proposed(line: str, folder: Path, tmp_path: Path) -> list[str]:
    """Return the completions of a command line, as the shell gets them."""
    answer = tmp_path / "answer"
    asked = {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "",
    }
    command = [str(folder / "bin" / "msggen")]
    done = subprocess.run(
        command, cwd=folder, env={**environment(folder), **asked}, capture_output=True, check=False, timeout=60
    )
    assert (done.stdout, done.stderr) == (b"", b"")
    return answer.read_text(encoding="utf-8").split("\n")


@pytest.mark.slow
@by_day("line", CASES, 12)
def test_a_command_line_is_completed_with_the_names_that_it_can_have(line: str, folder: Path, tmp_path: Path) -> None:
    expected = CASES[line]
    line = line.replace("TYPES", str(TYPES))
    names = proposed(line, folder, tmp_path)
    options = line.rpartition(" ")[2].startswith("--")
    assert [name for name in names if name and (options or not name.startswith("--"))] == expected


HOSTILE = ("a\nfake", "a\x1b[31mred", "a\x1b]0;title\x07", "a\u202eturned", "a\x9b31m")


@pytest.mark.slow
def test_names_that_are_not_printable_are_not_proposed(folder: Path, tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("mine/msg/M", "ros2msg", b"uint8 x\n")
        for name in ("alright", *HOSTILE):
            writer.add_message(writer.register_channel(f"/{name}", "cdr", schema), 5, b"\0\1\0\0\7", 5)
        writer.finish()
    for name in HOSTILE:
        (tmp_path / f"{name}.j2").touch()
    for words, expected in (("show", ["/alright"]), ("plot", ["/alright.x"])):
        found = proposed(f"msggen log {words} {tmp_path}/a.mcap /", folder, tmp_path)
        assert [name for name in found if name.startswith("/")] == expected
    paths = proposed(f"msggen render --template {tmp_path}/a", folder, tmp_path)
    assert any(name.endswith("a.mcap") for name in paths)
    assert not re.search(r"[\x00-\x1f\x7f-\x9f]", "".join(paths))


SHELLS = {
    "bash": (["bash", "--norc", "--noprofile", "-i"], 'bind "set enable-bracketed-paste off"'),
    "zsh": (["zsh", "-f", "-i"], "unset zle_bracketed_paste; autoload -U compinit; compinit -u -D"),
}
LINES = {
    "msggen explain FIELD_MO": "msggen explain FIELD_MOVED",
    "msggen bump --px4 fw Ho": "msggen bump --px4 fw HomePosition",
    "msggen build --px4 fw": "msggen build --px4 fw/",
    "msggen bre": "msggen breaking",
    f"msggen topic echo --types {TYPES} vehicle_st": f"msggen topic echo --types {TYPES} vehicle_status",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "shell",
    [
        pytest.param("bash", marks=pytest.mark.tools("bash")),
        pytest.param("zsh", marks=[pytest.mark.tools("zsh"), pytest.mark.night]),
    ],
)
def test_a_shell_completes_with_tab(shell: str, folder: Path) -> None:
    start, prepare = SHELLS[shell]
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        start,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        cwd=folder,
        env={**environment(folder), "PS1": "> "},
        start_new_session=True,
    )
    os.close(theirs)
    try:
        type_in(ours, f'{prepare}; PS1="> "; source <(msggen completion {shell}); echo pre""pared\n', "prepared\r")
        for line, completed in LINES.items():
            # after the completion, the line becomes the argument of echo
            shown = type_in(ours, f"{line}\t\x01echo '\x05' do\"\"ne\n", " done\r")
            assert re.search(rf"\n(?:\x1b\[\w)*{re.escape(completed)} +done\r", shown), shown
    finally:
        process.kill()
        process.wait()
        os.close(ours)


def type_in(terminal: int, text: str, mark: str) -> str:
    """Write `text` to the terminal, and return what it shows until `mark`."""
    os.write(terminal, text.encode())
    shown = b""
    end = time.monotonic() + 60
    while mark.encode() not in shown and time.monotonic() < end:
        if select.select([terminal], [], [], 1)[0]:
            shown += os.read(terminal, 65536)
    return shown.decode(errors="replace")


@pytest.mark.slow
@pytest.mark.tools("fish")
@by_day("line", LINES, 5)
def test_fish_completes(line: str, folder: Path) -> None:
    command = ["fish", "--no-config", "-c", f"msggen completion fish | source; complete -C '{line}'"]
    done = subprocess.run(
        command, cwd=folder, env=environment(folder), capture_output=True, text=True, check=True, timeout=60
    )
    assert [row.split("\t")[0] for row in done.stdout.splitlines()] == [LINES[line].split()[-1]]
