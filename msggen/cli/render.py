"""`msggen render`: definitions through a template of the user's own."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence

from msggen.cli.common import (
    DONE,
    FINDINGS,
    Commands,
    add_board,
    add_command,
    add_source_options,
    given,
    print_change,
    print_notices,
    sources_of,
)
from msggen.diagnostics import counted
from msggen.disk.output import stale_files, write_stale_files
from msggen.disk.staging import write_if_changed
from msggen.generate.build import depfile
from msggen.render import THINGS
from msggen.settings import read_settings

_FEW = 10
"""So many stale files are named without being asked for."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "render",
        _render,
        writes=True,
        help="render a Jinja2 or EmPy template of your own",
        description="Render a Jinja2 (.j2) or EmPy (.em) template of your own, once for each message, service or "
        "endpoint, or once for all; without a source, from the embedded set.",
        epilog="Exit codes: 0 done, 1 findings (--check, --diff), 2 usage, input or I/O error. "
        "Sources may stand in [tool.msggen] of pyproject.toml.",
    )
    template = parser.add_argument_group("template")
    template.add_argument("--template", metavar="FILE", type=given, required=True, help="a file *.j2 or *.em")
    template.add_argument(
        "--each", choices=THINGS, default="message", metavar="THING", help=f"{', '.join(THINGS)} (message)"
    )
    add_board(add_source_options(parser))
    output = parser.add_argument_group("output")
    output.add_argument("-o", "--output", metavar="DIR", type=given, required=True, help="folder to put the files into")
    output.add_argument(
        "--name",
        metavar="PATTERN",
        type=given,
        help="name of each file, in Jinja2: '{{ message.name }}.h' ('{{ message.name | snake_case }}', and the "
        "suffix that the template has before .j2 or .em)",
    )
    output.add_argument("--check", action="store_true", help="write nothing; exit 1 when a file is stale")
    output.add_argument("--diff", action="store_true", help="write nothing; show the changes, exit 1 if any")
    output.add_argument(
        "--depfile", metavar="FILE", type=given, help="write a Makefile rule with all inputs, for CMake and Ninja"
    )
    output.add_argument("--list-outputs", action="store_true", help="write nothing; list the files")
    parser.add_argument("-q", "--quiet", action="store_true", help="say nothing but what is wrong")


def _render(options: argparse.Namespace) -> int:
    sources = sources_of(options, read_settings("."))
    from msggen.firmware.catalog import read_catalog
    from msggen.render.run import check_places, items_of, open_template, output_names, texts_of

    template = open_template(options.template)
    catalog = read_catalog(sources)
    print_notices(catalog.notices, quiet=options.quiet)
    items = items_of(catalog, options.each)
    names = output_names(items, options.each, options.template, options.name)
    places = [os.path.join(options.output, name) for name in names]
    if options.list_outputs:
        print("\n".join(places))
        return DONE
    files = dict(zip(names, texts_of(template, items), strict=True))
    inputs = (*sources.dependencies(), *template.inputs)
    check_places(options.output, names, inputs)
    writes = not (options.check or options.diff)
    stale = write_stale_files(options.output, files) if writes else stale_files(options.output, files)
    if options.depfile and writes:
        write_if_changed(options.depfile, depfile(places[0], inputs))
    if options.diff:
        for name in stale:
            print_change(os.path.join(options.output, name), files[name])
    if not options.quiet:
        print("\n".join(_report(options, stale, len(files), sources.label)))
    return FINDINGS if stale and not writes else DONE


def _report(options: argparse.Namespace, stale: Sequence[str], number: int, label: str) -> Iterator[str]:
    """Say what was done, or what there would be to do."""
    writes = not (options.check or options.diff)
    if not writes:
        yield from (f"to write: {os.path.join(options.output, name)}" for name in stale[:_FEW])
        if len(stale) > _FEW:
            yield f"... and {len(stale) - _FEW} more"
    else:
        what = "" if options.each == "catalog" else f": {counted(number, options.each)}"
        yield f"{os.path.basename(options.template)} from {label}{what}"
    if not stale:
        yield f"{options.output} is up to date, {counted(number, 'file')}"
    elif writes:
        yield f"{options.output}: {counted(len(stale), 'file')} written, {number - len(stale)} unchanged"
    else:
        yield f"{options.output} is stale: {counted(len(stale), 'file')} to write"
