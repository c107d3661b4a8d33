"""The rules about what programs send to a vehicle, in the order in which they are looked at."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from msggen.check.finding import Category, Change, Rule
from msggen.doctor import commands, measurements, not_following, setpoints
from msggen.doctor.case import Case
from msggen.messages.setpoints import KINDS, SELECTORS


def _setpoints_of(field: str) -> str:
    """Return a field of OffboardControlMode with the topics that it selects."""
    return f"{field} ({' or '.join(' and '.join(kind.topics) for kind in KINDS if field in kind.selectors)})"


def of_category(category: Category) -> Callable[[str, str, Callable[[Case], Iterable[Change]], str], Rule]:
    """Return what makes rules of a category: of an ID, a purpose, a function and a fix."""
    return lambda name, purpose, find, fix: Rule(name, purpose, category, find, fix)


_measurement, _setpoint = map(of_category, (Category.MEASUREMENT, Category.SETPOINT))

MEASUREMENT = (
    _measurement(
        "MEASUREMENT_DROPPED",
        "a measurement has values that EKF2 drops without a word",
        measurements.find_dropped,
        "A position or velocity counts only with three finite numbers and a known frame, and an attitude only as a"
        " unit quaternion, w first. Give 0 and a large variance for an axis that is not measured. NaN stands for "
        "what is not measured at all.",
    ),
    _measurement(
        "MEASUREMENT_TIME",
        "measurements are too old, in the future, or too near to each other",
        measurements.find_wrong_times,
        "Set `timestamp_sample` to the time at which the picture was taken, in us of the agent's computer, and "
        "send the measurement within 0.2 s. EKF2 uses nothing that is older than 0.3 s. EKF2_EV_DELAY is for a "
        "delay that is always the same and that `timestamp_sample` does not contain.",
    ),
    _measurement(
        "MEASUREMENT_SLOW",
        "measurements arrive at less than 5 Hz",
        measurements.find_slow,
        "Send 10 to 50 measurements a second. EKF2 does not start with two that are more than 0.2 s apart, and "
        "ends after 0.4 s without one.",
    ),
    _measurement(
        "MEASUREMENT_UNFUSED",
        "measurements are good, and EKF2 does not use them",
        measurements.find_unfused,
        "If a measurement is far from the estimate, correct its frame, raise its variance, or raise "
        "`reset_counter` after a jump. A position in NED needs a heading from a magnetometer or GPS, and beside GPS, "
        "an attitude needs a position in NED. Otherwise, set EKF2_EV_CTRL to the sum of 1 (horizontal position), 2 "
        "(height), 4 (velocity) and 8 (yaw): it is 0 from v1.16 on. For aux_global_position, set EKF2_AGP_CTRL to 1; "
        "in v1.18, EKF2_AGP0_CTRL to 1 and EKF2_AGP0_ID to the `id` of the message, and restart it.",
    ),
)
"""Those about measurements, which can be the cause of a missing position."""

SETPOINT = (
    _setpoint(
        "INPUT_UNPUBLISHED",
        "nobody publishes a topic that was asked for and that PX4 reads",
        setpoints.find_unpublished,
        "Start the program that publishes it. Programs are heard that share the link, or that are in the domain of "
        "`--link dds://0`. A program with `direct=True` on another link, and MAVLink, are not heard.",
    ),
    _setpoint(
        "INPUT_UNREADABLE",
        "the vehicle does not accept the samples: their type, size or encapsulation differs",
        setpoints.find_unreadable,
        "Build the program with the definitions of the vehicle's firmware: `msggen build --px4 PX4-Autopilot`, in "
        "ROS 2 the branch of px4_msgs for its release. PX4 reads CDR with little-endian numbers, as all DDS "
        "libraries write it on usual computers.",
    ),
    _setpoint(
        "COMMAND_MISADDRESSED",
        "a program sends commands to another system or component than the vehicle",
        commands.find_misaddressed,
        "Set `target_system` of VehicleCommand to the vehicle's MAV_SYS_ID, which `system_id` of vehicle_status "
        "tells, and `target_component` to its `component_id`, usually 1; or both to 0. In simulation, each instance "
        "has a MAV_SYS_ID of its own: 1 for the first one, 2 for the next. PX4 ignores the commands for others and "
        "does not acknowledge them.",
    ),
    _setpoint(
        "SETPOINT_CONTESTED",
        "several programs publish the same setpoint",
        setpoints.find_contested,
        "End all programs but one. PX4 takes the newest sample, whoever has sent it, so the vehicle is torn "
        "between them.",
    ),
    _setpoint(
        "SETPOINT_OLD",
        "the timestamps of setpoints are those of another clock",
        setpoints.find_old,
        "Set `timestamp` to 0, so that PX4 takes the time of arrival, or to the time of the agent's computer in "
        "us. In ROS 2, a node with `use_sim_time` has another time.",
    ),
    _setpoint(
        "OFFBOARD_MODE_MISSING",
        "setpoints arrive without offboard_control_mode",
        setpoints.find_no_mode,
        "Publish OffboardControlMode too, with the field of the setpoint set, at 10 Hz. PX4 accepts Offboard mode "
        "only while it arrives. A mode that a program adds to PX4 does not need it.",
    ),
    _setpoint(
        "OFFBOARD_MODE_SLOW",
        "offboard_control_mode arrives at less than 2 Hz, or with gaps of more than 1 s",
        setpoints.find_slow_mode,
        "Publish it from a timer or a thread of its own, at 10 Hz, so that the rest of the program cannot delay "
        "it: `vehicle.every(10, message)` in msggen.live. The longest gap that PX4 accepts is the parameter "
        "COM_OF_LOSS_T, 1 s by default.",
    ),
    _setpoint(
        "SETPOINT_UNSELECTED",
        "offboard_control_mode selects another setpoint than the one that is published",
        setpoints.find_unselected,
        "Set the field of the published setpoint. PX4 takes the first field that is set, in the order "
        f"{', '.join(map(_setpoints_of, SELECTORS))}. Leave the fields before it false.",
    ),
    _setpoint(
        "SETPOINT_EMPTY",
        "a setpoint has no number where PX4 needs one",
        setpoints.find_empty,
        "NaN means that a value is not controlled. A TrajectorySetpoint needs a number on each of the axes x, y "
        "and z in position, velocity or acceleration. An attitude needs a unit quaternion and a thrust.",
    ),
    _setpoint(
        "SETPOINT_DOWNWARD",
        "a setpoint points down, probably because z was taken as upward",
        setpoints.find_downward,
        "PX4's world is NED and its body FRD: z points down. 5 m above the origin is z = -5, climbing is a "
        "negative velocity z, and the thrust of a multicopter is a negative `thrust_body[2]`. `px4_types.frames` "
        "converts from ENU, as ROS has it: `frames.from_ros`.",
    ),
    _setpoint(
        "POSITION_MISSING",
        "the vehicle has no estimate of its position, and its setpoints need one",
        not_following.find_no_position,
        "Wait for a GPS fix, or send visual odometry. Look at `commander check`, and at the flags of "
        "estimator_status_flags. Attitude and rates need no position.",
    ),
    _setpoint(
        "FAILSAFE_ACTIVE",
        "the vehicle is in a failsafe",
        not_following.find_failsafe,
        "End the cause that the finding names: start the program again that sent offboard_control_mode, charge the "
        "battery, switch the remote control on. Then select Offboard mode again. Parameters such as COM_OBL_RC_ACT and "
        "NAV_RCL_ACT decide what the vehicle does meanwhile.",
    ),
    _setpoint(
        "ARMING_REFUSED",
        "the vehicle has refused to arm",
        not_following.find_refused_arming,
        "End what the finding names. The flags of FailsafeFlags are not all that PX4 checks: the reasons "
        "themselves are events, which do not cross the bridge. `commander check` in PX4's shell "
        "and ground stations show them.",
    ),
    _setpoint(
        "CHECKS_FAIL",
        "the vehicle gets setpoints and could not be armed",
        not_following.find_failing_checks,
        "End what the finding names. Without a remote control, set COM_RC_IN_MODE to 4 or COM_RCL_EXCEPT for "
        "Offboard mode. `commander check` in PX4's shell and ground stations show all reasons.",
    ),
    _setpoint(
        "NOT_ARMED",
        "the vehicle gets setpoints and is not armed",
        not_following.find_not_armed,
        "Arm it: VehicleCommand COMPONENT_ARM_DISARM with param1 = 1, `msggen command arm`. A vehicle that does "
        "not take off within 10 s disarms itself, by the parameter COM_DISARM_PRFLT: arm it after Offboard mode "
        "is selected.",
    ),
    _setpoint(
        "MODE_REFUSED",
        "the vehicle has refused another mode",
        not_following.find_refused_mode,
        "Publish OffboardControlMode for 1 s before the command, and go on publishing. With the field `position` "
        "or `velocity`, the vehicle needs an estimate of its position.",
    ),
    _setpoint(
        "MODE_OTHER",
        "the vehicle gets setpoints in a mode that does not use them",
        not_following.find_other_mode,
        "Select Offboard mode: VehicleCommand DO_SET_MODE with param1 = 1 and param2 = 6. A pilot, a ground "
        "station or a failsafe may have selected another mode since.",
    ),
)
"""The rules."""
