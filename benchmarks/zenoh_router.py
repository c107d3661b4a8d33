"""A Zenoh router: a process of its own for network.py.

Its arguments are its port, and the ports of the routers that it connects to. It prints `ready`, and ends with its
input.
"""

from __future__ import annotations

import json
import sys

import zenoh


def main() -> None:
    """Route until the input ends."""
    port, *others = sys.argv[1:]
    made = zenoh.Config()
    settings = {
        "mode": "router",
        "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
        "connect/endpoints": [f"tcp/127.0.0.1:{other}" for other in others],
        "scouting/multicast/enabled": False,
    }
    for name, value in settings.items():
        made.insert_json5(name, json.dumps(value))
    with zenoh.open(made):
        print("ready", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
