"""Records of sessions on disk: what is written when, what is read again, and what damage does."""

from __future__ import annotations

import errno
import json
import os
import stat
import subprocess
import sys
import time
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from msggen.link import session_files as module
from msggen.link.address import parse_address
from msggen.link.link import Service
from msggen.link.session_files import PATIENCE, DamagedError, Records, pack, records_folder, unpack
from msggen.link.udp import UdpLink
from msggen.link.xrce.record import Record
from msggen.live import Vehicle
from msggen.sim import Options, Simulator
from msggen.vehicle.opening import open_link
from support.link_records import Records as Listening
from support.ports import free_port
from support.replay import DATA, HEARTBEAT, INFO, Client, creation, kind, sample
from support.repository import ROOT

LINK = "udp://127.0.0.1:8888"
ADDRESS = ("127.0.0.1", 40123)
RECORD = Record(ADDRESS, 1, 0x81, 508, 71, (b"\1\5\2\0ab", b"\x08\1\1\0c"), MappingProxyType({"px4_msgs/msg/A": 7}))


class Told(list[str]):
    """What the user is told."""

    def records(self, folder: Path, link: str = LINK) -> Records:
        return Records(str(folder), link, self.append)


@pytest.fixture
def told() -> Told:
    return Told()


def test_what_was_written_is_read(tmp_path: Path, told: Told) -> None:
    folder = tmp_path / "state" / "sessions"
    samples = MappingProxyType({"/fmu/out/home_position": (b"\0\1\0\0home", 1_700_000_000_000_000_000)})
    record = RECORD._replace(samples=samples)
    device = RECORD._replace(address="/dev/ttyUSB0", key=0)
    told.records(folder).write([(ADDRESS, record)])
    told.records(folder, "/dev/ttyUSB0").write([(device.address, device)])
    told.records(folder, "udp://127.0.0.1:9999").write([(ADDRESS, RECORD._replace(key=9))])
    assert told.records(folder).load() == [record]
    assert told.records(folder, "/dev/ttyUSB0").load() == [device]
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}
    assert len(list(folder.iterdir())) == 3
    assert told == []


def test_a_session_that_has_ended_leaves_no_file(tmp_path: Path, told: Told) -> None:
    kept = told.records(tmp_path)
    kept.write([(ADDRESS, RECORD), (ADDRESS, RECORD._replace(key=2)), (("127.0.0.1", 1), None)])
    assert [record.key for record in told.records(tmp_path).load()] == [2]
    kept.write([(ADDRESS, None)])
    assert list(tmp_path.iterdir()) == []


