"""Frames of reference: unknown ones, and vectors without one. Also fields that are parts of one vector or rotation."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from msggen.base.diagnostics import suggestion
from msggen.check.finding import Change
from msggen.check.lint.definition import Definition
from msggen.definitions.model import Comment, Field, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.unit import normalized_unit

FRAMES = ("NED", "ENU", "FRD", "FLU", "Body", "Sensor", "ECEF", "WGS84", "MSL", "AMSL")
"""The frames of reference that tags name."""

_SPELLINGS = frozenset(
    [
        *(frame.lower() for frame in FRAMES),
        *("body frd", "body flu", "body frame", "body frame frd", "body frame flu", "local frd", "local flu"),
    ]
)
_LOCAL = "local frame"
_POSE_FRAME = "pose_frame"
"""A frame that a field of the message names: that of VehicleOdometry.position."""

_NAMED = re.compile(r"\b(?:NED|ENU|FRD|FLU)\b")
_EXPLAINED = re.compile(r"\b(?:NED|ENU|FRD|FLU|body|earth|world|local|sensor|axes|frames?|pose_frame)\b", re.IGNORECASE)
"""Words of sentences that tell the two frames of an attitude."""

_BODY = re.compile(r"\bbody\b", re.IGNORECASE)
_ROTATIONS = {frozenset({"FRD", "NED"}): "NED", frozenset({"FLU", "ENU"}): "ENU"}
"""The frames that a sentence names, and the tag that means the rotation from the first to the second."""

_VECTOR = re.compile(r"(?:^|_)(?:position|velocity|acceleration)(?:_|$)")
_ATTITUDE = re.compile(r"(?:^|_)(?:attitude|quaternion|q)(?:_|$)")
_NO_VECTOR = re.compile(r"(?:^|_)(?:var|variances?|cov|covariance|std|stddev|accuracy|noise)(?:_|$)|^delta_q")
_AXES = 3
_UNITS = frozenset({"m", "m s^-1", "m s^-2"})
"""The units of positions, velocities and accelerations."""

AXES_OF_VECTORS = (("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az"))
AXES = (
    *AXES_OF_VECTORS,
    ("north", "east", "down"),
    ("n", "e", "d"),
    ("roll", "pitch", "yaw"),
    ("rollspeed", "pitchspeed", "yawspeed"),
)
"""Words of names of which one stands in the place of another: `vx`, `vy`, `vz`; `delta_x`, `delta_y`."""


def is_frame(text: str) -> bool:
    """Whether `text` is a frame, in any case."""
    return text.lower() in _SPELLINGS


def frame_problem(definition: Definition, content: str) -> str:
    """Return what is wrong with the content of a tag `[@frame ...]`, "" for nothing.

    `@name` is the frame that a field of the message has as its value, or that one of its constants names.
    """
    message = definition.message
    names = [*(field.name for field in message.fields), *(constant.name for constant in message.constants)]
    if content.startswith("@"):
        name = content[1:].strip()
        return "" if name in names else f"'[@frame {content}]': no field or constant '{name}'{suggestion(name, names)}"
    if " ".join(content.lower().split()) == _LOCAL:
        return "" if _POSE_FRAME in names else f"'[@frame {content}]' can be any frame: expected NED or FRD"
    if is_frame(" ".join(content.split())):
        return ""
    hint = suggestion(content, FRAMES) or f": expected one of {', '.join(FRAMES)}"
    return f"unknown frame '{content}'{hint}"


def find_missing(definition: Definition) -> Iterator[Change]:
    """Yield the vectors and attitudes without a frame: arrays by their names, three joined fields by their unit."""
    for field in definition.message.fields:
        if _is_vector(field) and not field.comment.tag("frame"):
            yield definition.change(field, f"'{field.name}' has no frame{_hint(definition, field)}")
        elif _is_attitude(field) and not field.comment.tag("frame"):
            yield from _untagged(definition, field)
    units = {field.name: field.comment.tag("unit") for field in definition.inferred.fields}
    for fields in joined(definition.message, AXES_OF_VECTORS):
        first = fields[0]
        is_spread = bool(_NO_VECTOR.search(first.name))
        is_known = any(field.comment.tag("frame") for field in fields)
        if len(fields) == _AXES and not (is_spread or is_known) and normalized_unit(units[first.name]) in _UNITS:
            names = ", ".join(f"'{field.name}'" for field in fields)
            yield definition.change(first, f"{names} have no frame{_hint(definition, first)}")


def joined(message: Message, axes: Sequence[Sequence[str]] = AXES) -> list[list[Field]]:
    """Return the groups of at least two fields of one type whose names differ only in a word of `axes`."""
    groups: dict[tuple[str, ...], list[Field]] = {}
    for field in message.fields:
        words = field.name.split("_")
        for number, group in enumerate(axes):
            places = [index for index, word in enumerate(words) if word in group]
            if len(places) == 1:
                rest = (*words[: places[0]], f"{number} ", *words[places[0] + 1 :], str(field.type))
                groups.setdefault(rest, []).append(field)
    return [fields for fields in groups.values() if len(fields) > 1]


def _untagged(definition: Definition, field: Field) -> Iterator[Change]:
    """Yield an attitude whose sentences name no frames, or those of a tag that no embedded release has either."""
    text = field.comment.text
    named = frozenset(_NAMED.findall(text))
    frame = _ROTATIONS.get(named | {"FRD"} if _BODY.search(text) and "FLU" not in named else named)
    if not _EXPLAINED.search(text):
        otherwise = ": expected '[@frame NED]' for a rotation from FRD to NED"
        hint = _hint(definition, field) or otherwise
        yield definition.change(field, f"'{field.name}' does not say which frames it relates{hint}")
    elif frame and not _known(definition, field).tag("frame"):
        body = "FLU" if frame == "ENU" else "FRD"
        yield definition.change(
            field, f"'{field.name}' has no frame, but a comment says {body} to {frame}: expected '[@frame {frame}]'"
        )


def _is_vector(field: Field) -> bool:
    return _holds(field, _AXES) and bool(_VECTOR.search(field.name))


def _is_attitude(field: Field) -> bool:
    return _holds(field, _AXES + 1) and bool(_ATTITUDE.search(field.name))


def _holds(field: Field, count: int) -> bool:
    """Whether a field has `count` floats, which are no variances."""
    type_ = field.type
    is_float = type_.is_primitive and PRIMITIVES[type_.name].is_float
    return is_float and type_.element_count == count and not _NO_VECTOR.search(field.name)


def _hint(definition: Definition, field: Field) -> str:
    """Return the frame that the sentences or an embedded release have."""
    for text in (field.comment.text, definition.message.comment):
        named = set(_NAMED.findall(text))
        if len(named) == 1:
            return f", but a comment says {(frame := named.pop())}: expected '[@frame {frame}]'"
    known = _known(definition, field)
    frame = known.tag("frame")
    return f": msggen's {known.origin('frame').removeprefix('embedded ')} has '[@frame {frame}]'" if frame else ""


def _known(definition: Definition, field: Field) -> Comment:
    """Return the comment of a field with the tags that msggen knows from sentences and embedded releases."""
    return next(each.comment for each in definition.inferred.fields if each.name == field.name)
