"""The commands that programs send to a vehicle: whether it takes them for its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msggen.base.diagnostics import few
from msggen.check.finding import Change
from msggen.doctor.case import Case, message_of
from msggen.doctor.observation import InputSeen, SampleSeen, VehicleSeen
from msggen.doctor.setpoints import means_inputs

_MESSAGE = "VehicleCommand"
_ACKNOWLEDGEMENT = "vehicle_command_ack"
_ANY = 0
"""The id that addresses every system, or every component of one (MAVLink)."""


class Misaddressed(NamedTuple):
    """A command that a vehicle ignores, because it is for another system or component."""

    topic: str
    senders: str
    number: int
    what: str
    """`system` or `component`."""
    target: int
    own: int


def misaddressed(case: Case, vehicle: VehicleSeen) -> list[Misaddressed]:
    """Return the commands of which no sample is for this vehicle.

    One for another component counts if nobody has acknowledged it: a gimbal or a camera does.
    """
    status = vehicle.state("vehicle_status")
    if not (means_inputs(case, vehicle) and "system_id" in status):
        return []
    found = []
    for topic, seen in _commands(vehicle):
        for number in dict.fromkeys(sample.values["command"] for sample in seen.last if "command" in sample.values):
            samples = [sample for sample in seen.last if sample.values.get("command") == number]
            for what in ("system", "component"):
                own, target = status.get(f"{what}_id", _ANY), samples[-1].values.get(f"target_{what}", _ANY)
                is_foreign = all(sample.values.get(f"target_{what}") not in (_ANY, own, None) for sample in samples)
                if is_foreign and (what == "system" or _is_unanswered(vehicle, samples)):
                    senders = few([str(each) for each in seen.programs]) or "an unknown program"
                    found.append(Misaddressed(topic, senders, number, what, target, own))
                    break
    return found


def _commands(vehicle: VehicleSeen) -> Iterator[tuple[str, InputSeen]]:
    """Yield the topics of commands that programs have published, also before the doctor looked."""
    for route in vehicle.routes:
        if route.direction == "in" and message_of(route) == _MESSAGE and route.name in vehicle.inputs:
            yield route.name, vehicle.inputs[route.name]


def _is_unanswered(vehicle: VehicleSeen, samples: list[SampleSeen]) -> bool:
    """Whether a vehicle publishes acknowledgements, which v1.14 does not, and none of this command."""
    publishes = any(f"/{_ACKNOWLEDGEMENT}" in route.name for route in vehicle.routes)
    number = samples[-1].values["command"]
    return publishes and all(each.values.get("command") != number for each in vehicle.kept(_ACKNOWLEDGEMENT))


def find_misaddressed(case: Case) -> Iterator[Change]:
    """Find commands that the vehicle ignores, because they are for another one."""
    for vehicle in case.alive:
        for topic, senders, number, what, target, own in misaddressed(case, vehicle):
            why = (
                f"and this vehicle is system {own} (MAV_SYS_ID) and ignores it"
                if what == "system"
                else f"which has not acknowledged it, and PX4 is component {own}"
            )
            yield case.change(
                topic,
                f"'{topic}' from {senders} has command {number} for {what} {target}, {why}: set "
                f"`target_{what}` to {own}, or to {_ANY} for every {what}",
            )
