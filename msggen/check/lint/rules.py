"""The table of the rules of `lint`. All of them are advice: their findings are warnings."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from msggen.check.finding import Category, Change, Rule, Severity
from msggen.check.lint import fields, frame
from msggen.check.lint.annotation import INEXACT, MALFORMED, UNKNOWN, find_annotations
from msggen.check.lint.definition import Definition


def _find(kinds: tuple[str, ...], definition: Definition) -> Iterator[Change]:
    """Yield the annotations of some kinds that have a problem."""
    for found in find_annotations(definition):
        if found.kind in kinds and found.problem:
            yield definition.change(found.remark.element, f"{found.remark.title}: {found.problem}", found.text)


_advice = partial(Rule, severity=Severity.WARNING)

LINT = (
    _advice(
        "TAG_MALFORMED",
        "a tag is not closed, is given twice, or has no brackets or no '@'",
        Category.TAG,
        partial(_find, (MALFORMED,)),
        fix="Write the tag in brackets, with an '@' before its name unless it is a unit: `[m] [@range 0, 100]`.",
    ),
    _advice(
        "TAG_UNKNOWN",
        "a tag has an unknown name",
        Category.TAG,
        partial(_find, (UNKNOWN,)),
        fix="Correct the name. The known tags are `@range`, `@enum`, `@invalid`, `@frame` and `@uncontrolled`.",
    ),
    _advice(
        "RANGE_INVALID",
        "a range cannot be read, has the larger bound first, or has a bound outside the range of the field's type",
        Category.TAG,
        partial(_find, ("range",)),
        fix="Write the smallest and the largest value, such as `[@range 0, 1]`. `inf`, `pi` and `2pi` are values.",
    ),
    _advice(
        "VALUE_INVALID",
        "the value of '@invalid' or '@uncontrolled' cannot be read, or is outside the range of the field's type",
        Category.TAG,
        partial(_find, ("invalid", "uncontrolled")),
        fix="Write a number, `NaN` or the name of a constant first, such as `[@invalid -1 if not measured]`.",
    ),
    _advice(
        "UNIT_UNKNOWN",
        "a unit is unknown or misspelt",
        Category.UNIT,
        partial(_find, ("unit",)),
        fix="Write a product of powers of known units, such as `[rad/s^2]`, and `[-]` for a value without a unit.",
    ),
    _advice(
        "UNIT_INCONSISTENT",
        "fields that are parts of one vector have different units, or only some of them have one",
        Category.UNIT,
        fields.find_inconsistent_units,
        fix="Give all of them the same unit. If they have different units on purpose, add this rule to "
        "`per-message-ignores`.",
    ),
    _advice(
        "ENUM_WITHOUT_CONSTANTS",
        "no constant of the message has the prefix of an enum, or its field is not an integer",
        Category.ENUM,
        partial(_find, ("enum",)),
        fix="Write the words that the names of the constants begin with: `[@enum STATE]` for `STATE_IDLE`. If the "
        "constants belong to another message, name it in a sentence.",
    ),
    _advice(
        "ENUM_INEXACT",
        "the prefix of an enum has words that its constants do not have",
        Category.ENUM,
        partial(_find, (INEXACT,)),
        fix="Write the prefix as the constants have it. msggen leaves out the first words, but other tools may not.",
    ),
    _advice(
        "CONSTANTS_UNUSED",
        "no field has the constants as values",
        Category.ENUM,
        fields.find_unused_constants,
        fix="Add `[@enum PREFIX]` to the comment of the field that has these values. Constants that are not values "
        "of a field, such as limits, can stay: add this rule to `per-message-ignores`.",
        is_default=False,
    ),
    _advice(
        "FRAME_UNKNOWN",
        "a frame of reference is unknown",
        Category.FRAME,
        partial(_find, ("frame",)),
        fix="Write the axes: `[@frame NED]`, `[@frame FRD]`. If a field of the message tells the frame, write "
        "`[@frame @name_of_the_field]`.",
    ),
    _advice(
        "FRAME_MISSING",
        "a position, velocity, acceleration or attitude has no frame of reference",
        Category.FRAME,
        frame.find_missing,
        fix="Add the frame to the comment of the field, such as `[@frame NED]`. For an attitude, this tag means the "
        "rotation from FRD to NED, and `[@frame ENU]` that from FLU to ENU. Name the frames of another rotation in a "
        "sentence.",
    ),
    _advice(
        "DESCRIPTION_MISSING",
        "a message or a field has no description",
        Category.DOCUMENTATION,
        fields.find_undocumented,
        fix="Write a comment: for a message at the top of its file, for a field on its line or directly above it.",
        is_default=False,
    ),
    _advice(
        "PADDING_AVOIDABLE",
        "samples in DDS have padding that another order of the fields avoids",
        Category.LAYOUT,
        fields.find_avoidable_padding,
        fix="Sort the fields of a new message by alignment: first those with values of 8 bytes, then 4, 2 and 1. Do "
        "not reorder a message that is already in use, because that breaks every application. The firmware's own "
        "struct has no padding between values: its generator sorts them.",
        is_default=False,
    ),
)
"""The rules, in the order in which they are listed and applied."""
