"""Tests of measurements that the simulated estimator fuses: what a PX4 v1.18 without GPS was seen to do.

The times in `test_...` are those that were seen, in s from the first sample of a kind. Ours are within 0.1 s, where no
other bound is given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.messages.measurements import HEIGHT, NED, PARTS, PLACE, POSITION, VELOCITY, YAW
from msggen.sim import Options
from msggen.sim.attitude import quaternion_of
from msggen.sim.commander.rules import V1_15, V1_16, V1_17, V1_18
from msggen.sim.disturbances import noise_of
from msggen.sim.flight import ZERO
from msggen.sim.parameters import PARAMETERS
from msggen.sim.publishing import localize
from msggen.sim.values import Filler, Scene
from msggen.sim.vehicle import world_of
from msggen.sim.wing_pilot import WingPilot
from msggen.sim.world import World

NAN3, NAN4 = (math.nan,) * 3, (math.nan,) * 4
ALL = {"position", "height", "velocity", "attitude"}
INDOORS = {"EKF2_EV_CTRL": 15.0, "EKF2_GPS_CTRL": 0.0}
STEP = 0.01
NEAR = 0.1
QUIET = noise_of(0, 1, 0.0)


class Camera:
    """A vehicle, and a program that sends what a camera measures. The vehicle has stood for 2 s."""

    def __init__(self, types: Any, parameters: Mapping[str, float] = INDOORS, **options: Any) -> None:
        self.types = types
        self.world = world_of(types, Options(parameters=parameters, **options))
        self._fillers: dict[str, Filler] = {}
        self.run(2.0)

    def run(self, seconds: float, send: Callable[[], Any] | None = None, rate: float = 20.0) -> None:
        """Let time pass. A function is called at a rate."""
        start, sent = self.world.time, 0
        while self.world.time - start < seconds * 1e6:
            if send is not None and self.world.time - start >= sent * 1e6 / rate:
                send()
                sent += 1
            self.world.advance(self.world.time + round(STEP * 1e6))

    def until(self, is_so: Callable[[], bool], send: Callable[[], Any] | None = None, rate: float = 20.0) -> float:
        """Let time pass until something is so, and return how long that took in s."""
        start, due = self.world.time, 0.0
        while not is_so():
            assert self.world.time - start < 8e6
            if send is not None and self.world.time - start >= due * 1e6:
                send()
                due += 1.0 / rate
            self.world.advance(self.world.time + round(STEP * 1e6))
        return (self.world.time - start) / 1e6

    def local(self, *, late: float = 0.0, stamp: int | None = None, **values: Any) -> None:
        """Send a VehicleOdometry, by default of a place in NED."""
        time = self.world.time - round(late * 1e6) if stamp is None else stamp
        given = {
            "position": (0.0, 0.0, 0.0),
            "pose_frame": NED,
            "velocity": NAN3,
            "q": NAN4,
            "position_variance": (0.01,) * 3,
            **values,
        }
        message = self.types.VehicleOdometry(timestamp_sample=min(time, self.world.time) or self.world.time, **given)
        self.world.external.handlers["vehicle_visual_odometry"](message, self.world.time)

    @property
    def fused(self) -> set[str]:
        return {part.name for part in self.world.external.fused}

    def message(self, name: str) -> Any:
        """Return what the vehicle publishes now."""
        if name not in self._fillers:
            self._fillers[name] = Filler(getattr(self.types, name))
        return self._fillers[name].make(Scene(self.world, QUIET), self.world.time)

    def flags(self) -> Any:
        return self.message("EstimatorStatusFlags")

    def place(self) -> Any:
        return self.message("VehicleLocalPosition")


@pytest.fixture
def camera(types: Any) -> Camera:
    return Camera(types)


@pytest.fixture
def started(camera: Camera) -> Camera:
    camera.run(2.0, camera.local)
    assert camera.fused == {"position", "height"}
    return camera


def test_nothing_sent(camera: Camera) -> None:
    place, flags = camera.place(), camera.flags()
    assert (place.xy_valid, place.z_valid, place.xy_global) == (False, True, False)
    assert math.isnan(place.ref_lat)
    assert flags.cs_inertial_dead_reckoning
    assert getattr(flags, "cs_valid_fake_pos", True)
    assert not any(getattr(flags, part.flag) for part in PARTS)


def test_xy_alone_is_nothing(camera: Camera) -> None:
    camera.run(4.0, lambda: camera.local(position=(0.0, 0.0, math.nan)))
    assert (camera.fused, camera.place().xy_valid) == (set(), False)


def test_all_three_are_fused_after_a_moment(camera: Camera) -> None:
    """Seen after 0.20 s, with eph 0.14 that falls to 0.04."""
    before = camera.place().xy_reset_counter
    send = lambda: camera.local(position=(2.0, -1.0, 0.0))  # noqa: E731 - what is sent
    seconds = camera.until(lambda: camera.world.has_position, send)
    assert seconds == pytest.approx(0.20, abs=NEAR)
    place, flags = camera.place(), camera.flags()
    assert (flags.cs_ev_pos, flags.cs_ev_hgt, flags.cs_inertial_dead_reckoning) == (True, True, False)
    assert (place.x, place.y, place.xy_reset_counter) == (2.0, -1.0, before + 1)
    assert tuple(place.delta_xy) == (2.0, -1.0)
    assert place.eph == pytest.approx(0.14, abs=0.02)
    camera.run(5.0, send)
    assert camera.place().eph == pytest.approx(0.04, abs=0.01)


def test_stopped(started: Camera) -> None:
    """Seen: flags off after 0.51 s with a reset, the position lost after 4.6 s."""
    before = started.place().xy_reset_counter
    assert started.until(lambda: not started.fused) == pytest.approx(0.51, abs=NEAR)
    assert started.place().xy_reset_counter == before + 1
    assert started.until(lambda: not started.place().xy_valid) == pytest.approx(4.1, abs=0.3)


def test_a_jump_is_rejected_for_a_second(started: Camera) -> None:
    """Seen: dead reckoning after 1.13 s, the new place after 1.18 s."""
    before = started.place().xy_reset_counter
    send = lambda: started.local(position=(10.0, 0.0, 0.0))  # noqa: E731 - what is sent
    assert started.until(lambda: bool(started.flags().cs_inertial_dead_reckoning), send) == pytest.approx(
        1.13, abs=NEAR
    )
    assert started.place().x == 0.0
    assert started.until(lambda: started.place().x == 10.0, send) <= NEAR
    assert (started.place().xy_reset_counter, started.place().xy_valid) == (before + 1, True)


def test_a_jump_that_is_told_is_followed(started: Camera) -> None:
    """Seen after 0.17 s."""
    send = lambda: started.local(position=(10.0, 0.0, 0.0), reset_counter=1)  # noqa: E731 - what is sent
    assert started.until(lambda: started.place().x == 10.0, send) == pytest.approx(0.17, abs=NEAR)
    assert "position" in started.fused


@pytest.mark.parametrize(
    "values",
    [{"late": 0.1}, {"late": 0.25}, {"late": -0.5}, {"stamp": 0}],
    ids=["0.1 late", "0.25 late", "in the future", "0"],
)
def test_times_that_are_fused(started: Camera, values: dict[str, Any]) -> None:
    for _ in range(60):
        started.run(0.05, lambda: started.local(**values))
        assert "position" in started.fused


def test_late_ones_are_not_used(started: Camera) -> None:
    """Seen: flags off after 3.2 s, for 0.4 s is at the edge: ours are off at once. On time again: after 0.21 s."""
    send = lambda: started.local(late=0.4)  # noqa: E731 - what is sent
    assert started.until(lambda: not started.fused, send) <= 3.2
    started.run(1.0, send)
    assert not started.fused
    assert started.until(lambda: "position" in started.fused, started.local) == pytest.approx(0.21, abs=NEAR)


def test_slow_ones_go_on_and_do_not_start(types: Any) -> None:
    values: dict[str, Any] = {"q": (1.0, 0.0, 0.0, 0.0), "velocity": (0.0,) * 3, "velocity_frame": 1}
    camera = Camera(types)
    for rate, parts in ((3.0, set()), (20.0, ALL), (3.0, ALL)):
        camera.run(5.0, lambda: camera.local(**values), rate=rate)
        assert camera.fused == parts


@pytest.mark.parametrize("variance", [1e-8, math.nan])
def test_small_variances_are_those_of_the_parameter(started: Camera, variance: float) -> None:
    """Seen: as 0.01, with eph 0.04."""
    started.run(4.0, lambda: started.local(position_variance=(variance,) * 3))
    assert (started.fused, started.place().eph) == ({"position", "height"}, pytest.approx(0.04, abs=0.01))


def test_a_large_variance_corrects_nothing(started: Camera) -> None:
    """Seen: fused, with eph 0.23 that grows."""
    send = lambda: started.local(position_variance=(1e4,) * 3)  # noqa: E731 - what is sent
    started.run(10.0, send)
    first = started.place().eph
    started.run(10.0, send)
    assert "position" in started.fused
    assert 0.15 < first < started.place().eph


def test_a_large_variance_of_the_height_does_not_matter(started: Camera) -> None:
    started.run(4.0, lambda: started.local(position_variance=(0.01, 0.01, 1e4)))
    assert (started.fused, started.place().eph) == ({"position", "height"}, pytest.approx(0.04, abs=0.01))


def test_velocity(camera: Camera) -> None:
    """Seen: fused after 0.19 s; x and y alone end it after 0.20 s."""
    values: dict[str, Any] = {"position": NAN3, "velocity_frame": NED, "velocity": (0.0, 0.0, 0.0)}
    assert camera.until(lambda: "velocity" in camera.fused, lambda: camera.local(**values)) == pytest.approx(
        0.2, abs=NEAR
    )
    camera.run(1.0, lambda: camera.local(**values))
    values["velocity"] = (0.0, 0.0, math.nan)
    assert camera.until(lambda: not camera.fused, lambda: camera.local(**values)) == pytest.approx(0.2, abs=NEAR)


def test_yaw(started: Camera) -> None:
    """Seen: fused after 0.18 s, the heading of an FRD frame after 0.2 s, and position off after 0.17 s without one."""
    q = quaternion_of(0.0, 0.0, 0.0)
    send = lambda: started.local(q=q)  # noqa: E731 - what is sent
    assert started.until(lambda: "attitude" in started.fused, send) == pytest.approx(0.18, abs=NEAR)
    counter = started.place().heading_reset_counter
    turned = quaternion_of(0.0, 0.0, 1.0)
    send = lambda: started.local(q=turned, pose_frame=2, position=(3.0, 0.0, 0.0), reset_counter=1)  # noqa: E731
    assert started.until(lambda: started.place().heading_reset_counter > counter, send) == pytest.approx(0.2, abs=NEAR)
    started.run(0.2, send)
    place = started.place()
    assert (place.heading, place.x) == (pytest.approx(1.0, abs=1e-5), 3.0)
    assert started.fused == {"position", "height", "attitude"}
    assert started.flags().cs_yaw_align  # it had begun in NED
    send = lambda: started.local(q=turned, pose_frame=0, reset_counter=1, velocity=(0.0,) * 3, velocity_frame=1)  # noqa: E731
    assert started.until(lambda: "position" not in started.fused, send) == pytest.approx(0.17, abs=NEAR)
    started.run(0.5, send)
    assert started.fused == {"attitude", "velocity"}


# What was read of the source


def test_a_heading_that_jumps_is_followed_after_a_second(started: Camera) -> None:
    started.run(1.0, lambda: started.local(q=quaternion_of(0.0, 0.0, 0.0)))
    send = lambda: started.local(q=quaternion_of(0.0, 0.0, 2.0))  # noqa: E731 - what is sent
    assert started.until(lambda: abs(started.place().heading - 2.0) < 1e-3, send) == pytest.approx(1.2, abs=0.2)
    assert "attitude" in started.fused


def test_a_position_in_ned_needs_north(started: Camera) -> None:
    started.world.external.is_yaw_aligned = False
    started.run(1.0, started.local)
    assert started.fused == {"height"}
    started.run(1.0, lambda: started.local(pose_frame=2))
    assert started.fused == {"position", "height"}


def test_the_heading_is_from_north_again_when_that_of_a_level_frame_ends(started: Camera) -> None:
    started.run(1.0, lambda: started.local(q=quaternion_of(0.0, 0.0, 1.0), pose_frame=2))
    assert not started.flags().cs_yaw_align
    started.run(1.0, started.local)
    assert started.flags().cs_yaw_align
    assert started.fused == {"position", "height"}


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 1), st.integers(-(2**52), 2**52), st.integers(0, 2**52))
def test_times_that_arrive_count_since_boot(px4_types: Any, stamp: int, sample: int, offset: int, now: int) -> None:
    """0, times to come and those of another clock count as now, in both fields."""
    message = px4_types.VehicleOdometry(timestamp=stamp, timestamp_sample=sample)
    localize(message, now, offset)
    for before, after in ((stamp, message.timestamp), (sample, message.timestamp_sample)):
        assert after == (before - offset if before and 0 <= before - offset <= now else now)


def test_what_parameters_switch_off_is_not_fused(types: Any) -> None:
    values: dict[str, Any] = {"q": (1.0, 0.0, 0.0, 0.0), "velocity": (0.0,) * 3, "velocity_frame": 1}
    for part in (POSITION, HEIGHT, VELOCITY, YAW):
        camera = Camera(types, {**INDOORS, "EKF2_EV_CTRL": float(part.bit)})
        camera.run(1.0, lambda: camera.local(**values))  # noqa: B023 - it is called at once
        assert camera.fused == {part.name}
        assert [each.name for each in PARTS if getattr(camera.flags(), each.flag)] == [part.name]
        assert camera.world.has_position == (part in {POSITION, VELOCITY})


@pytest.mark.parametrize(("rules", "control"), [(V1_15, 15), (V1_16, 0), (V1_17, 0), (V1_18, 0)])
def test_the_default_is_that_of_the_release(rules: Any, control: float) -> None:
    world = World(rules=rules)
    assert rules.estimator["EKF2_EV_CTRL"] == control
    assert world.external._control == control


def test_a_parameter_of_another_release_is_an_error(types: Any) -> None:
    own, other = ("EKF2_AGP0_CTRL", "EKF2_AGP_CTRL") if _has_ids(types) else ("EKF2_AGP_CTRL", "EKF2_AGP0_CTRL")
    world_of(types, Options(parameters={own: 1.0}))
    near = own.replace("0", r"\d")
    with pytest.raises(ValueError, match=f"'{other}' cannot be set, did you mean '{near}'"):
        world_of(types, Options(parameters={other: 1.0}))


def test_a_level_frame_is_turned_by_the_attitude_if_that_is_not_fused(types: Any) -> None:
    camera = Camera(types, {**INDOORS, "EKF2_EV_CTRL": 3.0})
    quarter = quaternion_of(0.0, 0.0, math.pi / 2)
    camera.run(1.0, lambda: camera.local(pose_frame=2, position=(0.0, 4.0, 0.0), q=quarter))
    assert camera.fused == {"position", "height"}
    place = camera.place()  # the vehicle looks north: what is to the right in the frame is ahead
    assert (place.x, place.y, place.heading) == pytest.approx((4.0, 0.0, 0.0), abs=1e-5)
    assert camera.flags().cs_yaw_align


def test_gps_decides_and_the_heading_of_a_level_frame_is_not_used(types: Any) -> None:
    camera = Camera(types, {"EKF2_EV_CTRL": 15.0})
    turned = quaternion_of(0.0, 0.0, 1.0)
    camera.run(1.0, lambda: camera.local(pose_frame=2, q=turned))
    assert (camera.fused, camera.place().heading) == ({"position", "height"}, 0.0)
    camera.run(1.0, lambda: camera.local(q=quaternion_of(0.0, 0.0, 0.1)))
    assert camera.fused == {"position", "height", "attitude"}


def test_gps_decides_and_a_bias_is_learned(types: Any) -> None:
    camera = Camera(types, {"EKF2_EV_CTRL": 15.0})
    resets = camera.place().xy_reset_counter
    camera.run(1.0, lambda: camera.local(position=(7.0, 0.0, 0.0)))
    assert camera.fused == {"position", "height"}
    assert (camera.place().x, camera.place().xy_reset_counter) == (0.0, resets)
    camera.run(3.0, lambda: camera.local(position=(20.0, 0.0, 0.0)))
    assert (camera.place().x, camera.place().xy_reset_counter) == (0.0, resets)
    assert "position" in camera.fused


def test_samples_out_of_order_or_too_near_are_dropped(started: Camera) -> None:
    newest = started.world.external._newest
    for time in (newest, newest - 50_000, newest + 9_000):
        started.local(stamp=time)
        assert started.world.external._newest == newest
    started.run(0.1)
    started.local()
    assert started.world.external._newest > newest


def test_fusion_ends_after_five_resets_in_the_air(started: Camera) -> None:
    started.world.flight.is_on_ground = False
    ends = []
    for number in range(1, 9):
        counter = started.world.external.changes
        started.world.external._is_resting = False
        for _ in range(30):
            started.local(position=(20.0 * number, 0.0, 0.0))
            started.world.external.step(started.world.time, has_gps=False, is_resting=False)
            started.world.time += 50_000
        ends.append(started.world.external.changes - counter)
    assert ends[:5] == [0] * 5
    assert any(ends[5:])


def test_a_measurement_of_low_quality_is_not_used(types: Any) -> None:
    """EKF2_EV_QMIN, ev_control.cpp of v1.16: no start, no sample of before, and after 0.4 s the data have stopped."""
    camera = Camera(types, {**INDOORS, "EKF2_EV_QMIN": 50.0})
    camera.run(1.0, lambda: camera.local(quality=49))
    assert not camera.fused
    assert camera.until(lambda: "position" in camera.fused, lambda: camera.local(quality=50)) < 0.3
    assert camera.until(lambda: not camera.fused, lambda: camera.local(quality=49)) == pytest.approx(0.5, abs=NEAR)
    camera.run(1.0, lambda: camera.local(quality=50))
    jump = lambda: camera.local(quality=49, reset_counter=1)  # noqa: E731 - what is sent
    assert camera.until(lambda: not camera.fused, jump) <= 0.25


def test_a_delay_of_the_parameter_makes_samples_older(types: Any) -> None:
    """EKF2_EV_DELAY in ms, setExtVisionData of v1.16: what is 0.2 s old counts as 0.4 s old."""
    for delay, is_used in ((0.0, True), (200.0, False)):
        camera = Camera(types, {**INDOORS, "EKF2_EV_DELAY": delay})
        camera.run(2.0, lambda: camera.local(late=0.2))  # noqa: B023 - it is called at once
        assert bool(camera.fused) is is_used


def test_a_height_that_is_the_reference_moves_the_estimate(types: Any) -> None:
    """EKF2_HGT_REF 3, ev_height_control.cpp of v1.16: the estimate is reset at the start and at each told jump."""
    camera = Camera(types, {**INDOORS, "EKF2_HGT_REF": 3.0})
    before = camera.place()
    camera.run(1.0, lambda: camera.local(position=(0.0, 0.0, -4.0)))
    place = camera.place()
    assert (place.z, place.z_reset_counter, place.delta_z) == (-4.0, before.z_reset_counter + 1, -4.0)
    assert place.dist_bottom == pytest.approx(before.dist_bottom, abs=1e-6)
    camera.run(1.0, lambda: camera.local(position=(0.0, 0.0, 1.0), reset_counter=1))
    assert camera.place().z == 1.0


def test_another_height_is_learned(started: Camera) -> None:
    """The same, with EKF2_HGT_REF 1: a jump is rejected for 5 s, hgt_fusion_timeout_max, and then learned anew."""
    before = started.place()
    started.run(1.0, lambda: started.local(position=(0.0, 0.0, -4.0), reset_counter=1))
    send = lambda: started.local(position=(0.0, 0.0, 7.0), reset_counter=1)  # noqa: E731 - what is sent
    assert started.until(lambda: "height" not in started.fused, send) == pytest.approx(5.1, abs=0.2)
    assert started.until(lambda: "height" in started.fused, send) <= NEAR
    assert (started.place().z, started.place().z_reset_counter) == (before.z, before.z_reset_counter)


@pytest.mark.parametrize(
    ("velocity", "frame", "is_used"),
    [
        ((3.0, 0.0, 0.0), 1, True),
        ((0.0, 3.0, 0.0), 1, False),
        ((-3.0, 0.0, 0.0), 1, False),
        ((0.0, -3.0, 0.0), 3, True),
        ((3.0, 0.0, 0.0), 3, False),
    ],
)
def test_the_direction_of_a_velocity_counts(types: Any, velocity: Any, frame: int, *, is_used: bool) -> None:
    """Each axis is compared, ev_vel.h and ev_vel_control.cpp of v1.16: with GPS, a velocity in the gate can begin."""
    camera = Camera(types, {"EKF2_EV_CTRL": 4.0})

    def send() -> None:
        flight.velocity, flight.yaw, flight.acceleration, flight.is_on_ground = (
            (3.0, 0.0, 0.0),
            math.pi / 2,
            ZERO,
            False,
        )
        camera.local(position=NAN3, velocity=velocity, velocity_frame=frame)
        camera.world.external.step(camera.world.time, has_gps=True, is_resting=False)
        camera.world.time += 50_000

    flight = camera.world.flight
    for _ in range(20):
        send()
    assert bool(camera.fused) is is_used


def test_a_velocity_that_is_too_fast_is_dropped(types: Any) -> None:
    """EKF2_VEL_LIM 100, ev_vel_control.cpp of v1.16."""
    for speed, is_used in ((99.0, True), (101.0, False)):
        camera = Camera(types, {**INDOORS, "EKF2_EV_CTRL": 4.0})
        camera.run(1.0, lambda: camera.local(position=NAN3, velocity=(speed, 0.0, 0.0), velocity_frame=1))  # noqa: B023
        assert bool(camera.fused) is is_used


def test_a_heading_far_from_the_estimate_begins_on_the_ground_only(types: Any) -> None:
    """fuseYaw of yaw_fusion.cpp, v1.16, which alone sets one of the flags of rejections up to v1.17."""
    names = {field.name for field in types.EstimatorStatusFlags.__msg__.fields}
    for is_resting in (False, True):
        camera = Camera(types, {"EKF2_EV_CTRL": 8.0})
        for _ in range(20):
            camera.local(q=quaternion_of(0.0, 0.0, 2.0))
            camera.world.external.step(camera.world.time, has_gps=True, is_resting=is_resting)
            camera.world.time += 50_000
        assert (camera.fused == {"attitude"}) is is_resting
        assert getattr(camera.flags(), "reject_yaw", not is_resting) is not is_resting
        assert not any(getattr(camera.flags(), name) for name in names if name in UNSET)
    assert ("reject_yaw" in names) == ("reject_hor_pos" in names) == (not _has_ids(types))


UNSET = ("reject_hor_pos", "reject_ver_pos", "reject_hor_vel", "reject_ver_vel")
"""The flags that EKF2 publishes up to v1.17, and sets nowhere."""


def test_an_attitude_without_a_position_counts_as_one_in_frd(types: Any) -> None:
    """UpdateExtVisionSample of EKF2.cpp, v1.16: the frame is taken only with a position."""
    q = quaternion_of(0.0, 0.0, 1.0)
    camera = Camera(types)
    camera.run(1.0, lambda: camera.local(position=NAN3, q=q))
    assert (camera.fused, camera.flags().cs_yaw_align) == ({"attitude"}, False)
    camera = Camera(types, {"EKF2_EV_CTRL": 8.0})
    camera.run(1.0, lambda: camera.local(position=NAN3, q=q))
    assert not camera.fused


@pytest.mark.parametrize("vehicle", ["plane", "vtol", "rover"])
def test_other_vehicles_jump_with_their_estimate_too(px4_types: Any, vehicle: str) -> None:
    camera = Camera(px4_types, {**INDOORS, "EKF2_HGT_REF": 3.0}, vehicle=vehicle)
    camera.run(1.0, lambda: camera.local(position=(5.0, -3.0, -1.0)))
    place = camera.place()
    assert (place.x, place.y, place.z) == pytest.approx((5.0, -3.0, -1.0))


# Places on earth


def _has_ids(types: Any) -> bool:
    return hasattr(types, "AuxGlobalPosition")


def placed(types: Any) -> dict[str, float]:
    found = {"EKF2_AGP0_CTRL": 1.0, "EKF2_AGP0_ID": 7.0} if _has_ids(types) else {"EKF2_AGP_CTRL": 1.0}
    return {"EKF2_GPS_CTRL": 0.0, **found}


def place_on_earth(camera: Camera, *, identity: int = 7, **values: Any) -> Any:
    given = {"lat": 47.0, "lon": 8.0, "alt": 500.0, "eph": 0.5, "epv": 0.5, **values}
    if _has_ids(camera.types):
        given["id"] = identity
    cls = getattr(camera.types, "AuxGlobalPosition", camera.types.VehicleGlobalPosition)
    message = cls(timestamp_sample=camera.world.time, **given)
    camera.world.external.handlers["aux_global_position"](message, camera.world.time)


def test_a_place_on_earth_sets_the_origin_and_is_fused(types: Any) -> None:
    camera = Camera(types, placed(types))
    camera.run(1.0, lambda: place_on_earth(camera), rate=4.0)
    assert camera.fused == {PLACE.name}
    assert camera.flags().cs_aux_gpos
    place = camera.place()
    assert (place.ref_lat, place.ref_lon, place.ref_alt) == pytest.approx((47.0, 8.0, 500.0))
    assert (place.xy_valid, place.xy_global) == (True, True)
    assert camera.until(lambda: not camera.fused) == pytest.approx(5.0, abs=0.5)


def test_altitudes_count_from_the_origin_that_a_place_on_earth_sets(px4_types: Any) -> None:
    camera = Camera(px4_types, placed(px4_types), vehicle="plane")
    camera.run(1.0, lambda: place_on_earth(camera, alt=700.0))
    pilot = camera.world.autopilot
    setpoint = px4_types.FixedWingLongitudinalSetpoint(altitude=720.0, height_rate=math.nan)
    pilot.handlers["fixed_wing_longitudinal_setpoint"](setpoint, camera.world.time)
    assert isinstance(pilot, WingPilot)
    assert pilot._wing.down == pytest.approx(-20.0)


@pytest.mark.parametrize(
    "values",
    [{"lat": math.nan}, {"lon": math.inf}, {"lat": 123.0}],
    ids=str,
)
def test_no_place_is_not_fused(types: Any, values: dict[str, Any]) -> None:
    camera = Camera(types, placed(types))
    camera.run(1.0, lambda: place_on_earth(camera, **values))
    assert not camera.fused


def test_a_source_with_another_number_is_not_fused(types: Any) -> None:
    camera = Camera(types, placed(types))
    camera.run(1.0, lambda: place_on_earth(camera, identity=8))
    assert bool(camera.fused) != _has_ids(types)


def test_gps_decides_beside_a_place_on_earth(types: Any) -> None:
    camera = Camera(types, {**placed(types), "EKF2_GPS_CTRL": 7.0})
    here, resets = camera.world.origin, camera.place().xy_reset_counter
    camera.run(1.0, lambda: place_on_earth(camera, lat=here.latitude, lon=here.longitude))
    assert camera.fused == {PLACE.name}
    if not camera.world.commander.rules.auxiliary_patience:  # v1.15 follows each place: the next test
        return
    camera.run(1.0, lambda: place_on_earth(camera, lat=here.latitude + 0.001, lat_lon_reset_counter=1))
    assert not camera.fused
    assert (camera.place().x, camera.place().xy_reset_counter) == (0.0, resets)
    assert camera.world.origin == here


def test_the_oldest_release_follows_each_place_at_once_beside_gps_too(px4_types: Any) -> None:
    """aux_global_position.cpp before v1.16: it begins without a look, and resets the position at each rejection."""
    for rules, is_followed in ((V1_15, True), (V1_16, False)):
        world = World(rules=rules, parameters={**PARAMETERS, "EKF2_AGP_CTRL": 1.0})
        place = world.origin._replace(latitude=world.origin.latitude + 0.001)
        message = px4_types.VehicleGlobalPosition(lat=place.latitude, lon=place.longitude, eph=1.0)
        for _ in range(20):
            message.timestamp_sample = world.time
            world.external.handlers["aux_global_position"](message, world.time)
            world.advance(world.time + 50_000)
        assert (world.flight.position[0] > 100.0) is is_followed
        assert (PLACE in world.external.fused) is is_followed


def test_a_jump_on_earth_is_followed_late_or_when_it_is_told(types: Any) -> None:
    camera = Camera(types, placed(types))
    camera.run(1.0, lambda: place_on_earth(camera))
    send = lambda **values: place_on_earth(camera, lat=47.001, **values)  # noqa: E731 - what is sent
    seconds = camera.until(lambda: camera.place().x > 100.0, send)
    assert seconds == pytest.approx(camera.world.commander.rules.auxiliary_patience / 1e6 + 0.15, abs=0.3)
    assert camera.until(lambda: camera.place().x < 1.0, lambda: place_on_earth(camera, lat_lon_reset_counter=1)) < 0.3
