"""The modes that a pilot flies, and the reasons in VehicleStatus."""

from __future__ import annotations

from typing import Final

from msggen.messages.nav_states import ALTITUDE, MANUAL, POSITION, STABILIZED

PILOTED: Final = frozenset({MANUAL, ALTITUDE, POSITION, STABILIZED})
"""The modes that a pilot flies with sticks."""

BY_COMMAND: Final = 4
BY_LANDING: Final = 6
BY_INACTION: Final = 7
BY_FAILSAFE: Final = 14
"""Reasons of arming and disarming: COMMAND_EXTERNAL, LANDING, PREFLIGHT_INACTION and FAILSAFE."""
