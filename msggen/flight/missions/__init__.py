"""Missions in files, flown by a program. See docs/missions.md."""

from __future__ import annotations

from msggen.flight.missions.handler import Action, Arguments, Handler, MissionError
from msggen.flight.missions.mission import Mission
from msggen.flight.missions.plan import ActionItem, Plan, Settings, Waypoint
from msggen.flight.missions.reading import parse_mission, read_mission

__all__ = [
    "Action",
    "ActionItem",
    "Arguments",
    "Handler",
    "Mission",
    "MissionError",
    "Plan",
    "Settings",
    "Waypoint",
    "parse_mission",
    "read_mission",
]
