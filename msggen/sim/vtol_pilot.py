"""What the modes of a simulated VTOL fly: those of a multicopter, of a fixed-wing aircraft, and the way between them.

Times are in us, lengths in m, speeds in m/s, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from msggen.messages.commands import ACCEPTED, TEMPORARILY_REJECTED
from msggen.messages.nav_states import DESCEND, EXTERNAL, LAND, RETURN, TAKEOFF, VTOL_TAKEOFF
from msggen.messages.vehicle_types import VtolState
from msggen.sim.attitude import Vector
from msggen.sim.autopilot import Autopilot, Lift, Setpoint
from msggen.sim.commander.setpoint_types import Controls
from msggen.sim.flight import NAN, Push, Target
from msggen.sim.setpoints import Setpoints
from msggen.sim.wing_pilot import WingPilot
from msggen.sim.wings import Wing, Wings

_NO_WINGS = frozenset({TAKEOFF, LAND, RETURN, 21})
"""The modes that refuse a transition to forward flight: with 21, Orbit."""
_PUSH, _LEAN, _PUSH_TIME = 4.8, 3.2, 0.3
"""The acceleration by the pusher, as captured from PX4's simulator, by a tailsitter that leans forward, and the time in
s in which it grows."""
_DRAG, _BRAKING = 1.3, 0.3
"""The deceleration by drag in 1/s in a transition back, as captured, and of a tailsitter."""
_NEAR_HOME, _NEAR_HEIGHT = 20.0, 10.0
"""How far outside its circle around home a return begins to hover, and how far from its height."""
_FALL = 1_300_000
"""The time after which a vehicle lies on its back that goes to forward flight on the ground, as captured."""
_UP, _FLAT = 15.0, 60.0
"""The pitch angles in degrees, nose down, at which a tailsitter ends its transitions."""
_QUARTER = 90.0


_TAKEOFFS = frozenset({TAKEOFF, VTOL_TAKEOFF})


class VtolPilot:
    """Flies the mode of the commander, by rotors or by wings."""

    def __init__(
        self, flight: Wings, setpoints: Setpoints, parameters: Mapping[str, float], *, pushes_in_modes: bool
    ) -> None:
        """`pushes_in_modes`: whether a transition in the mode of a program starts the pusher, as from v1.17 on."""
        self.state = VtolState.HOVER
        self.has_failed = False
        """Whether the last transition to forward flight failed: fixed_wing_system_failure."""
        self.rotors = Autopilot(flight, setpoints, parameters)
        self.wings = WingPilot(flight, setpoints, parameters)
        self.handlers: Mapping[str, Callable[[Any, int], None]] = self.wings.handlers
        self._flight, self._parameters, self._pushes_in_modes = flight, parameters, pushes_in_modes
        self._mode = -1
        self._begin = self._now = 0
        self._height = 0.0
        """The down position at the beginning of a transition."""

    @property
    def lift(self) -> Lift:
        """See Autopilot."""
        return self.rotors.lift

    # What both pilots are told

    @property
    def controls_position(self) -> bool:
        """See Pilot."""
        return self.rotors.controls_position and self.state is not VtolState.FORWARD

    @property
    def is_led(self) -> bool:
        """See Autopilot."""
        return self.rotors.is_led

    def climb_to(self, down: float) -> None:
        """See Autopilot."""
        self.rotors.climb_to(down)
        self.wings.climb_to(down)

    def hold_at(self, position: Vector, yaw: float, speed: float) -> None:
        """See Autopilot."""
        self.rotors.hold_at(position, yaw, speed)
        self.wings.hold_at(position, yaw, speed)

    def shift(self, move: Vector) -> None:
        """See Autopilot."""
        self.rotors.shift(move)
        self.wings.shift(move)
        self._height += move[2]

    def begin_again(self) -> None:
        """See Autopilot."""
        self.rotors.begin_again()
        self.wings.begin_again()

    def enter(self, mode: int, time: int) -> None:
        """Begin a mode, if it is not the present one."""
        if mode != self._mode and mode in _NO_WINGS and self.state is VtolState.TO_FORWARD:
            self._hover(time)
        self._mode = mode
        self.rotors.enter(TAKEOFF if mode == VTOL_TAKEOFF else mode, time)
        self.wings.enter(mode, time)

    def is_done(self, *, is_landed: bool) -> bool:
        """Whether a takeoff, a landing or a return has reached its end."""
        if self._mode == VTOL_TAKEOFF:
            return self.state is VtolState.FORWARD
        return (self.wings if self.state is VtolState.FORWARD else self.rotors).is_done(is_landed=is_landed)

    # Transitions

    def transition(self, to: VtolState, time: int, *, is_at_once: bool, is_grounded: bool) -> int:
        """Take DO_VTOL_TRANSITION, and return the result. On the ground, the transition is over at once."""
        if to is VtolState.FORWARD:
            if self._mode in _NO_WINGS:
                return TEMPORARILY_REJECTED
            self.has_failed = False
            if self.state in {VtolState.HOVER, VtolState.TO_HOVER}:
                self._start(VtolState.TO_FORWARD, time)
        elif self.state in {VtolState.FORWARD, VtolState.TO_FORWARD}:
            if is_at_once:
                self._fail(time)
            elif self.state is VtolState.FORWARD:
                self._start(VtolState.TO_HOVER, time)
            else:
                self._hover(time)
        if is_grounded and self.state.is_transition:
            self._end_on_ground(time)
        return ACCEPTED

    def _start(self, state: VtolState, time: int) -> None:
        self.state, self._begin = state, time
        self._height = self._flight.position[2]
        if state is VtolState.TO_HOVER:
            self.rotors.restart(time)

    def _hover(self, time: int) -> None:
        self.state = VtolState.HOVER
        self.rotors.restart(time)

    def _fail(self, time: int) -> None:
        """Give up forward flight: a quad-chute."""
        self.has_failed = True
        self._hover(time)

    def _end_on_ground(self, time: int) -> None:
        if self.state is VtolState.TO_HOVER:
            self._hover(time)
        else:
            self.state = VtolState.FORWARD

    def _follow(self, time: int) -> None:
        """Begin and end transitions."""
        self._now = time
        seconds = (time - self._begin) / 1e6
        if self.state is VtolState.TO_FORWARD:
            sunk = self._flight.position[2] - self._height > self._parameters["VT_QC_T_ALT_LOSS"]
            if self._has_speed(seconds):
                self.state = VtolState.FORWARD
            elif sunk or seconds >= self._parameters["VT_TRANS_TIMEOUT"]:
                self._fail(time)
        elif self.state is VtolState.TO_HOVER:
            if self._is_slow(seconds) or seconds >= self._parameters["VT_B_TRANS_DUR"]:
                self._hover(time)
        elif self._wants_hover():
            self._start(VtolState.TO_HOVER, time)
        elif self._mode == VTOL_TAKEOFF and self.state is VtolState.HOVER and self.rotors.is_done(is_landed=False):
            self._start(VtolState.TO_FORWARD, time)

    def _has_speed(self, seconds: float) -> bool:
        if self._flight.is_tailsitter:
            return seconds * _QUARTER / self._parameters["VT_F_TRANS_DUR"] >= _FLAT
        return (
            seconds >= self._parameters["VT_TRANS_MIN_TM"]
            and self._flight.airspeed >= self._parameters["VT_ARSP_TRANS"]
        )

    def _is_slow(self, seconds: float) -> bool:
        if self._flight.is_tailsitter:
            return seconds * _QUARTER / self._parameters["VT_B_TRANS_DUR"] >= _QUARTER - _UP
        return self._flight.airspeed < self._parameters["MPC_XY_CRUISE"]

    def _wants_hover(self) -> bool:
        """Whether a landing or a return hovers from here on."""
        if self.state is not VtolState.FORWARD or self._flight.is_on_ground:
            return False
        x, y, z = self._flight.position
        distance = math.dist((x, y), self._flight.home[:2]) - self._parameters["NAV_LOITER_RAD"]
        is_home = distance < _NEAR_HOME and abs(z - self.wings.height) < _NEAR_HEIGHT
        return self._mode in {LAND, DESCEND} or (self._mode == RETURN and is_home)

    # Setpoints

    def target(self, time: int, controls: Controls) -> Setpoint | Wing | None:
        """Return the setpoint at a time. None: the motors are off."""
        self._follow(time)
        self._flight.push = 0.0
        if self._flight.is_tailsitter:
            self._lean()
        if self.state is VtolState.FORWARD:
            self._fall(time)
            return None if self._flight.is_overturned else self.wings.target(time, controls)
        if self.state is VtolState.HOVER:
            return self.rotors.target(time, controls)
        return self._between(time, controls)

    def _lean(self) -> None:
        is_forward = self.state in {VtolState.TO_FORWARD, VtolState.FORWARD}
        seconds = self._parameters["VT_F_TRANS_DUR" if is_forward else "VT_B_TRANS_DUR"]
        self._flight.nose_rate = math.radians(_QUARTER if is_forward else -_QUARTER) / seconds

    def _fall(self, time: int) -> None:
        """Fall over, if the vehicle tries to take off as an aircraft."""
        if not self._flight.is_on_ground or self._mode not in _TAKEOFFS:
            self._begin = time
        elif time - self._begin >= _FALL:
            self._flight.is_overturned = True

    def rest(self) -> None:
        """See Pilot."""
        self.rotors.rest()

    def lift_off(self, time: int, armed: int, target: Setpoint | Wing | None, *, is_landed: bool) -> float:
        """See Autopilot."""
        if isinstance(target, Wing):
            return math.inf
        return self.rotors.lift_off(time, armed, target, is_landed=is_landed)

    def _between(self, time: int, controls: Controls) -> Setpoint | Wing | None:
        """Return the setpoint of a transition: level, with the turn of the wings and the height of the rotors."""
        wing, rotors = self.wings.target(time, controls), self.rotors.target(time, controls)
        if wing is None or rotors is None:
            return None
        flight, is_forward = self._flight, self.state is VtolState.TO_FORWARD
        if is_forward and (self._pushes_in_modes or self._mode not in EXTERNAL):
            most = _LEAN if flight.is_tailsitter else _PUSH
            flight.push = most * min(1.0, (time - self._begin) / 1e6 / _PUSH_TIME)
        elif not is_forward:
            flight.push = -(_BRAKING if flight.is_tailsitter else _DRAG) * flight.airspeed
        if isinstance(rotors, Push) or self._mode not in EXTERNAL:
            down, climb, pull = self._height, NAN, (0.0, 0.0)
        else:
            down, climb = rotors.position[2], rotors.velocity[2]
            pull = rotors.acceleration[:2]
            pull = (0.0, 0.0) if any(map(math.isnan, pull)) else pull
        turn = wing.course if is_forward else flight.yaw
        return Target((NAN, NAN, down), (NAN, NAN, climb), (*pull, NAN), yaw=turn, turn=0.3)
