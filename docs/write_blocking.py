"""Write msggen/flight/blocking_calls.py: the calls of flights for programs without asyncio, from those with it."""

from __future__ import annotations

import ast
import builtins
import inspect
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msggen.flight.flight import Flight
from msggen.flight.measurements import Measurements
from msggen.flight.offboard import Offboard
from msggen.flight.telemetry import Telemetry

FILE = Path(__file__).resolve().parent.parent / "msggen/flight/blocking_calls.py"
CLASSES = (Flight, Telemetry, Offboard, Measurements)
_OTHERS = {"run"}
"""The coroutines that blocking.py has itself."""
_FRONT = '''"""The calls of flights for programs without asyncio.

`python docs/write_blocking.py` writes this file from {names}.
"""

from __future__ import annotations

{imports}

_Result = TypeVar("_Result")


class Waits(Hinted):
    """Waits for what coroutines return."""

    def _wait(self, coroutine: Coroutine[Any, Any, _Result]) -> _Result:
        raise NotImplementedError


{classes}
'''
_CLASS = '''class {name}Calls(Waits):
    """The coroutines of `{name}` as calls that return when they are done."""

    @property
    def _own(self) -> {name}:
        raise NotImplementedError

{methods}
'''
_FIXED = {
    "Any": "from typing import Any",
    "Coroutine": "from collections.abc import Coroutine",
    "Hinted": "from msggen.flight.elsewhere import Hinted",
    "TypeVar": "from typing import TypeVar",
}


def coroutines(cls: type) -> dict[str, Any]:
    """Return the coroutine functions of a class by their names, in the order in which they are defined."""
    names = dict.fromkeys(name for each in reversed(cls.__mro__) for name in vars(each) if not name.startswith("_"))
    found = {name: getattr(cls, name) for name in names if name not in _OTHERS}
    return {name: each for name, each in found.items() if inspect.iscoroutinefunction(inspect.unwrap(each))}


def _definition(function: Any) -> ast.AsyncFunctionDef:
    source = textwrap.dedent(inspect.getsource(inspect.unwrap(function)))
    return next(node for node in ast.parse(source).body if isinstance(node, ast.AsyncFunctionDef))


def _method(cls: type, name: str, node: ast.AsyncFunctionDef) -> str:
    """Return the method that calls a coroutine function with the same arguments, and waits for it."""
    first, *plain = (each.arg for each in node.args.args)
    variable = [f"*{node.args.vararg.arg}"] if node.args.vararg else []
    keywords = [f"{each.arg}={each.arg}" for each in node.args.kwonlyargs]
    decorators = "".join(f"@{ast.unparse(each)}\n" for each in node.decorator_list)
    returned = ast.unparse(node.returns) if node.returns else "None"
    call = f"{first}._wait({first}._own.{name}({', '.join([*plain, *variable, *keywords])}))"
    return textwrap.indent(
        f"{decorators}def {name}({ast.unparse(node.args)}) -> {returned}:\n"
        f'    """See `{cls.__name__}.{name}`."""\n'
        f"    {'' if returned == 'None' else 'return '}{call}\n",
        "    ",
    )


def _imports(function: Any, node: ast.AsyncFunctionDef) -> Iterator[str]:
    """Yield the imports of the names in a signature, as the module of the function has them."""
    module = sys.modules[function.__module__]
    parts = [node.args, *node.decorator_list, *([node.returns] if node.returns else [])]
    names = {each.id for part in parts for each in ast.walk(part) if isinstance(each, ast.Name)}
    for statement in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(statement, (ast.Import, ast.ImportFrom)):
            for alias in statement.names:
                name = alias.asname or alias.name
                if name in names:
                    names.discard(name)
                    yield ast.unparse(type(statement)(**{**vars(statement), "names": [alias]}))
    yield from (f"from {module.__name__} import {name}" for name in names if not hasattr(builtins, name))


def blocking_calls() -> str:
    """Return the content of the file."""
    imports = {*_FIXED.values()}
    classes = []
    for cls in CLASSES:
        imports.add(f"from {cls.__module__} import {cls.__name__}")
        found = {name: (each, _definition(each)) for name, each in coroutines(cls).items()}
        imports.update(line for each, node in found.values() for line in _imports(each, node))
        methods = "\n".join(_method(cls, name, node) for name, (_, node) in found.items())
        classes.append(_CLASS.format(name=cls.__name__, methods=methods))
    text = _FRONT.format(
        names=" and ".join(", ".join(f"`{cls.__name__}`" for cls in CLASSES).rsplit(", ", 1)),
        imports="\n".join(sorted(imports)),
        classes="\n\n".join(classes),
    )
    for command in (("check", "--fix-only", "--select", "I,TC,F401"), ("format",)):
        ruff = [sys.executable, "-m", "ruff", *command, "--quiet", "--stdin-filename", str(FILE), "-"]
        text = subprocess.run(ruff, input=text, capture_output=True, text=True, check=True, cwd=FILE.parent).stdout  # noqa: S603 - ruff
    return text


if __name__ == "__main__":
    FILE.write_text(blocking_calls(), encoding="utf-8")
