"""Print every array of floats: message, field, type, size and offset. An argument names a source, as for `--px4`."""

import sys

from msggen import ArrayKind, InputError, lay_out, read

try:
    catalog = read(*sys.argv[1:2])
except InputError as error:
    sys.exit(str(error))
for message in catalog.uorb_messages:
    extents = lay_out(catalog, message).extents()
    for field in message.fields:
        if field.type.name in ("float32", "float64") and field.type.array is ArrayKind.FIXED:
            offset, size = extents[field.name]
            print(f"{message.name}.{field.name}: {field.type}, {size} bytes at {offset}")
