"""The table of the rules about flights, in the order in which they are listed."""

from __future__ import annotations

from msggen.analysis.rules import (
    estimator,
    failures,
    gps,
    landing,
    links,
    magnetometer,
    motors,
    power,
    recording,
    system,
    vibration,
    wind,
)

FLIGHT = (
    *recording.RULES,
    *failures.RULES,
    *links.RULES,
    *vibration.RULES,
    *estimator.RULES,
    *gps.RULES,
    *magnetometer.RULES,
    *motors.RULES,
    *power.RULES,
    *landing.RULES,
    *wind.RULES,
    *system.RULES,
)
"""The rules."""

TOPICS = frozenset(topic for rule in FLIGHT for topic in rule.topics)
"""The topics that they read."""
