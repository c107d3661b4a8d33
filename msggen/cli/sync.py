"""`msggen sync`: a ROS 2 package in step with the firmware."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.cli.common import DONE, FINDINGS, Commands, add_command, add_source_options, given, print_diff, sources_of
from msggen.settings import read_settings

if TYPE_CHECKING:
    from msggen.package.definitions import Definitions
    from msggen.package.plan import Plan


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "sync",
        _sync,
        writes=True,
        help="bring a ROS 2 package such as px4_msgs in step with the firmware",
        description="Make msg/ and srv/ of a ROS 2 package what the firmware has. Definitions that are not the "
        "firmware's, and everything else in the package, stay as they are. Without a source, from the embedded set.",
        epilog="Exit codes: 0 done, 1 out of step (--dry-run, --diff), 2 usage, input or I/O error. "
        "Sources may stand in [tool.msggen] of pyproject.toml.",
    )
    parser.add_argument("target", metavar="PKG", type=given, help="folder of the package")
    add_source_options(parser)
    package = parser.add_argument_group("package")
    package.add_argument("--create", action="store_true", help="make a whole package where there is none")
    package.add_argument(
        "--package", metavar="NAME", type=given, default="px4_msgs", help="name of the ROS package (px4_msgs)"
    )
    package.add_argument(
        "--topics-only", action="store_true", help="only what crosses the bridge, what that nests, and services"
    )
    package.add_argument(
        "--dry-run", action="store_true", help="write nothing; say what would change, exit 1 if anything"
    )
    package.add_argument("--diff", action="store_true", help="write nothing; show the changes, exit 1 if any")
    parser.add_argument("-q", "--quiet", action="store_true", help="say nothing but what is wrong")


def _sync(options: argparse.Namespace) -> int:
    sources = sources_of(options, read_settings("."))
    from msggen.package.definitions import read_definitions
    from msggen.package.sync import sync
    from msggen.package.target import Request

    writes = not (options.dry_run or options.diff)
    definitions = read_definitions(sources, options.package, topics_only=options.topics_only)
    plan = sync(sources, definitions, Request(options.target, options.package, options.create), write=writes)
    if options.diff:
        _print_diffs(plan)
    if not options.quiet:
        print("\n".join(_report(plan, definitions, sources.label, writes=writes)))
    return FINDINGS if plan.is_stale and not writes else DONE


def _report(plan: Plan, definitions: Definitions, label: str, *, writes: bool) -> Iterator[str]:
    """Say what was done, or what there would be to do: the changes one by one, then how many."""
    path = plan.target.path
    if not plan.target.is_new:
        yield from _changes(plan, definitions, writes=writes)
    if plan.left_alone:
        yield f"left alone, not the firmware's: {', '.join(plan.left_alone)}"
    if not plan.is_stale:
        yield f"{path} is in step with {label}: {len(plan.unchanged)} definitions"
    elif plan.target.is_new:
        yield f"{path} {'made' if writes else 'would be made'} from {label}: {len(plan.files)} definitions"
    else:
        counts = [(len(plan.added), "added"), (len(plan.changed), "changed"), (len(plan.removed), "removed")]
        would = "" if writes else "would be "
        changes = ", ".join(f"{number} {would}{verb}" for number, verb in counts)
        yield f"{path} from {label}: {changes}, {len(plan.unchanged)} unchanged, {len(plan.left_alone)} left alone"


def _changes(plan: Plan, definitions: Definitions, *, writes: bool) -> Iterator[str]:
    from msggen.package.change import describe_change

    would = "" if writes else "would be "
    for verb, names in (("added", plan.added), ("changed", plan.changed), ("removed", plan.removed)):
        for name in names:
            how = describe_change(name, plan.before[name], plan.files[name]) if verb == "changed" else ""
            topics = " ".join(definitions.topics.get(name, ()))
            yield f"{would}{verb:7} {name}{': ' if how or topics else ''}{'; '.join(filter(None, (how, topics)))}"
    for name in plan.scaffold:
        yield f"{would}{'changed':7} {name}"


def _print_diffs(plan: Plan) -> None:
    from msggen.package.plan import read_if_file

    after = {**plan.files, **plan.scaffold}
    for name in (*plan.added, *plan.changed, *plan.removed, *plan.scaffold):
        path = plan.target.place(name)
        print_diff(path, read_if_file(path) or b"", after.get(name, b""))
