"""The command line: arguments, settings and exit codes; everything it does is done elsewhere.

argparse on purpose: a build with nothing to do takes about 40 ms, and every larger library adds half of that
again to each run (docs/libraries.md).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Mapping, Sequence

from msggen import __version__

DONE, FINDINGS, FAILED = 0, 1, 2
"""Exit codes: all well, something found, and usage, input or I/O errors."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    try:
        return _run(arguments)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"msggen: {place}{error.strerror or error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("msggen: interrupted, nothing is half-written", file=sys.stderr)
        return FAILED


def _run(arguments: Sequence[str] | None) -> int:
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except Exception as error:
        if type(error).__name__ != "InputError":
            raise
        _print_faults([str(fault) for fault in getattr(error, "diagnostics", ())])
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
    build.set_defaults(run=_build)
    source = build.add_argument_group("sources")
    source.add_argument("--px4", metavar="PATH", help="PX4-Autopilot tree, px4_msgs package or folder of .msg files")
    source.add_argument(
        "--msg-dir", metavar="DIR", action="append", help="further .msg files, as of external modules; repeatable"
    )
    source.add_argument("--topics", metavar="FILE", help="dds_topics.yaml to use instead of the tree's own")
    source.add_argument("--release", help="conventions to follow, not those the tree shows: v1.14 to v1.17, main")
    output = build.add_argument_group("output")
    output.add_argument("-o", "--output", metavar="DIR", help="folder to put the package into (generated)")
    output.add_argument("--package", metavar="NAME", help="name of the Python package (px4_types)")
    output.add_argument("--check", action="store_true", help="write nothing; exit 1 when the package is stale")
    output.add_argument("--diff", action="store_true", help="write nothing; show the changes, exit 1 if any")
    output.add_argument("--depfile", metavar="FILE", help="write a Makefile rule with all inputs, for CMake and Ninja")
    output.add_argument("--list-outputs", action="store_true", help="write nothing; list the files of the package")
    loudness = build.add_mutually_exclusive_group()
    loudness.add_argument("-q", "--quiet", action="store_true", help="say nothing but what is wrong")
    loudness.add_argument("-v", "--verbose", action="store_true", help="name every file written and removed")
    return parser


def _build(options: argparse.Namespace) -> int:
    from msggen.firmware.source import find_sources
    from msggen.generate.build import Build, depfile, write_if_changed
    from msggen.settings import read_settings

    started = time.perf_counter()
    settings = read_settings(".")
    package = options.package or settings.package or "px4_types"
    _check_package_name(package)
    sources = find_sources(
        options.px4 or settings.px4,
        tuple(options.msg_dir or settings.msg_dir),
        options.topics or settings.topics,
        options.release or settings.release,
    )
    build = Build(sources, options.output or settings.output or "generated", package)
    if options.list_outputs:
        print("\n".join(os.path.join(build.folder, name) for name in build.outputs()))
        return DONE
    writes = not (options.check or options.diff)
    outcome = build.run(write=writes)
    if options.depfile and writes:
        write_if_changed(options.depfile, depfile(outcome.folder, outcome.outputs, sources))
    if outcome.plan is None or (not outcome.plan.is_stale and not writes):
        _say(options, f"{outcome.summary}\n{outcome.folder} is up to date, {len(outcome.outputs)} files")
        return DONE
    plan = outcome.plan
    if options.diff:
        _print_diff(plan.folder, plan.files, (*plan.written, *plan.removed))
    for name in plan.edited:
        text = "was edited since msggen wrote it and is no longer needed: left in place"
        print(f"{os.path.join(plan.folder, name)}: {text}", file=sys.stderr)
    if options.verbose:
        for verb, names in (
            ("wrote" if writes else "to write:", plan.written),
            ("removed" if writes else "to remove:", plan.removed),
        ):
            for name in names:
                print(f"{verb} {os.path.join(plan.folder, name)}")
    if not writes:
        _say(options, f"{plan.folder} is stale: {len(plan.written)} files to write, {len(plan.removed)} to remove")
        return FINDINGS
    unchanged = len(plan.files) - len(plan.written)
    counts = f"{len(plan.written)} files written, {len(plan.removed)} removed, {unchanged} unchanged"
    _say(options, f"{outcome.summary}\n{plan.folder}: {counts}, in {time.perf_counter() - started:.2f} s")
    return DONE


def _check_package_name(name: str) -> None:
    import keyword

    if not (name.isidentifier() and name.isascii()) or keyword.iskeyword(name):
        from msggen.diagnostics import fault

        raise fault("--package", "S103", f"'{name}' cannot be imported: expected a name such as 'px4_types'", line=0)


def _say(options: argparse.Namespace, text: str) -> None:
    if not options.quiet:
        print(text)


def _print_diff(folder: str, files: Mapping[str, str], names: Sequence[str]) -> None:
    from difflib import unified_diff

    for name in names:
        path = os.path.join(folder, name)
        try:
            with open(path, encoding="utf-8", errors="replace") as stream:
                before = stream.read().splitlines(keepends=True)
        except OSError:
            before = []
        after = files.get(name, "").splitlines(keepends=True)
        sys.stdout.writelines(unified_diff(before, after, path, path))


def _print_faults(faults: list[str]) -> None:
    colour = sys.stderr.isatty() and not os.environ.get("NO_COLOR")
    for fault in faults:
        place, _, rest = fault.partition(": ")
        code, _, message = rest.partition(" ")
        print(f"\033[1m{place}\033[0m: \033[31m{code}\033[0m {message}" if colour else fault, file=sys.stderr)
    print(f"{len(faults)} error{'' if len(faults) == 1 else 's'}, nothing written", file=sys.stderr)
