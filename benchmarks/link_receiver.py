"""A vehicle that reads all topics that PX4 subscribes to: a process of its own for link.py.

Its argument is the port of the link. It prints `ready` when it is connected. When its input ends, it prints the
latencies of the samples that it has received, in ns, as JSON: their timestamps have the time of sending, in ns of the
monotonic clock.
"""

from __future__ import annotations

import json
import select
import socket
import sys
import time

from link_sender import TIMESTAMP, connect, endpoints
from msggen.link.xrce.client import Client
from msggen.link.xrce.client_entities import Reader, Settings, Writer
from msggen.link.xrce.client_events import Received


def receive(client: Client, sock: socket.socket) -> list[int]:
    """Return the latencies of all samples until the standard input ends."""
    (own,) = endpoints(1)
    sample, latencies, due = own.message().encode()[4:], list[int](), 0
    while True:
        ready, _, _ = select.select([sock, sys.stdin], [], [], 0.1)
        if sys.stdin in ready:
            return latencies
        now = time.monotonic_ns()
        if sock in ready:
            client.receive(sock.recv(4096), now // 1000)
        if now >= due:  # the client of PX4 ends a session in which it publishes nothing for 3 s
            due = now + 100_000_000
            client.write(own.object_id, sample)
        client.advance(now // 1000)
        for data, _ in client.take_outgoing():
            sock.send(data)
        latencies += [
            now - TIMESTAMP.unpack_from(each.data)[0] for each in client.take_events() if type(each) is Received
        ]


def main() -> None:
    """Receive until the input ends."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    sock.connect(("127.0.0.1", int(sys.argv[1])))
    sock.settimeout(0.1)
    readers = [Reader(each.object_id, each.dds_name, each.dds_type, 1) for each in endpoints(1000, "in")]
    writers = [Writer(each.object_id, each.dds_name, each.dds_type) for each in endpoints(1)]
    client = Client(Settings(readers, writers, sync="off"))
    connect(client, sock)
    print("ready", flush=True)
    print(json.dumps(receive(client, sock)), flush=True)


if __name__ == "__main__":
    main()
