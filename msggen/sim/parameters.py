"""The parameters of PX4 that a simulated vehicle follows, with their defaults."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from msggen.base.diagnostics import suggestion
from msggen.messages.ranges import DEFAULTS
from msggen.sim.commander.rules import V1_17, V1_18, Rules

PARAMETERS: Mapping[str, float] = MappingProxyType(
    {
        **DEFAULTS,
        "COM_DISARM_LAND": 2.0,
        "COM_DISARM_PRFLT": 10.0,
        "COM_FAIL_ACT_T": 5.0,
        "COM_LOW_BAT_ACT": 0.0,
        "COM_MODE_ARM_CHK": 0.0,
        "COM_OF_LOSS_T": 1.0,
        "COM_SPOOLUP_TIME": 1.0,
        "EKF2_EV_DELAY": 0.0,
        "EKF2_EV_QMIN": 0.0,
        "EKF2_GPS_CTRL": 7.0,
        "EKF2_HGT_REF": 1.0,
        "FW_AIRSPD_TRIM": 15.0,
        "FW_GND_SPD_MIN": 5.0,
        "FW_PN_R_SLEW_MAX": 90.0,
        "FW_T_ALT_TC": 5.0,
        "FW_T_CLMB_R_SP": 3.0,
        "FW_T_SINK_R_SP": 2.0,
        "FW_T_TAS_TC": 5.0,
        "LNDMC_TRIG_TIME": 1.0,
        "MC_ROLLRATE_MAX": 220.0,
        "MC_ROLL_P": 6.5,
        "MC_YAW_P": 2.8,
        "MIS_TAKEOFF_ALT": 2.5,
        "MPC_ACC_DOWN_MAX": 3.0,
        "MPC_ACC_HOR": 3.0,
        "MPC_ACC_HOR_MAX": 5.0,
        "MPC_ACC_UP_MAX": 4.0,
        "MPC_LAND_ALT2": 5.0,
        "MPC_LAND_SPEED": 0.7,
        "MPC_THR_HOVER": 0.5,
        "MPC_TKO_RAMP_T": 3.0,
        "MPC_TKO_SPEED": 1.5,
        "MPC_XY_CRUISE": 5.0,
        "MPC_XY_P": 0.95,
        "MPC_XY_VEL_MAX": 12.0,
        "MPC_YAWRAUTO_MAX": 60.0,
        "MPC_Z_VEL_MAX_DN": 1.5,
        "MPC_Z_VEL_MAX_UP": 3.0,
        "MPC_Z_V_AUTO_DN": 1.5,
        "MPC_Z_V_AUTO_UP": 3.0,
        "NAV_ACC_RAD": 10.0,
        "NAV_LOITER_RAD": 80.0,
        "NAV_MC_ALT_RAD": 0.8,
        "NPFG_DAMPING": 0.7,
        "NPFG_PERIOD": 10.0,
        "RA_MAX_STR_ANG": 0.5236,
        "RA_STR_RATE_LIM": 360.0,
        "RA_WHEEL_BASE": 0.321,
        "RD_TRANS_DRV_TRN": 0.175,
        "RO_ACCEL_LIM": 3.0,
        "RO_DECEL_LIM": 3.0,
        "RO_MAX_THR_SPEED": 3.2,
        "RO_YAW_P": 3.0,
        "RTL_CONE_ANG": 45.0,
        "RTL_MIN_DIST": 10.0,
        "RTL_RETURN_ALT": 60.0,
        "RTL_TYPE": 0.0,
        "SIH_WIND_E": 0.0,
        "SIH_WIND_N": 0.0,
        "VT_ARSP_TRANS": 10.0,
        "VT_B_TRANS_DUR": 10.0,
        "VT_F_TRANS_DUR": 5.0,
        "VT_QC_T_ALT_LOSS": 20.0,
        "VT_TRANS_MIN_TM": 2.0,
        "VT_TRANS_TIMEOUT": 15.0,
    }
)
"""Times are in s, heights in m, speeds in m/s, accelerations in m/s^2, angles in degrees, and gains in 1/s."""

_OF_RELEASES = {*V1_17.estimator, *V1_18.estimator}
SETTABLE = (
    *(name for name in PARAMETERS if name.startswith("COM_") and name not in {"COM_OF_LOSS_T", "COM_SPOOLUP_TIME"}),
    *sorted({*(name for name in PARAMETERS if name.startswith("EKF2_")), *_OF_RELEASES}),
    *(
        "FW_AIRSPD_MAX",
        "FW_AIRSPD_MIN",
        "FW_AIRSPD_TRIM",
        "FW_GND_SPD_MIN",
        "MIS_TAKEOFF_ALT",
        "NAV_ACC_RAD",
        "NAV_LOITER_RAD",
    ),
    *("RTL_CONE_ANG", "RTL_MIN_DIST", "RTL_RETURN_ALT", "SIH_WIND_E", "SIH_WIND_N", "VT_TRANS_TIMEOUT"),
)
"""Those that a vehicle can have other values of. The others are built into its motion."""


def check_settable(name: str, rules: Rules | None = None) -> None:
    """Raise ValueError for what is no parameter that a vehicle can have another value of, if it has some rules."""
    missing = _OF_RELEASES - rules.estimator.keys() if rules else ()
    known = [each for each in SETTABLE if each not in missing]
    if name not in known:
        raise ValueError(f"parameter '{name}' cannot be set{suggestion(name, known)}: there are {', '.join(known)}")


def microseconds(name: str) -> int:
    """Return a parameter in s as a time in us."""
    return round(PARAMETERS[name] * 1e6)
