"""Measure the links: latency, loss and CPU time of a sample, from the sender's call to the decoded message.

    python benchmarks/link.py            everything, in 4 minutes; docs/links.md shows some rows
    python benchmarks/link.py --quick    checks in a minute that it works
    python benchmarks/link.py --soak     a Vehicle with 24 topics at 100 Hz for 10 minutes, and its memory, on Linux

The vehicle is another process on this computer. CPU time is that of the process with the link, with its part of the
kernel, and includes decoding and encoding. Needs the packages of the extra `test`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from environment import HERE, ROOT
from link_sender import Load, Send, endpoints, send_all, sensor_combined
from msggen.link.dds import LOOPBACK, DdsLink
from msggen.link.link import Link, Listener, Remote, Route, Service
from msggen.link.udp import UdpLink
from tables import Table

DOMAIN = 100 + os.getpid() % 100
SETTLE = 0.5
"""Seconds until the last samples have arrived."""


class Result(NamedTuple):
    """A measurement."""

    sent: int
    received: int
    latencies: list[int]
    """Sorted, in ns."""
    cpu: float
    """Seconds."""

    def row(self, name: str) -> list[str]:
        """Return the cells of a table."""
        if not self.received:
            return [name, f"{self.sent:,}", "100 %", "", "", ""]
        lost = 100 * (self.sent - self.received) / self.sent
        middle, late = (self.latencies[int(self.received * part)] / 1000 for part in (0.5, 0.99))
        loss = f"{lost:.2g} %" if lost else "0"
        return [name, f"{self.sent:,}", loss, f"{middle:,.0f}", f"{late:,.0f}", f"{self.cpu / self.received * 1e6:.0f}"]


HEAD = ["samples", "sent", "lost", "latency: median, us", "99 %, us", "CPU, us a sample"]


class Meter(Listener):
    """A listener that decodes samples and keeps how long they took."""

    def __init__(self, topics: int) -> None:
        self.decode: dict[str, Callable[[bytes], Any]] = {
            f"px4_msgs/msg/{each.message_name}": each.message.decode for each in endpoints(topics)
        }
        self.latencies: list[int] = []
        self.routes: list[tuple[Remote, Route | Service]] = []

    def opened(self, remote: Remote, route: Route | Service) -> None:
        """Keep a route."""
        self.routes.append((remote, route))

    def sample(self, remote: Remote, route: Route, payload: bytes, _time: int) -> None:  # noqa: ARG002
        """Decode a sample whose timestamp is the time of sending."""
        message = self.decode[route.ros_type](payload)
        self.latencies.append(time.monotonic_ns() - message.timestamp)

    def warned(self, text: str) -> None:
        """Print a warning."""
        print(text)

    def failed(self, reason: str) -> None:
        """Print the reason."""
        print(reason)


def measure_link(link: Link, place: Callable[[], int], load: Load) -> Result:
    """Measure a link. `place` returns the port or the domain when the link is started."""
    meter = Meter(load.topics)
    link.start(meter)
    try:
        with sender(load._replace(place=place())) as process:
            wait(lambda: len(meter.routes) >= load.vehicles * load.topics)
            return run(process, meter.latencies)
    finally:
        link.close()


def measure_udp(load: Load) -> Result:
    """Measure the link over UDP."""
    link = UdpLink(port=0)
    return measure_link(link, lambda: link.port, load)


def measure_to_vehicle(rate: float, seconds: float) -> Result:
    """Measure all topics that PX4 subscribes to. `rate` is in samples a second, of all topics together."""
    meter, link = Meter(1), UdpLink(port=0)
    messages = {f"px4_msgs/msg/{each.message_name}": each.message() for each in endpoints(1000, "in")}
    link.start(meter)
    try:
        with vehicle("link_receiver.py", str(link.port)) as process:
            wait(lambda: len(meter.routes) > len(endpoints(1000, "in")))
            time.sleep(SETTLE)

            def sender(remote: Remote, route: Route) -> Send:
                def send() -> None:
                    message = messages[route.ros_type]
                    message.timestamp = time.monotonic_ns()
                    link.publish(remote, route, message.encode())

                return send

            before = time.process_time()
            sends = [
                sender(remote, route)
                for remote, route in meter.routes
                if isinstance(route, Route) and route.direction == "in"
            ]
            sent = send_all(sends, Load("in", link.port, 1, len(sends), rate, seconds))
            time.sleep(SETTLE)
            cpu = time.process_time() - before
            printed, _ = process.communicate("end\n")
            found = sorted(json.loads(printed))
            return Result(sent, len(found), found, cpu)
    finally:
        link.close()


def measure_dds(load: Load) -> Result:
    """Measure the link over DDS."""
    return measure_link(DdsLink(DOMAIN), lambda: DOMAIN, load)


def measure_typed(load: Load) -> Result:
    """Measure a program that uses cyclonedds with its own Python types."""
    from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    domain = Domain(DOMAIN, LOOPBACK)  # kept: the configuration is dropped with it
    participant = DomainParticipant(DOMAIN)
    topic: Any = Topic(participant, endpoints(1)[0].dds_name, sensor_combined())
    reader: Any = DataReader(participant, topic, Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(512)))
    waiting = WaitSet(participant)
    waiting.attach(ReadCondition(reader, SampleState.Any | ViewState.Any | InstanceState.Any))
    latencies: list[int] = []
    closing = threading.Event()

    def receive() -> None:
        while not closing.is_set():
            waiting.wait(100_000_000)
            latencies.extend(
                time.monotonic_ns() - sample.timestamp for sample in reader.take(256) if sample.sample_info.valid_data
            )

    thread = threading.Thread(target=receive)
    thread.start()
    try:
        with sender(load._replace(place=DOMAIN)) as process:
            wait(reader.get_matched_publications)
            result = run(process, latencies)
    finally:
        closing.set()
        thread.join()
    del domain
    return result


def sender(load: Load) -> contextlib.AbstractContextManager[subprocess.Popen[str]]:
    """Run a sender until it is ready."""
    return vehicle("link_sender.py", json.dumps(load))


@contextlib.contextmanager
def vehicle(program: str, argument: str) -> Iterator[subprocess.Popen[str]]:
    """Run the program of a vehicle until it is ready."""
    command = [sys.executable, str(HERE / program), argument]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=variables, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            if line(process) != "ready":
                raise RuntimeError("the vehicle has failed")
            yield process
        finally:
            process.kill()


def line(process: subprocess.Popen[str]) -> str:
    """Return the next line of a sender."""
    return process.stdout.readline().strip() if process.stdout else ""


def run(process: subprocess.Popen[str], latencies: list[int]) -> Result:
    """Let a sender send, and return what arrived."""
    time.sleep(SETTLE)  # discovery, on both sides
    before = time.process_time()
    sent = send(process)
    cpu = time.process_time() - before
    found = sorted(latencies)
    return Result(sent, len(found), found, cpu)


def send(process: subprocess.Popen[str]) -> int:
    """Let a sender send, and return the number of its samples when the last one has arrived."""
    if process.stdin:
        process.stdin.write("go\n")
        process.stdin.flush()
    sent = int(line(process))
    time.sleep(SETTLE)
    return sent


def wait(true: Callable[[], object]) -> None:
    """Wait until something is true."""
    end = time.monotonic() + 30
    while not true():
        if time.monotonic() > end:
            raise TimeoutError("nothing has connected in 30 s")
        time.sleep(0.01)


def tables(seconds: float, *, is_quick: bool) -> Iterator[Table]:
    """Measure, and yield tables."""
    everything = len(endpoints(1000))
    rates = (100, 1000) if is_quick else (100, 1000, 10_000)
    rows = [measure_udp(Load("udp", 0, 1, 1, rate, seconds)).row(f"1 topic at {rate:,} Hz") for rate in rates]
    for rate in rates[:1] if is_quick else rates[:2]:
        load = Load("udp", 0, 1, everything, rate * everything, seconds)
        rows.append(measure_udp(load).row(f"{everything} topics at {rate:,} Hz"))
    yield Table("UDP, one vehicle", HEAD, rows)
    rows = []
    for vehicles in (1, 5) if is_quick else (1, 10, 50):
        load = Load("udp", 0, vehicles, everything, 500 if is_quick else 5000, seconds)
        rows.append(measure_udp(load).row(f"{vehicles} vehicle{'s' * (vehicles > 1)}"))
    yield Table("UDP, vehicles that send 5,000 samples a second together", HEAD, rows)
    topics = len(endpoints(1000, "in"))
    rows = [measure_to_vehicle(100 * topics, seconds).row(f"{topics} topics at 100 Hz")]
    yield Table("UDP, to the vehicle", HEAD, rows)
    rows = []
    for rate in rates:
        for name, kind, measure in (("DdsLink", "dds", measure_dds), ("cyclonedds", "typed", measure_typed)):
            result = measure(Load(kind, DOMAIN, 1, 1, rate, seconds))
            rows.append(result.row(f"1 topic at {rate:,} Hz, {name}"))
    yield Table("DDS without an agent: DdsLink and cyclonedds with its own Python types", HEAD, rows)


def soak(seconds: float) -> Iterator[str]:
    """Run a Vehicle with 24 topics at 100 Hz, half of them read by threads, and yield its memory and its counters."""
    from msggen.live import Vehicle

    link, topics, told = UdpLink(port=0), endpoints(24), list[tuple[float, int]]()
    with Vehicle(link) as vehicle:
        subscriptions = [vehicle.subscribe(each, lambda _: None) for each in topics[::2]]
        queued = [vehicle.subscribe(each) for each in topics[1::2]]
        for each in queued:
            threading.Thread(target=deque, args=(each, 0)).start()
        with sender(Load("udp", link.port, 1, len(topics), 100 * len(topics), seconds)) as process:
            vehicle.wait_connected(30)
            timers = [threading.Timer(at, lambda at=at: told.append((at, memory()))) for at in (30.0, seconds - 30)]
            for timer in timers:
                timer.start()
            if process.stdin:
                process.stdin.write("go\n")
                process.stdin.flush()
            sent = int(line(process))
            time.sleep(SETTLE)
        received = sum(each.received for each in (*subscriptions, *queued))
        dropped = sum(each.dropped for each in queued)
        yield from (f"{kilobytes:,} kB after {at:g} s" for at, kilobytes in told)
        yield f"{sent:,} samples sent, {received:,} received, {dropped} dropped by queues; {vehicle.statistics}"


def memory() -> int:
    """Return the resident memory of this process in kB."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status.partition("VmRSS:")[2].split()[0])


def main() -> None:
    """Measure and print tables, as Markdown if the output is not a terminal."""
    parser = argparse.ArgumentParser(description="Measure the links to a vehicle.")
    parser.add_argument("--quick", action="store_true", help="less than a second for each measurement")
    parser.add_argument("--soak", action="store_true", help="10 minutes of a Vehicle, and its memory")
    options = parser.parse_args()
    if options.soak:
        for text in soak(600):
            print(text)
        return
    for table in tables(0.3 if options.quick else 10, is_quick=options.quick):
        table.print()


if __name__ == "__main__":
    main()
