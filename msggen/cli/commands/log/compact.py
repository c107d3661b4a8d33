"""`msggen log compact`."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted
from msggen.base.exit_codes import DONE
from msggen.cli.commands.log.fleet import fleet_errors
from msggen.cli.commands.log.progress import progress_bar
from msggen.cli.options import FAILED_CODES, Commands, add_command, add_shared
from msggen.cli.packages import missing_extra
from msggen.cli.printing import number_of_bytes
from msggen.cli.values import new_recording
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.exports.fleet import Compacted


def add_to(actions: Commands) -> None:
    """Add the action to `msggen log`."""
    parser = add_command(
        actions,
        "compact",
        _compact,
        help="make large files of the small ones of a fleet",
        description="Make large files of the small ones that runs of `msggen log convert` have added to a fleet "
        "(docs/fleet.md). The rows stay the same.",
        epilog=f"Exit codes: 0 done, {FAILED_CODES}",
    )
    parser.add_argument(
        "fleet", metavar="FLEET", type=new_recording, help="folder or address that `msggen log convert` has written"
    )
    add_shared(parser, "--json", "-q, --quiet")


def _compact(options: argparse.Namespace) -> int:
    done = _compacted(options)
    if options.json:
        print(dump(done._asdict()))
    elif not options.quiet:
        print(f"{options.fleet}: {_line(done)}")
    return DONE


def _compacted(options: argparse.Namespace) -> Compacted:
    """Compact a fleet. Raises InputError."""
    try:
        import pyarrow  # noqa: F401, ICN001

        from msggen.exports.fleet import compact
    except ImportError as error:
        raise missing_extra(error, "recordings", "R150") from None
    with progress_bar(options) as show, fleet_errors(options.fleet):
        return compact(options.fleet, progress=show)


def _line(done: Compacted) -> str:
    """Return the result for people."""
    if not done.topics:
        return f"nothing to do: {counted(done.files, 'file')}, {number_of_bytes(done.bytes)}"
    before = f"{counted(done.files_before, 'file')}, {number_of_bytes(done.bytes_before)}"
    return f"{before}, became {counted(done.files, 'file')}, {number_of_bytes(done.bytes)}"
