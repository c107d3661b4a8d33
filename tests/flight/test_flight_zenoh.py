"""Tests of flights over Zenoh: what works in which release, and what is refused with what to do instead."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from msggen.flight import FIXED_WING, Flight, Limits, Mode, UnsupportedError
from msggen.generate.cache import package_of
from msggen.live import Vehicle
from msggen.sim import Simulator
from support.flying import CALM, Hop, Hops, simulated, wait_long_for_replies
from support.networked import networked
from support.ports import free_port

pytest.importorskip("zenoh")


class Glides(Mode, name="Glides"):
    """Flies as a plane does."""

    setpoints = (FIXED_WING,)

    async def fly(self) -> None:
        self.fixed_wing(course=0.0, altitude=100.0)


@contextmanager
def flown(types: Any, kind: str = "multicopter") -> Iterator[tuple[Vehicle, Simulator]]:
    """Connect to a simulated vehicle over Zenoh."""
    url = f"zenoh://127.0.0.1:{free_port()}"
    with (
        Vehicle(url, types, direct=True) as vehicle,
        simulated(types, url, CALM._replace(vehicle=kind), speed=2.0) as simulator,
    ):
        vehicle.wait_connected(20.0)
        wait_long_for_replies(simulator)
        yield vehicle, simulator


@pytest.mark.slow
def test_a_flight_over_zenoh(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    async def fly(vehicle: Vehicle) -> None:
        executor = Hops()
        async with Flight(vehicle) as flight:
            await flight.add(executor)
            await flight.set_mode(Hop)
            await flight.arm()
            await executor.end.wait()

    with caplog.at_level(logging.WARNING, "msggen.flight"), flown(px4_types) as (vehicle, simulator):
        asyncio.run(asyncio.wait_for(fly(vehicle), 100.0))
        assert not simulator.vehicles[0].refused
        assert vehicle.lost == 0
    assert "(PX4 28306)" in caplog.text


@pytest.mark.slow
def test_a_flight_with_limits_through_a_network(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    """The limits are measured from home_position, which a carried vehicle has, unlike PX4's own module."""

    async def fly(vehicle: Vehicle) -> None:
        executor = Hops()
        async with Flight(vehicle, limits=Limits(height=20.0, distance=50.0)) as flight:
            await flight.add(executor)
            await flight.set_mode(Hop)
            await flight.arm()
            await executor.end.wait()

    with (
        caplog.at_level(logging.WARNING, "msggen.flight"),
        networked(px4_types, [CALM], speed=2.0) as space,
        Vehicle(space.url, px4_types, direct=True) as vehicle,
    ):
        vehicle.wait_connected(20.0)
        wait_long_for_replies(space.simulator)
        asyncio.run(asyncio.wait_for(fly(vehicle), 100.0))
        assert not space.simulator.vehicles[0].refused
        assert vehicle.lost == 0
    assert "(PX4 28306)" not in caplog.text


@pytest.mark.parametrize(
    ("release", "limits", "part", "error"),
    [
        ("v1.18", Limits(distance=50.0), None, "does not have /fmu/out/home_position on Zenoh: .*zenoh/pub.csv"),
        (
            "v1.18",
            Limits(),
            Glides,
            "fixed_wing_lateral_setpoint, .* on Zenoh: .*zenoh/pub.csv or sub.csv.*uxrce_dds_client",
        ),
        ("v1.17", Limits(), Hop, "v1.17 publishes what arrives over Zenoh for 'config_control_setpoints' as the uORB"),
    ],
)
def test_what_zenoh_does_not_have_is_refused(
    release: str, limits: Limits, part: type[Mode] | None, error: str, px4_types: Any
) -> None:
    types = px4_types if release == "v1.18" else package_of(release)
    kind = "plane" if part is Glides else "multicopter"

    async def fly(vehicle: Vehicle) -> None:
        async with Flight(vehicle, limits=limits) as flight:
            if part is not None:
                await flight.add(part())

    with flown(types, kind) as (vehicle, simulator), pytest.raises(UnsupportedError, match=error):
        asyncio.run(asyncio.wait_for(fly(vehicle), 60.0))
    assert not any("setpoint" in name for name in simulator.vehicles[0].received)
