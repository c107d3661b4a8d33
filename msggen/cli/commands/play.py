"""`msggen play`: publish a recording as the vehicle did."""

from __future__ import annotations

import argparse
import sys
from math import inf
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted, few, input_error, printable
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.recording_formats import FORMATS
from msggen.cli.commands.record import add_topics, check_packages
from msggen.cli.link import agent_of, link_errors
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_shared, add_value, new_command
from msggen.cli.packages import check_reading, read_errors
from msggen.cli.screen import Status
from msggen.cli.values import KEY, local_path, non_empty, positive, seconds
from msggen.cli.watching import watching
from msggen.link.link_types import CLIENTS, DEFAULT, SIMULATED, usages

if TYPE_CHECKING:
    from msggen.exports.player import Endpoints, Player
    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.choice import Choice
    from msggen.sim.runner import Runner

_REFRESH = 0.5
"""The time in s after which news are printed."""
_NOTICE = 2.0
"""The time in s without a program after which to say so."""


@new_command(
    "play",
    "publish a recording as the vehicle did",
    "Play an MCAP file in place of a vehicle: connect to a program that uses msggen.live, to another "
    "msggen command, or to an agent, as PX4's client does, and publish the recorded samples at their times.",
    epilog=f"Exit codes: 0 done, or ended by Ctrl-C, 1 no program answered, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "file", "FILE", local_path, "recording of `msggen record` or `ros2 bag record`, an MCAP file")
    add_topics(parser, "play")
    text = f"of the agent: {usages(CLIENTS)} (default: where the setting `link` listens, or {DEFAULT})"
    add_value(parser, "--to", "ADDRESS", non_empty, text)
    add_value(parser, "--rate", "FACTOR", positive, "speed (default: 1)", default="1")
    add_flag(parser, "--loop", "begin again at the end")
    add_value(parser, "--start", "SECONDS", seconds, "begin at this time of the recording")
    add_shared(parser, "--for")
    add_value(parser, "--key", "N", KEY, "key of the client, as UXRCE_DDS_KEY (default: 1)", default="1")
    add_shared(parser, "-q, --quiet")
    return _play


def _play(options: argparse.Namespace) -> int:
    check_packages("R102")
    check_reading("R102")
    from msggen.exports.player import Player, endpoints_of
    from msggen.recordings.log import opening
    from msggen.recordings.source.source import RecordingError

    options.to = agent_of(options, options.to)
    _check_client(options.to)
    with read_errors(options.file):
        recording = opening.open(options.file)
    if options.start and options.start * 1e9 > recording.end - recording.start:
        options.parser.error(f"argument --start: the recording has {(recording.end - recording.start) / 1e9:.1f} s")
    endpoints = endpoints_of(recording, _choice(options, recording), options.key)
    if endpoints.left_out:
        names, most = printable(few(endpoints.left_out)), len(endpoints.writers)
        text = f"not played, because a vehicle has room for {counted(most, 'topic')}: name those to play"
        print(f"warning: {names}: {text}", file=sys.stderr, flush=True)
    try:
        player = Player(recording, endpoints, rate=options.rate, start=options.start or 0.0, is_repeated=options.loop)
        if not options.quiet:
            print(f"{options.file}: {_contents(recording, endpoints)}; to {options.to}", flush=True)
        runner = _runner(options, player)
        try:
            with watching():
                _run(runner, player, options)
        finally:
            runner.close()
    except RecordingError as error:
        raise input_error(options.file, "R102", str(error), 0) from None
    if not options.quiet:
        print(f"{counted(player.sent, 'sample')} sent, {player.received} received")
    if player.is_answered:
        return DONE
    print(f"no program answered at {options.to}: nothing was played", file=sys.stderr)
    return FINDINGS


def _choice(options: argparse.Namespace, recording: Log) -> Choice:
    """Return the topics to play. Ends the process, or raises InputError, if there is none."""
    from msggen.exports.player import is_played
    from msggen.recordings.topics.choice import Choice

    played = [(topic.recorded_name, topic.ros_type) for topic in recording.topics if is_played(topic)]
    choice = Choice(options.topics, options.exclude)
    if FORMATS[recording.kind].is_of_vehicle:
        raise input_error(options.file, "R102", "is a ULog, which cannot be played: convert it to MCAP first", 0)
    if not played:
        raise input_error(options.file, "R102", "has no samples of topics that PX4 publishes, /fmu/out/...", 0)
    problem = choice.problem(played).replace("no topic is called", "not in this recording:", 1)
    if problem or not any(choice.takes(*topic) for topic in played):
        names = few([name for name, _ in played])
        options.parser.error(
            f"argument TOPIC: {f'{problem}; it has {names}' if problem else 'all topics are left out'}"
        )
    return choice


def _contents(recording: Log, endpoints: Endpoints) -> str:
    duration = (recording.end - recording.start) / 1e9
    is_cut = any(each.offset is not None or each.size or each.samples for each in recording.problems)
    cut = " (cut off or damaged)" if is_cut else ""
    return f"{counted(len(endpoints.writers), 'topic')} of {endpoints.release}, {duration:.1f} s{cut}"


def _check_client(address: str) -> None:
    """Raise an InputError for a Zenoh router, to which vehicles connect, but no clients of DDS-XRCE."""
    if any(address.lower().startswith(f"{scheme}:") for scheme in SIMULATED if scheme not in CLIENTS):
        text = f"'{address}': a recording is played as by a client of DDS-XRCE, which is not on Zenoh: let a program "
        raise input_error("--to", "L101", f"{text}listen on a link such as {DEFAULT}, and name that", 0)


def _runner(options: argparse.Namespace, player: Player) -> Runner:
    from msggen.sim.runner import Runner
    from msggen.sim.transport import read_address

    try:
        with link_errors(options.to, has_owner=False):
            return Runner([player], read_address(options.to))
    except ValueError as error:
        raise input_error("--to", "L101", str(error), 0) from None


def _run(runner: Runner, player: Player, options: argparse.Namespace) -> None:
    """Run until all is sent or the time is over, and print what happens."""
    end = runner.now + (options.seconds or inf) * 1e6
    notice = None if options.quiet else runner.now + _NOTICE * 1e6
    status = Status(is_quiet=options.quiet)

    def elapsed() -> str:
        return f"{(runner.now - runner.boot) / 1e6:8.2f} s"

    try:
        with link_errors(options.to, has_owner=False):
            while not player.is_done and runner.now < end:
                runner.serve(min(_REFRESH, (end - runner.now) / 1e6), lambda: player.is_done)
                if player.changes:
                    notice = None
                elif notice is not None and runner.now >= notice:
                    notice = None
                    text = f"no program answers at {options.to}: waiting for one, such as `msggen topic list`"
                    print(text, file=sys.stderr, flush=True)
                changes = [f"{elapsed()}  {player.changes.popleft()}" for _ in range(len(player.changes))]
                status.show(*changes, state=lambda: f"{elapsed()}  {counted(player.sent, 'sample')} sent")
    finally:
        status.show()
