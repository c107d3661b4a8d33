"""A program that takes all samples of vehicles: a process of its own for shared_link.py and network.py.

Its arguments are `direct` or `shared`, the address of the link, and the number of topics of all vehicles. It prints
`ready` when these are open, and after two lines what arrived between them, as JSON: the count, latencies in us, CPU
time in s, and the most memory of the process in kB.
"""

from __future__ import annotations

import json
import resource
import sys
import time

from link import Meter, wait
from msggen.link.address import parse_address
from msggen.link.link import Link, Remote, Route, Service
from msggen.vehicle.opening import open_link


class Follower(Meter):
    """A meter that follows all topics of the vehicle."""

    link: Link

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Keep a route, and follow it."""
        super().opened(remote, route)
        if isinstance(route, Route) and route.direction == "out":
            self.link.follow(remote, route, is_followed=True)


def main() -> None:
    """Take samples until a line is read."""
    way, address, topics = sys.argv[1], sys.argv[2], int(sys.argv[3])
    follower = Follower(topics)
    follower.link = open_link(parse_address(address), is_shared=way == "shared")
    follower.link.start(follower)
    print("open", flush=True)
    try:
        wait(lambda: len(follower.routes) >= topics)
        print("ready", flush=True)
        sys.stdin.readline()
        before = time.process_time()
        follower.latencies.clear()
        print("begun", flush=True)
        sys.stdin.readline()
        cpu, found = time.process_time() - before, sorted(follower.latencies)
        middle, late = (found[int(len(found) * part)] / 1000 for part in (0.5, 0.99))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print(json.dumps([len(found), middle, late, cpu, memory]), flush=True)
    finally:
        follower.link.close()


if __name__ == "__main__":
    main()
