"""A simulated world for tests, with programs that send it setpoints and fly modes of their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from msggen.messages.commands import ACCEPTED, ARM_DISARM, SET_NAV_STATE, TAKEOFF
from msggen.messages.nav_states import HOLD, LAND
from msggen.sim.airframes import AIRFRAMES, airframe_of
from msggen.sim.attitude import Quaternion, Vector
from msggen.sim.commander.checks import Reply
from msggen.sim.commander.components import Registration
from msggen.sim.commander.rules import V1_18, Rules
from msggen.sim.flight import FREE, GRAVITY, NAN, ZERO
from msggen.sim.parameters import PARAMETERS
from msggen.sim.world import STEP, World

SECOND = 1_000_000
NOTHING = (NAN,) * 7
ARM = (1.0, *NOTHING[1:])
DISARM = (0.0, *NOTHING[1:])
_LOOPS = 0.024
GOTO, TRAJECTORY, RATES, ATTITUDE = 2, 4, 5, 6
"""The types of SetpointConfig."""


class Controls(NamedTuple):
    """An OffboardControlMode."""

    position: bool = True
    velocity: bool = False
    acceleration: bool = False


POSITIONS = Controls()


class Setpoint(NamedTuple):
    """A TrajectorySetpoint."""

    position: Vector = FREE
    velocity: Vector = FREE
    acceleration: Vector = FREE
    yaw: float = NAN
    yawspeed: float = NAN


class Goto(NamedTuple):
    """A GotoSetpoint."""

    position: Vector
    flag_control_heading: bool = False
    heading: float = 0.0
    flag_set_max_horizontal_speed: bool = False
    max_horizontal_speed: float = 0.0
    flag_set_max_vertical_speed: bool = False
    max_vertical_speed: float = 0.0
    flag_set_max_heading_rate: bool = False
    max_heading_rate: float = 0.0


class Attitude(NamedTuple):
    """A VehicleAttitudeSetpoint."""

    q_d: Quaternion = (1.0, 0.0, 0.0, 0.0)
    thrust_body: Vector = (0.0, 0.0, -0.5)


class Rates(NamedTuple):
    """A VehicleRatesSetpoint."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    thrust_body: Vector = (0.0, 0.0, -0.5)


class Thrust(NamedTuple):
    """A VehicleThrustSetpoint."""

    xyz: Vector = (0.0, 0.0, -0.5)


class Torque(NamedTuple):
    """A VehicleTorqueSetpoint."""

    xyz: Vector = ZERO


class Motors(NamedTuple):
    """An ActuatorMotors."""

    control: tuple[float, ...]


class Servos(NamedTuple):
    """An ActuatorServos."""

    control: tuple[float, ...]


class Lateral(NamedTuple):
    """A FixedWingLateralSetpoint."""

    course: float = NAN
    airspeed_direction: float = NAN
    lateral_acceleration: float = NAN


class Longitudinal(NamedTuple):
    """A FixedWingLongitudinalSetpoint."""

    altitude: float = NAN
    height_rate: float = NAN
    equivalent_airspeed: float = NAN
    pitch_direct: float = NAN
    throttle_direct: float = NAN


class LateralLimits(NamedTuple):
    """A LateralControlConfiguration."""

    lateral_accel_max: float = NAN


class LongitudinalLimits(NamedTuple):
    """A LongitudinalControlConfiguration."""

    climb_rate_target: float = NAN
    sink_rate_target: float = NAN
    pitch_min: float = NAN
    pitch_max: float = NAN
    throttle_max: float = NAN


class RoverPosition(NamedTuple):
    """A RoverPositionSetpoint."""

    position_ned: tuple[float, float]
    cruising_speed: float = NAN
    arrival_speed: float = NAN


class Speed(NamedTuple):
    """A RoverSpeedSetpoint."""

    speed_body_x: float


class Throttle(NamedTuple):
    """A RoverThrottleSetpoint."""

    throttle_body_x: float


class Yaw(NamedTuple):
    """A RoverAttitudeSetpoint."""

    yaw_setpoint: float


class YawRate(NamedTuple):
    """A RoverRateSetpoint."""

    yaw_rate_setpoint: float


class Steering(NamedTuple):
    """A RoverSteeringSetpoint."""

    normalized_steering_setpoint: float


_TOPICS = {
    Lateral: "fixed_wing_lateral_setpoint",
    Longitudinal: "fixed_wing_longitudinal_setpoint",
    LateralLimits: "lateral_control_configuration",
    LongitudinalLimits: "longitudinal_control_configuration",
    RoverPosition: "rover_position_setpoint",
    Speed: "rover_speed_setpoint",
    Throttle: "rover_throttle_setpoint",
    Yaw: "rover_attitude_setpoint",
    YawRate: "rover_rate_setpoint",
    Steering: "rover_steering_setpoint",
}
"""The topics of the setpoints of vehicles that are no multicopters."""


def world_of(vehicle: str, parameters: Mapping[str, float] = {}, rules: Rules = V1_18) -> World:
    """Return the world of a kind of vehicle."""
    airframe = airframe_of(vehicle)
    values = {**PARAMETERS, **airframe.parameters, **parameters}
    return World(rules=rules, parameters=values, airframe=airframe)


