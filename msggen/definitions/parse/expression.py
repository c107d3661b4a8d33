"""Evaluation of boolean expressions of CMake and Kconfig. The values of operands may be unknown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, TypeAlias

Truth = bool | None
"""A truth value, None if it is unknown."""

Terms: TypeAlias = list[Truth | str]
"""Values with `and` and `or` between them."""


class Grammar(NamedTuple):
    """The operators of a language, and the function that reduces terms to a value."""

    operators: Mapping[str, str]
    reduced: Callable[[Terms], Truth]


def evaluate(words: Iterable[str], grammar: Grammar, holds: Callable[[Sequence[str]], Truth]) -> Truth:
    """Return the value of an expression, None if it is unknown or the expression is invalid.

    `holds` returns the value of an operand: the words between two operators or parentheses. The function is not
    recursive, because parentheses may be nested to any depth.
    """
    open_terms: list[Terms] = [[], []]
    operand: list[str] = []
    try:
        for word in (*words, ")"):
            operator = grammar.operators.get(word)
            if operator is None and word not in ("(", ")"):
                operand.append(word)
                continue
            if operand:
                _add(open_terms[-1], holds(operand))
                operand = []
            if operator:
                open_terms[-1].append(operator)
            elif word == "(":
                open_terms.append([])
            else:
                value = _checked(open_terms.pop(), grammar)
                _add(open_terms[-1], value)
    except IndexError:
        return None
    return _checked(open_terms[0], grammar) if len(open_terms) == 1 else None


def both(left: Truth, right: Truth) -> Truth:
    """Return the value of `left and right`."""
    if left is False or right is False:
        return False
    return None if left is None or right is None else True


def negated(value: Truth) -> Truth:
    """Return the value of `not value`."""
    return None if value is None else not value


def _add(terms: Terms, value: Truth) -> None:
    """Add a value, negated by each `not` before it."""
    while terms and terms[-1] == "not":
        terms.pop()
        value = negated(value)
    terms.append(value)


def _checked(terms: Terms, grammar: Grammar) -> Truth:
    """Return the value of terms, None unless values and the operators `and` and `or` alternate."""
    values, operators = terms[::2], terms[1::2]
    if len(values) != len(operators) + 1 or any(isinstance(value, str) for value in values):
        return None
    return grammar.reduced(terms) if all(operator in ("and", "or") for operator in operators) else None


def _joined(left: Truth | str, operator: Truth | str, right: Truth | str) -> Truth:
    if isinstance(left, str) or isinstance(right, str):
        return None
    return both(left, right) if operator == "and" else negated(both(negated(left), negated(right)))


def _in_rounds(terms: Terms) -> Truth:
    """Reduce terms as CMake does, in which AND and OR have the same precedence.

    Neighbouring values are joined in pairs, then neighbouring results in pairs, and so on.
    """
    while len(terms) > 1:
        pairs = [terms[start : start + 4] for start in range(0, len(terms), 4)]
        terms = []
        for left, *more in pairs:
            terms.append(_joined(left, more[0], more[1]) if len(more) > 1 else left)
            terms += more[2:]
    return None if isinstance(terms[0], str) else terms[0]


def _and_first(terms: Terms) -> Truth:
    """Reduce terms in which `and` has a higher precedence than `or`."""
    result: Truth = False
    group = terms[0]
    for operator, value in zip(terms[1::2], terms[2::2], strict=True):
        if operator == "and":
            group = _joined(group, operator, value)
        else:
            result, group = _joined(result, "or", group), value
    return _joined(result, "or", group)


CMAKE = Grammar({"OR": "or", "AND": "and", "NOT": "not"}, _in_rounds)
KCONFIG = Grammar({"||": "or", "&&": "and", "!": "not"}, _and_first)
