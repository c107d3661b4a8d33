"""Parsed EmPy templates, made with the scanner and the tokens of EmPy.

EmPy parses and compiles a template each time it is expanded. Here this is done once for the markup that most templates
use. EmPy itself runs all rare markup, so the output is the same.
"""

from __future__ import annotations

import os
import re
import sys
from bisect import bisect_right
from collections.abc import Callable, Mapping
from functools import lru_cache
from io import StringIO
from types import CodeType
from typing import Any, TypeAlias

import em

Run: TypeAlias = "Callable[[Machine], None]"
Block: TypeAlias = "list[tuple[int, Run]]"

_BOOKKEEPING = re.compile(r"[hH]ooks?\b|(?:set|push|pop)Context|\.contexts?\b|set(?:Name|Line)\b|identify|@[!?]")
"""Markup that reads or changes the state of EmPy's parser: EmPy itself runs a template that has it."""

_NAME = re.compile(r"\s*([_a-zA-Z][_a-zA-Z0-9]*)\s*")


class MarkupError(Exception):
    """An error in the markup of a template, on `line`."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def is_of_empy(error: BaseException) -> bool:
    """Whether `error` is an error of EmPy about markup."""
    return isinstance(error, em.Error)


class Program:
    """A parsed template."""

    def __init__(self, path: str, text: str) -> None:
        """Parse `text`. Raises MarkupError."""
        self._path = path
        self._text = text
        self.included: dict[str, None] = {}
        self._lines = [0, *(match.end() for match in re.finditer("\n", text))]
        self._failed: tuple[BaseException | None, int] = None, 1
        self._block = None if _BOOKKEEPING.search(text) else self._parse()

    def run(self, names: dict[str, object]) -> str:
        """Return the text of the template for `names`, to which its assignments are added. Raises any exception."""
        output = _Output()
        stdout, sys.stdout = sys.stdout, _Stdout(sys.stdout)
        try:
            machine = Machine(output=output, globals=names, options={em.RAW_OPT: True, em.BUFFERED_OPT: True})
            machine.included = self.included
            try:
                if self._block is None:
                    self._run_in_empy(machine)
                else:
                    machine.push()
                    self._run(self._block, machine)
                    machine.pop()
            finally:
                machine.shutdown()
        finally:
            sys.stdout = stdout
        return output.text()

    def line_of(self, error: BaseException) -> int:
        """Return the line of the template that raised `error`: a line of its code, or else of its markup."""
        if isinstance(error, SyntaxError) and error.filename == self._path and error.lineno:
            return error.lineno
        line, trace = 0, error.__traceback__
        while trace:
            line = trace.tb_lineno if trace.tb_frame.f_code.co_filename == self._path else line
            trace = trace.tb_next
        return line or (self._failed[1] if self._failed[0] is error else 1)

    def _run_in_empy(self, machine: Machine) -> None:
        try:
            machine.file(StringIO(self._text))
        except BaseException as error:
            self._failed = error, min(machine.context().line, len(self._lines)) if machine.contexts else 1
            raise

    def _run(self, block: Block, machine: Machine) -> None:
        line = 1
        try:
            for line, run in block:  # noqa: B007 - used after an exception
                run(machine)
        except BaseException as error:
            if self._failed[0] is not error:  # an inner block may have recorded it
                self._failed = error, line
            raise

    def _parse(self) -> Block:
        text = f"@#{self._text[2:]}" if self._text.startswith(em.BANGPATH) else self._text
        scanner = _Scanner(em.DEFAULT_PREFIX, text)
        tokens: list[Any] = []
        try:
            try:
                scanner.read_into(tokens)
            except em.TransientParseError:
                if scanner and scanner.rest()[-1] != "\n":
                    scanner.feed(f"{em.DEFAULT_PREFIX}\n")
                scanner.read_into(tokens)
        except em.TransientParseError as error:
            raise MarkupError(f"unterminated markup: {error}", self._line(scanner.failed)) from error
        except em.ParseError as error:
            raise MarkupError(str(error), self._line(scanner.failed)) from error
        return self._block_of(tokens, scanner)

    def _line(self, position: int) -> int:
        return bisect_right(self._lines, position)

    def _block_of(self, tokens: list[Any], scanner: _Scanner) -> Block:
        block = []
        for token in tokens:
            line = self._line(scanner.starts[token])
            run = self._run_of(token, line, scanner)
            if run:
                block.append((line, run))
        return block

    def _run_of(self, token: Any, line: int, scanner: _Scanner) -> Run | None:
        """Return a function that does the same as `token`, or None if the token does nothing."""
        kind = type(token)
        if kind in (em.CommentToken, em.WhitespaceToken):
            return None
        if kind is em.NullToken:
            return _write(token.data)
        if kind is em.SimpleExpressionToken or (
            kind is em.ExpressionToken and not (token.thenCode or token.exceptCode)
        ):
            return _expand(self._expression(token.code if kind is em.SimpleExpressionToken else token.testCode, line))
        if kind is em.StatementToken:
            return _execute(_Code(token.code, self._path, line, "exec"))
        if kind is em.ControlToken and token.type in ("if", "for"):
            return self._control(token, line, scanner)
        return _run_token(token)

    def _expression(self, text: str, line: int) -> Callable[[Machine], object]:
        if text in ("1", "True"):
            return lambda _: True
        if text in ("0", "False"):
            return lambda _: False
        return _Code(text, self._path, line, "eval").evaluate

    def _control(self, token: Any, line: int, scanner: _Scanner) -> Run:
        """Return a function that does the same as an `if` or a `for`. EmPy runs invalid ones, to report errors."""
        try:
            parts = token.build(["elif", "else"] if token.type == "if" else ["else"])
        except em.ParseError:
            return _run_token(token)
        otherwise = self._block_of(parts.pop()[1], scanner) if parts[-1][0].type == "else" else []
        if any(secondary.type == "else" for secondary, _ in parts):
            return _run_token(token)
        blocks = [self._block_of(tokens, scanner) for _, tokens in parts]
        if token.type == "if":
            tests = [self._expression(head.rest, self._line(scanner.starts[head])) for head, _ in parts]
            return self._if([*zip(tests, blocks, strict=True)], otherwise)
        sides = token.IN_RE.split(token.rest, 1)
        if len(sides) != len(("target", "values")):
            return _run_token(token)
        return self._for(sides[0], self._expression(sides[1], line), blocks[0], otherwise)

    def _if(self, branches: list[tuple[Callable[[Machine], object], Block]], otherwise: Block) -> Run:
        def run(machine: Machine) -> None:
            for test, block in branches:
                if test(machine):
                    self._run(block, machine)
                    return
            self._run(otherwise, machine)

        return run

    def _for(self, target: str, values: Callable[[Machine], Any], block: Block, otherwise: Block) -> Run:
        plain = _NAME.fullmatch(target)
        name = plain[1] if plain else ""

        def run(machine: Machine) -> None:
            for value in values(machine):
                try:
                    if name:
                        machine.globals[name] = value
                    else:
                        machine.assign(target, value, None)
                    self._run(block, machine)
                except em.ContinueFlow:
                    continue
                except em.BreakFlow:
                    break
            else:
                self._run(otherwise, machine)

        return run


def _write(text: str) -> Run:
    return lambda machine: machine.write(text)


def _expand(evaluate: Callable[[Machine], object]) -> Run:
    def run(machine: Machine) -> None:
        value = evaluate(machine)
        if value is not None:
            machine.write(str(value))

    return run


def _execute(code: _Code) -> Run:
    return code.execute


def _run_token(token: Any) -> Run:
    return lambda machine: token.run(machine, None)


class _Code:
    """Python code of a template.

    It is compiled when it first runs, because EmPy ignores errors in code that never runs.
    """

    def __init__(self, text: str, path: str, line: int, mode: str) -> None:
        self._text, self._path, self._line, self._mode = text, path, line, mode
        self._compiled: CodeType | None = None

    def evaluate(self, machine: Machine) -> object:
        return eval(self._compiled or self._compile(), machine.globals)  # noqa: S307 - a template is code

    def execute(self, machine: Machine) -> None:
        exec(self._compiled or self._compile(), machine.globals)  # noqa: S102 - a template is code

    def _compile(self) -> CodeType:
        """Compile the code with the line numbers of the template."""
        self._compiled = _compile(self._text, self._mode, self._path, self._line)
        return self._compiled


@lru_cache(maxsize=4096)
def _compile(text: str, mode: str, path: str = "<string>", line: int = 1) -> CodeType:
    """Compile `text` without the whitespace that EmPy (statements) or `eval` (expressions) removes."""
    if mode == "eval":
        text = text.lstrip(" \t")
    else:
        text = text.replace("\r", "")
        text = text if "\n" in text else text.strip()
    code: CodeType = compile("\n" * (line - 1) + text, path, mode, dont_inherit=True)
    return code


class Machine(em.Interpreter):  # type: ignore[misc]  # EmPy has no types
    """An interpreter of EmPy that caches compiled code; templates know it as `empy`."""

    included: dict[str, None]
    """The absolute paths of the included files, because a build system may start in another folder."""

    def include(self, fileOrFilename: Any, locals: Any = None) -> None:  # noqa: A002, N803 - EmPy's names
        """Include a file as EmPy does, and record it."""
        if isinstance(fileOrFilename, str):
            self.included[os.path.abspath(fileOrFilename)] = None
        super().include(fileOrFilename, locals)

    def evaluate(self, expression: str, locals: Mapping[str, object] | None = None) -> object:  # noqa: A002 - EmPy's name
        """Evaluate an expression as EmPy does, with cached code."""
        if self.hooksEnabled or expression in ("0", "1", "False", "True"):
            return super().evaluate(expression, locals)
        self.push()
        try:
            return eval(_compile(expression, "eval"), self.globals, locals)  # noqa: S307 - a template is code
        finally:
            self.pop()

    def execute(self, statements: str, locals: Any = None) -> None:  # noqa: A002 - EmPy's name
        """Execute statements as EmPy does, with cached code."""
        if self.hooksEnabled:
            super().execute(statements, locals)
            return
        self.push()
        try:
            exec(_compile(statements, "exec"), self.globals, locals)  # noqa: S102 - a template is code
        finally:
            self.pop()

    def write(self, data: str) -> None:
        """Write as EmPy does, with fewer calls."""
        self.streams.data[-1].write(data)

    def __del__(self) -> None:
        """Shut down an interpreter that a template created and did not shut down, while `sys.stdout` is a proxy."""
        if self.streams and isinstance(sys.stdout, em.ProxyFile):
            self.shutdown()

    def installProxy(self) -> None:  # noqa: N802 - EmPy's name
        """Do nothing, because Program.run installs and removes the proxy."""


class _Scanner(em.Scanner):  # type: ignore[misc]  # EmPy has no types
    """A scanner of EmPy that records where each token starts."""

    def __init__(self, prefix: str, text: str) -> None:
        super().__init__(prefix, text)
        self.starts: dict[Any, int] = {}
        self.failed = -1
        self._gone = 0

    def read_into(self, tokens: list[Any]) -> None:
        self.failed = -1
        while (token := self.one()) is not None:
            tokens.append(token)

    def one(self) -> Any:
        start = self._gone + self.pointer
        try:
            token = super().one()
        except em.ParseError:
            self.failed = start if self.failed < 0 else self.failed
            raise
        self.starts[token] = start
        return token

    def sync(self) -> None:
        self._gone += self.pointer if self.lock == 0 else 0
        super().sync()


class _Output:
    """The output stream of EmPy. Its text can be read after EmPy has closed it."""

    def __init__(self) -> None:
        self._parts: list[str] = []
        self.write = self._parts.append

    def text(self) -> str:
        return "".join(self._parts)

    def flush(self) -> None: ...

    def close(self) -> None: ...


class _Stdout(em.ProxyFile):  # type: ignore[misc]  # EmPy has no types
    """The `sys.stdout` of a template. As in EmPy, it writes to the stream of the interpreter that was started first."""

    def write(self, data: str) -> None:
        running = self.stack.data
        (running[0][1] if running else self.bottom).write(data)
