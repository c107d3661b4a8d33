"""Samples that are not carried: how many of each topic, and why."""

from __future__ import annotations

from collections import Counter
from logging import getLogger

from msggen.base.diagnostics import printable

LOGGER = getLogger("msggen.live.ros")


class Refusals:
    """Counts the samples of each topic that are not carried. The first reason of a topic is logged and kept."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.reasons: dict[str, str] = {}

    def add(self, topic: str, reason: object) -> None:
        """Count a sample."""
        if topic not in self.reasons:
            self.reasons[topic] = printable(str(reason))
            text = "a sample of '%s' is not carried, and further ones are only counted: %s"
            LOGGER.warning(text, topic, self.reasons[topic])
        self.counts[topic] += 1
