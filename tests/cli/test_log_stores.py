"""Tests of `msggen log` with recordings in stores and on servers that fail: an error with the address, and no trace."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from msggen import recordings
from msggen.base.exit_codes import FAILED, FINDINGS
from support.commands import Outcome, check_outcome, run
from support.examples import by_day
from support.object_server import FAULTS, ObjectServer, hasten, object_server, set_credentials
from support.random_mcap import WAYS, recording
from support.raw_server import raw_server, whole_answer

INFO = ["log", "info", "s3://bucket/a.mcap"]
COMMANDS = {
    "info": INFO,
    "verify": [*INFO, "--verify"],
    "topic": [*INFO, "/texts"],
    "show": ["log", "show", "s3://bucket/a.mcap", "/texts"],
    "plot": ["log", "plot", "s3://bucket/a.mcap", "/texts.last", "-o", "x.png"],
    "convert": ["log", "convert", "s3://bucket/a.mcap", "-o", "out"],
    "put": ["log", "convert", "s3://bucket/a.mcap", "-o", "s3://bucket/out.mcap"],
    "cut": ["log", "cut", "s3://bucket/a.mcap", "--stop", "1", "-o", "out.mcap"],
    "merge": ["log", "merge", "s3://bucket/a.mcap", "here.mcap", "-o", "out.mcap"],
    "repair": ["log", "repair", "s3://bucket/a.mcap", "-o", "out.mcap"],
}


@pytest.fixture(scope="module")
def data(px4_types: Any) -> bytes:
    """A recording."""
    return recording(px4_types, 3000, 5, 20_000, **WAYS["none"])


@pytest.fixture
def server(data: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectServer]:
    hasten(monkeypatch)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here.mcap").write_bytes(data)
    with object_server() as has:
        set_credentials(monkeypatch, has.url)
        has.files["/bucket/a.mcap"] = data
        yield has


def check_failed(outcome: Outcome, reason: str) -> None:
    assert outcome.code == FAILED, outcome
    assert re.fullmatch(rf"s3://bucket/\S+: R10[12] {re.escape(reason)}\n1 error\n", outcome.stderr), outcome.stderr
    assert os.listdir() == ["here.mcap"]


@by_day(
    ("name", "fault", "reason"),
    [(name, *each) for name in COMMANDS for each in (*FAULTS.items(), ("404", "there is no such object"))],
    3,
)
def test_a_store_that_fails_is_an_error_of_every_command(
    server: ObjectServer, name: str, fault: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hasten(monkeypatch, fault)
    server.fault = fault
    check_failed(run(COMMANDS[name]), reason)
    assert list(server.files) == ["/bucket/a.mcap"]


@by_day(
    ("fault", "name"),
    [*product(("half", "500"), ("verify", "show", "convert", "put", "cut", "merge", "repair"))],
    3,
)
def test_a_store_that_fails_later_leaves_nothing(server: ObjectServer, name: str, fault: str) -> None:
    run(INFO)
    opening = {each[:3] for each in server.requests}  # a busy computer repeats some
    server.after, server.fault = len(server.requests) + len(opening), fault
    outcome = run(COMMANDS[name])
    assert outcome.code == FAILED, outcome
    assert "Traceback" not in outcome.stderr
    assert re.search(r"^s3://bucket/(a|out)\.mcap: R10[12] the (server|connection) ", outcome.stderr, re.MULTILINE)
    assert os.listdir() == ["here.mcap"]
    assert list(server.files) == ["/bucket/a.mcap"]


def test_a_code_of_the_store_is_told(server: ObjectServer) -> None:
    server.fault, server.code = "403", "InvalidAccessKeyId"
    check_failed(run(INFO), "access is forbidden (403 InvalidAccessKeyId): these credentials may not do this")
    server.fault, server.code = "404", "NoSuchBucket"
    check_failed(run(INFO), "there is no such bucket")
    server.fault, server.code = "404", "NoSuchUpload"
    check_failed(run(INFO), "the server answers with an error (404 NoSuchUpload)")
    server.fault, server.code = "301", "PermanentRedirect"
    check_failed(run(INFO), "the bucket is in another region (301): set AWS_REGION")


def test_a_file_that_is_no_recording_is_an_error(server: ObjectServer) -> None:
    server.files["/bucket/a.mcap"] = b"<html>"
    check_failed(run(INFO), "is not a recording: expected an MCAP file, a ULog or a database of rosbag2")


def test_a_damaged_recording_in_a_store_is_a_finding(server: ObjectServer) -> None:
    server.files["/bucket/a.mcap"] = server.files["/bucket/a.mcap"][:-300_000]
    outcome = run(INFO)
    assert outcome.code == FINDINGS
    assert outcome.stderr.startswith("s3://bucket/a.mcap: ")


def test_secrets_in_an_address_are_not_shown(server: ObjectServer) -> None:
    server.files["/a.mcap"] = server.files["/bucket/a.mcap"]
    address = server.url.replace("//", "//user:word@") + "/a.mcap?X-Signature=secret"
    for words in (["info", address], ["show", address, "nothing"], ["cut", address, "--stop", "1"]):
        outcome = run(["log", *words])
        assert not re.search("secret|word", outcome.stdout + outcome.stderr), outcome
    server.fault = "500"
    for words in (["info", address], ["merge", address, "here.mcap"]):
        outcome = run(["log", *words])
        assert outcome.code == FAILED
        assert not re.search("secret|word", outcome.stdout + outcome.stderr), outcome


def test_a_server_of_http_is_not_written_to(server: ObjectServer) -> None:
    target = f"{server.url}/out.mcap"
    outcome = run(["log", "convert", "here.mcap", "-o", target])
    assert (outcome.code, outcome.stderr.partition(": ")[2][:29]) == (FAILED, "S131 a URL, expected a path: ")
    assert not server.requests


def test_a_store_is_only_asked_if_the_command_line_names_it(server: ObjectServer) -> None:
    Path("pyproject.toml").write_text('[tool.msggen]\noutput = "s3://bucket/out"\n')
    outcome = run(["build"])
    assert outcome.code == FAILED
    assert " S131 " in outcome.stderr
    assert (server.requests, sorted(os.listdir())) == ([], ["here.mcap", "pyproject.toml"])


@pytest.mark.parametrize("fault", FAULTS)
def test_a_store_of_a_fleet_that_fails_is_an_error(
    server: ObjectServer, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hasten(monkeypatch, fault)
    Path("logs").mkdir()
    shutil.copy("here.mcap", "logs/a.mcap")
    server.fault = fault
    server.files["/bucket/fleet/_msggen/layout.json"] = b"{}"
    convert = ["log", "convert", "logs", "-o", "s3://bucket/fleet", "--jobs", "1"]
    for words in (convert, ["log", "compact", "s3://bucket/fleet"], ["log", "convert", "s3://bucket/logs/", "-o", "x"]):
        outcome = run(words)
        assert outcome.code == FAILED, outcome
        assert re.fullmatch(r"s3://bucket/\S+: R1(50|02) .+\n1 error\n", outcome.stderr), outcome.stderr
        assert FAULTS[fault] in outcome.stderr or fault in ("half", "stall")
    assert sorted(os.listdir()) == ["here.mcap", "logs"]


def test_a_server_of_http_has_no_fleet(server: ObjectServer) -> None:
    Path("logs").mkdir()
    for words in (["convert", "logs", "-o", f"{server.url}/fleet"], ["compact", f"{server.url}/fleet"]):
        outcome = run(["log", *words])
        assert outcome.code == FAILED
        assert " S131 " in outcome.stderr
    assert not server.requests


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for one process")
def test_ctrl_c_ends_a_command_whose_store_stalls(server: ObjectServer) -> None:
    server.fault = "stall"
    words = [sys.executable, "-m", "msggen", *INFO]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        end = monotonic() + 30
        while not server.requests and monotonic() < end:
            sleep(0.02)
        assert server.requests
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=30)
    assert "Traceback" not in told
    assert process.returncode == 130


ADDRESS = "http://user:hidden@hidden@127.0.0.1:9/flight.mcap?signature=hidden"


@pytest.mark.parametrize("words", [["show", ADDRESS], ["info", ADDRESS], ["merge", ADDRESS, ADDRESS]])
def test_no_error_shows_a_password_or_a_signature(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hasten(monkeypatch)
    monkeypatch.chdir(tmp_path)
    outcome = run(["log", *words])
    assert outcome.code == FAILED
    assert "http://127.0.0.1:9/flight.mcap" in outcome.stderr
    assert "hidden" not in outcome.stderr


REDIRECTS = [
    "{path}",
    "http://user:hidden@127.0.0.1:{port}{path}",
    "http://:hidden@[",
    "//",
    "ftp://a:hidden@b/c?hidden",
]


@pytest.mark.parametrize("location", REDIRECTS)
def test_a_server_that_redirects_without_end_learns_no_secret(
    location: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    hasten(monkeypatch)
    monkeypatch.chdir(tmp_path)

    def redirect(head: str) -> Iterator[bytes]:
        place = location.format(path=head.split(" ")[1], port=raw.port)
        yield whole_answer("302 a", f"Location: {place}\r\n")

    with raw_server(redirect) as raw:
        address = f"http://user:hidden@127.0.0.1:{raw.port}/flight.mcap?signature=hidden"
        for words in (["info", address], ["convert", address, "-o", "made.mcap"], ["merge", address, address]):
            outcome = run(["log", *words])
            check_outcome(outcome)
            assert outcome.code == FAILED
            assert f"http://127.0.0.1:{raw.port}/flight.mcap" in outcome.stderr
            assert "hidden" not in outcome.stdout + outcome.stderr
        with pytest.raises(OSError, match=r"flight\.mcap: ") as caught:
            recordings.open(address)
        assert "hidden" not in str(caught.value) + repr(caught.value)


@pytest.mark.parametrize("words", [["build", "--px4"], ["check", "--px4"], ["lint"], ["build", "--msg-dir"]])
def test_an_address_in_the_place_of_a_path_is_shown_without_secrets(words: list[str]) -> None:
    outcome = run([*words, "https://user:hidden@example.invalid/a/PX4?token=hidden"])
    assert outcome.code == FAILED
    assert "https://example.invalid/a/PX4" in outcome.stdout + outcome.stderr
    assert "hidden" not in outcome.stdout + outcome.stderr


def test_an_error_of_the_temporary_folder_is_without_the_query(
    server: ObjectServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(**_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.mkdtemp", full)
    outcome = run(["log", "info", f"{server.url}/bucket/a.mcap?signature=hidden"])
    assert outcome.stderr == f"{server.url}/bucket/a.mcap: R102 cannot be read: No space left on device\n1 error\n"
