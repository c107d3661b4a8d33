"""The simulated vehicle without its messages: its clock, motion, battery, commander and autopilot.

Times are in us since boot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from msggen.live.sim.autopilot import Autopilot
from msggen.live.sim.battery import Battery
from msggen.live.sim.commander.commander import LOOP, Commander
from msggen.live.sim.commander.requirements import Senses
from msggen.live.sim.commander.rules import V1_18, Rules
from msggen.live.sim.commander.states import BY_INACTION, BY_LANDING, MODE_NAMES
from msggen.live.sim.commands import carry_out
from msggen.live.sim.flight import GRAVITY, Flight, Target
from msggen.live.sim.parameters import PARAMETERS
from msggen.live.sim.setpoints import Setpoints

STEP = 4_000
"""The time in us between two steps, so that a flight does not depend on how often the world is asked."""
_MOST_STEPS = 2_500
"""The number of steps after which the rest of a long pause is skipped: 10 s."""
_IDLE_THRUST = 0.2
_EARTH_RADIUS = 6_371_000.0


class Home(NamedTuple):
    """The place of the start."""

    latitude: float = 47.397742
    longitude: float = 8.545594
    altitude: float = 488.0
    """Above mean sea level in m."""


class World:
    """A vehicle on the ground at its home, disarmed, in hold mode."""

    def __init__(
        self,
        home: Home | None = None,
        system_id: int = 1,
        *,
        has_position: bool = True,
        rules: Rules = V1_18,
        parameters: Mapping[str, float] = PARAMETERS,
    ) -> None:
        self.home = home or Home()
        self.has_position = has_position
        """Whether the vehicle knows its position."""
        self.has_sticks = False
        """Whether a pilot's sticks are there."""
        self.system_id = system_id
        self.flight = Flight()
        self.battery = Battery()
        self.time = 0
        """The time of the last step."""
        self.reason = ""
        """Why the last command was refused."""
        self.commander = Commander(rules, parameters)
        self.setpoints = Setpoints()
        self.autopilot = Autopilot(self.flight, self.setpoints)
        self._parameters = parameters
        self._loop_time = -LOOP

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
            self.autopilot.enter(self.commander.mode, self.time)
            self.commander.step(self.time, self.senses)
        self.autopilot.enter(self.commander.mode, self.time)
        self.flight.step(seconds, self.target)
        self.battery.drain(seconds, self.thrust)

    @property
    def senses(self) -> Senses:
        """What the commander is told."""
        known, setpoints = self.has_position, self.setpoints
        return Senses(
            local_position=known,
            local_position_relaxed=known,
            global_position=known,
            global_position_relaxed=known,
            home_position=known,
            offboard_signal=setpoints.has_heartbeat(self.time) and (known or not setpoints.controls_position),
            manual_control=self.has_sticks,
            battery=self.battery.warning,
            is_landed=self.flight.is_on_ground,
            is_done=self.autopilot.is_done,
        )

    # State

    @property
    def mode(self) -> int:
        """The mode that flies, as NAVIGATION_STATE_*."""
        return self.commander.mode

    @property
    def mode_name(self) -> str:
        """The name of the mode."""
        return MODE_NAMES[self.mode]

    @property
    def is_armed(self) -> bool:
        """Whether the motors can turn."""
        return self.commander.is_armed

    @property
    def is_landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return self.flight.is_on_ground

    @property
    def why_disarmed(self) -> str:
        """Why the vehicle has disarmed by itself, "" if a command did it."""
        pause = self._parameters["COM_DISARM_PRFLT"]
        texts = {BY_LANDING: "landed", BY_INACTION: f"no takeoff within {pause:.0f} s"}
        return texts.get(self.commander.disarming_reason, "")

    def state(self, *, was_armed: bool) -> str:
        """Return the state for people, and why the vehicle has disarmed by itself if it was armed before."""
        failsafe = ", failsafe" if self.commander.failsafe.is_active else ""
        why = f": {self.why_disarmed}" if was_armed and not self.is_armed and self.why_disarmed else ""
        return f"{'armed' if self.is_armed else 'disarmed'}, {self.mode_name}{failsafe}{why}"

    @property
    def thrust(self) -> float:
        """The thrust of all motors: 1 in hover, 0 with the motors off."""
        if not self.is_armed:
            return 0.0
        return _IDLE_THRUST if self.flight.is_on_ground else -self.flight.specific_force[2] / GRAVITY

    @property
    def target(self) -> Target | None:
        """The setpoint of the mode, None with the motors off."""
        return self.autopilot.target(self.time, self.commander.controls) if self.is_armed else None

    def command(self, number: int, parameters: Sequence[float], source_component: int = 0) -> int:
        """Carry out a command with its seven parameters, and return the result. `reason` tells why it is refused."""
        return carry_out(self, number, parameters, source_component)

    # Places

    @property
    def latitude(self) -> float:
        """In degrees."""
        return self.home.latitude + math.degrees(self.flight.position[0] / _EARTH_RADIUS)

    @property
    def longitude(self) -> float:
        """In degrees."""
        radius = _EARTH_RADIUS * math.cos(math.radians(self.home.latitude))
        return self.home.longitude + math.degrees(self.flight.position[1] / radius)

    @property
    def altitude(self) -> float:
        """Above mean sea level in m."""
        return self.home.altitude - self.flight.position[2]
