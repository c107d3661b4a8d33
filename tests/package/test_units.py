"""Units as dimensions and factors, compared with pint."""

from __future__ import annotations

import importlib
import math
from array import array
from typing import Any

import numpy as np
import pytest

from msggen import read
from msggen.definitions.unit import SPELLINGS
from support.repository import shared

OF_PINT = {"dB", "dBm", "dBHz", "Ga"}
"""pint converts the first two to ratios, which are dimensions here. It has no dBHz. Its gauss is not a unit of SI."""

NO_UNITS = {"bool", "boolean", "enum"}
"""The tags of the firmware that are no units."""


@pytest.fixture(scope="module")
def units(px4_types: Any) -> Any:
    return importlib.import_module(f"{px4_types.__name__}.units")


@pytest.fixture(scope="module")
def registry() -> Any:
    import pint

    return pint.UnitRegistry()


def tags(path: str) -> set[str]:
    """Return the units of a source."""
    messages = read(path).messages.values()
    return {unit for message in messages for field in message.fields if (unit := field.comment.tag("unit"))}


def test_every_unit_of_the_embedded_definitions_is_known(px4_types: Any, units: Any) -> None:
    messages = [getattr(px4_types.msg, name) for name in px4_types.msg.__all__]
    found = {field.unit for cls in messages for field in cls.__msg__.fields if field.unit}
    unknown = set()
    for text in found:
        try:
            units.parse(text)
        except units.UnitError:
            unknown.add(text)
    assert unknown <= NO_UNITS


@pytest.mark.parametrize("tree", ["v1.14", "v1.16", "v1.18", "main-2026-03"])
def test_every_unit_of_the_firmware_is_known(tree: str, units: Any) -> None:
    for text in tags(str(shared(f"firmware/{tree}"))) - NO_UNITS:
        units.parse(text)


def test_every_unit_that_msggen_knows_has_a_dimension(units: Any) -> None:
    for text in SPELLINGS:
        assert units.parse(text).text == text
    assert units.convert(8.0, "kbit", "kB") == 1.0
    assert units.parse("dBHz").dimension == (("dBHz", 1),)


def test_units_are_those_of_pint(units: Any, registry: Any) -> None:
    for name in units._BASES.keys() - OF_PINT:
        for text in (name, f"{name}^2", f"m/{name}", f"({name}/s)^2"):
            unit = units.parse(text)
            if text == "°C" or "°C" not in text:
                check(unit, registry)


def check(unit: Any, registry: Any) -> None:
    """Check that pint converts values to SI units as `unit` does."""
    si = registry.Quantity(2.0, unit.pint).to_base_units()
    names = {"m": "meter", "kg": "kilogram", "s": "second", "A": "ampere", "K": "kelvin", "byte": "bit"}
    expected = {names[name]: power for name, power in unit.dimension if name != "rad"}
    found = {name: power for name, power in si.unit_items() if name != "radian"}
    assert found == expected, unit
    bits = 8 ** dict(unit.dimension).get("byte", 0)
    assert math.isclose(si.magnitude, (2.0 * unit.factor + unit.offset) * bits, rel_tol=1e-12), unit


@pytest.mark.parametrize(
    ("value", "text", "to", "expected"),
    [
        (1.0, "rad/s", "deg/s", 180 / math.pi),
        (25.0, "degC", "K", 298.15),
        (298.15, "K", "°C", 25.0),
        (1000, "mAh", "A h", 1.0),
        (60, "rpm", "rad/s", 2 * math.pi),
        (1, "(m/s)^2", "cm^2/s^2", 10_000.0),
        (473977418, "1e-7 deg", "deg", 47.3977418),
        (5, "-", "%", 500.0),
        (1.5, "Ga", "Gs", 1.5),
    ],
)
def test_convert(units: Any, value: float, text: str, to: str, expected: float) -> None:
    assert math.isclose(units.convert(value, text, to), expected)
    assert np.allclose(units.convert(np.full(3, value, float), text, to), expected)


@pytest.mark.parametrize("to_sequence", [list, tuple, lambda values: array("f", values)])
def test_sequences_are_converted_to_tuples(units: Any, to_sequence: Any) -> None:
    unit, to = units.parse("degC"), units.parse("K")
    converted = units.convert(to_sequence([0.0, 1.5]), unit, to)
    assert converted == (273.15, 274.65)
    assert unit.convert([to_sequence([0.0]), to_sequence([1.5])], "K") == ((273.15,), (274.65,))


def test_the_unit_of_a_field_can_be_converted(px4_types: Any, units: Any) -> None:
    """A vector of a message, with the unit of its field."""
    message = px4_types.SensorCombined(gyro_rad=(0.0, 1.0, math.pi))
    unit = units.of(px4_types.SensorCombined, "gyro_rad")
    assert units.convert(message.gyro_rad, unit, "deg/s") == pytest.approx((0.0, 180 / math.pi, 180.0))
    none = units.of(px4_types.VehicleStatus, "nav_state")
    with pytest.raises(units.UnitError, match="expected a unit such as 'm/s', got an object of type NoneType"):
        units.convert(1.0, none, "m")


def test_fields_have_units(px4_types: Any, units: Any) -> None:
    unit = units.of(px4_types.SensorCombined, "gyro_rad")
    assert (unit.text, unit.factor, unit.dimension) == ("rad/s", 1.0, (("rad", 1), ("s", -1)))
    assert units.of(px4_types.VehicleStatus, "nav_state") is None
    with pytest.raises(KeyError, match="did you mean 'gyro_rad'"):
        units.of(px4_types.SensorCombined, "gyrorad")


def test_nested_fields_have_units(px4_types: Any, units: Any) -> None:
    for path in ("esc.esc_voltage", "esc[0].esc_voltage", "esc[-1].esc_voltage"):
        assert units.of(px4_types.EscStatus, path).text == "V"
    assert units.of(px4_types.SensorCombined, "gyro_rad[2]").text == "rad/s"
    with pytest.raises(KeyError, match=r"EscStatus has no field 'esc\[x\]', did you mean 'esc'"):
        units.of(px4_types.EscStatus, "esc[x].esc_voltage")
    with pytest.raises(TypeError, match="expected a name such as 'gyro_rad', got an object of type int"):
        units.of(px4_types.EscStatus, 3)
    with pytest.raises(KeyError, match="did you mean 'esc_voltage'"):
        units.of(px4_types.EscStatus, "esc.voltage_esc")
    with pytest.raises(KeyError, match=r"gyro_rad of SensorCombined is float32\[3\], which has no fields"):
        units.of(px4_types.SensorCombined, "gyro_rad.x")


def test_errors_name_the_nearest_unit(units: Any) -> None:
    with pytest.raises(ValueError, match="unknown unit 'rads', did you mean 'rad'"):
        units.parse("rads")
    with pytest.raises(units.UnitError, match="unknown unit 'm/ss', did you mean 'm/s'"):
        units.parse("m/ss")
    with pytest.raises(units.UnitError, match="expected a unit such as 'm/s', got an object of type int"):
        units.convert(1.0, "m", 3)
    with pytest.raises(units.UnitError, match="cannot convert 'm' to 's': they have different dimensions"):
        units.convert(1.0, "m", "s")
    for text in ("", "m/(s", "m s)", "@"):
        with pytest.raises(units.UnitError):
            units.parse(text)
