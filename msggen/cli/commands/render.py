"""`msggen render`: render definitions with a template of the user."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Mapping, Sequence

from msggen.base.diagnostics import OF_BOARDS, counted
from msggen.base.disk.depfile import check_depfile, write_depfile
from msggen.base.disk.output import stale_files, write_stale_files
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.cli.options import WRITING_CODES, Run, add_shared, add_sources, add_value, new_command, writes
from msggen.cli.printing import print_change, print_notices
from msggen.cli.source_options import settings_of, sources_of
from msggen.cli.values import local_path, non_empty
from msggen.generate.render import THINGS

_STDOUT = "-"
"""The output folder that stands for stdout."""

_FEW = 10
"""The largest number of stale files that are listed."""


@new_command(
    "render",
    "render a Jinja2 or EmPy template of your own",
    "Render a Jinja2 (.j2) or EmPy (.em) template of your own, once for each message, service or "
    "endpoint, or once for the whole catalog; by default from the newest embedded release.",
    epilog=f"{WRITING_CODES} Sources can be set in [tool.msggen] of pyproject.toml.",
    writes=True,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    parser.set_defaults(hints={"--output": "with -o -, the text is printed"})
    template = parser.add_argument_group("template")
    add_value(template, "--template", "FILE", local_path, "template file, *.j2 or *.em", required=True)
    template.add_argument(
        "--each", choices=THINGS, default="message", metavar="THING", help=f"{', '.join(THINGS)} (default: message)"
    )
    text = "render only this message; repeatable"
    add_value(template, "--message", "NAME", non_empty, text, dest="messages", action="append")
    add_sources(parser, "--board")
    output = parser.add_argument_group("output", "With -o -, the texts are printed and no file is written.")
    add_shared(output, "-o, --output", required=True)
    text = (
        "name of each file, in Jinja2, such as '{{ message.name }}.h' (default: "
        "'{{ message.name | snake_case }}' and the suffix of the template before .j2 or .em)"
    )
    add_value(output, "--name", "PATTERN", non_empty, text)
    add_shared(output, "--check", "--diff", "--depfile", "--list-outputs")
    add_shared(parser, "-q, --quiet")
    return _render


def _render(options: argparse.Namespace) -> int:
    _check_options(options)
    sources = sources_of(options, settings_of(options))
    from msggen.generate.render.run import (
        check_each,
        check_places,
        items_of,
        open_template,
        output_names,
        select,
        shows_ids,
        texts_of,
    )
    from msggen.sources.catalog import read_catalog
    from msggen.sources.inferred import with_inferred

    template = open_template(options.template)
    catalog = with_inferred(read_catalog(sources), sources)
    of_ids = [each for each in catalog.notices if each.code in OF_BOARDS]
    print_notices((each for each in catalog.notices if each not in of_ids), quiet=options.quiet)
    items = items_of(catalog, options.each)
    if options.messages:
        items = select(items, options.messages)
    check_each(template, options.each, items)
    if options.output == _STDOUT:
        *texts, last = texts_of(template, items)
        whole = "".join(f"{text}\n" if text and text[-1] != "\n" else text for text in texts) + last
        sys.stdout.flush()
        sys.stdout.buffer.write(whole.encode())  # as it would be written to a file: in UTF-8, with the same line ends
        print_notices(of_ids if shows_ids(template) else (), quiet=options.quiet)
        return DONE
    names = output_names(items, options.each, options.template, options.name)
    if options.list_outputs:
        print(*(os.path.join(options.output, name) for name in names), sep="\n")
        return DONE
    files = dict(zip(names, texts_of(template, items), strict=True))
    print_notices(of_ids if shows_ids(template) else (), quiet=options.quiet)
    inputs = (*sources.dependencies(), *template.inputs)
    check_places(options.output, names, inputs)
    return _update(options, files, inputs, sources.label)


def _update(options: argparse.Namespace, files: Mapping[str, str], inputs: Sequence[str], label: str) -> int:
    """Write `files`, texts by name, or with `--check` or `--diff` only report the changes. Return the exit code."""
    places = [os.path.join(options.output, name) for name in files]
    write = writes(options)
    if options.depfile and write:
        check_depfile(options.depfile, inputs, places)
    stale = write_stale_files(options.output, files) if write else stale_files(options.output, files)
    if options.depfile and write:
        write_depfile(options.depfile, inputs, places[0])
    if options.diff:
        for name in stale:
            print_change(os.path.join(options.output, name), files[name])
    if not options.quiet:
        print(*_report(options, stale, len(files), label), sep="\n")
    return FINDINGS if stale and not write else DONE


def _check_options(options: argparse.Namespace) -> None:
    """Exit with 2 if options cannot be combined."""
    if options.messages and options.each != "message":
        options.parser.error(f"--message cannot be combined with --each {options.each}")
    if options.output != _STDOUT and os.path.lexists(options.output) and not os.path.isdir(options.output):
        options.parser.error(f"-o names a folder, and '{options.output}' is not one: to print the text, use -o -")
    others = ("name", "check", "diff", "depfile", "list_outputs")
    for other in others if options.output == _STDOUT else ():
        if getattr(options, other):
            options.parser.error(f"-o - writes no file: it cannot be combined with --{other.replace('_', '-')}")


def _report(options: argparse.Namespace, stale: Sequence[str], number: int, label: str) -> Iterator[str]:
    """Yield lines that report the changes made, or with `--check` or `--diff` the changes to make."""
    write = writes(options)
    if not write:
        yield from (f"to write: {os.path.join(options.output, name)}" for name in stale[:_FEW])
        if len(stale) > _FEW:
            yield f"... and {len(stale) - _FEW} more"
    else:
        count = "" if options.each == "catalog" else f": {counted(number, options.each)}"
        yield f"{os.path.basename(options.template)} from {label}{count}"
    if not stale:
        yield f"{options.output} is up to date, {counted(number, 'file')}"
    elif write:
        yield f"{options.output}: {counted(len(stale), 'file')} written, {number - len(stale)} unchanged"
    else:
        yield f"{options.output} is stale: {counted(len(stale), 'file')} to write"
