"""Tests of `msggen topic` with a simulated vehicle: what it prints, when it ends, and what it says about errors."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from types import SimpleNamespace
from typing import Any, NoReturn

import pytest

from msggen.cli import main
from msggen.cli.link import Connection
from msggen.cli.watching import rounds
from msggen.generate.cache import package_of
from msggen.link.link import Route
from msggen.live import LinkError, LinkTimeoutError, Vehicle
from msggen.messages.lookup import Named
from msggen.sim import Misbehaviour, Options, Simulator
from support.commands import COMMANDS, Outcome, run
from support.fake_link import FakeLink
from support.ports import free_port
from support.repository import ROOT

TYPES = str(ROOT / "generated" / "px4_types")


@pytest.fixture(scope="module")
def link(px4_types: Any) -> Iterator[list[str]]:
    """The options of a link with a vehicle."""
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short")]):
        yield ["--link", url, "--types", TYPES]


def topic(*words: str, link: list[str]) -> Outcome:
    outcome = run(["topic", *words, *link])
    return outcome._replace(stderr=without_notices(outcome.stderr))


def without_notices(errors: str) -> str:
    """Return the output without notices of a client that gives up a session, after a pause between two commands."""
    return re.sub(r"(?m)^the vehicle (has disconnected, waiting for it|is connected again)\n", "", errors)


def test_every_action_takes_the_link() -> None:
    actions = {name: parser for name, parser in COMMANDS.items() if name.startswith("topic ")}
    assert {*actions} >= {f"topic {name}" for name in ("list", "info", "find", "echo", "hz", "bw", "delay")}
    for parser in actions.values():
        assert {"--link", "--types", "--px4", "--key", "--namespace", "--wait"} <= {*parser._option_string_actions}


def test_a_wrong_action_gets_the_right_one() -> None:
    for words, text in {
        "topic ecko": "argument ACTION: invalid choice: 'ecko', did you mean 'echo'? (choose from list, type, ",
        "topic": "the following arguments are required: ACTION",
        "topic --link x list": "unknown argument '--link': name an action first",
        "topic list --field x": "unknown argument '--field': an option of topic echo",
        "build --link x": "unknown argument '--link': an option of ",
        "link stop --link x": "unknown argument '--link': write the address alone: msggen link stop udp://",
        "link stop foo": "URL: L101 'foo' is not the address of a link, did you mean 'udp://foo'?",
        "topic list foo": "unknown argument 'foo'\n",
        "topic show": "did you mean 'info'?",
    }.items():
        outcome = run(words.split())
        assert outcome.code == 2
        assert text in outcome.stderr
    assert "did you mean 'echo'?" in run(["topic", "ecko"]).stderr


def test_list_has_all_topics_sorted(link: list[str], px4_types: Any) -> None:
    endpoints = px4_types.topics.ENDPOINTS
    outcome = topic("list", link=link)
    assert outcome.stdout.splitlines() == sorted(endpoint.ros_name for endpoint in endpoints)
    outcome = topic("list", "-t", "--direction", "in", link=link)
    assert outcome.stdout.splitlines() == sorted(
        f"{each.ros_name} [{each.message.__msg__.ros_type}]" for each in endpoints if each.direction == "in"
    )


def test_list_tells_what_is_heard(link: list[str], px4_types: Any) -> None:
    outcome = topic("list", "-v", "--json", "--window", "1", link=link)
    assert outcome.stderr == "listening for 1 s\n"
    rows = {row["topic"]: row for row in json.loads(outcome.stdout)}
    assert rows.keys() == {endpoint.ros_name for endpoint in px4_types.topics.ENDPOINTS}
    odometry, command = rows["/fmu/out/vehicle_odometry"], rows["/fmu/in/vehicle_command"]
    assert odometry["samples"] > 1
    assert odometry["rate"] > 1
    assert odometry["size"] == px4_types.VehicleOdometry.__msg__.cdr_size + 4
    assert 0 <= odometry["age"] < 60
    assert (command["direction"], command["samples"], command["rate"]) == ("in", 0, None)


def test_a_definition_that_differs_is_told_before_a_message_is_printed(px4_types: Any) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="short", misbehaviour=Misbehaviour(wrong_hashes=("VehicleStatus",)))]):
        outcome = run(["topic", "echo", "vehicle_status", "--once", "--link", url, "--types", TYPES])
    assert (outcome.code, outcome.stdout) == (2, "")
    assert "argument TOPIC: the vehicle's definition of '/fmu/out/vehicle_status_v4' has the hash 0x" in outcome.stderr
    assert "name the vehicle's firmware, --px4 PX4-Autopilot, or its package, --types" in outcome.stderr


@pytest.mark.slow  # the client takes seconds to notice that the types are wrong for the session
def test_types_of_another_firmware_are_noticed() -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(package_of("v1.17"), url, [Options(sync="short")]):
        outcome = run(["topic", "list", "-v", "--window", "0.5", "--link", url, "--types", TYPES])
        assert "not on the vehicle" in outcome.stdout
        assert "silent" in outcome.stdout
        wrong = run(["topic", "echo", "vehicle_status", "--once", "--link", url, "--types", TYPES])
        assert wrong.code == 2
        assert "/fmu/out/vehicle_status" in wrong.stderr
        assert "name the vehicle's firmware, --px4 PX4-Autopilot, or its package, --types" in wrong.stderr


def test_find_lists_the_topics_of_a_message(link: list[str]) -> None:
    expected = "/fmu/in/vehicle_command\n/fmu/in/vehicle_command_mode_executor\n"
    for text in ("VehicleCommand", "px4_msgs/msg/VehicleCommand"):
        assert topic("find", text, link=link) == (0, expected, "")
    assert topic("find", "EscStatus", link=link) == (
        0,
        "",
        "no topic of the vehicle has the message px4_msgs/msg/EscStatus\n",
    )
    wrong = topic("find", "VehicleComand", link=link)
    assert wrong.code == 2
    assert "did you mean 'px4_msgs/msg/VehicleCommand'?" in wrong.stderr


def test_info_has_the_facts_of_the_package(link: list[str], px4_types: Any) -> None:
    found = json.loads(topic("info", "VehicleStatus", "--json", link=link).stdout)
    info = px4_types.VehicleStatus.__msg__
    assert found["vehicle_hash"] == found["message_hash"] == f"{info.message_hash:#010x}"
    assert (found["type"], found["type_hash"], found["object_id"]) == (info.ros_type, info.type_hash, 307)
    assert [field["name"] for field in found["fields"]] == [field.name for field in info.fields]
    assert found["enums"]["ArmingState"] == {"DISARMED": 1, "ARMED": 2}
    text = topic("info", "trajectory_setpoint", link=link).stdout
    assert "in: PX4 reads it" in text
    assert "ros2 topic pub /fmu/in/trajectory_setpoint px4_msgs/msg/TrajectorySetpoint" in text


def test_echo_prints_messages_in_each_form(link: list[str]) -> None:
    text = topic("echo", "VehicleStatus", "-n", "2", link=link).stdout
    assert len(re.findall(r"(?m)^---$", text)) == 2
    assert re.search(r"(?m)^nav_state: 4 \(AUTO_LOITER\)$", text)
    rows = topic("echo", "vehicle_attitude", "-n", "3", "--json", link=link).stdout.splitlines()
    stamps = [json.loads(row)["timestamp"] for row in rows]
    assert len(stamps) == 3
    assert stamps == sorted({*stamps})
    table = list(csv.reader(topic("echo", "vehicle_attitude", "-n", "2", "--csv", link=link).stdout.splitlines()))
    assert [len(row) for row in table] == [len(table[0])] * 3
    assert {"timestamp", "q[0]", "q[3]"} <= {*table[0]}


def test_echo_filters_and_counts_what_it_prints(link: list[str]) -> None:
    words = ["echo", "vehicle_status", "--field", "nav_state", "-n", "1"]
    for condition in ("nav_state == AUTO_LOITER", "arming_state == DISARMED and not failsafe", "timestamp > 0"):
        assert topic(*words, condition, link=link).stdout == "4 (AUTO_LOITER)\n---\n"
        assert topic("echo", "vehicle_status", condition, *words[2:], link=link).code == 0
    outcome = topic(*words, "nav_state == OFFBOARD", "--for", "0.6", link=link)
    assert outcome.code == 1
    assert re.fullmatch(r"none of \d+ messages? met the condition\n", outcome.stderr)
    silent = topic("echo", "vehicle_command_ack", "--once", "--for", "0.2", link=link)
    assert (silent.code, silent.stderr) == (1, "no message arrived\n")


def test_echo_prints_at_most_one_message_in_a_time(link: list[str]) -> None:
    words = ["echo", "vehicle_odometry", "--every", "0.2", "--field", "timestamp", "--for", "1", "--csv"]
    head, *rows = topic(*words, link=link).stdout.splitlines()
    assert head == "timestamp"
    assert 2 <= len(rows) <= 6


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["echo", "vehicle_statsu"], "argument TOPIC: no topic 'vehicle_statsu', did you mean 'vehicle_status'?"),
        (["info", "/fmu/out/vehicle_statsu"], "'/fmu/out/vehicle_statsu', did you mean '/fmu/out/vehicle_status_v4'?"),
        (["echo", "esc_status"], "that does not cross the bridge: it is not in dds_topics.yaml; add it there"),
        (["echo", "trajectory_setpoint"], "does not publish it: what programs send to it is heard on a link that they"),
        (["echo", "vehicle_status", "m.nav_state == 4"], "'m.nav_state' is not a field: write 'nav_state', without"),
        (["echo", "vehicle_status", "--field", "nav_stat"], "VehicleStatus has no field 'nav_stat', did you"),
        (["echo", "vehicle_status", "nav_state = 4"], "argument FILTER: column 11: expected '==', not '='"),
        (["echo", "vehicle_status", "nav_state == X"], "argument FILTER: column 14: NavigationState has no member 'X'"),
        (["echo", "vehicle_status", "--once", "-n", "2"], "argument --once: not allowed with argument -n/--count"),
        (["echo", "vehicle_status", "--csv", "--json"], "argument --json: not allowed with argument --csv"),
        (["echo", "vehicle_status", "--every", "x"], "argument --every: expected a number, found 'x'"),
        (["hz", "vehicle_status", "wnd"], "argument TOPIC: no topic 'wnd', did you mean 'wind'?"),
        (["bw", "-n", "0"], "argument --count: expected a number from 1 to"),
        (["delay", "--window", "0"], "argument --window: expected a number above 0, found '0'"),
    ],
)  # fmt: skip
def test_wrong_arguments_end_with_a_line(words: list[str], error: str, link: list[str]) -> None:
    outcome = topic(*words, link=link)
    assert (outcome.code, outcome.stdout) == (2, "")
    first, second = outcome.stderr.splitlines()
    assert error in first
    assert second == f"for all arguments: msggen topic {words[0]} --help"


def test_measures_are_of_the_topics_that_are_named(link: list[str]) -> None:
    for action, keys in {
        "hz": {"rate", "min", "max", "std_dev", "window"},
        "bw": {"bandwidth", "mean", "min", "max", "window"},
        "delay": {"delay", "min", "max", "std_dev", "window", "field", "in_sync"},
    }.items():
        text = topic(action, "vehicle_odometry", "vehicle_command_ack", "-n", "1", "--json", link=link).stdout
        rows = [json.loads(line) for line in text.splitlines()]
        heard = [row for row in rows if row["topic"] == "/fmu/out/vehicle_odometry"]
        assert all(row.keys() == {"topic", *keys} for row in heard)
        assert len(heard) == (2 if action == "delay" else 1)
        assert [row for row in rows if row not in heard] == [{"topic": "/fmu/out/vehicle_command_ack_v1", "window": 0}]


def test_a_field_is_named_behind_its_topic_or_as_an_option(link: list[str]) -> None:
    for one, other in ((["vehicle_status.nav_state"], ["vehicle_status", "--field", "nav_state"]),):
        texts = [topic("echo", *words, "--once", link=link).stdout for words in (one, other)]
        assert texts[0] == texts[1] != ""
    drawn = topic("plot", "vehicle_attitude", "--field", "q[0]", "--for", "1", link=link).stdout
    assert "vehicle_attitude.q[0]" in drawn


def test_measures_of_all_topics_are_a_table(link: list[str]) -> None:
    lines = topic("hz", "-n", "1", link=link).stdout.splitlines()
    assert lines[0].split() == ["topic", "rate", "min", "max", "std", "dev", "window"]
    assert "/fmu/out/sensor_combined" in {line.split()[0] for line in lines[1:]}
    assert topic("hz", "vehicle_command_ack", "--for", "1", link=link).stdout == "no new messages\n"


@pytest.mark.parametrize("action", ["hz", "bw"])
def test_a_topic_that_was_heard_once_is_not_silent(
    action: str, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link, px4_types) as vehicle:
        remote = link.connect()

        def once(*_: object) -> Iterator[None]:
            link.sample(remote, px4_types.Vtx())
            return iter([None])

        found = nullcontext(Connection(vehicle, px4_types, "fake", "v1.18"))
        monkeypatch.setattr("msggen.cli.commands.topic.measuring.connection", lambda *_, **__: found)
        monkeypatch.setattr("msggen.cli.commands.topic.measuring.rounds", once)
        assert run(["topic", action, "vtx"]).stdout == "one sample\n"
        _, *rows = run(["topic", action, "vtx", "wind"]).stdout.splitlines()
        assert [row.split() for row in rows] == [
            ["/fmu/out/vtx", "one", "sample", "1"],
            ["/fmu/out/wind", "silent"],
        ]
        row, _ = map(json.loads, run(["topic", action, "vtx", "wind", "--json"]).stdout.splitlines())
        assert (row["topic"], row["window"]) == ("/fmu/out/vtx", 1)
        assert row["rate" if action == "hz" else "bandwidth"] is None


def test_clocks_that_are_not_in_sync_are_told(px4_types: Any) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [Options(sync="off")]):
        outcome = run(["topic", "delay", "vehicle_odometry", "-n", "1", "--link", url, "--types", TYPES])
    assert "average delay: not in sync: the timestamps are not of this computer's time" in outcome.stdout


@pytest.fixture
def unknown(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A vehicle with a topic `mine` of a message that the types do not have, for all actions."""

    @contextmanager
    def connected(*_: object, **__: object) -> Iterator[Connection]:
        link = FakeLink(px4_types)
        with Vehicle(link, px4_types) as vehicle:
            link.open(link.connect(), Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4000))
            yield Connection(vehicle, px4_types, "fake", "v1.18")

    for module in ("echo", "info", "listing", "measuring"):
        monkeypatch.setattr(f"msggen.cli.commands.topic.{module}.connection", connected)
    monkeypatch.setattr("msggen.cli.commands.topic.info._PATIENCE", 0.01)  # it tells no hashes


