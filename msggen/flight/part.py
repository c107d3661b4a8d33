"""The parts of a program that the vehicle registers, and the topics that they need."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from msggen.flight.answering import Check
from msggen.flight.connection import Connection, Topics
from msggen.flight.executor import Executor
from msggen.flight.link import Need
from msggen.flight.mode import Mode
from msggen.flight.registration import Wanted
from msggen.messages.setpoints import SENT

_ALWAYS: Final = (
    Need("in", "register_ext_component_request"),
    Need("out", "register_ext_component_reply"),
    Need("in", "unregister_ext_component"),
    Need("out", "arming_check_request"),
    Need("in", "arming_check_reply"),
    Need("in", "mode_completed"),
)
_CONFIGURATION: Final = (
    Need("in", "setpoint_config"),
    Need("out", "setpoint_config_reply"),
    Need("in", "config_control_setpoints"),
)
"""Needed as far as the release has them."""
_OF_EXECUTORS: Final = Need("in", "vehicle_command_mode_executor")
NEEDED: Final = (
    *_ALWAYS,
    *_CONFIGURATION,
    _OF_EXECUTORS,
    *(Need("in", topic) for kind in SENT for topic in kind.topics),
)
"""All topics that modes, executors and checks can need."""


class Part(NamedTuple):
    """A mode, and the executor that it belongs to, or a check."""

    subject: Mode | Check
    executor: Executor | None = None

    @property
    def wanted(self) -> Wanted:
        """The registration to request."""
        mode, executor = self.subject, self.executor
        if isinstance(mode, Check):
            return Wanted(mode.name, is_mode=False)
        return Wanted(
            mode.name,
            executor=executor is not None,
            replaces=mode.replaces,
            is_immediate=executor is not None and executor.starts == "registered",
            is_selectable=mode.is_selectable,
        )


def needed_topics(connection: Connection, parts: Sequence[Part]) -> Iterator[Need]:
    """Yield the topics that modes, executors and checks need."""
    topics = Topics(connection.package)
    yield from _ALWAYS
    yield from (each for each in _CONFIGURATION if topics.has(*each))
    modes = [part.subject for part in parts if isinstance(part.subject, Mode)]
    for topic in {topic for mode in modes for kind in mode.setpoints for topic in kind.topics}:
        yield Need("in", topic)
    if any(part.executor is not None for part in parts):
        yield _OF_EXECUTORS
