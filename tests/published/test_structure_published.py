"""Section 4.3.7: what the thesis' chuck, bars and ram give, held to what was found."""

from __future__ import annotations

import pytest

from tests.published.row import Row
from tests.published.rows_structure import aluminium, chuck_tables, ram, steel


def one(rows: list[Row], quantity: str, why: str = "") -> Row:
    """The row of this quantity whose reason holds `why`."""
    found, = [r for r in rows if r.quantity == quantity and why in r.why]
    return found


def test_the_printed_stiffness_is_that_of_frequency_and_mass() -> None:
    for row in chuck_tables():
        assert row.computed == pytest.approx(row.published, rel=3e-3)


@pytest.mark.parametrize(("why", "first", "second"), [
    ("as printed", 329.1, 3932), ("6e5", 327.2, 1075), ("7e5", 327.5, 1153), ("0.26 m, rotation rigid", 315.8, 4092),
    ("(fitted)", 313.3, 1165),
])
def test_aluminium_stock_in_x(why: str, first: float, second: float) -> None:
    rows = aluminium()
    for number, value in (("first", first), ("second", second)):
        assert one(rows, f"aluminium stock in x, {number} mode", why).computed == pytest.approx(value, rel=5e-4)


def test_the_steel_stock_is_predicted_within_two_percent() -> None:
    """The chuck was fitted to the aluminium stock only."""
    rows = steel()
    for plane in "xy":
        row = one(rows, f"steel stock in {plane}, first mode", "fitted")
        assert row.computed == pytest.approx(251, rel=0.02)


def test_the_ram() -> None:
    """Erratum D11: 11.8-fold peak, not twice; the limits' ratio is that of the print."""
    rows = ram()
    assert one(rows, "peak of Y, longest over shortest ram").computed == pytest.approx(11.8, abs=0.05)
    limit = "lowest depth limit of the slot"
    short, long = (one(rows, f"{limit}, {name} ram").computed for name in ("shortest", "longest"))
    assert short / long == pytest.approx(4.1 / 2.26, rel=0.03)
