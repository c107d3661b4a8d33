"""EmPy templates, with errors that name the file and the line.

The module `empy_program`, which imports EmPy, is imported only when a template is used.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from traceback import walk_tb
from types import ModuleType
from typing import TYPE_CHECKING, TypeAlias

from msggen.base.diagnostics import InputError, input_error, suggestion
from msggen.base.disk.resources import PACKAGE
from msggen.generate.text.words import NotTextError, read_template, unknown_name

if TYPE_CHECKING:
    from msggen.generate.text.empy_program import Program

Hint: TypeAlias = "Callable[[BaseException], str]"
"""A function that returns what to do about an exception of a template, as the end of its message."""


def nearest_name(error: BaseException) -> str:
    """Return a suggestion for an unknown name or attribute, or "" for other errors and if no name is near."""
    name = getattr(error, "name", None) or ""
    if isinstance(error, AttributeError):
        return suggestion(name, (known for known in dir(error.obj) if not known.startswith("_")))
    if isinstance(error, NameError):
        frame = [*walk_tb(error.__traceback__)][-1][0]
        return suggestion(name, (known for known in (*frame.f_locals, *frame.f_globals) if not known.startswith("__")))
    return ""


class EmpyTemplate:
    """A template that can be expanded any number of times: it is parsed and compiled once."""

    def __init__(self, path: str, text: str | None = None) -> None:
        """Read the template at `path`, or use `text` as its content.

        Raises InputError if EmPy is not installed, if the file cannot be read, or if its markup is invalid.
        """
        self.path = path
        self._modules: dict[str, ModuleType] = {}
        self._program = _program(path, read_template(path) if text is None else text)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that were read so far: the template, its includes, and its own modules."""
        modules = (getattr(module, "__file__", None) for module in self._modules.values())
        return (self.path, *self._program.included, *filter(None, modules))

    def expand(self, names: Mapping[str, object], prepare_path: Sequence[str] = (), hint: Hint = nearest_name) -> str:
        """Return the text of the template for `names`. It may import modules from the folders `prepare_path`.

        The mapping of names is not changed. Changes of `sys.path` and `sys.stdout` are undone. Modules from
        `prepare_path` are visible only to this template, and are kept for its next expansion.
        Raises InputError for any exception that the template raises. An InputError about another input is not wrapped.
        """
        with importing_from(prepare_path, self._modules):
            try:
                text = self._program.run(dict(names))
                os.fsencode(text)
            except (Exception, SystemExit) as error:
                if isinstance(error, InputError):
                    raise
                code, text = _describe(error, self.path, hint)
                raise input_error(self.path, code, text, self._program.line_of(error)) from error
        return text


def _program(path: str, text: str) -> Program:
    """Return the parsed template. Raises InputError."""
    _check_empy(path)
    from msggen.generate.text.empy_markup import MarkupError
    from msggen.generate.text.empy_program import Program

    try:
        return Program(path, text)
    except MarkupError as error:
        raise input_error(path, "T103", str(error), error.line) from error


def _check_empy(path: str) -> None:
    """Raise InputError if the module `em` is missing or is not EmPy 3.3 or 4."""
    wanted = "this template needs EmPy 3.3 or 4 (pip install 'empy>=3.3,<5')"
    try:
        import em
    except ImportError as error:
        raise input_error(path, "T101", f"{wanted}: {error}", 0) from error
    version = str(getattr(em, "__version__", "without a version"))
    if not version.startswith(("3.3", "4.")):
        raise input_error(path, "T101", f"{wanted}, found the module 'em' {version} at {em.__file__}", 0)


def _describe(error: BaseException, path: str, hint: Hint) -> tuple[str, str]:
    """Return the code and the message for an exception that the template at `path` raised."""
    from msggen.generate.text.empy_program import is_of_empy

    if is_of_empy(error):
        return "T103", str(error)
    if isinstance(error, SyntaxError) and error.filename is not None:
        if error.filename == path or error.filename.startswith("<"):
            return "T104", f"not Python: {error.msg}"
        return "T105", f"{type(error).__name__}: {error.msg}, raised at {error.filename}:{error.lineno}"
    if isinstance(error, SystemExit):
        return "T105", f"the template called exit({'' if error.code is None else error.code!r})"
    if isinstance(error, NotTextError):
        return "T210", f"{error}{_raised_at(error)}"
    known = unknown_name(error.obj, error.name or "") if isinstance(error, AttributeError) else ""
    return "T105", f"{known or _text_of(error) + hint(error)}{_raised_at(error)}"


def _text_of(error: BaseException) -> str:
    """Return the name and the text of an exception, without the number of a system error."""
    text = str(error)
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        text = f"cannot open {error.filename!r}: {error.strerror}"
    return f"{type(error).__name__}: {text}".rstrip(": ")


def _raised_at(error: BaseException) -> str:
    """Return the place in a module of the template that raised `error`, or "" for the template and for libraries."""
    engine = sys.modules["em"].__file__ or "<"
    libraries = (os.path.dirname(os.__file__), PACKAGE, engine, "<")
    places = [(frame.f_code.co_filename, line) for frame, line in walk_tb(error.__traceback__)]
    path, line = next((place for place in reversed(places) if not place[0].startswith(libraries)), ("", 0))
    return f", raised at {path}:{line}" if path.endswith(".py") else ""


@contextmanager
def importing_from(folders: Sequence[str], modules: dict[str, ModuleType]) -> Iterator[None]:
    """Add `modules` to `sys.modules`, and `folders` to the front of `sys.path`.

    Afterwards `sys.path` and `sys.modules` are restored, and `modules` also holds the modules imported from `folders`.
    """
    path, before = sys.path[:], dict(sys.modules) if folders or modules else {}
    roots = tuple(os.path.join(os.path.abspath(folder), "") for folder in folders)
    sys.path[:0] = folders
    sys.modules.update(modules)
    try:
        yield
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - set(before) if roots else ():
            file = getattr(sys.modules[name], "__file__", None)
            if file and os.path.abspath(file).startswith(roots):
                modules[name] = sys.modules[name]
        for name in modules:
            del sys.modules[name]
            if name in before:
                sys.modules[name] = before[name]