def test_a_client_that_was_not_heard_for_long_is_gone(
    tmp_path: Path, told: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic()
    kept = told.records(tmp_path)
    kept.write([(ADDRESS, RECORD)])
    (path,) = tmp_path.iterdir()
    monkeypatch.setattr(time, "monotonic", lambda: now + PATIENCE - 1)
    assert told.records(tmp_path).load() == [RECORD]
    monkeypatch.setattr(time, "monotonic_ns", lambda: int((now + 5) * 1e9))
    kept.touch([ADDRESS, ("127.0.0.1", 2)], now + 5)
    kept.touch([ADDRESS], now + 5.5)
    assert path.stat().st_mtime_ns == pytest.approx((now + 5) * 1e9, abs=1e6)
    monkeypatch.setattr(time, "monotonic", lambda: now + 5 + PATIENCE + 0.1)
    assert told.records(tmp_path).load() == []
    assert list(tmp_path.iterdir()) == []


def test_the_date_does_not_matter(tmp_path: Path, told: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    told.records(tmp_path).write([(ADDRESS, RECORD)])
    monkeypatch.setattr(time, "time", lambda: 0.0)
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    assert told.records(tmp_path).load() == [RECORD]


def test_a_record_does_not_outlive_the_start_of_the_computer(
    tmp_path: Path, told: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    told.records(tmp_path).write([(ADDRESS, RECORD)])
    monkeypatch.setattr(module, "boot_id", lambda: "another")
    assert told.records(tmp_path).load() == []


def test_a_byte_that_is_damaged_is_noticed(tmp_path: Path, told: Told) -> None:
    data = pack(LINK, RECORD, "boot")
    assert unpack(data) == (LINK, RECORD, "boot")
    for place in range(len(data)):
        for change in (1, 0x20, 0x80):
            damaged = data[:place] + bytes([data[place] ^ change]) + data[place + 1 :]
            try:
                assert unpack(damaged) == (LINK, RECORD, "boot")
            except DamagedError:
                continue
            assert json.loads(damaged)["record"] == json.loads(data)["record"], "what is not read may differ"
    for end in range(len(data)):
        with pytest.raises(DamagedError):
            unpack(data[:end])
    assert told == []
    assert tmp_path


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b"\xff", b"[" * 100_000, b'{"version": 1, "record": null}', b"null"]
)
def test_a_damaged_file_is_set_aside_and_told_once(content: bytes, tmp_path: Path, told: Told) -> None:
    told.records(tmp_path).write([(ADDRESS, RECORD), (("127.0.0.1", 2), RECORD)])
    paths = sorted(tmp_path.iterdir())
    for path in paths:
        path.write_bytes(content)
    assert told.records(tmp_path).load() == []
    (text,) = told
    assert text.startswith("the record of a session was set aside, and the vehicle connects again: ")
    assert {path.suffix for path in tmp_path.iterdir()} == {".damaged"}
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [content] * 2
    told.clear()
    assert told.records(tmp_path).load() == []
    assert told == Told()


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.EMFILE])
def test_a_file_that_cannot_be_read_now_stays(
    number: int, tmp_path: Path, told: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    told.records(tmp_path).write([(ADDRESS, RECORD)])

    def read(path: str, **_: Any) -> bytes:
        raise OSError(number, os.strerror(number), path)

    with monkeypatch.context() as patched:
        patched.setattr("msggen.link.session_files.read_bytes", read)
        assert told.records(tmp_path).load() == []
    (text,) = told
    assert text.startswith("the record of a session cannot be read, and the vehicle connects again: ")
    assert os.strerror(number) in text
    assert told.records(tmp_path).load() == [RECORD]


def test_a_newer_version_is_set_aside(tmp_path: Path, told: Told) -> None:
    told.records(tmp_path).write([(ADDRESS, RECORD)])
    (path,) = tmp_path.iterdir()
    path.write_text(path.read_text().replace('"version": 3', '"version": 4'))
    assert told.records(tmp_path).load() == []
    assert told[0].endswith("it has another version, 4")


@pytest.mark.parametrize("field", ["key", "session_id", "mtu", "next"])
@pytest.mark.parametrize("value", [-1, 1 << 32, "1", None, 1.5])
def test_numbers_beyond_their_range_are_damage(field: str, value: Any) -> None:
    with pytest.raises(DamagedError):
        unpack(pack(LINK, RECORD._replace(**{field: value}), ""))


def test_a_folder_that_cannot_be_written_is_told_once(tmp_path: Path, told: Told) -> None:
    (tmp_path / "file").write_text("")
    kept = told.records(tmp_path / "file" / "sessions")
    assert kept.load() == []
    kept.write([(ADDRESS, RECORD), (ADDRESS, RECORD)])
    kept.touch([ADDRESS], 10.0)
    (text,) = told
    assert text.startswith("the next program cannot continue the sessions of this one: ")


def test_a_full_disk_leaves_the_earlier_record(tmp_path: Path, told: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = told.records(tmp_path)
    kept.write([(ADDRESS, RECORD)])

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    kept.write([(ADDRESS, RECORD._replace(key=2))])
    assert told.records(tmp_path).load() == [RECORD]
    assert len(list(tmp_path.iterdir())) == 1
    assert told[0].endswith("cannot be written: No space left on device")


def test_a_folder_of_others_is_not_used(tmp_path: Path, told: Told) -> None:
    told.records(tmp_path).write([(ADDRESS, RECORD)])
    tmp_path.chmod(0o777)
    assert told.records(tmp_path).load() == []
    assert told == [f"the records of sessions are not used: others can write to {tmp_path}"]


def test_the_folder_is_that_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert records_folder() == "/state/msggen/sessions"
    for value in ("", "relative"):
        monkeypatch.setenv("XDG_STATE_HOME", value)
        assert records_folder() == os.path.expanduser("~/.local/state/msggen/sessions")


# --- links


def test_a_link_of_a_program_keeps_records_if_it_is_asked_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for link in (UdpLink(port=0), UdpLink(port=free_port())):
        with_vehicle(link)
        assert list(tmp_path.iterdir()) == []
    with_vehicle(open_link(parse_address(f"udp://127.0.0.1:{free_port()}")))
    assert len(list((tmp_path / "msggen" / "sessions").iterdir())) == 1
    with_vehicle(UdpLink(port=0, records=str(tmp_path / "own")))
    assert len(list((tmp_path / "own").iterdir())) == 1


def with_vehicle(link: Any) -> None:
    listening = Listening()
    link.start(listening)
    try:
        with Client(link.port) as client:
            client.play(creation("session-udp"))
            listening.wait(lambda: len(listening.opened_routes) == 66)
    finally:
        link.close()


KILLED = """
import sys, time
sys.path[:0] = sys.argv[2:]
import px4_types
from msggen.live import Vehicle
vehicle = Vehicle(sys.argv[1], px4_types)
vehicle.wait_connected(30)
vehicle.wait_firmware(30)
time.sleep(0.5)
print("connected", flush=True)
time.sleep(60)
"""


def test_a_program_that_is_killed_leaves_the_session_to_the_next_one(px4_types: Any) -> None:
    """With its key, its namespace, its definitions and its service, and without types."""
    url = f"udp://127.0.0.1:{free_port()}"
    command = [sys.executable, "-c", KILLED, url, str(ROOT), str(ROOT / "generated")]
    with Simulator(px4_types, url, [Options(sync="short", namespace="uav_1", key=5)]):
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
            assert program.stdout is not None
            assert program.stdout.readline() == "connected\n"
            program.kill()
        with Vehicle(url, key=5, namespace="uav_1") as vehicle:
            remote = vehicle.wait_connected(10)
            assert (remote.continued, remote.key, remote.namespace) == (True, 5, "uav_1")
            assert len(vehicle.routes) == len(px4_types.topics.ENDPOINTS)
            assert vehicle.subscribe(px4_types.VehicleStatus).wait_for(lambda _: True, 20)
            request = px4_types.VehicleCommand(command=512, target_system=5, target_component=1)
            assert vehicle.call(px4_types.srv.VehicleCommand.Request(request=request), 20).reply.command == 512
            assert len(vehicle.firmware.hashes) > 50


def test_a_link_goes_on_with_the_session_of_the_last_one(tmp_path: Path) -> None:
    port = free_port()
    first, second = (UdpLink(port=port, records=str(tmp_path)) for _ in range(2))
    before, after = Listening(), Listening()
    first.start(before)
    with Client(port) as client:
        client.play(creation("session-udp"))
        before.wait(lambda: len(before.opened_routes) == 66)
        first.remember(before.remotes[0], {"px4_msgs/msg/VehicleStatus": 9})
        first.close()
        client.received(0.1)
        second.start(after)
        try:
            woken = client.received(0.3)
            assert [kind(data) for data in woken] == [INFO, *[HEARTBEAT] * 8]
            client.play([sample(number, bytes(16)) for number in range(10)])
            after.wait(lambda: len(after.samples) == 10)
            (remote,) = after.remotes
            assert (remote.key, remote.continued) == (before.remotes[0].key, True)
            assert second.hashes(remote) == {"px4_msgs/msg/VehicleStatus": 9}
            assert set(second.routes(remote)) == {route for _, route in before.opened_routes}
            service = next(route for route in second.routes(remote) if isinstance(route, Service))
            second.call(remote, service, 1, b"\0\1\0\0" + bytes(56))
            client.socket.send(bytes.fromhex("810000000a010500d100000080"))
            requests = [data for data in client.received() if kind(data) == DATA]
            assert [data[2] for data in requests] == [0xD1]
        finally:
            second.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_error_in_the_end_of_a_link_keeps_nothing_from_being_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise KeyError("planted")

    link, listening = UdpLink(port=0), Listening()
    link.start(listening)
    with Client(link.port) as client:
        client.play(creation("session-udp"))
        listening.wait(lambda: len(listening.opened_routes) == 66)
        monkeypatch.setattr(link, "_keep", fail)
        listening.wait(lambda: listening.failures)
    assert listening.failures == ["the link failed: KeyError: 'planted'"]
    assert [reason for _, reason in listening.gone] == listening.failures
    link.close()
