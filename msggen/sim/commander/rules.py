"""What differs between the releases of PX4."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

_AUXILIARY: Final = {f"EKF2_AGP{number}_{name}": 0.0 for number in range(4) for name in ("CTRL", "ID")}
_BEFORE: Final[Mapping[str, float]] = {"EKF2_EV_CTRL": 0.0, "EKF2_AGP_CTRL": 0.0}


class Rules(NamedTuple):
    """The rules of a release. The defaults are those of v1.18."""

    misses: int = 4
    """How many requests in a row a registration leaves unanswered until it is unresponsive."""
    first_misses: int = 11
    """The same until its first reply."""
    most_age: int | None = 300_000
    """The age in us from which on replies are dropped."""
    always_registers: bool = False
    """Whether programs can register while the vehicle is armed, whatever COM_MODE_ARM_CHK says."""
    asks_executor: bool = True
    """Whether disarming selects the mode of the executor in charge, and Hold in place of a mode that does not answer.

    Without that, it selects the mode that was selected last and allows arming."""
    configures_setpoints: bool = True
    """Whether SetpointConfig sets the type of a mode's setpoints. Otherwise, VehicleControlMode does."""
    takes_both_of_vtol: bool = False
    """Whether a VTOL accepts fixed-wing setpoints also while it hovers, as v1.18 has since September 2026."""
    pushes_in_modes: bool = True
    """Whether a VTOL can go to forward flight in the mode of a program: its pusher starts there, as from v1.17 on."""
    api_version: int = 2
    """The version of the interface that replies carry: LATEST_PX4_ROS2_API_VERSION."""
    estimator: Mapping[str, float] = {"EKF2_EV_CTRL": 0.0, **_AUXILIARY}
    """The parameters of measurements whose names or defaults differ, with their defaults."""
    auxiliary_patience: int = 7_000_000
    """The time in us for which global positions are rejected until the position is reset to them. 0: at once, and
    beside GPS, too."""


V1_18 = Rules()
V1_17 = Rules(configures_setpoints=False, api_version=1, estimator=_BEFORE)
V1_16 = V1_17._replace(most_age=None, asks_executor=False, pushes_in_modes=False, auxiliary_patience=1_000_000)
V1_15 = V1_16._replace(misses=3, first_misses=3, estimator={**_BEFORE, "EKF2_EV_CTRL": 15.0}, auxiliary_patience=0)
V1_15_SITL = V1_15._replace(always_registers=True)
