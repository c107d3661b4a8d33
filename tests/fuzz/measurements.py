"""Measurements of hostile programs: messages to a simulated vehicle, and calls of `flight.measure`.

The vehicle is simulated, on its own clock. Whatever arrives, its estimate is finite, and it fuses only what its
parameters switch on. A program gets errors that are documented, and sends only what EKF2 can use, at once. At the end,
a camera sends the same for some time: what is not fused has a reason, and no parameter is blamed that is set.
"""

from __future__ import annotations

import asyncio
import importlib
import math
from contextlib import suppress
from itertools import pairwise
from random import Random
from typing import Any, NamedTuple

from fuzz.payloads import targets
from msggen.flight import Flight, GlobalPlace
from msggen.flight.measurements import LOGGER
from msggen.messages.measurements import GLOBAL, LOCAL, PARTS, PLACE
from msggen.sim import Options
from msggen.sim.disturbances import noise_of
from msggen.sim.loop import run
from msggen.sim.near import NearVehicle
from msggen.sim.values import Filler, Scene
from msggen.sim.world import STEP

COUNT = 60

ACTS = 60
NUMBERS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-45, 3.4e38, -3.4e38, 1.0, -1.0, 1e6, 123.0)
WORDS: tuple[Any, ...] = ("ned", "enu", "frd", "flu", "body_frd", "NED", "", None, 7)
CALLS = ("position", "variance", "velocity", "velocity_variance", "attitude", "attitude_variance", "time", "frame")
STEADY = 60
"""How many measurements the last camera sends, at 20 Hz: more than EKF2 rejects before it begins anew."""
LOST = 5.5
"""The time in s after which nothing is fused any more."""
TOLD = ("VehicleLocalPosition", "VehicleOdometry", "VehicleGlobalPosition", "EstimatorStatusFlags", "SensorGps")


class Case(NamedTuple):
    """Parameters of the vehicle, and what is sent: a pause in s, a kind, and the seed of its values."""

    parameters: tuple[tuple[str, float], ...]
    acts: tuple[tuple[float, str, int], ...]
    camera: int = 0
    """The seed of what is sent at the end."""


class Watched(NearVehicle):
    """A vehicle that keeps what programs send."""

    def __init__(self, package: Any, options: Options) -> None:
        super().__init__(package, options)
        self.sent: list[tuple[int, str, Any]] = []

    def publish(self, topic: str, message: Any) -> None:
        self.sent.append((self.time, topic, message))
        super().publish(topic, message)


def case(chance: Random) -> Case:
    parameters = {
        "EKF2_EV_CTRL": float(chance.randrange(16)),
        "EKF2_GPS_CTRL": chance.choice((0.0, 7.0)),
        "EKF2_EV_DELAY": chance.choice((0.0, 0.0, 100.0, math.inf)),
        "EKF2_EV_QMIN": chance.choice((0.0, 0.0, 50.0, 101.0, -1.0)),
        "EKF2_HGT_REF": chance.choice((1.0, 1.0, 3.0)),
        "EKF2_AGP0_CTRL": chance.choice((0.0, 1.0, math.inf)),
        "EKF2_AGP0_ID": float(chance.randrange(3)),
    }
    kinds = chance.choice((("local", "place"), ("call", "good"), ("local", "place", "call", "good")))
    acts = [
        (chance.choice((0.001, 0.02, 0.05, 0.1, 0.3)), chance.choice(kinds), chance.randrange(1 << 32))
        for _ in range(chance.randrange(ACTS))
    ]
    return Case((*parameters.items(),), (*acts,), chance.randrange(1 << 32))


def check(case: Case) -> None:
    targets()  # makes the package known
    types = importlib.import_module("px4_types")
    vehicle = Watched(types, Options(parameters=dict(case.parameters)))
    LOGGER.disabled = True
    try:
        run(_fly(vehicle, types, case), vehicle)
    finally:
        LOGGER.disabled = False


async def _fly(vehicle: Watched, types: Any, case: Case) -> None:
    fillers = [Filler(getattr(types, name)) for name in TOLD]
    quiet = noise_of(0, 1, 0.0)
    await asyncio.sleep(1.0)
    async with Flight(vehicle) as flight:
        before = len(vehicle.sent)
        for pause, kind, seed in case.acts:
            chance = Random(seed)  # noqa: S311 - no secret
            if kind == "local":
                NearVehicle.publish(vehicle, LOCAL, _odometry(types, vehicle.time, chance))
            elif kind == "place":
                NearVehicle.publish(vehicle, GLOBAL, _place(types, vehicle.time, chance))
            else:
                with suppress(ValueError, TypeError):
                    _call(flight, chance, is_good=kind == "good")
            await asyncio.sleep(pause)
            for filler in fillers:
                filler.make(Scene(vehicle.world, quiet), vehicle.time).encode()
            _check_estimate(vehicle, dict(case.parameters))
        _check_sent(vehicle.sent[before:])
        await asyncio.sleep(LOST)
        assert not vehicle.world.external.fused
        await _check_reasons(flight, vehicle, dict(case.parameters), Random(case.camera))  # noqa: S311 - no secret


