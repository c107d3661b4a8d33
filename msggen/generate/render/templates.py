"""The templates of users: Jinja2, which is strict, and EmPy, in which filters are functions.

Both know the same names, and their errors name the file and the line.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial

import jinja2
from jinja2 import meta

from msggen.base.diagnostics import InputError, input_error, suggestion
from msggen.generate.render import THINGS
from msggen.generate.text.empy import EmpyTemplate, nearest_name
from msggen.generate.text.words import FILTERS, NotTextError, known_names, read_template, unknown_name, with_article

_NOT_DEFINED = " is not defined"
"""The end of a message about an unknown name to which no name is similar."""


_OF_FIRMWARE = (
    "all_topics file_base_name file_name_in genmsg msg_context msgs name_snake_case publications "
    "px_generate_uorb_topic_helper search_path spec subscriptions subscriptions_multi topics type_includes"
)
"""The names and modules that the firmware's own templates use."""


class JinjaTemplate:
    """A template that can be expanded any number of times. It can include files from its folder and from subfolders."""

    def __init__(self, path: str) -> None:
        """Read the template at `path`. Raises InputError if it cannot be read or is not valid Jinja2."""
        self.path = path
        self._loader = _Loader(os.path.dirname(path))
        environment = make_environment(self._loader)
        self._loader.read(path)
        with _reported(path, self._loader.files):
            self._template = environment.get_template(os.path.basename(path))

    @property
    def names(self) -> frozenset[str] | None:
        """The names that the template and its includes use. None if an include is computed, missing or invalid."""
        loader = _Loader(os.path.dirname(self.path))
        environment = make_environment(loader)
        waiting, known = [os.path.basename(self.path)], set[str]()
        used = frozenset[str]()
        while waiting:
            name = waiting.pop()
            known.add(name)
            try:
                tree = environment.parse(loader.get_source(environment, name)[0])
                used |= meta.find_undeclared_variables(tree)
            except (jinja2.TemplateError, InputError):
                return None
            for other in meta.find_referenced_templates(tree):
                if other is None:
                    return None
                waiting += [] if other in known else [other]
        return used

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that were read so far: the template and its includes."""
        return tuple(self._loader.files)

    def expand(self, names: Mapping[str, object]) -> str:
        """Return the text of the template for `names`. Raises InputError with the line of the error."""
        with _reported(self.path, self._loader.files, names):
            return self._template.render(names)


class Empy:
    """A template that can be expanded any number of times. It may import modules from its folder."""

    def __init__(self, path: str) -> None:
        """Read the template at `path`. Raises InputError if it cannot be read or is not valid EmPy."""
        self.path = path
        self._template = EmpyTemplate(path)

    @property
    def names(self) -> None:
        """The names that the template uses are not known: any Python code may use them."""
        return

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that were read so far: the template, its includes, and its own modules."""
        return self._template.inputs

    def expand(self, names: Mapping[str, object]) -> str:
        """Return the text of the template for `names`. Raises InputError with the line of the error."""
        folder = os.path.dirname(self.path) or os.curdir
        return self._template.expand({**FILTERS, **names}, [folder], partial(_hint_of_empy, names, folder))


class Pattern:
    """A pattern for the names of outputs, given on the command line as `option`."""

    def __init__(self, text: str, option: str) -> None:
        """Parse the pattern. Raises InputError if it is not valid Jinja2."""
        self._option = option
        with _reported(option, {}):
            self._template = make_environment(jinja2.BaseLoader()).from_string(text)

    def expand(self, names: Mapping[str, object]) -> str:
        """Return the name of the output for `names`. Raises InputError."""
        with _reported(self._option, {}, names):
            return self._template.render(names)


