"""Samples that arrive, but are misread, late, rare or incomplete."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msggen.base.diagnostics import counted, few
from msggen.check.finding import Change
from msggen.doctor.case import Case, message_of
from msggen.doctor.observation import VehicleSeen
from msggen.messages.names import stem_of, version_of, without_namespace

_CLOCK = 1.0
"""The difference in s between two clocks that is reported."""
_SETTLED = 0.02
"""The error in s of an estimate of the difference between both clocks that is reported."""
_DDS = 2
"""SOURCE_PROTOCOL_DDS of TimesyncStatus."""
_SHARE = 0.01
"""The share of lost samples that is reported."""
_FEWEST = 5
"""The lost samples that are reported, at least."""
_SLOW = 0.5
"""The share of its limit below which a rate is reported."""
_STEADY = {
    "sensor_combined",
    "vehicle_attitude",
    "vehicle_global_position",
    "vehicle_local_position",
    "vehicle_odometry",
}
"""The topics of the sensors and the estimator, which PX4 publishes at 100 Hz and more. Others may be rare."""
_FULL = 0.85
"""The share of the bytes of a serial line that counts as all of them."""
_OVERHEAD = 14
"""The bytes of a frame besides the sample: 2 x 4 of headers, 4 of ids, 7 + 2 of the frame; less the encapsulation."""
_FULL_BUFFER = 4 << 20
"""The receive buffer that a link asks for."""


def find_unknown_types(case: Case) -> Iterator[Change]:
    """Find messages of the vehicle that the program does not have."""
    for vehicle in case.vehicles:
        expected = case.expected_by(vehicle)
        types = {
            route.ros_type: route.name for route in case.routes(vehicle) if message_of(route) not in expected.messages
        }
        for ros_type, name in types.items():
            yield case.change(
                name,
                f"'{name}' has the type {ros_type}, which is not in {expected.label}: build the types of the vehicle's "
                "firmware, `msggen build --px4 PX4-Autopilot`",
            )


def find_differing(case: Case) -> Iterator[Change]:
    """Find definitions that differ, by their hashes."""
    for vehicle in case.vehicles:
        expected = case.expected_by(vehicle)
        told: set[str] = set()
        for route in case.routes(vehicle):
            theirs, own = vehicle.hashes.get(route.ros_type), expected.messages.get(message_of(route))
            if theirs is None or own is None or own.message_hash == theirs or route.ros_type in told:
                continue
            if version_of(route.name) == own.version:  # another version is another finding
                told.add(route.ros_type)
                yield case.change(
                    message_of(route),
                    f"'{route.name}': {message_of(route)} has the hash {theirs:#010x} at the vehicle, and "
                    f"{own.message_hash:#010x} in {expected.label}: build the types of its firmware, `msggen build "
                    "--px4 PX4-Autopilot`; in ROS 2, `msggen sync` px4_msgs and build it again",
                )


def find_unsynchronised(case: Case) -> Iterator[Change]:
    """Find vehicles whose timestamps are times since boot."""
    for vehicle in case.alive:
        age = case.age(vehicle)
        if age is not None and not case.has_utc(vehicle) and not vehicle.remote.guid:  # Zenoh has no other times
            yield case.of(
                vehicle,
                "sends times since its boot, not UTC: set its parameter UXRCE_DDS_SYNCT to 1, which synchronizes the "
                "clocks, and restart it",
            )


def find_wrong_clock(case: Case) -> Iterator[Change]:
    """Find vehicles whose clock differs from that of this computer."""
    for vehicle in case.alive:
        age = case.age(vehicle)
        if age is not None and abs(age) > _CLOCK and case.has_utc(vehicle):
            where = "behind" if age > 0 else "ahead of"
            yield case.of(
                vehicle,
                f"sends times {abs(age):.1f} s {where} the clock of this computer: synchronize the clocks of all "
                "computers (chrony), and restart the client after a clock was set",
            )


def find_unsettled_clock(case: Case) -> Iterator[Change]:
    """Find vehicles whose estimate of the difference of both clocks is wrong, by which they convert their times."""
    for vehicle in case.alive:
        error, age = _estimate_error(vehicle), case.age(vehicle)
        if abs(error) > _SETTLED and case.has_utc(vehicle) and age is not None and abs(age) <= _CLOCK:
            yield case.of(
                vehicle,
                f"sends times that are {abs(error) * 1e3:.0f} ms too {'early' if error < 0 else 'late'}: its estimate "
                "of the difference of the clocks takes minutes after its start to become right, and stays wrong in a "
                "simulation that is slower than real time; wait, or correct times by `clock.TimeSync().bridge_error`",
            )


def _estimate_error(vehicle: VehicleSeen) -> float:
    """Return the error of the vehicle's times in s by its exchanges with the agent: at least this, 0 if not known.

    A measured offset is wrong by half of its round trip at most.
    """
    errors = []
    for values in (each.values for each in vehicle.kept("timesync_status")):
        if values.get("source_protocol") == _DDS and values.get("estimated_offset"):
            error = values["observed_offset"] - values["estimated_offset"]
            errors.append(math.copysign(max(0.0, abs(error) - values["round_trip_time"] / 2), error) / 1e6)
    return min(errors, key=abs, default=0.0)


def find_slow(case: Case) -> Iterator[Change]:
    """Find rates far below the limits of dds_topics.yaml: of named topics, or of most topics at once.

    Only topics that PX4 publishes steadily are judged.
    """
    for vehicle in case.alive:
        limits = _limits(case, vehicle)
        slow = [name for name, limit in limits.items() if vehicle.rate(name) < _SLOW * limit]
        rates = few([f"{name} at {vehicle.rate(name):.1f} of {limits[name]:.0f} Hz" for name in slow])
        if case.wanted:
            for name in slow:
                yield case.change(
                    name,
                    f"'{name}' arrives at {vehicle.rate(name):.1f} Hz, and dds_topics.yaml allows {limits[name]:.0f} "
                    "Hz: the link or the vehicle's CPU is too slow; `uorb top` in PX4's shell shows the rate there",
                )
        elif len(slow) > len(limits) / 2:
            yield case.of(
                vehicle,
                f"sends topics at less than half of the rate that dds_topics.yaml allows ({rates}): the link or the "
                "vehicle's CPU is too slow; `uorb top` in PX4's shell shows the rates there",
            )


def _limits(case: Case, vehicle: VehicleSeen) -> dict[str, float]:
    """Return the limits in Hz of the steady topics that are meant and were heard."""
    expected = case.expected_by(vehicle)
    by_stem = {stem_of(topic.name): 1 / topic.interval for topic in expected.topics if topic.interval}
    found = {}
    for route in case.routes(vehicle):
        stem = stem_of(without_namespace(route.name, vehicle.remote.namespace))
        if route.name in vehicle.topics and stem.rpartition("/")[2] in _STEADY and stem in by_stem:
            found[route.name] = by_stem[stem]
    return found


def find_lost(case: Case) -> Iterator[Change]:
    """Find samples that did not arrive, unless the reason is known."""
    if _kernel_drops(case):
        return
    for vehicle in case.vehicles:
        arrived = _messages(case, vehicle)
        if _is_much(vehicle.lost, arrived) and not _line_use(case, vehicle) >= _FULL:
            share = vehicle.lost / (vehicle.lost + arrived)
            cure = (
                "check the wires, and the ground between both sides"
                if case.seen.link_type.is_device
                else "the network loses datagrams: use a cable, or lower rates with rate_limit in dds_topics.yaml"
            )
            yield case.of(
                vehicle, f"has sent {counted(vehicle.lost, 'message')} that did not arrive ({share:.0%}): {cure}"
            )


def _messages(case: Case, vehicle: VehicleSeen) -> float:
    """Return how many messages of a vehicle arrived: what is lost is counted in them, and each can have many samples.

    Each is a datagram. If the link has several vehicles, all have as many samples in a message.
    """
    samples = sum(each.samples for each in case.vehicles)
    datagrams = case.seen.statistics.received
    return vehicle.samples * min(1.0, datagrams / samples) if samples and datagrams else vehicle.samples


def find_full_line(case: Case) -> Iterator[Change]:
    """Find serial lines that are too slow for their topics."""
    for vehicle in case.vehicles:
        use = _line_use(case, vehicle)
        if use >= _FULL:
            cost = _costs(vehicle)
            most = sorted(cost, key=lambda name: -cost[name])[:4]
            shares = ", ".join(f"{name} {cost[name]:,.0f}" for name in most)
            yield case.of(
                vehicle,
                f"sends {sum(cost.values()):,.0f} bytes a second, and {case.seen.baud} baud carries "
                f"{case.seen.baud / 10:,.0f}: raise the speed, or lower rate_limit in dds_topics.yaml; most cost "
                f"{shares}",
            )


def _line_use(case: Case, vehicle: VehicleSeen) -> float:
    """Return the share of a serial line that the samples of a vehicle take, 0 for other links."""
    return (
        sum(_costs(vehicle).values()) / (case.seen.baud / 10)
        if case.seen.link_type.is_device and case.seen.baud
        else 0.0
    )


def _costs(vehicle: VehicleSeen) -> dict[str, float]:
    """Return the bytes a second on a serial line, by topic."""
    seconds = vehicle.seconds
    return {
        name: topic.samples * (topic.size + _OVERHEAD) / seconds
        for name, topic in vehicle.topics.items()
        if seconds > 0
    }


def find_small_buffer(case: Case) -> Iterator[Change]:
    """Find that the kernel had no room for datagrams."""
    if not _kernel_drops(case):
        return
    statistics, limit = case.seen.statistics, case.seen.buffer_limit
    text = f"the kernel dropped {counted(statistics.dropped, 'datagram')}, because the receive buffer of "
    text += f"{statistics.receive_buffer:,} bytes was full: "
    if 0 < limit < _FULL_BUFFER:
        cure = f"`sudo sysctl net.core.rmem_max={_FULL_BUFFER}` allows a larger one (docs/links.md)"
    else:
        cure = "this computer is too busy: end other programs, or lower rate_limit in dds_topics.yaml"
    yield case.change(case.seen.link, text + cure)


def _kernel_drops(case: Case) -> bool:
    statistics = case.seen.statistics
    return case.seen.link_type.has_port and _is_much(statistics.dropped, statistics.received)


def _is_much(lost: int, arrived: float) -> bool:
    return lost >= _FEWEST and lost > _SHARE * (lost + arrived)


def find_reliable(case: Case) -> Iterator[Change]:
    """Find readers that ask for more than PX4's writers offer."""
    for reader in case.seen.readers:
        if reader.is_reliable and "/fmu/out/" in reader.name:
            yield case.change(
                reader.name,
                f"a reader of '{reader.name}' is RELIABLE, and PX4 writes BEST_EFFORT, so it gets nothing: use "
                "qos_profile_sensor_data, or `--qos-reliability best_effort` with ros2 topic",
            )
