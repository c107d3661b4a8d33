"""Tests of the link over Zenoh, with simulated vehicles and with sessions of other programs, on loopback."""

from __future__ import annotations

import builtins
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from msggen.link.age import expiry, now
from msggen.link.link import LinkError, Route, Service, StaleError
from msggen.link.rmw_zenoh.names import Attachment, parse_attachment
from msggen.link.zenoh import ZenohLink
from msggen.sim import Options, Simulator
from support.imports import forget
from support.link_records import Records
from support.ports import free_port
from support.zenoh_space import COMMAND, GUID, STATUS, definition, session, token_of

pytest.importorskip("zenoh")
SHORT = Options(sync="off")


@contextmanager
def linked(port: int, **options: Any) -> Iterator[tuple[ZenohLink, Records]]:
    link, records = ZenohLink(port=port, **options), Records()
    link.start(records)
    try:
        yield link, records
    finally:
        link.close()


def route(records: Records, name: str) -> Route:
    return next(each for _, each in records.opened_routes if isinstance(each, Route) and each.name == name)


def test_a_vehicle_connects_to_the_router_that_the_link_is(px4_types: Any) -> None:
    port, before = free_port(), set(threading.enumerate())
    with linked(port) as (link, records):
        assert link.is_router
        with Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [SHORT]) as simulator:
            records.wait(lambda: len(records.opened_routes) == 49)
            records.wait(lambda: any(each.route.name == "/fmu/out/vehicle_status_v4" for each in records.samples))
            status = next(each for each in records.samples if each.route.name == "/fmu/out/vehicle_status_v4")
            assert px4_types.VehicleStatus.decode(status.payload).system_id == 1  # no surplus
            command = px4_types.VehicleCommand(command=400, param1=1.0, target_system=1, from_external=True)
            link.publish(status.remote, route(records, "/fmu/in/vehicle_command"), command.encode(), expiry())
            records.wait(lambda: any("command_ack" in each.route.name for each in records.samples))
            assert simulator.vehicles[0].received == {"/fmu/in/vehicle_command": 1}
        records.wait(lambda: records.gone)
        assert records.gone[0][1] == "its tokens are gone: PX4, or its module zenoh, has ended"
        counted = link.statistics()
        assert (counted.lost, counted.refused, counted.sent) == (0, 0, 1)
    assert not records.failures + records.warnings
    records.wait(lambda: {*threading.enumerate()} <= before)  # the pool of Zenoh itself stays


def test_a_session_ends_with_the_functions_that_it_calls() -> None:
    """A thread of Zenoh that is left when Python ends would abort the program."""
    from msggen.link.rmw_zenoh.session import open_session

    before, called, returned = {*threading.enumerate()}, threading.Event(), threading.Event()

    def slow(*_: object) -> None:
        called.set()
        time.sleep(0.3)
        returned.set()

    made = open_session("127.0.0.1", free_port())
    made.tokens(lambda *_: None)
    made.subscribe("a", slow)
    made.publisher("b", lambda _: None)
    made.answer("c", lambda _: None)
    made.put("a", b"", b"")
    assert called.wait(10.0)
    made.close()
    assert returned.is_set()
    assert {*threading.enumerate()} <= before


def test_the_router_of_others_is_needed_by_them() -> None:
    port = free_port()
    with linked(port) as (router, records):
        assert not router.serves_others()
        with linked(port) as (client, _), session(port):
            records.wait(router.serves_others)
            assert not client.serves_others()
        records.wait(lambda: not router.serves_others())
    assert not router.serves_others()


def test_the_link_is_a_client_where_a_router_runs(px4_types: Any) -> None:
    port = free_port()
    with session(port, "router"), linked(port) as (link, records):
        assert not link.is_router
        with Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [SHORT]):
            records.wait(lambda: records.samples)


def test_a_vehicle_that_was_there_before_is_there_at_once(px4_types: Any) -> None:
    port = free_port()
    with session(port, "router"), Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [SHORT]) as simulator:
        while not simulator.vehicles[0].sent:
            time.sleep(0.01)
        with linked(port) as (_, records):
            records.wait(lambda: len(records.opened_routes) == 49)
            records.wait(lambda: records.samples)


def test_the_link_takes_the_place_of_a_router_that_has_ended(px4_types: Any) -> None:
    port = free_port()
    address = f"zenoh://127.0.0.1:{port}"
    with session(port, "router") as router, linked(port) as (link, records), Simulator(px4_types, address, [SHORT]):
        records.wait(lambda: records.samples)
        router.close()
        records.wait(lambda: link.is_router)
        before = len(records.samples)
        records.wait(lambda: len(records.samples) > before)


