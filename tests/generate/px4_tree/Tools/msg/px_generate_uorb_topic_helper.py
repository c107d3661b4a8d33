"""What the templates of these tests share. It uses `genmsg` as the firmware's helper does, and changes what it gets."""

from typing import Any

import genmsg.msgs

SIZES = {"bool": 1, "char": 1, "uint8": 1, "int16": 2, "uint32": 4, "float32": 4, "uint64": 8, "float64": 8}


def size_of(field: Any) -> int:
    """Return the bytes of a field's type, 0 for a message."""
    return SIZES.get(genmsg.msgs.bare_msg_type(field.type), 0)


def fields_of(base_type: str, search_path: Any) -> Any:
    """Return the fields of a nested message, loaded anew."""
    package, name = genmsg.names.package_resource_name(base_type)
    context = genmsg.msg_loader.MsgContext.create_default()
    return genmsg.msg_loader.load_msg_by_type(context, f"{package}/{name}", search_path).parsed_fields()


def pad(fields: Any, search_path: Any) -> int:
    """Note each field's bytes, put a field of padding at the end of the list, and return the bytes of all."""
    total = 0
    for field in fields:
        field.bytes = size_of(field) if field.is_builtin else pad(fields_of(field.base_type, search_path), search_path)
        total += field.bytes * (field.array_len if field.is_array else 1)
    rest = -total % 8
    if rest:
        fields.append(genmsg.Field("_padding", f"uint8[{rest}]"))
    return total + rest


def print_field(field: Any) -> None:
    """Print a field as C has it."""
    base, is_array, length = genmsg.msgs.parse_type(field.type)
    print(f"\t{base.replace('/', '_')} {field.name}{f'[{length}]' if is_array else ''};")
