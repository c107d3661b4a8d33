"""The plan of a sync: the changes that make a package match the firmware."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from typing import NamedTuple

from msggen.base.disk.reading import read_bytes
from msggen.base.disk.record import Record, digest
from msggen.generate.sync.scaffold import Scaffold
from msggen.generate.sync.target import Target
from msggen.sources.embedded import all_releases
from msggen.sources.overlap import KINDS

_FORMER = """
AccelCalibration ActuatorControls ActuatorControls0 ActuatorControls1 ActuatorControls2 ActuatorControls3
ActuatorControlsVirtualFw ActuatorControlsVirtualMc ActuatorDirect ArmRequest AttPosMocap BaroBiasEstimate
CommanderState ControlState Ekf2Innovations Ekf2Replay EkfGpsDrift EkfGpsPosition Encoders EstimatorBaroBias
EstimatorOpticalFlowVel Fence FenceVertex FilteredBottomFlow FwPosCtrlStatus FwVirtualAttitudeSetpoint
FwVirtualRatesSetpoint GeofenceUpdate GyroCalibration HilSensor LowStack MagCalibration ManualControlInput
McAttCtrlStatus McVirtualAttitudeSetpoint McVirtualRatesSetpoint MecanumVelocitySetpoint ModeRequest MountStatus
MultirotorMotorLimits NavigationCapabilities ObstacleAvoidance OpticalFlow OutputPwm RangeFinder
RoverAckermannGuidanceStatus RoverAckermannSetpoint RoverAckermannStatus RoverDifferentialGuidanceStatus
RoverDifferentialSetpoint RoverDifferentialStatus RoverMecanumGuidanceStatus RoverMecanumSetpoint RoverMecanumStatus
RoverVelocitySetpoint RpmControlStatus RtlFlightTime Safety SensorAccelIntegrated SensorAccelStatus SensorBias
SensorGyroControl SensorGyroFftAxis SensorGyroIntegrated SensorGyroStatus SensorPreflight SensorPreflightImu
ServorailStatus Sih SubsystemInfo TelemetryHeartbeat TestMotor TimeOffset Timesync UwbDistance UwbGrid
VehicleActuatorSetpoint VehicleAngularAcceleration VehicleForceSetpoint VehicleGlobalVelocitySetpoint VehicleGpsPosition
VehicleStatusFlags VehicleViconPosition VisionPositionEstimate VtxAuxMap VtxTable WindEstimate
"""
"""The messages that PX4 had only before the first embedded release, or between two of them."""


class SyncPlan(NamedTuple):
    """The changes that a sync makes. Names are relative to the package.

    `files` are the definitions of the firmware, `before` those of the package, None for a name that is not a file.
    `left_alone` are definitions that the firmware does not have and msggen did not write. `scaffold` has the other
    files to write. `known` is the record that was found, `record` the new one.
    """

    target: Target
    files: Mapping[str, bytes]
    before: Mapping[str, bytes | None]
    added: tuple[str, ...]
    changed: tuple[str, ...]
    removed: tuple[str, ...]
    unchanged: tuple[str, ...]
    left_alone: tuple[str, ...]
    scaffold: Mapping[str, bytes]
    known: Record
    record: Record

    @property
    def is_stale(self) -> bool:
        """Whether the plan changes any file."""
        return bool(self.added or self.changed or self.removed or self.scaffold)

    @property
    def is_unfinished(self) -> bool:
        """Whether there is a record that differs from the new one, as after a run that was killed."""
        known, record = self.known, self.record
        return bool(known.files) and (known.files, known.topics_only) != (record.files, record.topics_only)

    @property
    def folders(self) -> tuple[str, ...]:
        """The folders among `msg` and `srv` in which definitions change."""
        names = (*self.added, *self.changed, *self.removed)
        return tuple(kind for kind in KINDS if any(name.startswith(f"{kind}/") for name in names))

    @property
    def during(self) -> Record:
        """The record while files are replaced, with the old and the new digest of each file."""
        old, new = self.known.files, self.record.files
        names = {*old, *new, *self.removed}
        digests = {name: [*old.get(name, "").split(), *new.get(name, "").split()] for name in names}
        files = {name: " ".join(dict.fromkeys(each)) for name, each in digests.items()}
        return self.record._replace(files=files, scaffold="")


def make_plan(
    target: Target, files: Mapping[str, bytes], known: Record, scaffold: Scaffold, *, topics_only: bool = False
) -> SyncPlan:
    """Return the changes that make the package contain `files`."""
    before = read_package(target.folder)
    surplus = [name for name in before if name not in files]
    owned = owned_names(known) if surplus else ()
    digests = {name: digest(data) for name, data in files.items()}
    return SyncPlan(
        target,
        files,
        before,
        added=tuple(name for name in files if name not in before),
        changed=tuple(name for name, data in files.items() if before.get(name, data) != data),
        removed=tuple(name for name in surplus if name in owned),
        unchanged=tuple(name for name, data in files.items() if before.get(name) == data),
        left_alone=tuple(name for name in surplus if name not in owned),
        scaffold=scaffold.changes,
        known=known,
        record=Record({**digests, **scaffold.digests}, scaffold.inputs, topics_only),
    )


def read_package(folder: str) -> dict[str, bytes | None]:
    """Return the definitions of the package in `folder`, with None for each name that is not a file."""
    found: dict[str, bytes | None] = {}
    for kind in KINDS:
        for base in entries(folder, kind):
            if base.endswith(f".{kind}") and not base.startswith("."):
                found[f"{kind}/{base}"] = read_if_file(os.path.join(folder, kind, base))
    return found


def entries(folder: str, kind: str) -> list[str]:
    """Return the sorted names in the folder `kind` of a package, or [] if it does not exist."""
    try:
        return sorted(os.listdir(os.path.join(folder, kind)))
    except (FileNotFoundError, NotADirectoryError):
        return []


def read_if_file(path: str) -> bytes | None:
    """Return the bytes of `path`, or None if it is not a file."""
    if not os.path.isfile(path):
        return None
    return read_bytes(path)


def owned_names(known: Record) -> Collection[str]:
    """Return the names of definitions that sync may remove: those in the record of the package.

    In a package without a record, definitions count as PX4's if PX4 has, or ever had, one of that name.
    """
    if known.files:
        return known.files.keys()
    return all_releases().definitions.union(f"msg/{name}.msg" for name in _FORMER.split())
