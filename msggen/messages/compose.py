"""Messages from mappings of values, as a user writes them in YAML: enums by name, and errors with the nearest name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from importlib import import_module
from operator import or_
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import suggestion
from msggen.messages.packages import package_of_class

if TYPE_CHECKING:
    from msggen.messages.packages import MessageT

_FEW = 12
"""The most members of an enum that an error lists."""


class ValuesError(ValueError):
    """Values that a message cannot have. `problems` has a line for each of them, with its path."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


def compose(cls: type[MessageT], values: object) -> MessageT:
    """Return a message with values by the names of its fields. Fields without a value are zero.

    A number can be the name of a member of its enum, several flags with `|` between them, or the name of a constant. An
    array needs all its values, `char[N]` takes text, and a nested message a mapping. None stands for no values.
    Raises ValuesError, with all problems.
    """
    composer = _Composer(cls)
    message = composer.message(cls, {} if values is None else values, "")
    if composer.problems:
        raise ValuesError(composer.problems)
    try:
        return cls.decode(message.encode())  # as the vehicle will see it
    except ValueError as error:
        raise ValuesError([str(error)]) from None


class _Composer:
    """Makes a message, and collects what is wrong with its values."""

    def __init__(self, cls: type[Any]) -> None:
        package = package_of_class(cls).__name__
        self._meaning, self._explain, self._text = (
            import_module(f"{package}.{name}") for name in ("meaning", "explain", "text")
        )
        self.problems: list[str] = []

    def _refuse(self, path: str, problem: str) -> None:
        self.problems.append(f"{path}: {problem}" if path else problem)

    def message(self, cls: type[Any], values: object, path: str) -> Any:
        """Return a message of `cls`, with zeros in place of wrong values."""
        if not isinstance(values, Mapping):
            first = cls.__msg__.fields[-1].name
            self._refuse(path, f"expected the fields of {cls.__msg__.name}, such as {{{first}: ...}}, got {values!r}")
            return cls()
        rules = {rule.field.name: rule for rule in self._meaning.rules(cls())}
        made = {}
        for name, value in values.items():
            try:
                field = cls.__msg__.field(str(name))
            except KeyError as error:
                self._refuse(path, f"{error}{_listed(cls, str(error))}")
                continue
            found = self._field(cls, rules[field.name], value, f"{path}.{field.name}" if path else field.name)
            if found is not None:
                made[field.attribute] = found
        return cls(**made)

    def _field(self, cls: type[Any], rule: Any, value: object, path: str) -> Any:
        """Return the value of a field, or None after a problem."""
        if not rule.is_array:
            return self._one(cls, rule, value, path)
        if not isinstance(value, (list, tuple)):
            self._refuse(path, f"expected {_expected(rule)}, got {value!r}")
            return None
        if rule.field.length not in (None, len(value)):
            self._refuse(path, f"expected {_expected(rule)}, got {len(value)}")
            return None
        items, known = [], len(self.problems)
        for index, item in enumerate(value):
            items.append(self._one(cls, rule, item, f"{path}[{index}]"))
            if len(self.problems) > known:
                return None  # the others are likely to have the same problem
        return bytes(items) if rule.is_octets else items

    def _one(self, cls: type[Any], rule: Any, value: object, path: str) -> Any:
        """Return one value of a field, or None after a problem."""
        if rule.nested is not None:
            return self.message(rule.nested, value, path)
        if rule.is_text:
            return self._packed(rule, value, path)
        if isinstance(value, str):
            value = self._named(cls, rule, value, path)
            if value is None:
                return None
        problem = self._explain.number_problem(rule.base, value, "")
        if problem:
            self._refuse(path, problem.removeprefix(": "))
            return None
        return value

    def _packed(self, rule: Any, value: object, path: str) -> Any:
        """Return text as its field holds it, or None after a problem."""
        if not isinstance(value, str):
            self._refuse(path, f"expected text, got {value!r}")
            return None
        if rule.base != "char":
            return value
        size, length = len(value.encode(errors="replace")), rule.field.length
        if size > length:
            self._refuse(path, f"expected text of up to {length} bytes, got {size}")
            return None
        return self._text.pack(value, length)

    def _named(self, cls: type[Any], rule: Any, text: str, path: str) -> Any:
        """Return the number that a text names, or None after a problem."""
        if rule.base in ("float32", "float64"):
            try:
                return float(text)  # YAML reads `nan` and `1e3` as text
            except ValueError:
                pass
        members = {} if rule.enum is None else {name: int(value) for name, value in rule.enum.__members__.items()}
        is_mask = rule.bits is not None  # its constants may be the numbers of bits
        known = members if is_mask else {**{each.name: each.value for each in cls.__msg__.constants}, **members}
        names = [name.strip() for name in text.split("|")] if is_mask else [text]
        for name in names:
            if name not in known:
                near = suggestion(name, known)
                own = f": there are {', '.join(members)}" if 0 < len(members) <= _FEW else ""
                kind = f"a member of {rule.enum.__name__}" if members else f"a {rule.base}"
                self._refuse(path, f"expected {kind}, got {name!r}{near or own}")
                return None
        return reduce(or_, [known[name] for name in names])


def _listed(cls: type[Any], error: str) -> str:
    """Return the names of the fields for an error that suggests none, if they are few."""
    names = [f"'{field.name}'" for field in cls.__msg__.fields]
    return "" if error.endswith("?") or len(names) > _FEW else f": it has {', '.join(names)}"


def _expected(rule: Any) -> str:
    length = rule.field.length
    return f"a list of {rule.field.base}" if length is None else f"a list of {length} values"
