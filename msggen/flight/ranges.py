"""Checks of setpoints by the parameters of PX4 that limit them, which it does not tell over DDS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from logging import getLogger
from types import MappingProxyType
from typing import Final

from msggen.base.diagnostics import suggestion
from msggen.flight.setpoints import Values
from msggen.messages.ranges import DEFAULTS, RANGES, Range

LOGGER = getLogger("msggen.flight")
_NONE: Final[Mapping[str, float]] = MappingProxyType({})


class Ranges:
    """The ranges of a vehicle. What the program does not say is as in PX4's documentation."""

    def __init__(self, parameters: Mapping[str, float] = _NONE) -> None:
        """Take the values of parameters that the vehicle has. Raises ValueError for others, and for wrong values."""
        for name, value in parameters.items():
            if name not in DEFAULTS:
                near = suggestion(name, DEFAULTS) or f": they are {', '.join(sorted(DEFAULTS))}"
                raise ValueError(f"{name!r} is no parameter that limits setpoints{near}")
            if not 0.0 < value < math.inf:
                raise ValueError(f"expected a value above 0 for {name}, got {value!r}")
        self._parameters = dict(parameters)
        self._told: set[str] = set()
        """The parameters that a warning has named."""

    def check(self, values: Values) -> None:
        """Raise ValueError for a value that the vehicle cannot follow, as far as the program has said.

        Without that, what is beyond the documented range of a parameter is an error, and what is beyond its default is
        a warning, which is given once.
        """
        for topic, fields in values.items():
            for name, found in RANGES.get(topic, {}).items():
                if name in fields:
                    self._check(found, fields[name])

    def _check(self, found: Range, value: float) -> None:
        bounds = found.least, found.most
        least, most = (each.of(self._parameters.get(each.parameter, each.extreme)) for each in bounds)
        if value < least or value > most:
            unknown = dict.fromkeys(each.parameter for each in bounds if each.parameter not in self._parameters)
            raise ValueError(
                f"expected {found.what} from {least:g} to {most:g} {found.unit}, got {value:g}, and nothing was sent"
                + (f". {_ANOTHER.format(' and '.join(unknown))}" if unknown else "")
            )
        usual_least, usual_most = (each.of(each.default) for each in bounds)
        if usual_least <= value <= usual_most or math.isnan(value):
            return
        bound, usual = (found.least, usual_least) if value < usual_least else (found.most, usual_most)
        if bound.parameter not in self._told | self._parameters.keys():
            self._told.add(bound.parameter)
            LOGGER.warning(
                "%s of %g %s is beyond %g, by which PX4 may replace it: %s is usually %g. %s",
                *(found.what, value, found.unit, usual, bound.parameter, bound.default),
                _ANOTHER.format(bound.parameter),
            )


_ANOTHER: Final = "`Flight(..., parameters={{...}})` says what the vehicle has as {}"
