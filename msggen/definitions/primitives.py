"""The built-in types of ROS 2's `.msg` grammar, in one table."""

from collections.abc import Mapping
from typing import NamedTuple


class Primitive(NamedTuple):
    """A built-in type. Strings have 0 or "" in the columns that only apply to numbers."""

    name: str
    size: int
    """The size of a value in CDR, in bytes (OMG DDS-XTypes 1.3, section 7.4)."""
    smallest: float
    largest: float
    """The largest value; for floats, the largest literal that does not round to infinity."""
    code: str
    """The character in `struct` formats."""
    type_id: int
    """The id in type_description_interfaces/msg/FieldType."""
    python_type: str
    zero: str
    """Zero as Python source."""
    cpp_type: str
    """The name of the type in C++."""
    cpp_zero: str
    """Zero as C++ source."""

    @property
    def is_integer(self) -> bool:
        """Whether the values are integers."""
        return self.python_type == "int"

    @property
    def is_float(self) -> bool:
        """Whether the values are floating-point numbers."""
        return self.python_type == "float"

    @property
    def is_string(self) -> bool:
        """Whether the values are text."""
        return self.python_type == "str"

    @property
    def is_octet(self) -> bool:
        """Whether the values are bytes, from 0 to 255."""
        return self.code == "B"

    @property
    def integer_range(self) -> tuple[int, int]:
        """The smallest and the largest value of an integer type."""
        return int(self.smallest), int(self.largest)


_FLOAT32 = 3.4028235677973362e38
_FLOAT64 = 1.7976931348623157e308
"""The largest literals that do not round to infinity."""

# PX4 and ROS 2 treat `char` as an unsigned byte, with the type id of `uint8`.
# fmt: off
_TABLE = (
    #         name       size  smallest    largest     code  id   Python    zero      C++               zero in C++
    Primitive("bool",    1,    0,          1,          "?",  15,  "bool",   "False",  "bool",           "false"),
    Primitive("byte",    1,    0,          2**8 - 1,   "B",  16,  "int",    "0",      "std::uint8_t",   "0"),
    Primitive("char",    1,    0,          2**8 - 1,   "B",  3,   "int",    "0",      "char",           "0"),
    Primitive("int8",    1,    -(2**7),    2**7 - 1,   "b",  2,   "int",    "0",      "std::int8_t",    "0"),
    Primitive("uint8",   1,    0,          2**8 - 1,   "B",  3,   "int",    "0",      "std::uint8_t",   "0"),
    Primitive("int16",   2,    -(2**15),   2**15 - 1,  "h",  4,   "int",    "0",      "std::int16_t",   "0"),
    Primitive("uint16",  2,    0,          2**16 - 1,  "H",  5,   "int",    "0",      "std::uint16_t",  "0"),
    Primitive("int32",   4,    -(2**31),   2**31 - 1,  "i",  6,   "int",    "0",      "std::int32_t",   "0"),
    Primitive("uint32",  4,    0,          2**32 - 1,  "I",  7,   "int",    "0",      "std::uint32_t",  "0"),
    Primitive("int64",   8,    -(2**63),   2**63 - 1,  "q",  8,   "int",    "0",      "std::int64_t",   "0"),
    Primitive("uint64",  8,    0,          2**64 - 1,  "Q",  9,   "int",    "0",      "std::uint64_t",  "0"),
    Primitive("float32", 4,    -_FLOAT32,  _FLOAT32,   "f",  10,  "float",  "0.0",    "float",          "0.0f"),
    Primitive("float64", 8,    -_FLOAT64,  _FLOAT64,   "d",  11,  "float",  "0.0",    "double",         "0.0"),
    Primitive("string",  0,    0,          0,          "",   17,  "str",    '""',     "std::string",    ""),
    Primitive("wstring", 0,    0,          0,          "",   18,  "str",    '""',     "std::u16string", ""),
)
# fmt: on

PRIMITIVES: Mapping[str, Primitive] = {row.name: row for row in _TABLE}
INTEGERS = tuple(name for name, row in PRIMITIVES.items() if row.is_integer)
FLOATS = tuple(name for name, row in PRIMITIVES.items() if row.is_float)
STRINGS = tuple(name for name, row in PRIMITIVES.items() if row.is_string)
OCTETS = tuple(name for name, row in PRIMITIVES.items() if row.is_octet)
"""The names of the integers, floats, strings and bytes."""
