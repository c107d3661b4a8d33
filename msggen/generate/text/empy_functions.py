"""The functions that EmPy markup becomes: each writes to an interpreter, or returns a value."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from types import CodeType
from typing import Any, Protocol, TypeAlias

from msggen.generate.text.empy_markup import MarkupError

Names: TypeAlias = "dict[str, object]"
Run: TypeAlias = "Callable[[Interpreter], None]"
Evaluate: TypeAlias = "Callable[[Interpreter], Any]"
Block: TypeAlias = "list[tuple[int, Run]]"
"""Functions, each with its line in the template."""


class Interpreter(Protocol):
    """What the functions use of an interpreter of EmPy. `scope` has the local names, if there are any."""

    globals: Names
    scope: Names | None
    callback: object

    def write(self, data: str) -> None:
        """Write a text."""

    def assign(self, name: str, value: object, locals: Names | None) -> None:  # noqa: A002 - EmPy's name
        """Assign a value to a name, or the values in it to several names."""

    def significate(self, key: str, value: object, locals: Names | None) -> None:  # noqa: A002 - EmPy's name
        """Set the name `__key__`."""

    def invokeCallback(self, contents: str) -> None:  # noqa: N802 - EmPy's name
        """Call the function that a template registered."""


def write(text: str) -> Run:
    """Return a function that writes a text."""
    return lambda machine: machine.write(text)


def expand(evaluate: Evaluate) -> Run:
    """Return a function that writes a value, unless it is None."""

    def run(machine: Interpreter) -> None:
        value = evaluate(machine)
        if value is not None:
            machine.write(str(value))

    return run


def choose(test: Evaluate, value: Evaluate, otherwise: Evaluate) -> Evaluate:
    """Return a function that returns the first value if `test` is true, or else the second."""
    return lambda machine: value(machine) if test(machine) else otherwise(machine)


def fall_back(evaluate: Evaluate, after: Evaluate) -> Evaluate:
    """Return a function that returns the value of `after` if `evaluate` raises an exception."""

    def run(machine: Interpreter) -> object:
        try:
            return evaluate(machine)
        except SyntaxError:
            raise
        except Exception:  # noqa: BLE001 - a template is code: it may raise anything
            return after(machine)

    return run


def raising(kind: type[MarkupError], message: str, line: int) -> Run:
    """Return a function that raises an error."""

    def run(_machine: Interpreter) -> None:
        raise kind(message, line)

    return run


class Code:
    """Python code of a template.

    It is compiled when it first runs, because EmPy ignores errors in code that never runs.
    """

    def __init__(self, text: str, path: str, line: int, mode: str) -> None:
        self._text, self._path, self._line, self._mode = text, path, line, mode
        self._compiled: CodeType | None = None

    def evaluate(self, machine: Interpreter) -> object:
        """Return the value of an expression."""
        return eval(self._compiled or self._compile(), machine.globals, machine.scope)  # noqa: S307 - a template is code

    def execute(self, machine: Interpreter) -> None:
        """Run statements."""
        exec(self._compiled or self._compile(), machine.globals, machine.scope)  # noqa: S102 - a template is code

    def _compile(self) -> CodeType:
        """Compile the code with the line numbers of the template."""
        self._compiled = _compile(self._text, self._mode, self._path, self._line)
        return self._compiled


@lru_cache(maxsize=4096)
def _compile(text: str, mode: str, path: str, line: int) -> CodeType:
    """Compile `text` without the whitespace that EmPy (statements) or `eval` (expressions) removes."""
    if mode == "eval":
        text = text.lstrip(" \t")
    else:
        text = text.replace("\r", "")
        text = text if "\n" in text else text.strip()
    code: CodeType = compile("\n" * (line - 1) + text, path, mode, dont_inherit=True)
    return code
