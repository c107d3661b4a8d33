"""`msggen sync`: update a ROS 2 package from the firmware."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.location import Location
from msggen.cli.options import (
    WRITING_CODES,
    Run,
    add_flag,
    add_shared,
    add_sources,
    add_value,
    new_command,
    writes,
)
from msggen.cli.printing import print_diff, print_notices
from msggen.cli.source_options import firmware_of, is_named, settings_of
from msggen.cli.values import local_path, non_empty
from msggen.sources.settings import Settings

if TYPE_CHECKING:
    from msggen.generate.sync.contents import PackageContents
    from msggen.generate.sync.plan import SyncPlan
    from msggen.generate.sync.target import Request

_VERBS = {True: ("added", "changed", "removed"), False: ("to add", "to change", "to remove")}
"""Verbs for changes that were written (True), or would be (False)."""

_MANY = 20
"""The largest number of changes of only comments, or only white space, that are listed one by one."""


@new_command(
    "sync",
    "bring a ROS 2 package such as px4_msgs up to date",
    "Copy the definitions of the firmware into msg/ and srv/ of a ROS 2 package. Your own definitions "
    "and all other files of the package are not changed. Without a source, only a new package can be created, from "
    "the newest embedded release.",
    epilog=f"{WRITING_CODES} Sources and ros-package can be set in [tool.msggen] of pyproject.toml.",
    writes=True,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "target", "PKG", local_path, "folder of the package")
    add_sources(parser)
    package = parser.add_argument_group("package")
    add_flag(package, "--create", "create the package if it does not exist")
    text = "name of the ROS package (default: that of the folder for a new package, px4_msgs for another)"
    add_value(package, "--ros-package", "NAME", non_empty, text)
    add_shared(package, "--topics-only", "--check", "--diff")
    add_shared(parser, "-q, --quiet")
    return _sync


def _sync(options: argparse.Namespace) -> int:
    settings = settings_of(options)
    if not is_named(options, settings) and os.path.lexists(os.path.join(options.target, "package.xml")):
        text = "the embedded definitions are only for a new package"
        options.parser.error(f"'{options.target}' exists, and {text}: name the firmware with --px4 or the setting px4")
    sources = firmware_of(options, settings)
    from msggen.base.disk.record import read_record
    from msggen.generate.sync.contents import read_contents
    from msggen.generate.sync.run import sync

    write = writes(options)
    request = _request(options, settings)
    known = read_record(options.target)
    topics_only = known.topics_only if options.topics_only is None else options.topics_only
    definitions = read_contents(sources, request.name, topics_only=topics_only)
    plan = sync(sources, definitions, request, write=write)
    print_notices(definitions.notices, quiet=options.quiet)
    if options.diff:
        _print_diffs(plan)
    if not options.quiet:
        if not (options.diff or plan.target.is_new):
            _print_list(plan, definitions, write=write)
        if plan.target.is_new and not (options.ros_package or settings.ros_package):
            _print_name(plan.target.name)
        print(_summary(plan, sources.label, write=write))
    return FINDINGS if plan.is_stale and not write else DONE


def _request(options: argparse.Namespace, settings: Settings) -> Request:
    """Return the package that the options or else the settings name."""
    from msggen.generate.sync.target import Request, default_name

    name = options.ros_package or settings.ros_package or default_name(options.target, create=options.create)
    place = Location("--ros-package", 0) if options.ros_package else settings.place("ros-package")
    return Request(options.target, name, options.create, place)


def _summary(plan: SyncPlan, label: str, *, write: bool) -> str:
    """Return the line that summarizes the changes made, or without `write` the changes to make."""
    target = plan.target
    path = target.name if os.path.normpath(target.path) == os.curdir else target.path
    if not plan.is_stale:
        return f"{path} is up to date with {label}: {counted(len(plan.unchanged), 'definition')}"
    if target.is_new:
        name = "" if os.path.basename(target.folder) == target.name else f"package {target.name}, "
        done, number = "created" if write else "would be created", counted(len(plan.files), "definition")
        return f"{path} {done} from {label}: {name}{number}"
    names = (plan.added, (*plan.changed, *plan.scaffold), plan.removed, plan.unchanged, plan.left_alone)
    verbs = (*_VERBS[write], "unchanged", "kept")
    counts = ", ".join(f"{len(each)} {verb}" for each, verb in zip(names, verbs, strict=True) if each)
    return f"{path} {'updated from' if write else 'differs from'} {label}: {counts}"


def _print_name(name: str) -> None:
    """Print what follows from the name of a new package, which its folder gave it."""
    from msggen.definitions.model import DEFAULT_PACKAGE

    if name != DEFAULT_PACKAGE:
        print(
            f"the package is named '{name}' after its folder, so its types are {name}/msg/...: PX4's topics have "
            f"{DEFAULT_PACKAGE}/msg/..., for which --ros-package {DEFAULT_PACKAGE} creates it"
        )


def _print_list(plan: SyncPlan, definitions: PackageContents, *, write: bool) -> None:
    """Print each change, with the topics that carry the message."""
    from msggen.generate.sync.change import COMMENTS, WHITE_SPACE, describe_change

    added, changed, removed = (verb.ljust(len(_VERBS[write][1])) for verb in _VERBS[write])
    how = {name: describe_change(name, plan.before[name], plan.files[name]) for name in plan.changed}
    numbers = {change: list(how.values()).count(change) for change in (COMMENTS, WHITE_SPACE)}
    folded = {change: number for change, number in numbers.items() if number > _MANY}
    listed = [(added, name) for name in plan.added]
    listed += [(changed, name) for name in plan.changed if how[name] not in folded]
    listed += [(changed, name) for name in plan.scaffold]
    for change, number in folded.items():
        listed.append((changed, f"{counted(number, 'definition')}: {change}"))
    listed += [(removed, name) for name in plan.removed]
    for verb, name in listed:
        about = "; ".join(filter(None, (how.get(name), " ".join(definitions.topics.get(name, ())))))
        print(f"{verb} {name}{': ' if about else ''}{about}")
    if plan.left_alone:
        print(f"kept, not in the firmware: {', '.join(plan.left_alone)}")


def _print_diffs(plan: SyncPlan) -> None:
    from msggen.generate.sync.plan import read_if_file

    after = {**plan.files, **plan.scaffold}
    for name in (*plan.added, *plan.changed, *plan.removed, *plan.scaffold):
        path = os.path.normpath(plan.target.place(name))
        print_diff(path, read_if_file(path), after.get(name))
