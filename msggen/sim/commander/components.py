"""What programs register: modes in slots that are kept by name, and executors.

The facts are those of ModeManagement in PX4's commander, measured with v1.18.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from msggen.messages.nav_states import EXTERNAL

EXECUTORS = range(1, 6)
"""The ids of executors. 0 is the autopilot."""
AUTOPILOT = 0
NONE = -1
"""The id of what is not there."""
_SELECTABLE: Final = 0x7EC5FF
"""The modes of PX4 that users can select, as bits."""
_FNV_START, _FNV_PRIME = 0x811C9DC5, 0x01000193


class Registration(NamedTuple):
    """A RegisterExtComponentRequest."""

    name: str
    check: bool = False
    mode: bool = False
    executor: bool = False
    replaces: int | None = None
    """The nav_state of the internal mode that it replaces."""
    is_immediate: bool = False
    """Whether the mode is selected at once."""


class Registered(NamedTuple):
    """The reply to it: RegisterExtComponentReply."""

    success: bool
    check: int = NONE
    mode: int = NONE
    executor: int = NONE


REFUSED = Registered(success=False)
REFUSED_ARMED = Registered(success=False, check=0, mode=0, executor=0)
"""The reply while the vehicle is armed: PX4 leaves the ids at zero."""


class Overrides(NamedTuple):
    """A ConfigOverrides: what a mode or an executor changes while it is active."""

    keeps_armed: bool = False
    """Whether the vehicle stays armed after landing."""
    defers: bool = False
    defer_seconds: int = 0
    keeps_home: bool = False
    """Whether the home position stays at takeoff: from v1.18 on."""


class Mode(NamedTuple):
    """A mode of a program."""

    name: str
    check: int
    executor: int = NONE
    replaces: int | None = None


class Components:
    """The modes by their nav_states, and the modes that executors own by their ids."""

    def __init__(self) -> None:
        self._hashes = [0] * len(EXTERNAL)
        """COM_MODE0_HASH to COM_MODE7_HASH: they outlive restarts."""
        self.modes: dict[int, Mode] = {}
        self.executors: dict[int, int] = {}

    @property
    def selectable(self) -> int:
        """The modes that users can select, as bits: those of programs in place of those that they replace."""
        replaced = sum(1 << own.replaces for own in self.modes.values() if own.replaces is not None)
        return (_SELECTABLE & ~replaced) | sum(1 << mode for mode in self.modes)

    def restart(self) -> None:
        """Forget all but the slots of names, as PX4 does when it restarts."""
        self.modes.clear()
        self.executors.clear()

    def has_room(self, wanted: Registration) -> bool:
        """Whether a mode and an executor can be registered, if they are wanted."""
        if wanted.executor and not wanted.mode:
            return False
        is_replaced = wanted.replaces is not None and self.replacement(wanted.replaces) is not None
        has_mode = not wanted.mode or (len(self.modes) < len(EXTERNAL) and not is_replaced)
        return has_mode and (not wanted.executor or len(self.executors) < len(EXECUTORS))

    def add(self, wanted: Registration) -> tuple[int, int]:
        """Add a mode, and its executor if it has one. Return their ids. The caller adds the arming check."""
        mode = EXTERNAL[self._slot(wanted.name)]
        executor = NONE
        if wanted.executor:
            executor = next(each for each in EXECUTORS if each not in self.executors)
            self.executors[executor] = mode
        self.modes[mode] = Mode(wanted.name, NONE, executor, wanted.replaces)
        return mode, executor

    def remove(self, mode: int, name: str) -> bool:
        """Remove the mode of a name. Return False if the mode has another name or is not there."""
        if mode not in self.modes or self.modes[mode].name != name:
            return False
        del self.modes[mode]
        return True

    def replacement(self, mode: int) -> int | None:
        """Return the mode that replaces an internal one, None if none does."""
        return min([each for each, own in self.modes.items() if own.replaces == mode], default=None)

    def replaced_by(self, mode: int) -> int:
        """Return the internal mode that a mode replaces, or the mode itself."""
        found = self.modes[mode].replaces if mode in self.modes else None
        return mode if found is None else found

    def owner(self, mode: int) -> int:
        """Return the executor that owns a mode, -1 for none."""
        return self.modes[mode].executor if mode in self.modes else NONE

    def _slot(self, name: str) -> int:
        """Return a slot that is free: that of the name, else one that no name has, else any. Remember the name."""
        own = _hash_of(name)
        free = [slot for slot, mode in enumerate(EXTERNAL) if mode not in self.modes]
        unused = [slot for slot in free if not self._hashes[slot]]
        if own in self._hashes:
            known = self._hashes.index(own)
            if known in free:
                return known
            if not unused:
                self._hashes[free[0]] = 0
            return (unused or free)[0]
        slot = (unused or free)[0]
        self._hashes[slot] = own
        return slot


def _hash_of(name: str) -> int:
    """Return the FNV-1a hash of a name in 32 bits, 1 in place of 0, which stands for no name."""
    found = _FNV_START
    for octet in name.encode():
        found = (found ^ octet) * _FNV_PRIME & 0xFFFFFFFF
    return found or 1
