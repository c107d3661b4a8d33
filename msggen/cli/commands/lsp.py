"""`msggen lsp`: a language server for editors."""

from __future__ import annotations

import argparse

from msggen.cli.logs import log_to_stderr
from msggen.cli.options import FAILED_CODES, Run, new_command
from msggen.cli.packages import needing


@new_command(
    "lsp",
    "serve an editor: problems, hover, completion, renaming and fixes in definitions",
    "Serve an editor by the Language Server Protocol on standard input and output, for .msg and .srv "
    "files, dds_topics.yaml and [tool.msggen] of pyproject.toml. Editors start it by themselves.",
    epilog=f"Exit codes: 0 ended by the editor, {FAILED_CODES} It needs the extra `lsp`. docs/editor.md has the "
    "settings of Neovim, Visual Studio Code, Emacs and Helix.",
)
def add_to(_: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    return _lsp


def _lsp(options: argparse.Namespace) -> None:
    del options
    with needing("lsp", "L111"):
        from msggen.lsp.features import make_server

    log_to_stderr("lsp")
    make_server().start_io()
