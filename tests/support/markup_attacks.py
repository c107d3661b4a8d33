"""Definitions whose texts try to be markup."""

from __future__ import annotations

from pathlib import Path

from msggen.definitions.model import Catalog
from support.catalogs import catalog_of

ATTACKS = (
    "<script>window.pwned = 1</script>",
    "</script><script src=x>",
    '"><img src=x onerror=pwned()>',
    "' onmouseover='pwned()",
    "<a href=javascript:pwned()>x</a>",
    "`<b>code</b>` &lt;b&gt; &#60;b&#62;",
    "{{ 7 * 7 }} {% raw %}",
    "[x](javascript:pwned()) ![x](http://example.com/x.png)",
    "| a | b |<!-- -->",
    "--> ]]> <svg/onload=pwned()>",
)


def hostile(folder: Path) -> Catalog:
    """Return definitions whose every text is an attack."""
    lines = []
    for number, text in enumerate(ATTACKS):
        tag = text.replace("[", "(").replace("]", ")")
        lines += [
            f"# {text}",
            "",
            f"float32 f{number}  # [{tag}] [@range {tag}] [@frame {tag}] [@invalid {tag}] {text}",
        ]
        lines += [f"uint8 g{number}  # [@enum E{number}] {text}", f"uint8 E{number}_A = {number}  # {text}"]
    about = "".join(f"# {text}\n" for text in ATTACKS)
    strings = "".join(f"string S{number} = {text}\n" for number, text in enumerate(ATTACKS))
    files = {
        "msg/Bad.msg": f"{about}\nuint64 timestamp\n" + "\n".join(lines) + "\n",
        "msg/Outer.msg": f"{about}\nuint64 timestamp\nBad[3] bad  # {ATTACKS[0]}\n{strings}",
        "srv/Ask.srv": f"{about}\nuint8 a  # {ATTACKS[0]}\n---\nuint8 b  # {ATTACKS[2]}\n",
    }
    return catalog_of(folder, files, tolerated=("M107",))
