"""Tests of what goes wrong on a network of Zenoh: programs that end or stand still, and packets that are lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep
from typing import Any

import pytest

from msggen.link.link import LinkError, Remote, Route
from msggen.link.zenoh import ZenohLink
from msggen.sim import Options, Simulator
from support.link_records import Records
from support.network import isolated
from support.ports import free_port
from support.repository import ROOT
from support.zenoh_space import session

pytest.importorskip("zenoh")
CALM = Options(sync="off", rate=20.0)

OTHER = """\
import sys, time
from support.zenoh_space import session
with session(int(sys.argv[1]), sys.argv[2]) as opened:
    if sys.argv[2] == "client":
        opened.declare_subscriber("**/fmu/out/**", lambda sample: None)
    print("open", flush=True)
    time.sleep(120)
"""
"""A program of others: a router, or a client that follows all topics of vehicles."""
VEHICLE = ("-m", "msggen", "sim", "--quiet", "--rate", "20", "--zenoh")


@contextmanager
def linked(port: int, records: Records | None = None, **options: Any) -> Iterator[tuple[ZenohLink, Records]]:
    link, records = ZenohLink(port=port, **options), records or Records()
    link.start(records)
    try:
        yield link, records
    finally:
        link.close()


@contextmanager
def process(*words: object) -> Iterator[subprocess.Popen[str]]:
    """Run a Python program, and kill it at the end."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    command = [sys.executable, *map(str, words)]
    running = subprocess.Popen(command, text=True, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": path})
    try:
        yield running
    finally:
        running.kill()
        running.communicate()


@contextmanager
def other(port: int, mode: str) -> Iterator[subprocess.Popen[str]]:
    """Run another program of Zenoh, whose session is open."""
    with process("-c", OTHER, port, mode) as running:
        assert running.stdout is not None
        assert running.stdout.readline() == "open\n"
        yield running


def more(records: Records, number: int = 100) -> None:
    """Wait for further samples."""
    before = len(records.samples)
    records.wait(lambda: len(records.samples) > before + number)


def test_a_router_that_is_killed_and_comes_back_has_its_programs_again(px4_types: Any) -> None:
    port = free_port()
    vehicle = Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [CALM])
    with other(port, "router") as first, linked(port) as (link, records), vehicle:
        more(records)
        first.kill()
        with other(port, "router"):
            more(records, 1000)  # more than can have waited
            assert not link.is_router
    assert not records.failures


class Slow(Records):
    """A program that takes its time for each sample."""

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        super().sample(remote, route, payload, time)
        sleep(0.05)


def test_a_slow_reader_loses_its_own_samples_only(px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("msggen.link.zenoh._MOST", 50)
    port = free_port()
    with (
        linked(port, Slow()) as (slow, of_slow),
        linked(port) as (quick, records),
        Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [CALM]),
    ):
        records.wait(lambda: slow.statistics().dropped > 100)
        assert len(records.samples) > 3 * len(of_slow.samples)
        assert (quick.statistics().lost, quick.statistics().dropped) == (0, 0)


def test_a_vehicle_at_one_router_is_at_another_one_that_is_connected_to_it(px4_types: Any, tmp_path: Path) -> None:
    first, second = free_port(), free_port()
    path = tmp_path / "second.json5"
    path.write_text(f'{{connect: {{endpoints: ["tcp/127.0.0.1:{first}"]}}}}', encoding="utf-8")
    with session(first, "router"), linked(second, config=str(path)) as (link, records):
        assert link.is_router
        with Simulator(px4_types, f"zenoh://127.0.0.1:{first}", [CALM]) as simulator:
            records.wait(lambda: len(records.opened_routes) == 49)
            more(records)
            route = records.route("/fmu/in/vehicle_command")
            assert isinstance(route, Route)
            remote = records.remotes[0]
            link.publish(remote, route, px4_types.VehicleCommand(command=400, target_system=1).encode())
            records.wait(lambda: simulator.vehicles[0].received)
        records.wait(lambda: records.gone)
    assert link.statistics().lost == 0


def test_a_name_that_no_computer_has_is_an_error_that_names_what_to_check() -> None:
    with pytest.raises(LinkError, match="check host and port"):
        ZenohLink("nohost.invalid", 7447).start(Records())


@pytest.mark.night
@pytest.mark.parametrize("fault", [signal.SIGKILL, signal.SIGSTOP])
def test_a_vehicle_without_power_is_gone_and_comes_back(fault: signal.Signals) -> None:
    port = free_port()
    with linked(port) as (_, records):
        with process(*VEHICLE, f"tcp/127.0.0.1:{port}") as vehicle:
            more(records)
            os.kill(vehicle.pid, fault)
            records.wait(lambda: records.gone)
            if fault == signal.SIGSTOP:
                assert "nothing has arrived" in records.gone[0][1]
                os.kill(vehicle.pid, signal.SIGCONT)
                more(records)
        if fault == signal.SIGKILL:
            with process(*VEHICLE, f"tcp/127.0.0.1:{port}"):
                more(records)
    assert len(records.remotes) >= 2


@pytest.mark.night
@pytest.mark.timeout(180)
def test_a_program_that_stands_still_holds_up_others_for_a_second_at_most(px4_types: Any) -> None:
    """The router ends the connection of a program whose buffers are full: samples that PX4 sends with `cc: block`."""
    port = free_port()
    with (
        linked(port) as (link, records),
        Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [CALM._replace(rate=200.0)]),
    ):
        with other(port, "client") as reader:
            more(records)
            reader.send_signal(signal.SIGSTOP)
            longest, last, before = 0.0, time.monotonic(), len(records.samples)
            end = last + 30
            while (now := time.monotonic()) < end:
                if len(records.samples) > before:
                    longest, last, before = max(longest, now - last), now, len(records.samples)
                sleep(0.01)
            assert max(longest, time.monotonic() - last) < 3.0  # Zenoh's own limit is 5 s
        assert not records.gone
        assert link.statistics().lost == 0


LOSSY = """\
import sys
from msggen.link.zenoh import ZenohLink
from msggen.sim import Options, Simulator
from support.link_records import Records
from support.network import lossy_interface
import px4_types

dropped = lossy_interface("10.9.0.1", share=0.01)
link, records = ZenohLink("10.9.0.1", 7447), Records()
link.start(records)
with Simulator(px4_types, "zenoh://10.9.0.2:7447", [Options(sync="off", rate=50.0)]):
    records.wait(lambda: len(records.samples) > 10_000)
told = link.statistics()
link.close()
print(len(dropped), told, records.gone, file=sys.stderr)
sys.exit(not (len(dropped) > 20 and told.lost == told.refused == 0))
"""


@pytest.mark.night
def test_nothing_is_lost_on_a_network_that_loses_one_packet_in_a_hundred() -> None:
    path = os.pathsep.join(map(str, (ROOT, ROOT / "tests", ROOT / "generated")))
    command = isolated(sys.executable, "-c", LOSSY)
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
