"""The numbers of results and reasons: those of VehicleCommandAck, VehicleCommand and VehicleStatus."""

from __future__ import annotations

from typing import Final

from msggen.live.messages.nav_states import ALTITUDE, MANUAL, POSITION, STABILIZED

PILOTED: Final = frozenset({MANUAL, ALTITUDE, POSITION, STABILIZED})
"""The modes that a pilot flies with sticks."""

ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
"""The results of a command."""

BY_COMMAND: Final = 4
BY_LANDING: Final = 6
BY_INACTION: Final = 7
"""Reasons of arming and disarming: COMMAND_EXTERNAL, LANDING, PREFLIGHT_INACTION."""
