"""A commander with programs that answer its arming checks, for tests. Times are in s."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msggen.messages.commands import ACCEPTED
from msggen.sim.commander.checks import Reply
from msggen.sim.commander.commander import LOOP, Commander
from msggen.sim.commander.components import Registered, Registration
from msggen.sim.commander.requirements import Senses
from msggen.sim.commander.rules import V1_18, Rules
from support.flight_replay import PARAMETERS

NEEDS = frozenset({"angular_velocity", "attitude", "local_alt", "local_position"})
"""What a mode requires that flies to positions."""


class Driver:
    """A commander, and the programs that have registered. `answers` are their replies by the ids of checks."""

    def __init__(self, rules: Rules = V1_18, **parameters: float) -> None:
        self.commander = Commander(rules, {**PARAMETERS, **parameters})
        self.answers: dict[int, Reply] = {}
        self.masks: list[int] = []
        self.senses = Senses()
        self.now = 1_000_000
        self.run(0.2)

    @property
    def time(self) -> float:
        """The time in s."""
        return self.now / 1e6

    def step(self) -> None:
        """Pass the time of a loop. Programs answer at once."""
        self.now += LOOP
        self.commander.step(self.now, self.senses)
        while self.commander.requests:
            request = self.commander.requests.popleft()
            self.masks.append(request.mask)
            for each in [*self.answers.values()]:
                self.commander.checks.take(each._replace(request=request.number), self.now, self.now)

    def run(self, seconds: float) -> None:
        """Pass a time."""
        for _ in range(round(seconds * 1e6 / LOOP)):
            self.step()

    def until(self, condition: Callable[[Commander], Any], most: float = 40) -> float:
        """Pass time until a condition holds, and return the time."""
        begin = self.time
        while not condition(self.commander):
            assert self.time < begin + most, "it never holds"
            self.step()
        return self.time - begin

    def sense(self, **changes: Any) -> None:
        """Change what the vehicle senses."""
        self.senses = self.senses._replace(**changes)

    def register(self, name: str, *, executor: bool = False, replaces: int | None = None, **other: Any) -> Registered:
        """Register a mode. Its program answers from now on."""
        wanted = Registration(name, check=True, mode=True, executor=executor, replaces=replaces, **other)
        found = self.commander.register(wanted)
        if found.success:
            self.answers[found.check] = Reply(check=found.check, can_run=True, requirements=NEEDS)
        return found

    def kill(self, registered: Registered) -> None:
        """End a program: it does not answer any more."""
        del self.answers[registered.check]

    def fly(self, mode: int) -> None:
        """Select a mode, arm, and leave the ground."""
        self.run(0.5)
        assert self.commander.select(mode) == ACCEPTED
        self.run(0.2)
        assert self.commander.arm() == ACCEPTED
        self.run(0.1)
        self.sense(is_landed=False)
        self.run(0.1)
