"""Quantities with units, as people write them in operation files and on the command line.

The unit registry is a small closed list, with angle as a dimension of its own. So a spindle speed
("3350 rpm", rad/s) is never taken for a frequency ("922 Hz"), a feed per revolution ("8 mm/rev")
never for a length, and nothing with an offset (temperatures) exists. A ratio is written with a
percent sign, because a bare 0.72 could mean 0.72 %.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Literal

import pint

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
second = [time] = s
gram = [mass] = g
radian = [angle] = rad
percent = 0.01 = %
minute = 60 * second = min
inch = 0.0254 * meter = in
degree = 3.141592653589793 / 180 * radian = deg
revolution = 2 * 3.141592653589793 * radian = rev
rpm = revolution / minute
hertz = 1 / second = Hz
newton = 1000 * gram * meter / second ** 2 = N
pascal = newton / meter ** 2 = Pa
watt = newton * meter / second = W
volt = [voltage] = V
"""

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT = r"(?:[A-Za-z]{1,20}|%)(?:(?:\^|\*\*)-?\d)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*((?:1/)?{_UNIT}(?:\s*[*/ ]\s*{_UNIT}){{0,4}})?\s*", re.ASCII)
_SPELLINGS = str.maketrans(
    {"µ": "u", "μ": "u", "°": "deg", "·": "*", "²": "^2", "³": "^3", "\u00a0": " ", "\u2212": "-"}
)

Bound = Literal["any", "positive", "not negative"]
_BOUND_TEXT = {"any": "", "positive": " > 0", "not negative": " >= 0"}


@dataclass(frozen=True)
class Kind:
    """A physical quantity: its name, the SI unit it is stored in and how people write it."""

    name: str
    unit: str
    example: str

    def expected(self, bound: Bound = "any") -> str:
        """What an error message asks for."""
        return f'{self.name}{_BOUND_TEXT[bound]} with its unit, such as "{self.example}"'


KINDS = {
    kind.unit: kind
    for kind in (
        Kind("a length", "m", "20 mm"),
        Kind("a time", "s", "2.5 s"),
        Kind("an angle", "rad", "25 deg"),
        Kind("an angular speed", "rad/s", "3350 rpm"),
        Kind("a frequency", "Hz", "682 Hz"),
        Kind("a ratio", "%", "5.32 %"),
        Kind("a mass", "kg", "1.303 kg"),
        Kind("a pressure", "Pa", "930 MPa"),
        Kind("a force per edge length", "N/m", "21 N/mm"),
        Kind("an indentation coefficient", "N/m^3", "2.69e13 N/m^3"),
        Kind("a feed per revolution", "m/rev", "8 mm/rev"),
        Kind("a speed", "m/s", "650 m/min"),
        Kind("a force", "N", "120 N"),
        Kind("a torque", "N*m", "2.5 N*m"),
        Kind("a power", "W", "3.7 kW"),
        Kind("a stiffness", "N*m^-1", "68.6 N/um"),
        Kind("a rotational stiffness", "N*m/rad", "6.5e5 N*m/rad"),
        Kind("a damping", "N*s/m", "200 N*s/m"),
        Kind("a rotational damping", "N*m*s/rad", "20 N*m*s/rad"),
        Kind("a density", "kg/m^3", "2700 kg/m^3"),
        Kind("a rotation per displacement", "rad/m", "30 rad/m"),
        Kind("a compliance", "m/N", "0.02 um/N"),
        Kind("a voltage", "V", "2.5 V"),
        Kind("a sensitivity to displacement", "V/m", "5.8 mV/um"),
        Kind("a sensitivity to sound", "V/Pa", "50 mV/Pa"),
        Kind("a sensitivity to acceleration", "V*s^2/m", "10.2 mV*s^2/m"),
        Kind("a sensitivity to force", "V/N", "2 mV/N"),
    )
}
"""Quantities by SI unit. The unit "%" stands for a ratio and is stored as the plain ratio."""


@cache
def _registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry(_DEFINITIONS.strip().splitlines(), on_redefinition="raise")


@cache
def _factor(unit: str, target: str) -> float:
    """Factor from `unit` to `target`; raises pint.PintError where there is none."""
    registry = _registry()
    wanted = "dimensionless" if target == "%" else target
    return float(registry.Quantity(1.0, registry.parse_units(unit)).to(wanted).magnitude)


def parse_quantity(text: object, unit: str, name: str, bound: Bound = "any") -> float:
    """Number in SI units from a text such as "3350 rpm".

    text: number and unit; unit: the SI unit wanted (a key of KINDS, or another one that the
    registry knows; "%" gives the plain ratio, "m/rev" metres per revolution, "rad/s" accepts rpm);
    name: what the error message calls it; bound: "positive" or "not negative" where that is asked.
    Raises ValueError naming `name`, the text and what was expected.
    """
    kind = KINDS.get(unit) or Kind(f"a quantity in {unit}", unit, f"1 {unit}")
    try:
        return quantity_value(text, kind, bound)
    except ValueError as error:
        raise ValueError(f"{name} is {text!r}, {error}") from None


def quantity_value(text: object, kind: Kind, bound: Bound = "any") -> float:
    """Value of `text` in ``kind.unit``; raises ValueError with the words "expected ..." only."""
    expected = f"expected {kind.expected(bound)}"
    match = _QUANTITY.fullmatch(text.translate(_SPELLINGS)) if isinstance(text, str) and len(text) <= 80 else None
    if match is None:
        hint = " (the unit is missing)" if isinstance(text, int | float) and not isinstance(text, bool) else ""
        raise ValueError(expected + hint)
    number, written = match.groups()
    if written is None:
        raise ValueError(f"{expected} (the unit is missing)")
    try:
        value = float(number) * _factor(written.strip(), kind.unit)
    except pint.UndefinedUnitError:
        raise ValueError(f"{expected} (unknown unit {written.strip()})") from None
    except pint.DimensionalityError:
        raise ValueError(f"{expected} (wrong unit {written.strip()})") from None
    if not math.isfinite(value) or (bound == "positive" and value <= 0) or (bound == "not negative" and value < 0):
        raise ValueError(expected)
    return value
