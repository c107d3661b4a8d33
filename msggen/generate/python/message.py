"""The model of a message class for the Python templates: all expressions that they need, by name."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from operator import attrgetter
from textwrap import wrap
from typing import NamedTuple

from msggen.definitions.identity import message_hash, type_hash
from msggen.definitions.layout import Encoding, Layout, Leaf, is_static, lay_out, struct_format, struct_size
from msggen.definitions.model import ArrayKind, Catalog, Comment, Field, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.definitions.tags import UNIT
from msggen.generate.python.enums import EnumClass, enum_classes
from msggen.generate.python.formatting import documentation, literal, long_literal, wrapped
from msggen.generate.python.kind import Kind, kind_of
from msggen.generate.python.names import attribute_names, class_name, module_name
from msggen.generate.python.static_codec import Codec, as_tuple
from msggen.generate.python.stream_codec import Function, functions_of
from msggen.generate.python.versions import AdjacentVersion, adjacent_versions

SPELLED_OUT_TO = 4
"""Tuples up to this length are spelled out in annotations."""

_UNSIGNED = {PRIMITIVES[name].size: PRIMITIVES[name].code for name in ("uint8", "uint16", "uint32", "uint64")}
_SHADOWING = frozenset({"int", "float", "bool", "bytes", "list", "str", "tuple"})


class ClassConstant(NamedTuple):
    """A constant of a class. `spaced` puts a blank line before it."""

    name: str
    type: FieldType
    attribute: str
    value: str
    documentation: str
    spaced: bool


class Attribute(NamedTuple):
    """An attribute of a class. `name` is the name of the field in the definition."""

    name: str
    attribute: str
    type: FieldType
    offset: int | None
    size: int | None
    comment: Comment
    annotation: str
    parameter: str
    """The parameter of `__init__` with its annotation and default."""
    initial: str
    """The expression that `__init__` assigns."""
    enum_class: str
    """The enum of the values, a class in this class; "" for none."""

    @property
    def documentation(self) -> str:
        """Type, tags and comment of the definition, as the content of a docstring."""
        renamed = "" if self.attribute == self.name else f"`{self.name}` in the definition, "
        return documentation(f"{renamed}{self.type} {self.comment.complete}".strip(), 4, closed=True)

    @property
    def description(self) -> str:
        """The description of the field in `__msg__`."""
        given = [f"{name}={literal(content)}" for name, content in self.comment.attributes]
        given += [] if self.attribute == self.name else [f"attribute={literal(self.attribute)}"]
        origins = "".join(f'("{tag.name}", "{tag.origin}"), ' for tag in self.comment.inferred)
        given += [f"inferred=({origins.strip()})"] if origins else []
        given += [f"enum_class={literal(self.enum_class)}"] if self.enum_class else []
        text = " ".join(self.comment.text.split())
        given += [f"description={long_literal(text, 16)}"] if text else []
        items = (literal(self.name), literal(str(self.type)), str(self.offset), str(self.size), *given)
        return f"info.Field({wrapped(items, 16)})"


class Import(NamedTuple):
    """The import of the class of a nested message: its module, its name there, and its name here."""

    module: str
    name: str
    here: str

    @property
    def text(self) -> str:
        """The part of the statement after `import`."""
        return self.name if self.name == self.here else f"{self.name} as {self.here}"


class MessageClass(NamedTuple):
    """A message class."""

    message: Message
    name: str
    """The name of the class."""
    root: str
    """The generated package in a relative import."""
    topic_names: tuple[str, ...]
    """The uORB topics of the message, empty for halves of services and for messages of other packages."""
    constants: tuple[ClassConstant, ...]
    enums: tuple[EnumClass, ...]
    fields: tuple[Attribute, ...]
    codec: Codec | None
    """The codec of a static layout. If it is None, `functions` is not empty."""
    functions: tuple[Function, ...]
    cdr_size: int | None
    """None if it varies by sample."""
    struct_size: int | None
    """None if uORB cannot carry the message."""
    message_hash: int
    type_hash: str
    layout_arguments: tuple[str, ...]
    nested: tuple[Import, ...]
    """The nested messages at any depth."""
    builtins: str
    """The prefix of built-in types: "builtins." if a field hides one of them, else ""."""
    uses_arrays: bool
    """Whether it needs the module `arrays`, for its own fields or for nested messages that its codec flattens."""
    adjacent: tuple[AdjacentVersion, ...]
    """The versions before and after this one."""

    @property
    def topics(self) -> tuple[str, ...]:
        """The uORB topics of the message, as literals."""
        return tuple(map(literal, self.topic_names))

    @property
    def names(self) -> tuple[str, ...]:
        """The attributes of the fields, as literals."""
        return tuple(literal(field.attribute) for field in self.fields)

    @property
    def is_padded(self) -> bool:
        """Whether padding to a multiple of 4 bytes changes the length of a sample.

        `decode` then has an unpacking function for each of the two lengths. They check it in bytes: `len(data)` counts
        items, such as four bytes each.
        """
        return (self.cdr_size or 0) % 4 != 0

    @property
    def nests_arrays(self) -> bool:
        """Whether a field is an array of messages. jedi knows their fields only from the parameters of `__init__`."""
        return any(field.type.array is not ArrayKind.SCALAR and not field.type.is_primitive for field in self.fields)

    @property
    def constant_rows(self) -> list[str]:
        """The constants in `__msg__`, as literals: `"uint8 LOW HIGH mro=mro_"` for consecutive ones of a type."""
        return [
            literal(f"{type_} {line}")
            for type_, constants in itertools.groupby(self.constants, key=attrgetter("type"))
            for line in wrap(" ".join(map(_row_entry, constants)), 80, break_long_words=False)
        ]

    @property
    def underscore(self) -> str:
        """The prefix of names from typing: "_" if a message in the module has such a name, else ""."""
        names = {self.name, *(nested.here for nested in self.nested)}
        return "_" if names & {"ClassVar", "Final"} else ""

    @property
    def enum_bases(self) -> list[str]:
        """The base classes of the enums."""
        return sorted({enum.base for enum in self.enums})

    @property
    def documentation(self) -> str:
        """The comment of the definition about the message, or its ROS type."""
        return self.message.comment or f"{self.message.ros_type}."

    @property
    def units(self) -> str:
        """The fields with their units, for the docstring of the class."""
        units = [each.comment.tag(UNIT.name) for each in self.fields]
        fields = [
            f"{each.attribute} [{unit}]" if unit else each.attribute
            for each, unit in zip(self.fields, units, strict=True)
        ]
        return f"Fields: {', '.join(fields)}." if fields else "No fields."

    @property
    def summary(self) -> str:
        """Topics, version and size of the message, for the docstring of the class."""
        names = self.topic_names
        topics = f"uORB topic{'s' if len(names) > 1 else ''}: {', '.join(names)}. " if names else ""
        number = self.message.message_version
        size = "Samples vary in size." if self.functions else f"{self.cdr_size} bytes."
        if self.message.version_of:
            return f"{topics}Archived version {number} of {self.message.released_as[1]}. {size}"
        return f"{topics}{f'Version {number}. ' if number else ''}{size}"


def message_class(catalog: Catalog, message: Message) -> MessageClass:
    """Return the class of `message`."""
    extents = _extents(catalog, message)
    names = _class_names(catalog, message)
    attributes = attribute_names(message, names.values())
    prefix = "" if _SHADOWING.isdisjoint(attributes.values()) else "builtins."
    is_own = message.released_as[0] == catalog.package
    layout = lay_out(catalog, message) if is_static(catalog, message) else None
    enums = enum_classes(message, attributes, names.values())
    classes_of_fields = {field: enum.name for enum in enums for field in enum.fields}

    def class_of(nested: Message) -> str:
        return names[nested.key]

    return MessageClass(
        message=message,
        name=names[message.key],
        root=".." if is_own else "...",
        topic_names=message.topic_names if is_own and message.folder == "msg" else (),
        constants=tuple(_constants(message, attributes)),
        enums=enums,
        fields=tuple(
            _attribute(
                field,
                _renamed(message, field, names, attributes),
                extents.get(field.name, _NO_EXTENT),
                prefix,
                classes_of_fields.get(field.name, ""),
            )
            for field in message.fields
        ),
        codec=Codec.of(catalog, message, class_of) if layout else None,
        functions=() if layout else functions_of(catalog, message, class_of),
        cdr_size=layout.size if layout else None,
        struct_size=struct_size(catalog, message) if layout and is_own else None,
        message_hash=message_hash(catalog, message),
        type_hash=type_hash(catalog, message),
        layout_arguments=tuple(_layout_arguments(layout, lay_out(catalog, message, Encoding.XCDR2))) if layout else (),
        nested=tuple(_nested_imports(catalog, message, names)),
        builtins=prefix,
        uses_arrays=any(kind_of(leaf.type) is Kind.ARRAY for leaf in layout.leaves)
        if layout
        else any(_is_sequence(field.type) for field in message.fields),
        adjacent=adjacent_versions(catalog, message) if catalog.archived else (),
    )


def _row_entry(constant: ClassConstant) -> str:
    return constant.name if constant.attribute == constant.name else f"{constant.name}={constant.attribute}"


_NO_EXTENT = (None, None)


def _extents(catalog: Catalog, message: Message) -> dict[str, tuple[int, int]]:
    """Return offset and size of the fields that have the same place in every sample.

    These are the fields before the first one that varies in size.
    """
    static = itertools.takewhile(lambda field: is_static(catalog, message._replace(fields=(field,))), message.fields)
    return lay_out(catalog, message._replace(fields=tuple(static))).extents()


def _constants(message: Message, attributes: Mapping[str, str]) -> Iterator[ClassConstant]:
    """Yield the constants. Those with documentation are separated by blank lines."""
    apart = True
    for constant in message.constants:
        text = documentation(str(constant.comment), 4, closed=True)
        attribute = attributes[constant.name]
        yield ClassConstant(constant.name, constant.type, attribute, literal(constant.value), text, apart or bool(text))
        apart = bool(text)


def _class_names(catalog: Catalog, message: Message) -> dict[str, str]:
    """Return the class names of `message` and its nested messages in its module, by key.

    If several packages have a class of the same name, it gets its package as a prefix: `std_msgs_Header`.
    """
    every = (message, *catalog.nested_all(message))
    classes = {each.key: class_name(each) for each in every}
    names = list(classes.values())
    return {
        each.key: classes[each.key]
        if each.package == message.package or names.count(classes[each.key]) == 1
        else f"{each.package}_{classes[each.key]}"
        for each in every
    }


def _nested_imports(catalog: Catalog, message: Message, names: Mapping[str, str]) -> Iterator[Import]:
    own, here = catalog.package, message.released_as[0]
    for inner in catalog.nested_all(message):
        there = inner.released_as[0]
        if there == here:
            folder = "." if message.folder == "msg" else "..msg."
        else:
            root = ".." if here == own else "..."
            folder = f"{root}msg." if there == own else f"{root}{there}.msg."
        yield Import(f"{folder}{module_name(inner.name)}", class_name(inner), names[inner.key])


def _renamed(message: Message, field: Field, names: Mapping[str, str], attributes: Mapping[str, str]) -> Field:
    """Return a field of `message` with the name of its attribute and the class of its type."""
    renamed = field._replace(name=attributes[field.name])
    if field.type.is_primitive:
        return renamed
    return renamed._replace(type=field.type._replace(name=names[message.key_of(field.type)], package=None))


def _attribute(
    field: Field, named: Field, extent: tuple[int | None, int | None], prefix: str, enum_class: str
) -> Attribute:
    annotation = _annotation(named.type, prefix)
    default, initial = _initial(named, prefix)
    parameter = f"{named.name}: {annotation}{' | None' if default == 'None' else ''} = {default}"
    return Attribute(
        field.name, named.name, field.type, *extent, field.comment, annotation, parameter, initial, enum_class
    )


def _annotation(type_: FieldType, prefix: str) -> str:
    kind = kind_of(type_)
    if kind is Kind.BYTES:
        return f"{prefix}bytes"
    item = f"{prefix}{PRIMITIVES[type_.name].python_type}" if type_.is_primitive else type_.name
    if kind is Kind.SCALAR:
        return item
    if _is_sequence(type_):
        return f"_arrays.Sequence[{item}]"
    if type_.length <= SPELLED_OUT_TO:
        return f"{prefix}tuple[{', '.join([item] * type_.length)}]"
    return f"{prefix}tuple[{item}, ...]"


def _is_sequence(type_: FieldType) -> bool:
    """Whether the annotation of a field of this type is the `Sequence` of the module `arrays`."""
    kind = kind_of(type_)
    return kind is Kind.ARRAY or (kind is Kind.TUPLE and type_.array is not ArrayKind.FIXED)


def _initial(field: Field, prefix: str) -> tuple[str, str]:
    """Return the default of the parameter, and the expression that is assigned to the attribute."""
    name, type_ = field.name, field.type
    if kind_of(type_) is Kind.ARRAY or (not type_.is_primitive and type_.array in (ArrayKind.SCALAR, ArrayKind.FIXED)):
        return "None", f"{_fresh(field)} if {name} is None else {name}"
    if field.default is None:
        return _zero(type_, prefix), name
    default = literal(field.default)
    return f"{prefix}bytes({field.default})" if kind_of(type_) is Kind.BYTES else default, name


def _zero(type_: FieldType, prefix: str) -> str:
    """Return the default of an immutable value."""
    if kind_of(type_) is Kind.BYTES:
        return f"{prefix}bytes({type_.length})" if type_.array is ArrayKind.FIXED else 'b""'
    if type_.array in (ArrayKind.BOUNDED, ArrayKind.UNBOUNDED):
        return "()"
    zero = PRIMITIVES[type_.name].zero
    if type_.array is ArrayKind.SCALAR:
        return zero
    if type_.length <= SPELLED_OUT_TO:
        return f"({', '.join([zero] * type_.length)}{',' if type_.length == 1 else ''})"
    return f"({zero},) * {type_.length}"


def _fresh(field: Field) -> str:
    """Return the expression that creates a mutable value for each message."""
    type_ = field.type
    if not type_.is_primitive:
        if type_.array is ArrayKind.SCALAR:
            return f"{type_.name}()"
        spelled_out = type_.length <= SPELLED_OUT_TO
        return (
            as_tuple([f"{type_.name}()"] * type_.length) if spelled_out else f"_cdr.fresh({type_.name}, {type_.length})"
        )
    code = literal(PRIMITIVES[type_.name].code)
    if field.default:
        return f"_arrays.array({code}, {literal(field.default)})"
    return f"_arrays.zeros({code}, {type_.length})" if type_.array is ArrayKind.FIXED else f"_arrays.array({code})"


def _layout_arguments(xcdr1: Layout, xcdr2: Layout) -> Iterator[str]:
    """Yield the arguments of `_cdr.Layout`, except those that it derives from others."""
    yield literal(struct_format(_values(xcdr1.leaves)))
    words = struct_format(_words(xcdr1))
    if any(kind_of(leaf.type) is Kind.ARRAY for leaf in xcdr1.leaves):
        yield f"words={literal(words)}"
    words2 = struct_format(_words(xcdr2))
    if words2 != words:
        yield f"xcdr2={literal(words2)}"
    if xcdr2.delimiter_headers:
        headers = "".join(f"({header.offset}, {header.size}), " for header in xcdr2.delimiter_headers)
        yield f"delimiters=({headers.strip()})"


def _values(leaves: tuple[Leaf, ...]) -> Iterator[tuple[int, int, str]]:
    for leaf in leaves:
        if kind_of(leaf.type) in (Kind.BYTES, Kind.ARRAY):
            yield leaf.padding, leaf.element_count * leaf.size, "s"
        else:
            yield leaf.padding, leaf.element_count, PRIMITIVES[leaf.type.name].code


def _words(layout: Layout) -> Iterator[tuple[int, int, str]]:
    for item in layout.items:
        if isinstance(item, Leaf):
            code = "s" if kind_of(item.type) is Kind.BYTES else _UNSIGNED[item.size]
            yield item.padding, item.element_count, code
        else:
            yield item.padding + 4, 0, "x"
