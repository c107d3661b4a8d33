"""Draw Neovim with `msggen lsp`: `python docs/draw_editor.py TREE > docs/editor.svg`.

TREE is a PX4-Autopilot tree of v1.18 in a repository of git. It stays as it is.
"""

from __future__ import annotations

import io
import re
import sys
import tempfile
import time
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from draw_top import FORMAT
from rich.console import Console
from rich.style import Style
from rich.text import Text

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from support.pseudo_terminal import TerminalProgram

if TYPE_CHECKING:
    import pyte

WIDTH, HEIGHT = 124, 27
SETTINGS = """
set termguicolors
highlight Normal guifg=#d8dee9 guibg=#20242c
highlight NormalFloat guifg=#eceff4 guibg=#343d4f
highlight LineNr guifg=#667084
highlight DiagnosticVirtualTextError guifg=#ff7b72
highlight DiagnosticVirtualTextWarn guifg=#e3b341
highlight DiagnosticVirtualTextInfo guifg=#79c0ff
set number laststatus=0 noshowcmd noruler shortmess+=F background=dark signcolumn=no nowrap
lua vim.diagnostic.config({ virtual_text = { prefix = " ", spacing = 2 }, signs = false })
lua vim.lsp.buf_attach_client(0, vim.lsp.start_client({ cmd = { "PYTHON", "-m", "msggen", "lsp" } }))
"""
_RUN = "import os, sys; os.execvp('nvim', ['nvim', *sys.argv[1:]])"


def draw(tree: str) -> str:
    """Return an SVG picture of Neovim at a changed message, with a hover."""
    path = f"{tree}/msg/versioned/BatteryStatus.msg"
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "init.vim"
        settings.write_text(SETTINGS.replace("PYTHON", sys.executable))
        start = ("-n", "-u", "NONE", path, "-S", str(settings))
        program = TerminalProgram("-c", _RUN, *start, size=(WIDTH, HEIGHT))
        program.wait_for(lambda text: "uint64 timestamp" in text)
        for keys in (
            "/^float32 current_a\r",
            "ofloat32 spare_v # [volts] [@range 30, 0] Spare.\x1b",
            ":3\rzt",
            "/^uint8 source\rw",
        ):
            program.press(keys)
            time.sleep(0.5)
        program.wait_for(lambda text: "FIELD_ADDED" in text or "is not in HEAD" in text)
        program.press(":nohlsearch | lua vim.lsp.buf.hover()\r")
        program.wait_for(lambda text: "values of" in text)
        program.press(":echo\r")
        time.sleep(0.5)
        screen = program.screen
        program.press("\x1b:qa!\r")
    console = Console(record=True, file=io.StringIO(), width=WIDTH, force_terminal=True, legacy_windows=False)
    for row in range(HEIGHT - 1):
        console.print(_line(screen, row), no_wrap=True, overflow="crop")
    return console.export_svg(title="nvim msg/versioned/BatteryStatus.msg", code_format=FORMAT, unique_id="editor")


def _line(screen: pyte.Screen, row: int) -> Text:
    text = Text()
    cells = [screen.buffer[row][column] for column in range(WIDTH)]
    for (front, back, bold, reverse), run in groupby(cells, lambda cell: (cell.fg, cell.bg, cell.bold, cell.reverse)):
        style = Style(color=_colour(front), bgcolor=_colour(back), bold=bold, reverse=reverse)
        text.append("".join(cell.data for cell in run), style)
    return text


def _colour(name: str) -> str | None:
    """Return rich's name of one of pyte's colours."""
    if name == "default":
        return None
    if re.fullmatch("[0-9a-f]{6}", name):
        return f"#{name}"
    return name.replace("brown", "yellow")


if __name__ == "__main__":
    print(draw(sys.argv[1]))
