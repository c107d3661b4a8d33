"""The command line: arguments in, exit codes and printed text out, with a module for each command.

It imports all rooms, each when a command needs it, and no room imports it.
"""

from __future__ import annotations

import argparse
import atexit
import gc
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from msggen.base.diagnostics import Diagnostic, InputError, printable
from msggen.base.exit_codes import DONE, FAILED, FINDINGS, INTERRUPTED
from msggen.base.foreign import guarded_output
from msggen.base.location import Location
from msggen.cli.options import WrongArgumentError, writes
from msggen.cli.parser import output_format_of, parser_for
from msggen.cli.printing import discard_output, print_document, print_errors, print_notices

__all__ = ["DONE", "FAILED", "FINDINGS", "main", "parser_for"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run msggen with `arguments`, by default those of this process, and return the exit code."""
    if arguments is None:
        gc.disable()  # there are few cycles, and collecting them costs more than it frees
        atexit.register(gc.freeze)  # so that Python does not collect at exit either
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:  # it is closed
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - until the process ends
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # the terminal may not be able to show every name
    with guarded_output():
        return _main(sys.argv[1:] if arguments is None else list(arguments))


def _main(words: Sequence[str]) -> int:
    """Run msggen with the arguments `words`, and return the exit code."""
    options = argparse.Namespace(writes=True)
    try:
        options = _parse(words)
        return _run(options)
    except InputError as error:
        with suppress(OSError):
            print_notices(error.notices, quiet=getattr(options, "quiet", False))
            print_errors(error.diagnostics, ", nothing written" if options.writes else "")
        print_document(error.diagnostics, output_format_of(words))
        return FAILED
    except WrongArgumentError as error:
        error.parser.error(str(error))
    except BrokenPipeError:
        discard_output()
        is_judging = hasattr(options, "output_format") or (options.writes and not writes(options))
        return FINDINGS if is_judging else DONE  # what was found is not read; commands that write do so before
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        text = printable(f"{place}{error.strerror or error}")
        _print_last(f"msggen: {text}")
        print_document([Diagnostic(Location("msggen", 0), "io", text)], output_format_of(words))
        return FAILED
    except (KeyboardInterrupt, RuntimeError) as error:
        from msggen.cli.watching import is_interrupt

        if not is_interrupt(error):
            raise
        _print_last("msggen: interrupted, nothing is half-written")
        return INTERRUPTED


def _parse(words: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line. Exits with 2 if one is wrong, or if there is no command."""
    parser = parser_for(words)
    if not words:
        parser.print_help(sys.stderr)
        parser.exit(FAILED)
    return parser.parse_args(words)


def _run(options: argparse.Namespace) -> int:
    code = int(options.run(options) or DONE)
    print(end="", flush=True)  # here, so that a BrokenPipeError is caught
    return code


def _print_last(text: str) -> None:
    """Print `text` to stderr, if anybody still reads it."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)