@pytest.mark.usefixtures("unknown")
def test_topics_of_messages_that_the_types_do_not_have_are_named() -> None:
    assert "/fmu/out/mine [px4_msgs/msg/Mine]\n" in run(["topic", "list", "-t"]).stdout
    assert run(["topic", "find", "Mine"]).stdout == "/fmu/out/mine\n"
    text = run(["topic", "info", "mine"]).stdout
    assert "px4_msgs/msg/Mine, of which v1.18 has no definition: name the firmware, --px4" in text
    assert json.loads(run(["topic", "info", "mine", "--json"]).stdout)["type"] == "px4_msgs/msg/Mine"
    assert run(["topic", "hz", "mine", "--for", "0.01"]).stdout == "no new messages\n"
    outcome = run(["topic", "echo", "mine"])
    assert outcome.code == 2
    assert "v1.18 has no definition of '/fmu/out/mine': name the vehicle's firmware, --px4 PX4-A" in outcome.stderr


class _Restarting:
    """A vehicle that is connected only at times."""

    states = iter([True, False, False, True, True])

    @property
    def is_connected(self) -> bool:
        return next(self.states)

    def wait_connected(self, _: float) -> None:
        raise LinkTimeoutError


def test_a_watching_command_says_that_a_vehicle_has_disconnected(capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = _Restarting()
    told: list[str] = []
    with suppress(RuntimeError):  # the states have ended
        told.extend(capsys.readouterr().err for _ in rounds(None, vehicle, 0.001))  # type: ignore[arg-type]
    assert told == ["", "the vehicle has disconnected, waiting for it\n", "", "the vehicle is connected again\n", ""]


class _Trouble(Vehicle):
    """A vehicle that sends a damaged sample to each subscription. To a watch, its link fails."""

    link: FakeLink

    def subscribe(self, *arguments: Any, **options: Any) -> Any:
        found = super().subscribe(*arguments, **options)
        self.link.sample(self.remote, b"\0\1\0\0", "/fmu/out/vehicle_status")
        return found

    def watch(self, watcher: Any, direction: Any = "out") -> Any:
        found = super().watch(watcher, direction)
        self.fail()
        return found

    def fail(self) -> None:
        self.link.disconnect(self.remote)
        self.link.user().failed("the link failed: no power")


@pytest.fixture
def trouble(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[_Trouble]:
    link = FakeLink(px4_types)
    with _Trouble(link, px4_types) as vehicle:
        vehicle.link = link
        link.connect()
        for module in ("echo", "measuring"):
            found = nullcontext(Connection(vehicle, px4_types, "fake", "v1.18"))
            monkeypatch.setattr(f"msggen.cli.commands.topic.{module}.connection", lambda *_, found=found, **__: found)
        monkeypatch.setattr("msggen.cli.commands.topic.echo._PATIENCE", 0.01)  # it tells no hashes
        yield vehicle


@pytest.mark.usefixtures("trouble")
def test_a_damaged_sample_is_counted_once() -> None:
    outcome = run(["topic", "echo", "vehicle_status", "--for", "0.4"])
    assert outcome.stderr == "no message arrived\n1 sample could not be decoded\n"


@pytest.mark.usefixtures("trouble")
def test_a_link_that_fails_ends_a_command() -> None:
    with pytest.raises(LinkError, match="the link failed: no power"):  # `connection` makes it an error of the user
        run(["topic", "hz", "vehicle_status"])


def test_a_link_that_fails_ends_an_echo(trouble: _Trouble, monkeypatch: pytest.MonkeyPatch) -> None:
    def confirmed(_: object, topic: Named) -> Named:
        trouble.fail()
        return topic

    monkeypatch.setattr("msggen.cli.commands.topic.echo._confirmed", confirmed)
    with pytest.raises(LinkError, match="the link failed: no power"):
        run(["topic", "echo", "vehicle_status"])


@pytest.mark.parametrize(("seconds", "count"), [(0.5, 1), (1.0, 1), (1.5, 1), (1.9, 1), (2.0, 2), (2.5, 2), (3.0, 3)])
def test_two_rounds_are_a_period_apart(seconds: float, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """`hz --for 1.5` reports once, on all samples."""
    now = [100.0]
    times = SimpleNamespace(monotonic=lambda: now[0], sleep=lambda rest: now.append(now.pop() + rest))
    monkeypatch.setattr("msggen.cli.watching.time", times)
    vehicle = type("Vehicle", (), {"is_connected": True})()
    found = [now[0] for _ in rounds(seconds, vehicle, 1.0)]
    assert len(found) == count
    assert found[-1] == pytest.approx(100.0 + seconds)


def test_rounds_end_with_their_time() -> None:
    vehicle = type("Vehicle", (), {"is_connected": True})()
    for seconds, period, most in ((0.05, 0.02, 3), (0.01, 5.0, 1)):
        found = list(rounds(seconds, vehicle, period))
        assert 1 <= len(found) <= most


@pytest.mark.parametrize(
    ("module", "words", "code"), [("topic.listing._list", "topic list", 0), ("doctor._doctor", "doctor", 1)]
)
def test_a_closed_pipe_ends_a_listing_with_0(
    module: str, words: str, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(_: object) -> NoReturn:
        raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", sys.stdout)  # which is replaced
    monkeypatch.setattr(f"msggen.cli.commands.{module}", closed)
    assert main(words.split()) == code


@pytest.mark.parametrize("words", [["echo", "vehicle_odometry"], ["hz", "vehicle_odometry"]])
def test_ctrl_c_and_a_closed_pipe_end_a_command_with_0(words: list[str], link: list[str]) -> None:
    command = [sys.executable, "-m", "msggen", "topic", *words, *link]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stdout=-1, stderr=-1, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline()
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=60)
    assert (program.returncode, without_notices(errors)) == (0, "")
    with subprocess.Popen(command, env=environment, stdout=-1, stderr=-1, text=True) as program:
        assert program.stdout is not None
        assert program.stderr is not None
        assert program.stdout.readline()
        program.stdout.close()
        assert program.wait(timeout=60) == 0
        assert without_notices(program.stderr.read()) == ""


# Several topics, and types


def test_type_prints_the_type(link: list[str]) -> None:
    for name in ("vehicle_gps_position", "/fmu/out/vehicle_gps_position", "SensorGps"):
        assert topic("type", name, link=link) == (0, "px4_msgs/msg/SensorGps\n", "")


def test_echo_prints_several_topics_with_their_names(link: list[str]) -> None:
    names = {"/fmu/out/vehicle_status_v4", "/fmu/out/vehicle_attitude"}
    text = topic("echo", "vehicle_status", "VehicleAttitude", "-n", "2", link=link).stdout
    blocks = text.split("---\n")
    assert blocks.pop() == ""
    assert sorted(block.partition("\n")[0] for block in blocks) == sorted(f"# {name}" for name in [*names] * 2)
    assert all(re.search(r"(?m)^timestamp: \d+  # us$", block) for block in blocks)
    rows = topic("echo", "vehicle_status", "VehicleAttitude", "--once", "--json", link=link).stdout.splitlines()
    objects = [json.loads(row) for row in rows]
    assert {each["topic"] for each in objects} == names
    assert all(each["message"]["timestamp"] > 0 for each in objects)


def test_a_field_is_that_of_the_topics_that_have_it(link: list[str]) -> None:
    words = ["echo", "vehicle_status", "vehicle_attitude", "--once", "--json"]
    rows = topic(*words, "--field", "nav_state", "--field", "timestamp", link=link).stdout.splitlines()
    found = {row["topic"].rpartition("/")[2]: row["message"] for row in map(json.loads, rows)}
    assert [*found["vehicle_status_v4"]] == ["nav_state", "timestamp"]
    assert [*found["vehicle_attitude"]] == ["timestamp"]
    outcome = topic(*words, "--field", "nothing", link=link)
    assert outcome.code == 2
    assert "argument --field: VehicleStatus has no field 'nothing'" in outcome.stderr


def test_a_filter_is_an_option_too(link: list[str]) -> None:
    words = ["--field", "nav_state", "--once"]
    for condition in (["--filter", "nav_state==AUTO_LOITER"], ["nav_state==AUTO_LOITER"]):
        assert topic("echo", "vehicle_status", *condition, *words, link=link).stdout == "4 (AUTO_LOITER)\n---\n"
        assert topic("echo", *words, "vehicle_status", *condition, link=link).stdout == "4 (AUTO_LOITER)\n---\n"
    none = topic("echo", "wind", "vehicle_status", "--filter", "timestamp < 0", "--for", "1.2", link=link)
    assert none.stdout == ""
    first, second = none.stderr.splitlines()
    assert re.fullmatch(r"/fmu/out/wind: (no message arrived|none of \d+ messages? met the condition)", first)
    assert re.fullmatch(r"/fmu/out/vehicle_status_v4: none of \d+ messages met the condition", second)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["wind", "vehicle_status", "--csv"], "argument --csv: only with one topic, as topics have different columns"),
        (["wind", "vehicle_status", "x > 1"], "argument TOPIC: 'x > 1' is a condition: write it once, as --filter"),
        (["wind", "x > 1", "--filter", "x > 2"], "argument TOPIC: 'x > 1' is a condition: write it once, as --filter"),
        (["wind", "vehicle_status", "--filter", "nav_state == 4"], "argument --filter: column 1: Wind has no field "),
        (["wind", "vehicle_statsu"], "argument TOPIC: no topic 'vehicle_statsu', did you mean 'vehicle_status'?"),
    ],
)  # fmt: skip
def test_wrong_uses_of_several_topics_end_with_a_line(words: list[str], error: str, link: list[str]) -> None:
    outcome = topic("echo", *words, link=link)
    assert (outcome.code, outcome.stdout) == (2, "")
    assert error in outcome.stderr.splitlines()[0]
