"""Start-up times: whole processes, compared with a bare interpreter."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import NamedTuple

from codec import Entries
from effort import Effort
from messages import GENERATED, Sample
from peers import OURS, PEERS
from rounds import Contestant, race_processes

BARE = "bare interpreter"
OUR_IMPORTS = {
    "one type": "from px4_types import SensorCombined",
    "all types": "from px4_types import *",
    "topics": "from px4_types import topics",
}


class Starts(NamedTuple):
    """Seconds above a bare interpreter."""

    bare: float
    """Seconds of the bare interpreter."""
    imports: Mapping[str, float]
    """Seconds of the statements in OUR_IMPORTS."""
    ready: Mapping[str, float]
    """Seconds until a first message is decoded, by contestant."""


def measure(sample: Sample, entries: Entries, effort: Effort) -> Starts:
    """Return the times of the generated package's imports, and of all contestants until `sample` is decoded."""
    path = f"import sys; sys.path.insert(0, {str(GENERATED)!r}); "
    programs = {BARE: "pass", **{name: f"{path}{statement}" for name, statement in OUR_IMPORTS.items()}}
    for peer in (OURS, *PEERS):
        if isinstance(entries[sample.name][peer.name].decode, Contestant):
            programs[peer.name] = f"{peer.program(sample)}data = {sample.payload!r}\nmessage = {peer.decode}\n"
    commands = {name: [sys.executable, "-c", program] for name, program in programs.items()}
    least = race_processes(commands, effort.processes)
    bare = least.pop(BARE)
    above = {name: took - bare for name, took in least.items()}
    return Starts(
        bare,
        {name: took for name, took in above.items() if name in OUR_IMPORTS},
        {name: took for name, took in above.items() if name not in OUR_IMPORTS},
    )
