"""`msggen lsp`: a language server for editors."""

from __future__ import annotations

import argparse
import logging
from typing import Any

from msggen.base.exit_codes import DONE
from msggen.cli.options import FAILED_CODES, Commands, add_command
from msggen.cli.packages import needing


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    add_command(
        commands,
        "lsp",
        _lsp,
        help="serve an editor: problems, hover, completion, renaming and fixes in definitions",
        description="Serve an editor by the Language Server Protocol on standard input and output, for .msg and .srv "
        "files, dds_topics.yaml and [tool.msggen] of pyproject.toml. Editors start it by themselves.",
        epilog=f"Exit codes: 0 ended by the editor, {FAILED_CODES} It needs the extra `lsp`. docs/editor.md has the "
        "settings of Neovim, Visual Studio Code, Emacs and Helix.",
    )


class _OneLine(logging.Formatter):
    """A log with an exception in one line."""

    def formatException(self, ei: Any) -> str:  # noqa: N802 - the name in logging
        """Return the name and the text of an exception."""
        return f"  {ei[0].__name__}: {ei[1]}".replace("\n", " ")


def _lsp(options: argparse.Namespace) -> int:
    del options
    with needing("lsp", "L111"):
        from msggen.lsp.features import make_server

    log = logging.StreamHandler()
    log.setFormatter(_OneLine("msggen lsp: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[log])
    make_server().start_io()
    return DONE
