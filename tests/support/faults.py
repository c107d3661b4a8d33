"""The faults that tests of the doctor provoke, and what it finds."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Fault(NamedTuple):
    """A fault: what is wrong, how a test provokes it, and the rules that find something, in their order."""

    what: str
    provoked: str
    rules: tuple[str, ...]


def _fault(what: str, provoked: str, *rules: str) -> Fault:
    return Fault(what, provoked, rules)


_ON_GROUND = ("NOT_ARMED", "MODE_OTHER")
"""What is found besides, because the test neither arms nor selects a mode."""

FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "port": _fault("another program has the port", "a socket that is bound to it", "PORT_TAKEN"),
        "agent": _fault(
            "an agent has the vehicle", "an agent with a simulated vehicle", "PORT_TAKEN", "AGENT_HAS_CLIENT"
        ),
        "idle": _fault("an agent has no vehicle", "an agent", "PORT_TAKEN", "AGENT_WITHOUT_CLIENT"),
        "old on Zenoh": _fault("a vehicle on Zenoh has v1.16", "a sample in its form", "ZENOH_LIMITED"),
        "checks on Zenoh": _fault("a program answers checks over Zenoh", "an ArmingCheckReply", "STACK_SMALL"),
        "no agent": _fault("no agent is behind a tap", "a tap", "AGENT_MISSING", "NO_CLIENT"),
        "nothing": _fault("nothing arrives", "an open port", "NO_CLIENT"),
        "elsewhere": _fault("a vehicle sends to another port", "`msggen sim` with another address", "CLIENT_ELSEWHERE"),
        "garbled": _fault("a serial line has another speed", "other bytes on a pseudo terminal", "LINE_GARBLED"),
        "refused": _fault("the vehicle may not connect", "`--allow 10.0.0.0/8`", "CLIENT_REFUSED"),
        "deaf": _fault("the client gets no time", "`msggen sim --no-time-reply`", "NO_TIME_SYNC"),
        "unready": _fault(
            "the client has the session of another program", "samples of an unknown session", "CLIENT_UNREADY"
        ),
        "twin": _fault("two vehicles have the same key", "two simulated vehicles", "KEY_SHARED"),
        "key": _fault("the vehicle has another key", "`--key 99`", "KEY_WRONG"),
        "restart": _fault("the client restarts", "`msggen sim --restart-every 3.5`", "VEHICLE_RESTARTS"),
        "early": _fault(
            "the client restarts before it has the time",
            "`msggen sim --sync px4 --restart-every 2`",
            "VEHICLE_RESTARTS",
        ),
        "silent": _fault("the vehicle stops to send", "`msggen sim --silent-after 3.5`", "VEHICLE_SILENT"),
        "names": _fault(
            "a program has other names of topics",
            "`msggen doctor` with five names",
            "NAMESPACE_WRONG",
            "VERSION_WRONG",
            "TOPIC_NOT_BRIDGED",
            "TOPIC_UNKNOWN",
            "TOPIC_UNPUBLISHED",
        ),
        "namespace": _fault("the vehicle has another namespace", "`--namespace uav_1`", "NAMESPACE_WRONG"),
        "version": _fault("a message has another version", "`msggen sim --version VehicleStatus=9`", "VERSION_WRONG"),
        "same namespace": _fault(
            "two vehicles have no namespace", "two simulated vehicles with other keys", "NAMESPACE_SHARED"
        ),
        "readers": _fault(
            "readers in DDS cannot match",
            "two readers of another participant",
            "VERSION_WRONG",
            "READER_RELIABLE",
            "TIME_NOT_SYNCED",
        ),
        "writers": _fault(
            "writers in DDS cannot match",
            "writers with another version and another type",
            "VERSION_WRONG",
            "TIME_NOT_SYNCED",
            "INPUT_UNREADABLE",
            "OFFBOARD_MODE_MISSING",
        ),
        "release": _fault("the vehicle has another release", "`msggen doctor --types` of v1.15", "RELEASE_DIFFERS"),
        "type": _fault("the program lacks a message", "types without Wind", "TYPE_UNKNOWN"),
        "hash": _fault(
            "a message has another definition", "`msggen sim --wrong-hash VehicleStatus`", "DEFINITION_DIFFERS"
        ),
        "boot": _fault("the clock is not synchronized", "`msggen sim --sync off`", "TIME_NOT_SYNCED"),
        "clock": _fault("the clock is wrong", "`msggen sim --clock-off -7`", "CLOCK_WRONG"),
        "unsettled": _fault(
            "the vehicle's estimate of the clocks is wrong", "`msggen sim --clock-off -0.04`", "CLOCK_UNSETTLED"
        ),
        "garbage": _fault("the network damages datagrams", "`msggen sim --garbage 0.3`", "DATAGRAMS_DAMAGED"),
        "noise": _fault("only another protocol arrives", "random datagrams", "DATAGRAMS_DAMAGED"),
        "full": _fault("a serial line is too slow", "a pseudo terminal with 57600 baud", "LINE_FULL"),
        "buffer": _fault("the kernel drops datagrams", "a small buffer and many datagrams", "BUFFER_FULL"),
        "lossy": _fault(
            "the network loses datagrams", "`msggen sim --sync off --drop 0.1`", "TIME_NOT_SYNCED", "SAMPLES_LOST"
        ),
        "slow": _fault("the vehicle is too slow", "`msggen sim --rate 1`", "RATE_LOW"),
        "unpublished": _fault(
            "the program does not run", "`msggen doctor trajectory_setpoint` without a program", "INPUT_UNPUBLISHED"
        ),
        "cut": _fault(
            "the program has another definition",
            "a TrajectorySetpoint without its last field",
            "INPUT_UNREADABLE",
            *_ON_GROUND,
        ),
        "other system": _fault(
            "the program commands another vehicle",
            "VehicleCommand for system 3, 20 times a second",
            "COMMAND_MISADDRESSED",
            "MODE_OTHER",
        ),
        "two": _fault("two programs fight", "`msggen topic pub` beside a program", "SETPOINT_CONTESTED", *_ON_GROUND),
        "old": _fault("the program has another clock", "timestamps since boot", "SETPOINT_OLD", *_ON_GROUND),
        "no mode": _fault("no offboard_control_mode", "only setpoints", "OFFBOARD_MODE_MISSING", *_ON_GROUND),
        "rare": _fault("offboard_control_mode is too slow", "1 Hz", "OFFBOARD_MODE_SLOW", *_ON_GROUND),
        "gap": _fault(
            "offboard_control_mode has gaps", "20 Hz, with pauses of 1.2 s", "OFFBOARD_MODE_SLOW", *_ON_GROUND
        ),
        "unselected": _fault(
            "the control mode does not fit the setpoint",
            "`position` with vehicle_attitude_setpoint",
            "SETPOINT_UNSELECTED",
            *_ON_GROUND,
        ),
        "nothing selected": _fault(
            "the control mode selects nothing", "all fields false", "SETPOINT_UNSELECTED", *_ON_GROUND
        ),
        "nan": _fault("NaN on every axis", "TrajectorySetpoint with NaN only", "SETPOINT_EMPTY", *_ON_GROUND),
        "no attitude": _fault("no attitude", "`q_d` with zeros", "SETPOINT_EMPTY", *_ON_GROUND),
        "upward": _fault("z is taken as upward", "a position with z = 5", "SETPOINT_DOWNWARD", *_ON_GROUND),
        "thrust": _fault("thrust is taken as upward", "`thrust_body[2]` = 0.7", "SETPOINT_DOWNWARD", *_ON_GROUND),
        "half a place": _fault(
            "a camera measures x and y only", "VehicleOdometry with NaN in z", "MEASUREMENT_DROPPED"
        ),
        "motion capture": _fault(
            "a program names the topic of motion capture", "vehicle_mocap_odometry", "MEASUREMENT_DROPPED"
        ),
        "late camera": _fault(
            "a camera needs half a second", "`timestamp_sample` 0.5 s before it is sent", "MEASUREMENT_TIME"
        ),
        "early camera": _fault("the clock of a camera is wrong", "a time in 3 s", "MEASUREMENT_TIME"),
        "slow camera": _fault("a camera sees little", "VehicleOdometry at 3 Hz", "MEASUREMENT_SLOW"),
        "unfused camera": _fault(
            "the vehicle uses GPS only", "VehicleOdometry without EKF2_EV_CTRL", "MEASUREMENT_UNFUSED"
        ),
        "no position": _fault(
            "the vehicle has no position, and refuses to arm",
            "`msggen sim --no-position`, and a command to arm",
            "POSITION_MISSING",
            "ARMING_REFUSED",
            "MODE_OTHER",
        ),
        "refused earlier": _fault(
            "the vehicle has refused to arm",
            "`msggen sim --no-position`, and a command to arm before the watch",
            "ARMING_REFUSED",
        ),
        "checks": _fault(
            "the checks of the vehicle fail",
            "`msggen sim --no-position`, without a command",
            "POSITION_MISSING",
            "CHECKS_FAIL",
            "MODE_OTHER",
        ),
        "disarmed": _fault("the vehicle is not armed", "Offboard mode without arming", "NOT_ARMED"),
        "refused mode": _fault(
            "the vehicle refuses Offboard mode",
            "a command to an armed vehicle without offboard_control_mode",
            "OFFBOARD_MODE_MISSING",
            "MODE_REFUSED",
        ),
        "other mode": _fault("the vehicle is in another mode", "arming in Hold mode", "MODE_OTHER"),
        "failsafe": _fault("the program ends in the air", "a flight whose program stops", "FAILSAFE_ACTIVE"),
    }
)
"""By a short name. Tests take what is to be found from here."""


def rules_of(name: str) -> list[str]:
    """Return the rules that find something in a fault."""
    return [*FAULTS[name].rules]
