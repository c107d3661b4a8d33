"""The parser of EmPy templates. It makes a function of each piece of markup, and compiles its code once."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

from msggen.generate.text.empy_functions import (
    Block,
    Code,
    Evaluate,
    Interpreter,
    Run,
    choose,
    expand,
    fall_back,
    raising,
    write,
)
from msggen.generate.text.empy_markup import Markup, MarkupError, first_outside_strings

_NAME = re.compile(r"\s*([_a-zA-Z][_a-zA-Z0-9]*)\s*")
_IN = re.compile(r"\bin\b")

_PARTS: Mapping[str, tuple[str, ...]] = {
    "if": ("elif", "else"),
    "for": ("else",),
    "while": ("else",),
    "try": ("except", "finally"),
    "def": (),
}
"""The controls that have an end, and those that may divide each one."""

_DIVIDERS = frozenset(name for names in _PARTS.values() for name in names)
_WITH_ARGUMENTS = frozenset({"if", "elif", "for", "while", "def", "end"})


class _BreakError(MarkupError):
    """The control `break`."""


class _ContinueError(MarkupError):
    """The control `continue`."""


_FLOW = {"break": _BreakError, "continue": _ContinueError}


class _Part(NamedTuple):
    """A control, such as `if` or `else`, and the block after it. A template is the block after a control ""."""

    kind: str
    code: str
    line: int
    block: Block


class Parser:
    """A parser of a template. `run` runs a block."""

    def __init__(self, path: str, text: str, run: Callable[[Block, Interpreter], None]) -> None:
        self._path = path
        self._markup = Markup(text)
        self._run = run

    def program(self) -> Block:
        """Return the block of the template. Raises MarkupError."""
        try:
            return self._parts(_Part("", "", 1, []))[0].block
        except RecursionError:
            raise self._markup.error("blocks are nested too deeply") from None

    def _parts(self, first: _Part) -> list[_Part]:
        """Read the block after `first` to its end, and the parts that divide it."""
        parts = [first]
        while True:
            if text := self._markup.plain():
                parts[-1].block.append((self._markup.line, write(text)))
            mark = self._markup.mark()
            line = self._markup.line
            if not mark:
                if first.kind:
                    raise MarkupError(f"unterminated markup: control '{first.kind}' needs more tokens", first.line)
                return parts
            part = self._part() if mark == "[" else None
            if part and part.kind == "end":
                if not first.kind:
                    raise MarkupError("control 'end' requires primary markup", line)
                if part.code != first.kind:
                    raise MarkupError(f"control must end with 'end {first.kind}'", first.line)
                return parts
            if part and part.kind in _DIVIDERS:
                parts.append(_checked(part, parts))
            elif run := self._control(part) if part else self._simple(mark):
                parts[-1].block.append((line, run))

    def _part(self) -> _Part:
        kind, _, code = self._markup.enclosed("[").strip().partition(" ")
        if kind in _WITH_ARGUMENTS and not code:
            raise self._markup.error(f"control '{kind}' needs arguments")
        if kind not in {*_PARTS, *_DIVIDERS, *_FLOW, "end"}:
            raise self._markup.error(f"unknown control markup: '{kind}'")
        return _Part(kind, code, self._markup.line, [])

    def _control(self, part: _Part) -> Run:
        if part.kind in _FLOW:
            return raising(_FLOW[part.kind], f"control '{part.kind}' without 'for', 'while'", part.line)
        start = self._markup.place
        parts = self._parts(part)
        if part.kind == "def":
            text = self._markup.text[start : self._markup.start]
            return Code(f"def {part.code}:\n return empy.expand({text!r}, locals())", "<string>", 1, "exec").execute
        if part.kind == "try":
            return self._try(part, parts[1:])
        otherwise = parts.pop().block if parts[-1].kind == "else" else []
        if part.kind == "if":
            return self._if([(self._expression(code, line), block) for _, code, line, block in parts], otherwise)
        if part.kind == "while":
            return self._while(self._expression(part.code, part.line), part.block, otherwise)
        target, *values = _IN.split(part.code, maxsplit=1)
        if not values:
            raise MarkupError("control expected 'for x in seq'", part.line)
        return self._for(target, self._expression(values[0], part.line), part.block, otherwise)

    def _if(self, branches: list[tuple[Evaluate, Block]], otherwise: Block) -> Run:
        def run(machine: Interpreter) -> None:
            for test, block in branches:
                if test(machine):
                    self._run(block, machine)
                    return
            self._run(otherwise, machine)

        return run

    def _for(self, target: str, values: Evaluate, block: Block, otherwise: Block) -> Run:
        plain = _NAME.fullmatch(target)
        name = plain[1] if plain else ""

        def run(machine: Interpreter) -> None:
            for value in values(machine):
                try:
                    if name and machine.scope is None:
                        machine.globals[name] = value
                    else:
                        machine.assign(target, value, machine.scope)
                    self._run(block, machine)
                except _ContinueError:
                    continue
                except _BreakError:
                    break
            else:
                self._run(otherwise, machine)

        return run

    def _while(self, test: Evaluate, block: Block, otherwise: Block) -> Run:
        """Return a loop. In EmPy 3.3 its `else` is only run if the loop was never run."""

        def run(machine: Interpreter) -> None:
            ran = False
            while test(machine):
                ran = True
                try:
                    self._run(block, machine)
                except _ContinueError:
                    continue
                except _BreakError:
                    break
            if not ran:
                self._run(otherwise, machine)

        return run

    def _try(self, part: _Part, others: list[_Part]) -> Run:
        kinds = [other.kind for other in others]
        if kinds == ["finally"]:
            return self._try_finally(part.block, others[0].block)
        if not kinds:
            raise MarkupError("control 'try' needs 'except' or 'finally'", part.line)
        if "finally" in kinds:
            raise MarkupError("control 'try' cannot have 'finally' and other parts", part.line)
        handlers = []
        for _, code, line, block in others:
            caught, _, name = code.partition(",")
            handlers.append((self._expression(caught.strip() or "Exception", line), name.strip(), block))
        return self._try_except(part.block, handlers)

    def _try_finally(self, block: Block, last: Block) -> Run:
        def run(machine: Interpreter) -> None:
            try:
                self._run(block, machine)
            finally:
                self._run(last, machine)

        return run

    def _try_except(self, block: Block, handlers: list[tuple[Evaluate, str, Block]]) -> Run:
        def run(machine: Interpreter) -> None:
            try:
                self._run(block, machine)
            except (_BreakError, _ContinueError):
                raise
            except Exception as error:
                handler = next((each for each in handlers if isinstance(error, each[0](machine))), None)
                if not handler:
                    raise
                if handler[1]:
                    machine.assign(handler[1], error, machine.scope)
                self._run(handler[2], machine)

        return run

    def _simple(self, mark: str) -> Run | None:
        """Return a function for the markup that starts with `@` and `mark`, or None if the markup does nothing."""
        read = _READERS.get(mark)
        if read is None:
            raise self._markup.error(f"unknown markup: @{mark}")
        return read(self, mark)

    def _expression(self, code: str, line: int) -> Evaluate:
        if code in ("1", "True"):
            return lambda _: True
        if code in ("0", "False"):
            return lambda _: False
        return Code(code, self._path, line, "eval").evaluate

    def _here(self, code: str) -> Evaluate:
        return self._expression(code, self._markup.line)

    def nothing(self, _mark: str) -> None:
        """Read `@` and white space."""

    def comment(self, _mark: str) -> None:
        """Read `@# comment`."""
        self._markup.rest_of_line()

    def literal(self, mark: str) -> Run:
        """Read `@@` or an escaped bracket."""
        return write(mark)

    def name(self, _mark: str) -> Run:
        """Read `@name`, `@name(1).other[0]`."""
        return expand(self._here(self._markup.name()))

    def string(self, _mark: str) -> Run:
        """Read `@'a string of Python'`."""
        return expand(self._here(self._markup.string()))

    def statement(self, mark: str) -> Run:
        """Read `@{statements}`."""
        return Code(self._markup.enclosed(mark), self._path, self._markup.line, "exec").execute

    def bracketed(self, mark: str) -> Run:
        """Read `@(value)` or `@(test ? value ! otherwise $ after an exception)`."""
        code = self._markup.enclosed(mark)
        code, after = _split("$", code)
        test, values = _split("?", code)
        value, otherwise = _split("!" if first_outside_strings("!", values) >= 0 else ":", values)
        evaluate = self._here(test)
        if value:
            evaluate = choose(evaluate, self._here(value), self._here(otherwise or "None"))
        return expand(fall_back(evaluate, self._here(after)) if after else evaluate)

    def repr(self, mark: str) -> Run:
        """Read `` @`value` ``."""
        evaluate = self._here(self._markup.until(mark))
        return lambda machine: machine.write(repr(evaluate(machine)))

    def in_place(self, mark: str) -> Run:
        """Read `@:value:what it was before:`."""
        code = self._markup.until(mark)
        self._markup.until(mark)
        value = expand(self._here(code))

        def run(machine: Interpreter) -> None:
            machine.write(f"@:{code}:")
            value(machine)
            machine.write(":")

        return run

    def significator(self, _mark: str) -> Run:
        """Read `@%key value`, which sets the name `__key__`."""
        line = self._markup.rest_of_line()
        if not line.strip() or line[0].isspace():
            raise self._markup.error("significator must have nonblank key")
        key, *value = line.split(maxsplit=1)
        evaluate = self._here(value[0].strip() if value else "None")
        return lambda machine: machine.significate(key, evaluate(machine), machine.scope)

    def escape(self, _mark: str) -> Run:
        """Read the markup of an escaped character."""
        return write(self._markup.escape())

    def custom(self, mark: str) -> Run:
        """Read `@<text>`, for the function that a template registered."""
        code = self._markup.enclosed(mark)
        return lambda machine: machine.invokeCallback(code) if machine.callback else None


_READERS: Mapping[str, Callable[[Parser, str], Run | None]] = {
    **dict.fromkeys(" \t\v\r\n", Parser.nothing),
    **dict.fromkeys("@)]}", Parser.literal),
    **dict.fromkeys("_abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ", Parser.name),
    **dict.fromkeys("'\"", Parser.string),
    "#": Parser.comment,
    "{": Parser.statement,
    "(": Parser.bracketed,
    "`": Parser.repr,
    ":": Parser.in_place,
    "%": Parser.significator,
    "\\": Parser.escape,
    "<": Parser.custom,
}


def _checked(part: _Part, before: list[_Part]) -> _Part:
    """Return a part if it may follow those before it. Raises MarkupError."""
    first, last = before[0].kind, before[-1].kind
    if not first:
        raise MarkupError(f"control '{part.kind}' cannot be at this level", part.line)
    if part.kind not in _PARTS[first] or last == "else":
        raise MarkupError(f"control '{first}' unexpected secondary: '{part.kind}'", part.line)
    return part


def _split(mark: str, code: str) -> tuple[str, str]:
    """Return the code before and after the first `mark`."""
    place = first_outside_strings(mark, code)
    return (code, "") if place < 0 else (code[:place], code[place + 1 :])
