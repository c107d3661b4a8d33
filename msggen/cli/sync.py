"""`msggen sync`: a ROS 2 package in step with the firmware."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

from msggen.cli.common import (
    DONE,
    FINDINGS,
    Commands,
    add_command,
    add_source_options,
    firmware_of,
    given,
    print_diff,
    print_notices,
)
from msggen.settings import read_settings

if TYPE_CHECKING:
    from msggen.sync.contents import PackageContents
    from msggen.sync.plan import SyncPlan

_VERBS = {True: ("added", "changed", "removed"), False: ("to add", "to change", "to remove")}
"""What is done to definitions, by whether it was, or only would be."""

_MANY = 20
"""More changes of nothing but comments are told by their number."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "sync",
        _sync,
        writes=True,
        help="bring a ROS 2 package such as px4_msgs in step with the firmware",
        description="Make msg/ and srv/ of a ROS 2 package what the firmware has. PackageContents that are not the "
        "firmware's, and everything else in the package, stay as they are. A new package may be made without a source, "
        "from the embedded set.",
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
    settings = read_settings(".")
    is_named = options.px4 or options.msg_dir or settings.px4 or settings.msg_dir
    if not is_named and os.path.lexists(os.path.join(options.target, "package.xml")):
        text = "name the firmware with --px4 or the setting px4"
        options.parser.error(f"{text}: '{options.target}' exists, the embedded set is for a new package only")
    sources = firmware_of(options, settings)
    from msggen.sync.contents import read_contents
    from msggen.sync.run import sync
    from msggen.sync.target import Request

    writes = not (options.dry_run or options.diff)
    definitions = read_contents(sources, options.package, topics_only=options.topics_only)
    plan = sync(sources, definitions, Request(options.target, options.package, options.create), write=writes)
    print_notices(definitions.notices, quiet=options.quiet)
    if options.diff:
        _print_diffs(plan)
    if not options.quiet:
        if not (options.diff or plan.target.is_new):
            _print_list(plan, definitions, writes=writes)
        print(_summary(plan, sources.label, writes=writes))
    return FINDINGS if plan.is_stale and not writes else DONE


def _summary(plan: SyncPlan, label: str, *, writes: bool) -> str:
    """Return in a line what was done, or what there would be to do."""
    target = plan.target
    path = target.name if os.path.normpath(target.path) == os.curdir else target.path
    if not plan.is_stale:
        return f"{path} is in step with {label}: {len(plan.unchanged)} definitions"
    if target.is_new:
        name = "" if os.path.basename(target.folder) == target.name else f"package {target.name}, "
        return f"{path} {'made' if writes else 'would be made'} from {label}: {name}{len(plan.files)} definitions"
    names = (plan.added, (*plan.changed, *plan.scaffold), plan.removed, plan.unchanged, plan.left_alone)
    verbs = (*_VERBS[writes], "unchanged", "left alone")
    counts = ", ".join(f"{len(each)} {verb}" for each, verb in zip(names, verbs, strict=True) if each)
    return f"{path} {'from' if writes else 'is out of step with'} {label}: {counts}"


def _print_list(plan: SyncPlan, definitions: PackageContents, *, writes: bool) -> None:
    """Print the changes one by one, with the topics that they touch."""
    from msggen.sync.change import COMMENTS, WHITE_SPACE, describe_change

    added, changed, removed = (verb.ljust(len(_VERBS[writes][1])) for verb in _VERBS[writes])
    how = {name: describe_change(name, plan.before[name], plan.files[name]) for name in plan.changed}
    numbers = {what: list(how.values()).count(what) for what in (COMMENTS, WHITE_SPACE)}
    folded = {what: number for what, number in numbers.items() if number > _MANY}
    listed = [(added, name) for name in plan.added]
    listed += [(changed, name) for name in plan.changed if how[name] not in folded]
    listed += [(changed, name) for name in plan.scaffold]
    for what, number in folded.items():
        listed.append((changed, f"{number} definitions: {what}"))
    listed += [(removed, name) for name in plan.removed]
    for verb, name in listed:
        about = "; ".join(filter(None, (how.get(name), " ".join(definitions.topics.get(name, ())))))
        print(f"{verb} {name}{': ' if about else ''}{about}")
    if plan.left_alone:
        print(f"left alone, not the firmware's: {', '.join(plan.left_alone)}")


def _print_diffs(plan: SyncPlan) -> None:
    from msggen.sync.plan import read_if_file

    after = {**plan.files, **plan.scaffold}
    for name in (*plan.added, *plan.changed, *plan.removed, *plan.scaffold):
        path = os.path.normpath(plan.target.place(name))
        print_diff(path, read_if_file(path), after.get(name))
