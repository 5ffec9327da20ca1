"""Published stability numbers against the model, and the model against independent values from the errata."""

from __future__ import annotations

import math

import pytest

from tests.published.row import Row
from tests.published.rows_stability import asymmetric_problem, asymmetric_verdict, rows
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.collocation import leading_multiplier

# computed independently of this code: value, relative tolerance
REFERENCE = {
    "spectral radius at 0.2 mm": (0.81974278, 1e-6), "spectral radius at 0.5 mm": (1.07397559, 1e-6),
    "spectral radius at 1.0 mm": (1.40647353, 1e-6),
    "delay at 6000 and 3000 rpm": (7.5, 1e-9), "change of the delay, 6 to 21 rpm": (0.447, 2e-3),
    "chatter line -1": (2501, 2e-3), "chatter line +0": (3043, 2e-3), "chatter line +1": (3584, 2e-3),
    "limit of the envelope": (0.2312, 1e-3), "asymptotic speed of the envelope": (873.7, 1e-3),
    "contact length of the flank": (294, 3e-3),
    "largest discrete delay as printed, 6000 and 3000 rpm": (7.5008, 1e-4),
    "ripple of the printed discrete delay, diameters 2, speeds 4": (1.6003, 1e-3),
}


@pytest.fixture(scope="module")
def table() -> dict[str, Row]:
    """All rows by quantity."""
    found = rows()
    assert len({row.quantity for row in found}) == len(found)
    return {row.quantity: row for row in found}


@pytest.mark.parametrize("quantity", REFERENCE)
def test_agrees_with_the_independent_value(table: dict[str, Row], quantity: str) -> None:
    value, tolerance = REFERENCE[quantity]
    assert table[quantity].computed == pytest.approx(value, rel=tolerance)


def test_every_row_says_why_and_is_finite(table: dict[str, Row]) -> None:
    assert all(row.why and row.source and math.isfinite(row.computed) for row in table.values())


def test_asymmetric_cutter_chatters_in_the_rotating_frame_only() -> None:
    assert asymmetric_verdict(True).predicted_type is PredictedType.HOPF
    assert asymmetric_verdict(False).predicted_type is PredictedType.STABLE
    assert abs(leading_multiplier(asymmetric_problem(1e-3, True))) < 1


def test_case_1_is_a_pocket_and_its_lobes_lie_beside_it(table: dict[str, Row]) -> None:
    """Lobe minima of 1.55 to 1.7 mm near 3100 and 3550 rpm; 3350 rpm is stable at 6 and at 21 rpm."""
    for rpm in (3100, 3550):
        assert 1.5 < table[f"lobe minimum near {rpm} rpm"].computed < 1.75
    assert table["depth limit, 3350 and 6 rpm"].computed > 1.4
    assert table["depth limit, 3350 and 21 rpm"].computed > 1.4


def test_case_2_rises_with_the_workpiece_speed(table: dict[str, Row]) -> None:
    for form in ("", ", round bar"):
        limits = [table[f"depth limit, 3500 and {w} rpm{form}"].computed for w in (6, 12, 40)]
        assert limits[0] < limits[1] < limits[2]
        assert limits[0] > 0.6


def test_aisi_620_chatters_at_the_bar_but_deeper(table: dict[str, Row]) -> None:
    assert table["chatter frequency, 2070 rpm"].computed == pytest.approx(256, abs=4)
    assert 0.5 < table["lowest depth limit, 1500 to 3000 rpm"].computed < 2.5
