"""A session of Python that runs the code on a page, block after block, as a reader who copies it.

Run as a program, it reads a line of JSON for each block from stdin, and prints what the block prints, and then END.
"""

from __future__ import annotations

import doctest
import json
import sys
import traceback

END = "\x04"


def run(code: str, names: dict[str, object]) -> None:
    """Run a block of code."""
    try:
        exec(compile(code, "<page>", "exec"), names)  # noqa: S102 - the code of our own page
    except Exception:  # noqa: BLE001 - it is the output
        traceback.print_exc(file=sys.stdout)


def run_session(text: str, names: dict[str, object]) -> None:
    """Run a block with prompts, and print it with the output of each statement. Of an error, only the last line."""
    for example in doctest.DocTestParser().get_examples(text):
        first, *others = example.source.splitlines()
        print(f">>> {first}", *(f"... {line}".rstrip() for line in others), sep="\n")
        try:
            exec(compile(example.source, "<page>", "single"), names)  # noqa: S102 - as above
        except Exception as error:  # noqa: BLE001 - as above
            print(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    sys.path[0] = ""  # as at the prompt of Python
    import __main__

    for line in sys.stdin:
        block = json.loads(line)
        (run_session if block["has_prompts"] else run)(block["code"], vars(__main__))
        print(END, end="", flush=True)
