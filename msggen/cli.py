"""The command line: arguments, settings and exit codes; everything it does is done elsewhere.

argparse on purpose: larger libraries take longer to import than a build with nothing to do (docs/libraries.md).
"""

from __future__ import annotations

import argparse
import keyword
import os
import sys
import time
from collections.abc import Iterator, Sequence

from msggen import __version__
from msggen.diagnostics import Diagnostic, InputError, fault, suggestion
from msggen.firmware.source import Sources, find_sources
from msggen.generate.build import Build, Outcome, depfile, write_if_changed
from msggen.generate.output import Plan
from msggen.location import Location
from msggen.settings import Settings, read_settings

DONE, FINDINGS, FAILED = 0, 1, 2
"""Exit codes: all well, something found, and usage, input or I/O errors."""


_FEW = 10
"""So many stale files are named without being asked for."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    try:
        options, unknown = _parser().parse_known_args(arguments)
        if unknown:
            options.parser.error(f"unknown argument '{unknown[0]}'{suggestion(unknown[0], options.known)}")
        return int(options.run(options))
    except InputError as error:
        _print_faults(error.diagnostics)
        return FAILED
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - who read us has left: say no more
        return FINDINGS
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"msggen: {place}{error.strerror or error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("msggen: interrupted, nothing is half-written", file=sys.stderr)
        return FAILED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="msggen",
        description="PX4's message definitions in; Python types, CDR codecs and a topic registry out.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"msggen {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    build = commands.add_parser(
        "build",
        help="generate a Python package from message definitions",
        description="Generate a Python package from message definitions; without a source, from the embedded set.",
        epilog="Exit codes: 0 done, 1 findings (--check, --diff), 2 usage, input or I/O error. "
        "Options may stand in [tool.msggen] of pyproject.toml.",
        allow_abbrev=False,
    )
    source = build.add_argument_group("sources")
    source.add_argument(
        "--px4", metavar="PATH", type=_given, help="PX4-Autopilot tree, px4_msgs package or folder of .msg files"
    )
    source.add_argument(
        "--msg-dir",
        metavar="DIR",
        type=_given,
        action="append",
        help="further .msg files, as of external modules; repeatable",
    )
    source.add_argument(
        "--topics", metavar="FILE", type=_given, help="dds_topics.yaml to use instead of the tree's own"
    )
    source.add_argument(
        "--release", type=_given, help="conventions to follow, not those the tree shows: v1.14 to v1.17, main"
    )
    output = build.add_argument_group("output")
    output.add_argument("-o", "--output", metavar="DIR", type=_given, help="folder to put the package into (generated)")
    output.add_argument("--package", metavar="NAME", type=_given, help="name of the Python package (px4_types)")
    output.add_argument("--check", action="store_true", help="write nothing; exit 1 when the package is stale")
    output.add_argument("--diff", action="store_true", help="write nothing; show the changes, exit 1 if any")
    output.add_argument(
        "--depfile", metavar="FILE", type=_given, help="write a Makefile rule with all inputs, for CMake and Ninja"
    )
    output.add_argument("--list-outputs", action="store_true", help="write nothing; list the files of the package")
    loudness = build.add_mutually_exclusive_group()
    loudness.add_argument("-q", "--quiet", action="store_true", help="say nothing but what is wrong")
    loudness.add_argument("-v", "--verbose", action="store_true", help="name every file written and removed")
    known = [option for action in build._actions for option in action.option_strings]  # noqa: SLF001 - argparse has no other way
    build.set_defaults(run=_build, parser=build, known=known)
    return parser


def _given(text: str) -> str:
    """Refuse an empty value: an unset variable in a script must not mean the default."""
    if not text:
        raise argparse.ArgumentTypeError("expected a value, found an empty text")
    return text


def _build(options: argparse.Namespace) -> int:
    started = time.perf_counter()
    build, sources = _prepare(options, read_settings("."))
    if options.list_outputs:
        print("\n".join(os.path.join(build.folder, name) for name in build.outputs()))
        return DONE
    writes = not (options.check or options.diff)
    outcome = build.run(write=writes)
    if options.depfile and writes:
        write_if_changed(options.depfile, depfile(outcome.folder, outcome.outputs, sources))
    lines = list(_report(outcome, sources.label, time.perf_counter() - started, writes=writes, verbose=options.verbose))
    if options.diff and outcome.plan:
        _print_diff(outcome.plan)
    for name in outcome.plan.edited if outcome.plan else ():
        print(f"{os.path.join(build.folder, name)} is no longer needed, but was edited: left in place", file=sys.stderr)
    if not options.quiet:
        print("\n".join(lines))
    return FINDINGS if outcome.plan and outcome.plan.is_stale and not writes else DONE


def _prepare(options: argparse.Namespace, settings: Settings) -> tuple[Build, Sources]:
    """Merge the command line with the settings; the command line wins."""
    package = settings.package or "px4_types" if options.package is None else options.package
    if not (package.isidentifier() and package.isascii()) or keyword.iskeyword(package):
        place = settings.place("package") if options.package is None else Location("--package", 0)
        text = f"'{package}' cannot be imported: expected a name such as 'px4_types'"
        raise fault(place.path, "S103", text, *place[1:])
    sources = find_sources(
        options.px4 or settings.px4,
        tuple(options.msg_dir or settings.msg_dir),
        options.topics or settings.topics,
        options.release or settings.release,
        settings.place("release") if options.release is None else Location("--release", 0),
    )
    return Build(sources, options.output or settings.output or "generated", package), sources


def _report(outcome: Outcome, label: str, seconds: float, *, writes: bool, verbose: bool) -> Iterator[str]:
    """Say what was done, or what there would be to do."""
    plan = outcome.plan
    if plan is None or not (writes or plan.is_stale):
        yield f"{os.path.basename(outcome.folder)} from {label}: {outcome.summary}"
        yield f"{outcome.folder} is up to date, {len(outcome.outputs)} files"
        return
    verbs = ("wrote", "removed") if writes else ("to write:", "to remove:")
    changes = [
        f"{verb} {os.path.join(plan.folder, name)}"
        for verb, names in zip(verbs, (plan.written, plan.removed), strict=True)
        for name in names
    ]
    shown = len(changes) if verbose else 0 if writes else _FEW
    yield from changes[:shown]
    if not writes and len(changes) > shown:
        yield f"... and {len(changes) - shown} more"
    if not writes:
        yield f"{plan.folder} is stale: {_files(len(plan.written))} to write, {len(plan.removed)} to remove"
        return
    unchanged = len(plan.files) - len(plan.written)
    counts = f"{_files(len(plan.written))} written, {len(plan.removed)} removed, {unchanged} unchanged"
    yield f"{os.path.basename(outcome.folder)} from {label}: {outcome.summary}"
    yield f"{plan.folder}: {counts}, in {seconds:.2f} s"


def _files(number: int) -> str:
    return f"{number} file{'' if number == 1 else 's'}"


def _print_diff(plan: Plan) -> None:
    from difflib import unified_diff

    for name in (*plan.written, *plan.removed):
        path = os.path.join(plan.folder, name)
        try:
            with open(path, encoding="utf-8", errors="replace") as stream:
                before = stream.read().splitlines(keepends=True)
        except OSError:
            before = []
        after = plan.files.get(name, "").splitlines(keepends=True)
        for line in unified_diff(before, after, path, path):
            sys.stdout.write(line.encode(sys.stdout.encoding, "backslashreplace").decode(sys.stdout.encoding))


def _print_faults(faults: Sequence[Diagnostic]) -> None:
    colour = sys.stderr.isatty() and not os.environ.get("NO_COLOR")
    for found in faults:
        place, code, message = found
        text = f"\033[1m{place}\033[0m: \033[31m{code}\033[0m {message}" if colour else str(found)
        print(text, file=sys.stderr)
    print(f"{len(faults)} error{'' if len(faults) == 1 else 's'}, nothing written", file=sys.stderr)
