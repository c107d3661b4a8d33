"""The table of the rules about flights, in the order in which they are listed."""

from __future__ import annotations

from msggen.analysis.rules import estimator, failures, gps, motors, power, recording, system, vibration

FLIGHT = (
    *recording.RULES,
    *failures.RULES,
    *vibration.RULES,
    *estimator.RULES,
    *gps.RULES,
    *motors.RULES,
    *power.RULES,
    *system.RULES,
)
"""The rules."""

TOPICS = frozenset(topic for rule in FLIGHT for topic in rule.topics)
"""The topics that they read."""
