"""Build the site of msggen: `python docs/product/build_site.py`. It needs `pip install -e '.[site]'`.

The pages are those of the repository, with references of the commands and of the library. The site of the definitions
is in its folder `definitions`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from site_commands import command_pages
from site_flow import with_drawings
from site_front import front_page
from site_library import library_pages
from site_pages import ROOT, pages, pictures
from site_tables import with_tables

PRODUCT = Path(__file__).resolve().parent
ENVIRONMENT = {**os.environ, "MSGGEN_SITE": str(PRODUCT), "PYTHONPATH": str(ROOT)}


def stage(folder: Path) -> None:
    """Write the pages to `folder`, at the paths that they have in the repository, so that their links stay the same."""
    for path in pictures():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, folder / path)
    ours = {page: with_tables(with_drawings((ROOT / f"{page}.md").read_text(encoding="utf-8"))) for page in pages()}
    for name, text in {"index": front_page(), **ours, **command_pages(), **library_pages()}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / f"{name}.md").write_text(text, encoding="utf-8")


def render(source: Path, output: Path) -> int:
    """Make HTML of the pages in `source`, and return an exit code, which is not 0 if Sphinx has warned."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-c", str(PRODUCT)]
    command += ["-d", str(source.parent / "doctrees"), str(source), str(output)]
    return subprocess.run(command, env=ENVIRONMENT, check=False).returncode


def build(output: Path) -> int:
    """Build the site in `output`, and return an exit code."""
    with tempfile.TemporaryDirectory() as made:
        source = Path(made) / "pages"
        stage(source)
        code = render(source, output)
    definitions = [sys.executable, "-m", "msggen", "docs", "--home", "../index.html", "-q", "-o", "definitions"]
    return code or subprocess.run(definitions, cwd=output, env=ENVIRONMENT, check=False).returncode


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "site", help="default: build/site")
    sys.exit(build(parser.parse_args().output.resolve()))
