"""`msggen mcp`: a server for assistants."""

from __future__ import annotations

import argparse
import os
import signal
from collections.abc import Sequence
from typing import Any

from msggen.base.diagnostics import input_error
from msggen.base.disk.urls import is_address
from msggen.cli.link import add_link
from msggen.cli.logs import log_to_stderr
from msggen.cli.options import FAILED_CODES, Run, add_value, new_command
from msggen.cli.packages import check_reading, needing
from msggen.cli.pictures import import_matplotlib
from msggen.cli.values import recording


@new_command(
    "mcp",
    "serve an assistant: definitions, recordings, findings, plots, and what is wrong on a link",
    "Serve an assistant by the Model Context Protocol on standard input and output. It reads: "
    "definitions, recordings below the folders that are named, and what a vehicle sends. It writes, publishes and "
    "arms nothing. Assistants start it by themselves.",
    epilog=f"Exit codes: 0 ended by the assistant, {FAILED_CODES} It needs the extra `mcp`.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    text = "folder, recording or address, s3://BUCKET/PREFIX, with all that may be read (default: no recordings)"
    add_value(parser, "places", "FOLDER", recording, text, nargs="*")
    add_link(parser)
    return _mcp


def _mcp(options: argparse.Namespace) -> None:
    for each in options.places:
        if not (is_address(each) or os.path.exists(each)):
            raise input_error(each, "R102", "cannot be read: there is no such folder", 0)
    with needing("mcp", "L111"):
        import mcp  # noqa: F401
    check_reading("L111", "mcp")
    import_matplotlib("L111", "mcp")
    from msggen.cli.commands.doctor import report_on
    from msggen.cli.commands.log.info import object_of
    from msggen.mcp.server import Commands, make_server
    from msggen.show.report.json import report_object

    def doctor(topics: Sequence[str], seconds: float) -> dict[str, Any]:
        return report_object(report_on(options, topics, seconds))

    log_to_stderr("mcp")
    server = make_server(options.places, options.px4 or "", Commands(object_of, doctor))
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)  # a thread of the SDK waits for a line until one comes
    try:
        server.run()
    finally:
        signal.signal(signal.SIGINT, before)
