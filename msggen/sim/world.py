"""The simulated vehicle without its messages: its clock, motion, battery, commander and autopilot.

Times are in us since boot.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from msggen.messages.nav_states import MODE_NAMES
from msggen.messages.vehicle_types import VtolState
from msggen.sim.airframes import AIRFRAMES, Airframe
from msggen.sim.battery import Battery
from msggen.sim.commander.arming import BY_FAILSAFE, BY_INACTION, BY_LANDING
from msggen.sim.commander.commander import LOOP, Commander
from msggen.sim.commander.requirements import Senses
from msggen.sim.commander.rules import V1_18, Rules
from msggen.sim.commands import carry_out
from msggen.sim.disturbances import Disturbances
from msggen.sim.external import External
from msggen.sim.flight import GRAVITY, Push, Target
from msggen.sim.landing import Now
from msggen.sim.models import model_of
from msggen.sim.parameters import PARAMETERS
from msggen.sim.places import Home
from msggen.sim.setpoints import Setpoints
from msggen.sim.vtol_pilot import VtolPilot
from msggen.sim.wheels import Drive
from msggen.sim.wings import Wing, Wings

STEP = 4_000
"""The time in us between two steps, so that a flight does not depend on how often the world is asked."""
_MOST_STEPS = 2_500
"""The number of steps after which the rest of a long pause is skipped: 10 s."""
_IDLE_THRUST = 0.2
_NEAR_HOME = 1.0
"""The distance in m by which home can be off while the vehicle is disarmed."""
_RANGE_HEIGHT, _RANGE_SPEED = 5.0, 1.0
_LOSS, _GAIN = 5_200_000, 1_270_000
"""The time in us after which the position is lost without GPS, and known again with it."""


class World:
    """A vehicle on the ground at its home, disarmed, in hold mode."""

    def __init__(  # noqa: PLR0913 - keywords, each of which has a default
        self,
        home: Home | None = None,
        system_id: int = 1,
        *,
        has_position: bool = True,
        rules: Rules = V1_18,
        parameters: Mapping[str, float] = PARAMETERS,
        airframe: Airframe = AIRFRAMES["multicopter"],
    ) -> None:
        self.setpoints = Setpoints()
        self.flight, self.autopilot, self.landing = model_of(airframe, self.setpoints, parameters, rules)
        self.external = External(self.flight, self.autopilot, {**rules.estimator, **parameters}, rules)
        """What measurements of programs tell the estimator."""
        self.home = self.flight.origin = home or Home()
        """Where a return ends."""
        self.has_gps = has_position
        """Whether GPS is there, which can be set at any time."""
        self.has_position = self.has_home = has_position and self.external.uses_gps
        """Whether the vehicle knows its position and its home."""
        self.flight.has_origin = self.has_position
        self.has_sticks = self.has_ground_station = False
        """Whether a pilot's sticks, and a ground station, are there. Both can be set at any time."""
        self.is_compass_disturbed = False
        """Whether the magnetic field is not that of the place, which the estimator notices. It can be set."""
        self.system_id = system_id
        self.parts: Collection[str] = ()
        """The names of the parts that the vehicle has."""
        self.disturbances = Disturbances()
        """What moves the vehicle beside its motors."""
        self.battery = Battery()
        self.time = 0
        """The time of the last step."""
        self.reason = ""
        """Why the last command was refused."""
        self.airframe = airframe
        self.commander = Commander(rules, parameters, airframe)
        self.position_resets = self.home_changes = self.control_changes = 0
        """How often the position was found again, home was set, and the vehicle took off or landed."""
        self._parameters = parameters
        self._rests = True, True
        """Whether the vehicle was disarmed and landed in the last step."""
        self._is_manual_home = False
        self._loop_time = -LOOP
        self._is_measured = False
        """Whether measurements of programs made the position known in the last loop."""
        self._gps_time = 0
        """When GPS and position were last both there or both gone."""
        self._setpoint: Target | Push | Wing | Drive | None = None

    # Time

    def advance(self, time: int) -> None:
        """Move on to a time. After a pause of more than 10 s, only the last 10 s are flown."""
        behind = (time - self.time) // STEP
        if behind > _MOST_STEPS:
            self.time += (behind - _MOST_STEPS) * STEP
        while self.time + STEP <= time:
            self.time += STEP
            self._step()

    def _step(self) -> None:
        seconds = STEP / 1e6
        if self.time >= self._loop_time + LOOP:
            self._loop_time = self.time
            self._estimate()
            self.autopilot.enter(self.commander.mode, self.time)
            self.commander.step(self.time, self.senses)
        self.autopilot.enter(self.commander.mode, self.time)
        self._fly(seconds)
        self._follow_home()
        self.battery.drain(seconds, self.thrust)

    def _estimate(self) -> None:
        """Lose the position some time after GPS, or find it again. Measurements of programs stand for GPS."""
        was_measured, has_gps = self._is_measured, self.has_gps and self.external.uses_gps
        decides = has_gps and self.has_position
        self._is_measured = self.external.step(self.time, has_gps=decides, is_resting=self.flight.is_on_ground)
        if self._is_measured or (was_measured and not has_gps):
            self.has_position, self._gps_time = self._is_measured, self.time
        elif has_gps == self.has_position:
            self._gps_time = self.time
        elif self.time - self._gps_time >= (_GAIN if has_gps else _LOSS):
            self.has_position = has_gps
            self.position_resets += self.has_position
        self.flight.has_origin |= has_gps and self.has_position
        self.flight.has_position = self.has_position
        self.commander.vtol_state = self.vtol_state
        self.has_home |= self.has_global

    def _fly(self, seconds: float) -> None:
        """Move the vehicle to the setpoint of the mode, and see whether it has landed."""
        commander, autopilot = self.commander, self.autopilot
        target: Any = None  # the motion takes what its pilot gives
        if commander.is_armed:
            target = autopilot.target(self.time, commander.controls)
            climb = autopilot.lift_off(self.time, commander.armed_time, target, is_landed=self.landing.landed)
        else:
            climb = -math.inf
            autopilot.rest()
        if not self.disturbances.is_calm:
            self.disturbances.step(self.flight, seconds)
        self.flight.step(seconds, target, climb)
        is_led, self.setpoints.has_new_goto = self.setpoints.has_new_goto and autopilot.controls_position, False
        armed = commander.armed_time if commander.is_armed else None
        self.landing.look(Now(self.time, armed, commander.mode, is_led))
        self._setpoint = target

    def _follow_home(self) -> None:
        """Let home be where the vehicle is armed, and then where it takes off, as PX4 does with COM_HOME_EN.

        While it is disarmed, home follows it, as when a rover rolls on.
        """
        rests = not self.commander.is_armed, self.landing.landed
        begins = all(rests) and math.dist(self.flight.position, self.flight.home) > _NEAR_HOME
        if rests != self._rests:
            before, self._rests = self._rests, rests
            self.control_changes += before[1] != self._rests[1]
            begins |= any(was and not still for was, still in zip(before, self._rests, strict=True))
        if begins and self.has_global and not self._is_manual_home and not self.commander.keeps_home:
            self.set_home(self.place)

    @property
    def senses(self) -> Senses:
        """What the commander is told."""
        known, setpoints = self.has_position, self.setpoints
        return Senses(
            local_position=known,
            local_position_relaxed=known,
            global_position=self.has_global,
            global_position_relaxed=self.has_global,
            home_position=self.has_home,
            offboard_signal=setpoints.has_heartbeat(self.time) and (known or not setpoints.controls_position),
            manual_control=self.has_sticks,
            ground_station=self.has_ground_station,
            battery=self.battery.warning,
            wings_failed=self.wings_failed,
            has_fallen=isinstance(self.flight, Wings) and self.flight.is_overturned,
            is_landed=self.landing.landed,
            is_done=self.autopilot.is_done(is_landed=self.landing.landed),
        )

    # State

    @property
    def vtol_state(self) -> VtolState | None:
        """Whether a VTOL hovers or flies by its wings, None for another vehicle."""
        return self.autopilot.state if isinstance(self.autopilot, VtolPilot) else None

    @property
    def wings_failed(self) -> bool:
        """Whether the last transition to forward flight failed."""
        return isinstance(self.autopilot, VtolPilot) and self.autopilot.has_failed

    @property
    def uses_range(self) -> bool:
        """Whether the range finder tells the height: while the vehicle is slow and low, EKF2_RNG_A_VMAX and _HMAX."""
        flight = self.flight
        north, east, _ = flight.velocity
        is_low = flight.ground - flight.position[2] < _RANGE_HEIGHT
        return is_low and north * north + east * east < _RANGE_SPEED * _RANGE_SPEED

    @property
    def has_flown_by_wings(self) -> bool:
        """Whether the wind is known."""
        return isinstance(self.flight, Wings) and self.flight.has_flown

    @property
    def has_global(self) -> bool:
        """Whether the vehicle knows where on earth it is."""
        return self.has_position and self.flight.has_origin

    @property
    def mode(self) -> int:
        """The mode that flies, as NAVIGATION_STATE_*."""
        return self.commander.mode

    @property
    def is_armed(self) -> bool:
        """Whether the motors can turn."""
        return self.commander.is_armed

    @property
    def is_landed(self) -> bool:
        """Whether the land detector says that the vehicle has landed."""
        return self.landing.landed

    @property
    def why_disarmed(self) -> str:
        """Why the vehicle has disarmed by itself, "" if a command did it."""
        pause = self._parameters["COM_DISARM_PRFLT"]
        texts = {
            BY_FAILSAFE: "the vehicle lies on its back",
            BY_LANDING: "landed",
            BY_INACTION: f"no takeoff within {pause:.0f} s",
        }
        return texts.get(self.commander.disarming_reason, "")

    def state(self, *, was_armed: bool) -> str:
        """Return the state for people, and why the vehicle has disarmed by itself if it was armed before."""
        failsafe = ", failsafe" if self.commander.failsafe.is_active else ""
        why = f": {self.why_disarmed}" if was_armed and not self.is_armed and self.why_disarmed else ""
        return f"{'armed' if self.is_armed else 'disarmed'}, {MODE_NAMES[self.mode]}{failsafe}{why}"

    @property
    def thrust(self) -> float:
        """The thrust of all motors: 1 in hover, 0 with the motors off."""
        if self._setpoint is None:
            return 0.0
        return _IDLE_THRUST if self.flight.is_on_ground else self.flight.thrust / GRAVITY

    @property
    def target(self) -> Target | None:
        """The setpoint of position control, None with the motors off, or if a program sets attitude or rates."""
        return self._setpoint if isinstance(self._setpoint, Target) else None

    def command(self, number: int, parameters: Sequence[float], source_component: int = 0) -> int:
        """Carry out a command with its seven parameters, and return the result. `reason` tells why it is refused."""
        return carry_out(self, number, parameters, source_component)

    # Places

    @property
    def origin(self) -> Home:
        """The origin of the local position."""
        return self.flight.origin

    @property
    def place(self) -> Home:
        """Where the vehicle is."""
        return self.origin.place(self.flight.position)

    def set_home(self, home: Home, *, is_manual: bool = False) -> None:
        """Let a return end at a place. One that `is_manual` stays at the next takeoff."""
        self.home, self.has_home, self._is_manual_home = home, True, is_manual
        self.home_changes += 1
        self.flight.home = self.origin.local(home)

    def set_origin(self, origin: Home) -> None:
        """Count the local position from a place. The vehicle stays where it is."""
        place, ground = self.place, self.origin.altitude - self.flight.ground
        had_origin, self.flight.has_origin, self.flight.origin = self.flight.has_origin, True, origin
        if not had_origin:  # the place of the vehicle on earth was not known: it follows from the origin
            return
        self.flight.position, self.flight.ground = origin.local(place), origin.altitude - ground
        self.flight.home = origin.local(self.home)
        self.autopilot.begin_again()
