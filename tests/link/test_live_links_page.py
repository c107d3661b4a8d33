"""Tests of docs/links.md: its first lines run, and its table of errors has texts that exist."""

from __future__ import annotations

import re
from typing import Any

from support.link_records import Records
from support.replay import Client, sent
from support.repository import ROOT

PAGE = (ROOT / "docs" / "links.md").read_text(encoding="utf-8")


def test_the_first_lines_give_statistics() -> None:
    block = PAGE.partition("```pycon\n")[2].partition("```")[0]
    lines = [line[4:].replace("port=8888", "port=0") for line in block.splitlines() if line.startswith(">>> ")]
    records = Records()
    names: dict[str, Any] = {"listener": records}
    exec("\n".join(lines[:-1]), names)  # noqa: S102 - our own text
    link = names["link"]
    try:
        with Client(link.port) as client:
            client.play(sent("session-udp"))
            records.wait(lambda: records.gone)
        shown = dict(re.findall(r"(\w+)=(\d+)", block.splitlines()[-1]))
        found = eval(lines[-1], names)._asdict()  # noqa: S307 - our own text
    finally:
        link.close()
    for name in ("received", "refused", "dropped", "lost"):
        assert found[name] == int(shown[name])
    assert shown.keys() == found.keys()


def test_the_errors_of_the_table_exist() -> None:
    folder = ROOT / "msggen"
    source = "".join(path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.py")))
    table = PAGE.partition("## Errors")[2]
    texts = [text for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for text in re.findall("`(.*?)`", row)]
    assert len(texts) > 7
    patterns = [text.replace("8888", "{port}").replace("127.0.0.1", "{host}") for text in texts]
    assert [pattern for pattern in patterns if pattern not in source] == []
