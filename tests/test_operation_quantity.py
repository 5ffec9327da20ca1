"""Quantities: units, what is refused, and that nothing but a ValueError comes out."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.operation_quantity import parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("20 mm", "m", 0.02), ("20mm", "m", 0.02), (" -1.5e1 um ", "m", -15e-6), ("20 µm", "m", 20e-6),
        ("2.5 in", "m", 0.0635), ("3350 rpm", "rad/s", 3350 * math.pi / 30), ("1 rev/s", "rad/s", 2 * math.pi),
        ("60 deg/s", "rad/s", math.pi / 3), ("50 Hz", "Hz", 50.0), ("1.2 kHz", "Hz", 1200.0), ("60 1/min", "Hz", 1.0),
        ("8 mm/rev", "m/rev", 0.008), ("5.32 %", "%", 0.0532), ("930 MPa", "Pa", 930e6), ("930 N/mm^2", "Pa", 930e6),
        ("930 N/mm²", "Pa", 930e6), ("21 N/mm", "N/m", 21e3), ("25 deg", "rad", math.radians(25)),
        ("25°", "rad", math.radians(25)), ("650 m/min", "m/s", 650 / 60), ("2 min", "s", 120.0), ("40 g", "kg", 0.04),
        ("3.7 kW", "W", 3700.0), ("2.5 N m", "N*m", 2.5), ("2 N/um", "N/m", 2e6),
    ],
)
def test_quantities(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit, "--x") == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("20", "m"), (20, "m"), (20.0, "m"), (None, "m"), (True, "m"), (["20 mm"], "m"), ("", "m"), ("mm", "m"),
        ("20 s", "m"), ("20 furlong", "m"), ("20 mm^2", "m"), ("20 mm/rev", "m"), ("8 mm", "m/rev"),
        ("8 mm/s", "m/rev"), ("50 Hz", "rad/s"), ("3350", "rad/s"), ("50 rad/s", "Hz"), ("3350 rpm", "Hz"),
        ("0.05", "%"), ("5 mm", "%"),
        ("5 %", "m"), ("20 degC", "rad"), ("1 2 mm", "m"), ("1,2 mm", "m"), ("2*3 mm", "m"), ("2**9 mm", "m"),
        ("nan mm", "m"), ("inf mm", "m"), ("1e999 mm", "m"), ("20 mm/", "m"), ("20 (mm", "m"), ("20 mm**x", "m"),
        ("20 __class__", "m"), ("٢٠ mm", "m"), ("20 mm" * 50, "m"), ("20 mm\n30 mm", "m"),
    ],
)
def test_bad_quantities_are_named(text: object, unit: str) -> None:
    with pytest.raises(ValueError, match=r"^--x is .*expected ") as caught:
        parse_quantity(text, unit, "--x")
    assert type(caught.value) is ValueError


def test_bounds_of_a_quantity() -> None:
    assert parse_quantity("0 mm", "m", "--x", "not negative") == 0
    for text, bound in (("0 mm", "positive"), ("-1 mm", "positive"), ("-1 mm", "not negative")):
        with pytest.raises(ValueError, match="expected a length >"):
            parse_quantity(text, "m", "--x", bound)  # type: ignore[arg-type]


@given(st.text(max_size=30), st.sampled_from(["m", "rad/s", "Hz", "%", "m/rev"]))
def test_any_text_is_a_finite_number_or_a_value_error(text: str, unit: str) -> None:
    def outcome(candidate: str) -> float | str:
        try:
            return parse_quantity(candidate, unit, "--x")
        except ValueError as error:
            return str(error)

    for candidate in (text, f"1 {text}", f"1{text}mm"):
        result = outcome(candidate)
        assert "expected" in result if isinstance(result, str) else math.isfinite(result)


@given(st.floats(-1e6, 1e6), st.sampled_from([("mm", 1e-3), ("um", 1e-6), ("in", 0.0254)]))
def test_numbers_keep_their_value(number: float, unit: tuple[str, float]) -> None:
    assert parse_quantity(f"{number!r} {unit[0]}", "m", "--x") == pytest.approx(number * unit[1], rel=1e-14, abs=1e-300)