def test_several_vehicles_are_on_one_router(px4_types: Any) -> None:
    port = free_port()
    several = [SHORT._replace(key=number, namespace=f"uav_{number}", rate=2.0) for number in (1, 2, 3)]
    with linked(port) as (link, records), Simulator(px4_types, f"zenoh://127.0.0.1:{port}", several) as simulator:
        records.wait(lambda: {each.remote.namespace for each in records.samples} == {"uav_1", "uav_2", "uav_3"})
        second = next(each for each in records.remotes if each.namespace == "uav_2")
        records.wait(lambda: any(each.name == "/uav_2/fmu/in/vehicle_command" for each in link.routes(second)))
        command = px4_types.VehicleCommand(command=400, target_system=2)
        link.publish(second, route(records, "/uav_2/fmu/in/vehicle_command"), command.encode())
        records.wait(lambda: simulator.vehicles[1].received)
        assert not simulator.vehicles[0].received + simulator.vehicles[2].received


def test_a_vehicle_over_zenoh_tells_times_since_boot(px4_types: Any) -> None:
    port = free_port()
    times: list[Any] = []
    with session(port, "router") as router:
        router.declare_subscriber("**/fmu/out/sensor_combined/**", times.append)
        with Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [SHORT]):
            while not times:
                time.sleep(0.01)
    sample = times[0]
    told = parse_attachment(bytes(sample.attachment))
    assert told is not None
    assert 10**6 <= told.time < 10**8
    payload = bytes(sample.payload)
    assert len(payload) == 4 + -(-px4_types.SensorCombined.__msg__.struct_size // 8) * 8 + 24
    assert px4_types.SensorCombined.decode(payload, allow_surplus=True).timestamp <= told.time


def test_samples_that_are_late_are_not_sent(px4_types: Any) -> None:
    port = free_port()
    with linked(port) as (link, records), Simulator(px4_types, f"zenoh://127.0.0.1:{port}", [SHORT]) as simulator:
        records.wait(lambda: len(records.opened_routes) == 49)
        to = route(records, "/fmu/in/vehicle_command")
        with pytest.raises(StaleError, match=r"waited for more than 0\.5 s"):
            link.publish(records.remotes[0], to, b"", now() - 1)
        with pytest.raises(LinkError, match="no service /fmu/vehicle_command on Zenoh"):
            link.call(records.remotes[0], Service("/fmu/vehicle_command", "", "", -1), 1, b"")
        assert link.statistics().unsent == 1
        assert not simulator.vehicles[0].received


def test_what_strangers_say_is_refused_and_counted() -> None:
    port = free_port()
    with linked(port) as (link, records), session(port) as stranger:
        tokens = [
            stranger.liveliness().declare_token(text) for text in ("@ros2_lv/x", token_of(STATUS), token_of(COMMAND))
        ]
        records.wait(lambda: len(records.opened_routes) == 2)
        payload = b"\0\1\0\0" + bytes(definition(STATUS).size)
        stranger.put(str(STATUS), payload)
        stranger.put("0/fmu/out/x", payload)
        stranger.put(str(STATUS), payload, attachment=Attachment(1, 1, GUID).pack())
        records.wait(lambda: records.samples)
        assert link.statistics().refused == 3
        assert link.refusals()["tokens that are not of the form"] == 1
        del tokens


def test_without_the_package_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def no_zenoh(name: str, *arguments: Any) -> Any:
        if name == "zenoh":
            raise ImportError(name)
        return real(name, *arguments)

    forget(monkeypatch, "msggen.link.rmw_zenoh.session")
    monkeypatch.setattr(builtins, "__import__", no_zenoh)
    with pytest.raises(LinkError, match=r"eclipse-zenoh is not installed: .*zenoh"):
        ZenohLink().start(Records())


@pytest.mark.parametrize("is_silent", [True, False])
def test_a_port_of_another_program_is_named(is_silent: bool) -> None:  # noqa: FBT001
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as server:
        server.bind(("127.0.0.1", 0))
        port = server.getsockname()[1]
        if is_silent:  # otherwise the connection is refused
            server.listen()
        with pytest.raises(LinkError, match=rf"TCP port {port} of 127\.0\.0\.1 is in use by a program that is no"):
            ZenohLink(port=port).start(Records())


def test_an_address_of_another_computer_needs_a_router_there() -> None:
    with pytest.raises(LinkError, match=r"no Zenoh router answers at 192\.0\.2\.1:1, which is no address of this"):
        ZenohLink("192.0.2.1", 1).start(Records())


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (None, "there is no configuration of Zenoh '.*none.json5': correct config= in the address"),
        ("{moode: 1}", "is no configuration of Zenoh: unknown field `moode`"),
        (
            '{transport: {link: {tls: {listen_certificate: "/none.pem"}}}}',
            "there is no file '/none.pem', the listen_certificate of '.*': correct it, or create the certificate",
        ),
    ],
)
def test_a_wrong_configuration_is_named(tmp_path: Path, text: str | None, error: str) -> None:
    path = tmp_path / "none.json5"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(LinkError, match=error):
        ZenohLink(port=free_port(), config=str(path)).start(Records())
