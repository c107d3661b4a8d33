"""Samples and calls that are not carried: how many of each topic and service, and why."""

from __future__ import annotations

from collections import Counter
from logging import getLogger

from msggen.base.diagnostics import printable

LOGGER = getLogger("msggen.live.ros")


class Refusals:
    """Counts what is not carried of each topic and service. The first reason of each is logged and kept."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.reasons: dict[str, str] = {}

    def add(self, topic: str, reason: object) -> None:
        """Count a sample or a call."""
        if topic not in self.reasons:
            self.reasons[topic] = printable(str(reason))
            text = "'%s' is not carried this time, and further times are only counted: %s"
            LOGGER.warning(text, topic, self.reasons[topic])
        self.counts[topic] += 1
