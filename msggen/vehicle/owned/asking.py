"""What a program can ask the process that owns its link."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from msggen.link.link import NOTHING, Client, Link, Publisher, Remote, Statistics


class Asking(Link):
    """The questions of a link to its owner."""

    is_shared = True

    def __init__(self) -> None:
        self._offset = 0
        """The number of the last vehicle of the owners before this one."""
        self._statistics = NOTHING

    @abstractmethod
    def ask(self, what: str) -> Any:
        """Return the answer of the owner to a question: its `state`, `clients` and so on. None if there is none."""

    def clients(self) -> list[Client]:
        """Return all clients that have begun a session at the owner, also those that are silent by now."""
        found = [Client(*each) for each in self.ask("clients") or ()]
        return [each._replace(number=each.number + self._offset) if each.number else each for each in found]

    def is_settled(self) -> bool:
        """Whether all clients that send to the owner have connected, as far as it is known."""
        return self.ask("settled") is not False

    def refusals(self) -> dict[str, int]:
        """Return how many datagrams the owner has refused, by reason."""
        return dict(self.ask("refusals") or {})

    def publishers(self, remote: Remote) -> list[Publisher]:
        """Return the running programs that have published to a vehicle. From any thread."""
        found = self.ask("publishers") or {}
        return [Publisher(*each) for each in found.get(str(remote.number - self._offset), ())]

    def warnings(self) -> list[str]:
        """Return what the owner has warned of, also before this program has joined."""
        return list(self.ask("warnings") or ())

    def address(self) -> str:
        """Return the address at which the owner listens, "" if it does not answer."""
        return str((self.ask("state") or {}).get("address", ""))

    def statistics(self) -> Statistics:
        """Return the counters of the owner, or the last known ones if it does not answer."""
        found = self.ask("statistics")
        if found is not None:
            self._statistics = Statistics(*found)
        return self._statistics