def rotated(q: Quaternion, vector: Vector) -> Vector:
    """Return a vector in body axes as one in NED, by the matrix of a quaternion."""
    w, x, y, z = q
    a, b, c = vector
    return (
        (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c,
        2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c,
        2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c,
    )


class Pilot:
    """A world, and a program that sends messages. Every step is checked."""

    most_acceleration, most_speed = 11.0, 13.0
    can_tumble = False
    """Whether the vehicle can have any attitude in the air."""

    def __init__(self, world: World | None = None) -> None:
        self.world = world or World()
        if self.world.airframe != AIRFRAMES["multicopter"]:
            self.most_acceleration, self.most_speed = 40.0, 40.0
        self.before = self.state()

    def state(self) -> tuple[Vector, Vector, Quaternion]:
        flight = self.world.flight
        return flight.position, flight.velocity, flight.quaternion

    def run(self, seconds: float, setpoint: Setpoint | None = None, controls: Controls = POSITIONS) -> None:
        """Let time pass. A program publishes a setpoint for Offboard mode at 10 Hz."""
        setpoints = self.world.setpoints

        def publish(time: int) -> None:
            setpoints.take_offboard(controls, time)
            setpoints.take_trajectory(setpoint, time)

        self.send(seconds, publish if setpoint is not None else None, 10.0)

    def send(self, seconds: float, publish: Callable[[int], None] | None = None, rate: float = 1.0) -> None:
        """Let time pass, and call a function at a rate."""
        end = self.world.time + round(seconds * SECOND)
        start, number = self.world.time, 0
        while self.world.time + STEP <= end:
            if publish is not None and self.world.time >= start + number * SECOND / rate:
                publish(self.world.time)
                number += 1
            self.world.advance(self.world.time + STEP)
            self.answer()
            self.check()

    def until(self, is_reached: Callable[[], bool], seconds: float = 60.0) -> float:
        """Let time pass until something is so, and return how long it took."""
        start = self.world.time
        while not is_reached():
            assert self.world.time < start + seconds * SECOND
            self.send(STEP / SECOND)
        return (self.world.time - start) / SECOND

    def answer(self) -> None:
        """Answer requests to arming checks."""

    def check(self) -> None:
        """Nothing jumps, the quaternion is one, and thrust and gravity give the acceleration."""
        seconds = STEP / SECOND
        flight = self.world.flight
        position, velocity, q = self.state()
        assert math.dist(position, self.before[0]) <= self.most_speed * seconds
        assert position[2] <= flight.ground
        if not flight.is_on_ground:
            assert math.dist(velocity, self.before[1]) <= self.most_acceleration * seconds
        if not self.can_tumble or not flight.is_on_ground:  # the ground puts a vehicle upright that falls on its back
            assert math.dist(q, self.before[2]) < 0.2, "the sign of a quaternion does not change either"
        assert abs(math.hypot(*q) - 1.0) <= 1e-9
        north, east, down = rotated(q, flight.specific_force)  # not pytest.approx: it takes longer than the flight
        assert math.dist((north, east, down + GRAVITY), flight.acceleration) <= 1e-6
        self.before = position, velocity, q

    def command(self, number: int, parameters: tuple[float, ...] = NOTHING) -> int:
        """Give a command, and wait for the next loops of the commander, in which a mode changes."""
        result = self.world.command(number, parameters)
        self.run(_LOOPS)
        return result

    def select(self, mode: int) -> int:
        return self.command(SET_NAV_STATE, (float(mode), *NOTHING[1:]))

    def take_off(self, height: float = NAN) -> None:
        """Arm, take off, and wait until the vehicle hovers."""
        altitude = self.world.origin.altitude + height
        assert self.command(ARM_DISARM, ARM) == ACCEPTED
        assert self.command(TAKEOFF, (*NOTHING[:6], altitude)) == ACCEPTED
        self.until(lambda: self.world.mode == HOLD)
        self.run(3.0)

    def land(self) -> None:
        """Land, and wait until the vehicle has disarmed."""
        assert self.select(LAND) == ACCEPTED
        self.until(lambda: not self.world.is_armed)


class Program(Pilot):
    """A program that has registered a mode, and answers that it can run."""

    def __init__(self, world: World | None = None, needs: frozenset[str] = frozenset({"local_position"})) -> None:
        super().__init__(world)
        self.needs = needs
        self.registered = self.world.commander.register(Registration("own", check=True, mode=True))
        assert self.registered.success
        self.mode = self.registered.mode
        self.run(1.0)

    def answer(self) -> None:
        commander = self.world.commander
        while commander.requests:
            request = commander.requests.popleft()
            if not hasattr(self, "registered"):
                continue
            reply = Reply(request.number, self.registered.check, can_run=True, requirements=self.needs)
            commander.checks.take(reply, self.world.time, self.world.time)

    def enter(self, kind: int | None = None) -> None:
        """Select the own mode, and set the type of its setpoints."""
        assert self.select(self.mode) == ACCEPTED
        self.run(0.02)
        if kind is not None:
            assert self.world.commander.configure(self.mode, kind, is_applied=True)[0] == 0

    def publish_all(self, seconds: float, *messages: Any) -> None:
        """Send several setpoints at 30 Hz for some time."""
        takers = [self.publish(each) for each in messages]

        def publish(time: int) -> None:
            for take in takers:
                take(time)

        self.send(seconds, publish, 30.0)

    def publish(self, message: Any) -> Callable[[int], None]:
        """Return a function that sends a setpoint."""
        setpoints = self.world.setpoints
        if type(message) in _TOPICS:
            handler = self.world.autopilot.handlers[_TOPICS[type(message)]]
            return lambda time: handler(message, time)
        take = {
            Goto: setpoints.take_goto,
            Setpoint: setpoints.take_trajectory,
            Attitude: setpoints.take_attitude,
            Rates: setpoints.take_rates,
            Thrust: setpoints.take_thrust,
            Torque: setpoints.take_torque,
            Motors: setpoints.take_motors,
            Servos: setpoints.take_servos,
        }[type(message)]
        return lambda time: take(message, time)


def speed_of(pilot: Pilot) -> float:
    """Return the horizontal speed."""
    return math.hypot(*pilot.world.flight.velocity[:2])


STOP = Setpoint(velocity=ZERO)
