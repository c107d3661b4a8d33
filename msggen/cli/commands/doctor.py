"""`msggen doctor`, and `msggen check --live`: why nothing arrives from a vehicle, and whether its definitions match."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING

from msggen.base.diagnostics import input_error
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.chosen_types import known_types
from msggen.cli.link import add_link, link_errors, link_of
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_output_format, add_shared, add_value, new_command
from msggen.cli.packages import import_package
from msggen.cli.printing import print_notices, print_report
from msggen.cli.source_options import settings_of
from msggen.cli.values import non_empty
from msggen.sources.embedded import EMBEDDED

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from types import ModuleType

    from msggen.check.finding import Report
    from msggen.doctor.expected import Expected
    from msggen.doctor.observation import Observation
    from msggen.link.address import Address
    from msggen.sources.finding import Sources
    from msggen.vehicle.selection import Selection

_FOR_PEOPLE = ("full", "concise")
_SECONDS = 5.0
_LEAST = 1.0
"""The time in s for which `check --live` watches a vehicle. It goes on until the vehicle has told its definitions."""


@new_command(
    "doctor",
    "find out why nothing arrives from a vehicle, or why it does not follow setpoints",
    f"Watch a link to a vehicle, by default for {_SECONDS:g} s, and say why nothing arrives, or not "
    "what a program expects, or why the vehicle does not follow setpoints: the port, agents, the session, names, "
    "definitions, times, rates, losses, and what programs send, in this order. Nothing is changed at the vehicle.",
    epilog="Examples: `msggen doctor`, `msggen doctor /fmu/out/vehicle_status`, `msggen doctor --types px4_types "
    f"--link dds://0`. Exit codes: 0 nothing found, 1 findings, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = (
        "topic that does not arrive, as the program has it, such as /fmu/out/vehicle_status, vehicle_status or "
        "VehicleStatus; or a topic that the vehicle reads, such as trajectory_setpoint (default: all)"
    )
    add_value(parser, "topics", "TOPIC", non_empty, text, nargs="*")
    add_shared(parser, "--for")
    add_link(parser)
    add_output_format(parser)
    add_shared(parser, "--json")
    add_flag(parser, "-v, --verbose", "list all topics and definitions that differ, if the vehicle has another release")
    return _doctor


def _doctor(options: argparse.Namespace) -> int:
    options.output_format = "json" if options.json else options.output_format
    is_brief = options.output_format in _FOR_PEOPLE and not options.verbose
    report = report_on(options, options.topics, options.seconds or _SECONDS, is_brief=is_brief)
    print_report(report, options)
    return FINDINGS if report.fails else DONE


def report_on(options: argparse.Namespace, topics: Sequence[str], seconds: float, *, is_brief: bool = False) -> Report:
    """Watch the link that the options of `add_link` name, and return what is wrong on it. Raises InputError.

    With `is_brief`, findings that follow from another release of the vehicle are left out.
    """
    from msggen.doctor.case import Case
    from msggen.doctor.decoding import decoded
    from msggen.doctor.diagnose import diagnose
    from msggen.doctor.watching import look_around

    own = _of_package_without_topics(options)
    given = None if own else known_types(options)
    address = _address(options)
    seen = _observe(options, address, seconds)
    seen = look_around(seen, address._replace(port=seen.port))
    seen = decoded(seen, lambda vehicle: _packages(given and given.package, vehicle.release))
    expected: Mapping[int, Expected]
    if own is not None:
        expected = dict.fromkeys((each.remote.number for each in seen.vehicles), own)
    elif given is None:
        expected = {each.remote.number: _embedded(each.release) for each in seen.vehicles}
    else:
        from msggen.doctor.expected import expected_of

        numbers = (each.remote.number for each in seen.vehicles)
        expected = dict.fromkeys(numbers, expected_of(given.package, given.label, is_given=True))
    return diagnose(Case(seen, expected, tuple(topics), _selection(options)), is_brief=is_brief)


def _address(options: argparse.Namespace) -> Address:
    from msggen.link.address import parse_address

    return parse_address(link_of(options))


def _selection(options: argparse.Namespace) -> Selection:
    from msggen.vehicle.selection import Selection

    namespace = options.namespace
    return Selection(options.key, None if namespace is None else namespace.strip("/"))


def _observe(options: argparse.Namespace, address: Address, seconds: float) -> Observation:
    """Watch the link. Raises InputError if it cannot be opened."""
    from msggen.doctor.watching import Plan, observe

    def tell(opened: Address) -> None:
        print(f"waiting for a vehicle on {opened}", file=sys.stderr, flush=True)

    plan = Plan(seconds, allow=options.allow, is_direct=options.direct)
    with link_errors(str(address), has_owner=False):
        return observe(address, plan._replace(wait=options.wait) if options.wait else plan, tell)


def _packages(given: ModuleType | None, release: str) -> Iterator[ModuleType]:
    """Yield the packages that may have the definitions of a vehicle."""
    from msggen.generate.cache import package_of

    if given is not None:
        yield given
    if release:
        yield package_of(release)


def _of_package_without_topics(options: argparse.Namespace) -> Expected | None:
    """Return what --px4 expects, or an installed package of the settings, if it tells no topics, as px4_msgs. Or None.

    Raises InputError.
    """
    from msggen.sources.finding import find_sources
    from msggen.sources.installed import names_installed

    px4 = options.px4
    if not (px4 or options.types):
        settings = settings_of(options)
        px4 = settings.px4 if not settings.types and settings.px4 and names_installed(settings.px4) else None
    sources = find_sources(px4) if px4 else None
    return _of_sources(sources) if sources and not sources.bridge and sources.has_own else None


def _embedded(release: str) -> Expected:
    from msggen.doctor.expected import expected_of
    from msggen.generate.cache import package_of

    name = release or EMBEDDED[0]
    return expected_of(package_of(name), f"PX4 {name}", is_given=False)


# check --live


def check_live(options: argparse.Namespace, sources: Sources | None) -> int:
    """Compare the definitions of a vehicle with those of sources, by default those of the generated package `side`.

    Raises InputError if there is no vehicle, or if it does not tell its definitions.
    """
    from dataclasses import replace

    from msggen.doctor.case import Case
    from msggen.doctor.diagnose import diagnose
    from msggen.doctor.rules import LIVE

    expected = _of_sources(sources) if sources else _of_package(options.side)
    address = _address(options)
    seen = _observe(options, address, _LEAST)
    case = Case(seen, dict.fromkeys((each.remote.number for each in seen.vehicles), expected), (), _selection(options))
    if seen.is_taken or not any(each.routes for each in case.vehicles):
        what = "it is in use" if seen.is_taken else f"no vehicle has created its topics within {seen.waited:.0f} s"
        raise input_error(str(address), "L104", f"{what}: `msggen doctor --link {address}` finds out why", 0)
    if not all(each.hashes for each in case.vehicles):
        text = "the vehicle does not tell its definitions: firmware before v1.15 cannot, and later firmware needs"
        raise input_error(str(address), "L104", f"{text} message_format_request in its dds_topics.yaml", 0)
    report = diagnose(case, LIVE)
    told = min(len(each.hashes) for each in case.vehicles)
    verdict = "differs from" if report.fails else "matches"
    summary = f"{expected.label} {verdict} the vehicle on {address}: {told} definitions compared"
    print_report(replace(report, previous=str(address), current=expected.label, summary=summary), options)
    return FINDINGS if report.fails else DONE


def _of_sources(sources: Sources) -> Expected:
    from msggen.doctor.expected import expected_of_catalog
    from msggen.sources.catalog import COMPARABLE, read_catalog

    print_notices(sources.notices)
    return expected_of_catalog(read_catalog(sources, tolerated=COMPARABLE), sources.label)


def _of_package(text: str) -> Expected:
    from msggen.doctor.expected import expected_of

    return expected_of(import_package(os.path.abspath(text)), text, is_given=False)
