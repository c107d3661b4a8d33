"""The reasons of arming and disarming in VehicleStatus, and those for failsafes that count from arming on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from msggen.messages.nav_states import HOLD, MISSION, TAKEOFF, VTOL_TAKEOFF
from msggen.sim.commander.failsafe import Action, Trigger
from msggen.sim.commander.requirements import Senses

BY_COMMAND: Final = 4
BY_LANDING: Final = 6
BY_INACTION: Final = 7
BY_FAILSAFE: Final = 14
"""COMMAND_EXTERNAL, LANDING, PREFLIGHT_INACTION and FAILSAFE."""
_QUADCHUTES = frozenset({TAKEOFF, VTOL_TAKEOFF, HOLD, MISSION})
"""The modes in which a quad-chute is a failsafe: COM_QC_ACT 0."""


class WhileArmed:
    """What has changed since the vehicle was armed: sticks, a low battery, the end of forward flight."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.had_sticks = False
        """Whether there were sticks at arming, or since then."""
        self._battery = 0
        self._parameters = parameters

    def begin(self, senses: Senses) -> None:
        """Take what there is at arming."""
        self.had_sticks, self._battery = senses.manual_control, senses.battery

    def triggers(self, mode: int, senses: Senses) -> dict[str, Trigger]:
        """Return the reasons for failsafes in the mode that was selected."""
        found = {}
        if self.had_sticks and not senses.manual_control:
            found["manual control"] = Trigger(Action.RETURN, stays=True)
        if senses.battery > self._battery and self._battery_action(senses.battery):
            found[f"battery {senses.battery}"] = Trigger(self._battery_action(senses.battery), stays=True)
        if senses.wings_failed and mode in _QUADCHUTES:
            found["quad-chute"] = Trigger(Action.RETURN, stays=True)
        return found

    def _battery_action(self, warning: int) -> Action:
        """Return what COM_LOW_BAT_ACT says: 0 warn, 1 return, 2 land, 3 return, and land in an emergency."""
        setting = round(self._parameters["COM_LOW_BAT_ACT"])
        if warning < 2 or setting == 0:  # noqa: PLR2004 - low
            return Action.WARN
        is_land = setting == 2 or (setting == 3 and warning > 2)  # noqa: PLR2004 - as above
        return Action.LAND if is_land else Action.RETURN