def make_environment(loader: jinja2.BaseLoader) -> jinja2.Environment:
    """Return an environment for templates of code: blocks leave no empty lines, and every name must be defined."""
    environment = jinja2.Environment(
        loader=loader,
        undefined=_Undefined,
        finalize=_checked,
        extensions=("jinja2.ext.do", "jinja2.ext.loopcontrols"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        auto_reload=False,
        autoescape=False,  # noqa: S701 - the output is any text, not HTML
    )
    environment.filters.update(FILTERS)
    return environment


def _checked(value: object) -> object:
    """Return a value that a template writes. Raises NotTextError for an object that has no text of its own.

    Numbers, None, and lists of them or of strings have one, as templates of Python code need it.
    """
    if isinstance(value, (str, int, float, type(None))):
        return value
    if type(value).__str__ is not object.__str__:
        str(value)  # views and their lists raise here
    elif isinstance(value, (list, tuple, set, frozenset, dict)):
        for each in (*value, *value.values()) if isinstance(value, dict) else value:
            _checked(each)
    else:
        hint = ": call it" if callable(value) else ": loop over it" if isinstance(value, Iterable) else ""
        raise NotTextError(f"{with_article(type(value).__name__.replace('_', ' '))} is not text{hint}")
    return value


class _Loader(jinja2.FileSystemLoader):
    """A loader that reads templates from a folder and records their paths."""

    def __init__(self, folder: str) -> None:
        super().__init__(folder)
        self.files: dict[str, None] = {}

    def get_source(
        self,
        environment: jinja2.Environment,  # noqa: ARG002 - Jinja2's signature
        template: str,
    ) -> tuple[str, str, Callable[[], bool]]:
        """Return text, path and up-to-date check of a template.

        Raises TemplateNotFound, or InputError for a file that cannot be read.
        """
        folder = self.searchpath[0]
        path = os.path.join(folder, *jinja2.loaders.split_template_path(template))
        if not os.path.isfile(path):
            raise jinja2.TemplateNotFound(template)
        return self.read(path), path, lambda: True

    def read(self, path: str) -> str:
        """Return the text of a file. Raises InputError."""
        self.files[path] = None
        return read_template(path)


class _Undefined(jinja2.StrictUndefined):
    """An undefined name, with a message that suggests the nearest defined one."""

    __slots__ = ()

    @property
    def _undefined_message(self) -> str:
        name, owner = self._undefined_name, self._undefined_obj
        if self._undefined_hint is None and isinstance(name, str):
            if owner is jinja2.utils.missing:
                hint = f": it needs --each {name}" if name in THINGS else suggestion(name, THINGS)
                return f"'{name}'{_NOT_DEFINED}{hint}"
            return unknown_name(owner, name) or super()._undefined_message
        return super()._undefined_message


@contextmanager
def _reported(path: str, files: Mapping[str, None], names: Collection[str] = ()) -> Iterator[None]:
    """Raise exceptions of a template that knows `names` as InputError.

    Their place is the innermost line in one of `files`, or else `path`.
    """
    try:
        yield
    except InputError:
        raise
    except jinja2.TemplateSyntaxError as error:
        known = error.filename in files
        place = (error.filename or path, error.lineno) if known else _place(error, path, files)
        raise input_error(place[0], "T201", _with_hint(error.message or "not Jinja2"), place[1]) from None
    except Exception as error:  # noqa: BLE001 - a template is code: it may raise anything
        place = _place(error, path, files)
        raise input_error(place[0], *_describe(error, names), place[1]) from None


def _describe(error: Exception, names: Collection[str]) -> tuple[str, str]:
    """Return the code and the message for an exception of a template that knows `names`."""
    if isinstance(error, jinja2.UndefinedError):
        text = str(error)
        return "T202", f"{text}{known_names(names)}" if text.endswith(_NOT_DEFINED) else text
    if isinstance(error, NotTextError):
        return "T210", str(error)
    if isinstance(error, jinja2.TemplateNotFound):
        missing = ", ".join(f"'{name}'" for name in getattr(error, "templates", None) or [error.name])
        return "T203", f"no template {missing} in the folder of this template"
    if isinstance(error, jinja2.TemplateError):
        return "T204", str(error)
    return "T204", f"{type(error).__name__}: {error}".rstrip(": ")


def _place(error: Exception, path: str, files: Mapping[str, None]) -> tuple[str, int]:
    """Return the file and the line of the innermost template in the traceback; an option has no lines."""
    place = path, 1 if files else 0
    trace = error.__traceback__
    while trace:
        file = trace.tb_frame.f_code.co_filename
        place = (file, trace.tb_lineno) if file in files else place
        trace = trace.tb_next
    return place


def _with_hint(message: str) -> str:
    """Return a message, with a suggestion if it is about an unknown filter."""
    wrong = re.match(r"No filter named '(.*?)'", message)
    return message.rstrip(".") + (suggestion(wrong[1], [*FILTERS, *jinja2.filters.FILTERS]) if wrong else "")


def _hint_of_empy(names: Mapping[str, object], folder: str, error: BaseException) -> str:
    """Return what to do about an exception of a template in `folder` that knows `names`."""
    if isinstance(error, (NameError, ImportError)) and str(error.name).partition(".")[0] in _OF_FIRMWARE.split():
        return ": msggen px4-generate renders templates in the firmware's style"
    if isinstance(error, NameError):
        return nearest_name(error) or known_names(names)
    if isinstance(error, TypeError) and "for |: " in str(error):
        return ": in EmPy a filter is a function, as in snake_case(message.name)"
    if isinstance(error, FileNotFoundError) and isinstance(error.filename, str):
        path = os.path.join(folder, error.filename)
        return f", did you mean {path!r}?" if os.path.isfile(path) else ""
    return nearest_name(error)
