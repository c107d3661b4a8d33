"""The kinds of setpoints: types of SetpointConfig in PX4 v1.18, flags of VehicleControlMode before."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from msggen.messages import vehicle_types

OFFBOARD_CONTROL_MODE: Final = "offboard_control_mode"
"""The topic of the message that selects a setpoint in Offboard mode."""
SELECTORS: Final = (
    "position",
    "velocity",
    "acceleration",
    "attitude",
    "body_rate",
    "thrust_and_torque",
    "direct_actuator",
)
"""The fields of OffboardControlMode. PX4 takes the first one that is set."""
_ATTITUDE: Final = ("allocation", "rates", "attitude")
_POSITION: Final = (*_ATTITUDE, "altitude", "climb_rate", "acceleration", "velocity", "position")
_ROTORS: Final = frozenset({vehicle_types.ROTARY_WING})
_WINGS: Final = frozenset({vehicle_types.FIXED_WING})
_WHEELS: Final = frozenset({vehicle_types.ROVER})
MODES: Final = "v1.15"
"""The first release with modes of programs."""
_LATER: Final = "v1.17"


class Kind(NamedTuple):
    """A kind of setpoint."""

    name: str
    number: int
    """Its type in SetpointConfig."""
    topics: tuple[str, ...] = ()
    """The topics of its messages."""
    controls: tuple[str, ...] = ()
    """What it controls: `flag_control_..._enabled` of VehicleControlMode."""
    selectors: tuple[str, ...] = ()
    """The fields of OffboardControlMode that select it."""
    rate: float = 0.0
    """How often a mode of `msggen.flight` sends it, in Hz. 0: it sends none."""
    followed_by: frozenset[int] = vehicle_types.ALL
    """The types of vehicles that follow it in the mode of a program."""
    accepted_by: frozenset[int] = vehicle_types.ALL
    """The types of vehicles for which PX4 v1.18 accepts its SetpointConfig."""
    renewed: tuple[str, ...] = ()
    """Those of its topics that are sent at its beginning and once a second: they configure what follows it."""
    since: str = MODES
    """The first release that bridges its topics for modes."""

    @property
    def topic(self) -> str:
        """The topic of its message."""
        return self.topics[0]

    @property
    def is_placed(self) -> bool:
        """Whether it has a place or a velocity, and needs an estimate of the position."""
        return "position" in self.controls

    @property
    def requirements(self) -> frozenset[str]:
        """The requirements of a mode that sends it: `mode_req_...` of SetpointConfigReply."""
        return requirements_of(self.controls)


TRAJECTORY: Final = Kind("trajectory", 4, ("trajectory_setpoint",), _POSITION, SELECTORS[:3], 50.0, _ROTORS)
GOTO: Final = Kind("goto", 2, ("goto_setpoint",), _POSITION, SELECTORS[:1], 30.0, _ROTORS, _ROTORS)
ATTITUDE: Final = Kind("attitude", 6, ("vehicle_attitude_setpoint",), _ATTITUDE, ("attitude",), 100.0, _ROTORS | _WINGS)
RATES: Final = Kind("rates", 5, ("vehicle_rates_setpoint",), _ATTITUDE[:2], ("body_rate",), 200.0, _ROTORS | _WINGS)
_CONFIGURATIONS: Final = ("lateral_control_configuration", "longitudinal_control_configuration")
FIXED_WING: Final = Kind(
    "fixed-wing",
    3,
    ("fixed_wing_lateral_setpoint", "fixed_wing_longitudinal_setpoint", *_CONFIGURATIONS),
    _POSITION,
    rate=30.0,
    followed_by=_WINGS,
    accepted_by=_WINGS,
    renewed=_CONFIGURATIONS,
    since=_LATER,
)


def _rover(number: int, name: str, topics: tuple[str, ...], controls: tuple[str, ...]) -> Kind:
    return Kind(
        f"rover {name}", number, topics, controls, rate=30.0, followed_by=_WHEELS, accepted_by=_WHEELS, since=_LATER
    )


def _driving(first: int, speed: str) -> tuple[Kind, Kind, Kind]:
    """Return the kinds of a speed or a throttle: with a heading, a turn rate and a steering."""
    heading, rate, steering = (
        _rover(
            first + index,
            f"{speed} and {turn}",
            (f"rover_{speed}_setpoint", f"rover_{turn}_setpoint"),
            (*controls, "velocity"),
        )
        for index, (turn, controls) in enumerate(
            (("attitude", _ATTITUDE), ("rate", _ATTITUDE[:2]), ("steering", _ATTITUDE[:1]))
        )
    )
    return heading, rate, steering


ROVER_POSITION: Final = _rover(7, "position", ("rover_position_setpoint",), (*_ATTITUDE, "velocity", "position"))
ROVER: Final = (ROVER_POSITION, *_driving(8, "speed"))
ROVER_THROTTLE: Final = _driving(11, "throttle")
THRUST_AND_TORQUE: Final = Kind(
    "thrust and torque",
    15,
    ("vehicle_thrust_setpoint", "vehicle_torque_setpoint"),
    _ATTITUDE[:1],
    ("thrust_and_torque",),
    200.0,
    _ROTORS | _WINGS,
)
ACTUATORS: Final = Kind("actuator", 1, ("actuator_motors", "actuator_servos"), (), ("direct_actuator",), 200.0)
KINDS: Final = (
    TRAJECTORY,
    GOTO,
    ATTITUDE,
    RATES,
    THRUST_AND_TORQUE,
    ACTUATORS,
    Kind("position triplet", 16, (), (*_POSITION, "auto"), followed_by=frozenset()),
    FIXED_WING,
    *ROVER,
    *ROVER_THROTTLE,
    Kind("6dof", 14, (), _POSITION, followed_by=frozenset(), accepted_by=frozenset({vehicle_types.UNSPECIFIED})),
)
"""All kinds. PX4 takes no position triplet and no 6dof trajectory from a program: their topics are not bridged."""
BY_NUMBER: Final[Mapping[int, Kind]] = MappingProxyType({kind.number: kind for kind in KINDS})
SENT: Final = tuple(kind for kind in KINDS if kind.rate)
"""The kinds that modes of `msggen.flight` send."""

SUCCESS: Final = 0
OTHER_FAILURE: Final = 1
UNSUPPORTED_TYPE: Final = 2
UNKNOWN_TYPE: Final = 3
"""The results of SetpointConfigReply."""

_REQUIREMENTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "rates": "angular_velocity",
        "attitude": "attitude",
        "altitude": "local_alt",
        "climb_rate": "local_alt",
        "velocity": "local_position",
        "position": "local_position",
    }
)


def requirements_of(controls: Iterable[str]) -> frozenset[str]:
    """Return the requirements that follow from what is controlled."""
    return frozenset(_REQUIREMENTS[each] for each in controls if each in _REQUIREMENTS)
