"""Parsed EmPy templates. EmPy gives them their object `empy`.

EmPy parses and compiles a template each time it is expanded. Here this is done once, with the markup of EmPy 3.3, so
that the output is the same under EmPy 3.3 and EmPy 4. EmPy itself runs a template that knows EmPy's parser.
"""

from __future__ import annotations

import io
import os
import re
import sys
from functools import lru_cache
from typing import Any

import em

from msggen.base.disk.reading import read_text
from msggen.generate.text.empy_functions import Block, Interpreter, Names
from msggen.generate.text.empy_markup import MarkupError
from msggen.generate.text.empy_parser import Parser

_IS_EMPY_3 = em.__version__.startswith("3.")

_OF_PARSER = re.compile(r"[hH]ooks?\b|(?:set|push|pop)Context|\.contexts?\b|set(?:Name|Line)\b|identify")
"""What reads or changes the state of EmPy's parser, in a template that uses the object `empy`."""

_CONTEXT = re.compile("@[!?]")
"""Markup that changes the state of EmPy's parser."""


def is_of_empy(error: BaseException) -> bool:
    """Whether `error` is an error about markup, of EmPy or of the parser here."""
    return isinstance(error, (MarkupError, em.Error, em.FlowError if _IS_EMPY_3 else em.Flow))


class Program:
    """A parsed template."""

    def __init__(self, path: str, text: str) -> None:
        """Parse `text`. Raises MarkupError."""
        self._path = path
        self._text = text
        self.included: dict[str, None] = {}
        self._failed: tuple[BaseException | None, int] = None, 1
        knows_parser = _CONTEXT.search(text) or ("empy" in text and _OF_PARSER.search(text))
        self._block = None if knows_parser else Parser(path, text, self._run).program()

    def run(self, names: Names) -> str:
        """Return the text of the template for `names`, to which its assignments are added. Raises any exception."""
        if "empy" in names:
            raise MarkupError("interpreter globals collision", 1)
        output, printed = _Output(), _Stdout()
        stdout, sys.stdout = sys.stdout, printed
        try:
            machine = Machine(output, names, self.included)
            printed.stream = machine.streams.data[0]
            try:
                self.run_on(machine)
            finally:
                machine.shutdown()
        finally:
            sys.stdout = stdout
        return output.text()

    def run_on(self, machine: Machine, scope: Names | None = None) -> None:
        """Write the text of the template to the output of `machine`. `scope` has the local names, if there are any."""
        outer = machine.scope, machine.parses
        machine.scope, machine.parses = scope, self._block is None
        try:
            if self._block is None:
                self._run_in_empy(machine, scope)
            else:
                self._run(self._block, machine)
        finally:
            machine.scope, machine.parses = outer

    def line_of(self, error: BaseException) -> int:
        """Return the line of the template that raised `error`: a line of its code, or else of its markup."""
        if isinstance(error, SyntaxError) and error.filename == self._path and error.lineno:
            return error.lineno
        line, trace = 0, error.__traceback__
        while trace:
            line = trace.tb_lineno if trace.tb_frame.f_code.co_filename == self._path else line
            trace = trace.tb_next
        return line or (self._failed[1] if self._failed[0] is error else 1)

    def _run_in_empy(self, machine: Machine, scope: Names | None) -> None:
        try:
            machine.file(io.StringIO(self._text), locals=scope)
        except BaseException as error:
            last = self._text.count("\n") + 1
            self._failed = error, min(machine.contexts.top().line, last) if machine.contexts else 1
            raise

    def _run(self, block: Block, machine: Interpreter) -> None:
        line = 1
        try:
            for line, run in block:  # noqa: B007 - used after an exception
                run(machine)
        except BaseException as error:
            if self._failed[0] is not error:  # an inner block may have recorded it
                self._failed = error, line
            raise


@lru_cache(maxsize=256)
def _expanded(text: str) -> Program:
    return Program("<expand>", text)


class Machine(em.Interpreter):  # type: ignore[misc]  # EmPy has no types
    """An interpreter of EmPy that expands parsed templates; templates know it as `empy`."""

    scope: Names | None = None
    """The local names of the template that is being expanded."""

    parses = False
    """Whether EmPy itself parses the template that is being expanded."""

    def __init__(self, output: _Output, names: Names, included: dict[str, None]) -> None:
        """Start to write to `output`. The absolute paths of included files are added to `included`."""
        self.included = included  # absolute, because a build system may start in another folder
        if _IS_EMPY_3:
            how: dict[str, Any] = {"options": {em.RAW_OPT: True, em.BUFFERED_OPT: True, em.OVERRIDE_OPT: False}}
        else:
            how = {"dispatcher": False}
        super().__init__(output=output, globals=names, **how)

    def include(self, fileOrFilename: Any, locals: Names | None = None, **_others: object) -> None:  # noqa: A002, N803 - EmPy's names
        """Include a file, and record it."""
        if isinstance(fileOrFilename, str):
            self.included[os.path.abspath(fileOrFilename)] = None
            text = read_text(fileOrFilename)
        else:
            text = fileOrFilename.read()
        _expanded(text).run_on(self, locals)

    def string(self, text: str, *others: Any, **named: Any) -> None:
        """Expand a text, with local names if a dictionary is among the arguments, whose order is that of EmPy."""
        if self.parses:
            super().string(text, *others, **named)
        else:
            scope = next((each for each in (*others, *named.values()) if isinstance(each, dict)), None)
            _expanded(text).run_on(self, scope)

    def write(self, data: str) -> None:
        """Write as EmPy does, with fewer calls."""
        self.streams.data[-1].write(data)

    def installProxy(self, output: Any = None) -> Any:  # noqa: N802 - EmPy's name
        """Return the output for EmPy 4. `sys.stdout` stays as it is, because Program.run replaces it."""
        return output

    install = uninstall = uninstallProxy = push = pop = installProxy  # noqa: N815 - EmPy's names


class _Output:
    """The output stream of EmPy. Its text can be read after EmPy has closed it."""

    def __init__(self) -> None:
        self._parts: list[str] = []
        self.write = self._parts.append

    def text(self) -> str:
        return "".join(self._parts)

    def flush(self) -> None: ...

    def close(self) -> None: ...


class _Stdout(io.TextIOBase):
    """The `sys.stdout` of a template.

    As in EmPy 3.3, it writes to the output of the template, also while the template expands a text.
    """

    stream: Any
    """The output of the template."""

    def write(self, data: str) -> int:
        """Write `data`, and return its length."""
        self.stream.write(data)
        return len(data)

    def push(self, _interpreter: object) -> None:
        """Do nothing for another interpreter of EmPy 3.3 that a template starts."""

    pop = clear = push

    def _testProxy(self) -> None:  # noqa: N802 - EmPy's name
        """Tell EmPy 3.3 that `sys.stdout` is replaced."""