async def _check_reasons(flight: Flight, vehicle: Watched, parameters: dict[str, float], chance: Random) -> None:
    """Let a camera see the same for some time, and look at the reasons at its end."""
    far, north = chance.choice((0.0, 0.0, 3.0, 90.0)), chance.choice((0.0, 2.0))
    half = math.sqrt(0.5)
    given: dict[str, Any] = {
        "position": (far, 0.0, 0.0),
        "velocity": (0.0, north, 0.0),
        "attitude": chance.choice(((1.0, 0.0, 0.0, 0.0), (half, 0.0, 0.0, half))),
    }
    values: dict[str, Any] = {"frame": chance.choice(("ned", "flu"))}
    for name in chance.sample([*given], chance.randrange(1, 4)):
        values |= {name: given[name], "variance" if name == "position" else f"{name}_variance": 0.01}
    for _ in range(STEADY):
        flight.measure.local(**values)
        await asyncio.sleep(0.05)
    world, bits = vehicle.world, int(parameters["EKF2_EV_CTRL"])
    is_spoilt = parameters["EKF2_EV_QMIN"] > 100.0  # that of what is sent
    parts = {part.name: part for part in PARTS}
    assert flight.measure.state
    for name, is_fused, reason in flight.measure.state:
        assert is_fused == (not reason)
        assert not is_fused or parts[name] in world.external.fused, name
        assert "EKF2_EV_CTRL" not in reason or not parts[name].bit & bits or is_spoilt, (name, reason)
        assert parts[name].bit & bits or reason, name


def _stamp(now: int, chance: Random) -> int:
    return chance.choice((0, 1, now, now - 30_000, now - 250_000, now - 800_000, now + 10**6, 2**63, 2**64 - 1))


def _numbers(chance: Random, count: int) -> tuple[float, ...]:
    if chance.random() < 0.5:
        return tuple(chance.uniform(-2, 2) for _ in range(count))
    return tuple(chance.choice(NUMBERS) for _ in range(count))


def _odometry(types: Any, now: int, chance: Random) -> Any:
    q = (1.0, 0.0, 0.0, 0.0) if chance.random() < 0.5 else _numbers(chance, 4)
    return types.VehicleOdometry(
        timestamp=_stamp(now, chance),
        timestamp_sample=_stamp(now, chance),
        pose_frame=chance.choice((0, 1, 2, 3, 255)),
        position=_numbers(chance, 3),
        q=q,
        velocity_frame=chance.choice((0, 1, 2, 3, 255)),
        velocity=_numbers(chance, 3),
        position_variance=_numbers(chance, 3),
        orientation_variance=_numbers(chance, 3),
        velocity_variance=_numbers(chance, 3),
        reset_counter=chance.choice((0, 0, 0, 1, 255)),
        quality=chance.choice((-128, 0, 100)),
    )


def _place(types: Any, now: int, chance: Random) -> Any:
    lat, lon, alt, eph, epv = _numbers(chance, 5)
    if chance.random() < 0.5:
        lat, lon = 47.4 + chance.choice((0.0, 1e-5, 1.0)), 8.5
    return types.AuxGlobalPosition(
        timestamp=_stamp(now, chance),
        timestamp_sample=_stamp(now, chance),
        id=chance.choice((0, 1, 2, 255)),
        lat=lat,
        lon=lon,
        alt=alt,
        eph=eph,
        epv=epv,
        lat_lon_reset_counter=chance.choice((0, 0, 1, 255)),
    )


def _call(flight: Flight, chance: Random, *, is_good: bool) -> None:
    """Call with values that are right or nearly right, or with any."""
    now = flight.measure.time
    if chance.random() < 0.2:
        place: Any = GlobalPlace(47.4, 8.5, 500.0) if is_good else chance.choice((None, 1.0, (47.4, 8.5, 500.0)))
        accuracy: Any = 1.0 if is_good else chance.choice((*NUMBERS, None))
        flight.measure.on_earth(place, accuracy=accuracy, time=chance.choice((None, now)))
        return
    if is_good:
        flight.measure.local(position=_numbers(chance, 3), variance=0.01, frame=chance.choice(("ned", "flu")))
        return
    given: dict[str, Any] = {"position": (0.0, 0.0, 0.0), "variance": 0.1}
    for name in chance.sample(CALLS, chance.randrange(4)):
        given[name] = chance.choice(
            (
                _numbers(chance, 3),
                _numbers(chance, 4),
                chance.choice(NUMBERS),
                chance.choice(WORDS),
                _stamp(now, chance),
            )
        )
    flight.measure.local(**given)


def _check_estimate(vehicle: Watched, parameters: dict[str, float]) -> None:
    world = vehicle.world
    flight = world.flight
    assert all(map(math.isfinite, (*flight.position, *flight.velocity, flight.yaw, world.external.accuracy)))
    for part in world.external.fused - {PLACE}:
        assert part.bit & int(parameters["EKF2_EV_CTRL"]), part
    if PLACE in world.external.fused:
        assert parameters["EKF2_AGP0_CTRL"] == 1.0
        assert parameters["EKF2_AGP0_ID"]


def _check_sent(sent: list[tuple[int, str, Any]]) -> None:
    """Check what a program has sent: EKF2 can use all of it, and nothing has waited."""
    by_topic: dict[tuple[str, int], list[int]] = {}
    for now, topic, message in sent:
        assert -STEP <= now - message.timestamp_sample <= 300_000, topic  # the vehicle moves in steps, and lags behind
        by_topic.setdefault((topic, getattr(message, "id", 0)), []).append(message.timestamp_sample)
        if topic == GLOBAL:
            assert math.isfinite(message.lat + message.lon)
            assert 0.0 < message.eph < math.inf
            continue
        for values, variances in (
            (message.position, message.position_variance),
            (message.velocity, message.velocity_variance),
            (message.q[1:], message.orientation_variance),
        ):
            is_given = not all(map(math.isnan, values))
            assert not is_given or all(map(math.isfinite, values))
            assert all(each > 0.0 if is_given else math.isnan(each) for each in variances), message
    for stamps in by_topic.values():
        assert all(after - before >= 10_000 for before, after in pairwise(stamps))
