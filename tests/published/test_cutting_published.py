"""Published numbers of chips, engagement, forces and limits against the model.

Reference values were computed independently of this code from the thesis' equations with their
errata; exact-chip values within 5 %, everything else within 1 %.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.published.row import Row
from tests.published.rows_cutting import load, rows
from turnmill_core.cutting.feed import feed_angle
from turnmill_core.cutting.loads import cutting_loads

REFERENCE = {
    ("Table 3.1", "largest chip"): 0.434,
    ("Table 3.1", "Fx smallest"): -315,
    ("Table 3.1", "Fx mean"): -48.7,
    ("Table 3.1", "Fy smallest"): -38,
    ("Table 3.1", "Fy largest"): 116,
    ("Table 3.1", "Fz smallest"): -84,
    ("Table 3.1", "cutting / non-cutting time"): 0.322,
    ("Table 3.1", "cutting / total time"): 0.243,
    ("Table 3.1", "cutting / non-cutting time, no helix"): 0.299,
    ("Table 3.1", "cutting / total time, no helix"): 0.230,
    ("Table 3.1", "exit angle at 0 mm"): 41.4,
    ("Table 3.1", "exit angle at 0.73 mm"): 41.4,
    ("Table 3.1", "exit angle at 0.8 mm"): 34.9,
    ("Table 3.1", "exit angle at 0.9 mm"): 23.9,
    ("Table 3.2", "largest chip"): 0.241,
    ("Table 3.2", "cutting / non-cutting time, no helix"): 0.285,
    ("Table 3.2", "cutting / non-cutting time, 13.7 deg helix"): 0.31,
    ("Table 3.2", "resultant force, peak, 30 deg helix"): 197,
    ("Table 5.2", "chip-load limit of the tool speed, workpiece 10 rpm"): 1966.0,
    ("Table 5.2", "chip-load limit of the tool speed, workpiece 20 rpm"): 3932.1,
    ("Table 5.2", "chip-load limit of the tool speed, workpiece 30 rpm"): 5898.1,
    ("Table 5.2", "chip-load limit of the tool speed, workpiece 40 rpm"): 7864.2,
    ("Table 5.2", "chip-load limit of the tool speed, workpiece 50 rpm"): 9830.2,
    ("section 5.3, Table 5.2", "cutting-speed limit of the tool, 650 m/min"): 10345.07,
    ("Table 5.2", "removal rate, workpiece 10 rpm, 5.5 mm"): 61512.4,
    ("Table 5.2", "removal rate, workpiece 20 rpm, 2.8 mm"): 66430.9,
    ("Table 5.2", "removal rate, workpiece 30 rpm, 1.85 mm"): 67162.9,
    ("Table 5.2", "removal rate, workpiece 40 rpm, 1.5 mm"): 73136.3,
    ("Table 5.2", "removal rate, workpiece 50 rpm, 1.25 mm"): 76576.3,
}
EXACT_CHIP = {
    ("Table 3.2", "largest chip, trochoid alone"): 0.26,
    ("Table 3.2", "largest chip, exact"): 0.185,
    ("Table 3.2", "resultant force, peak, 30 deg helix, exact chip"): 156,
}


@pytest.fixture(scope="module")
def table() -> dict[tuple[str, str], Row]:
    return {(row.source, row.quantity): row for row in rows()}


@pytest.mark.parametrize(("key", "value", "tolerance"), [
    *((key, value, 0.01) for key, value in REFERENCE.items()),
    *((key, value, 0.05) for key, value in EXACT_CHIP.items())])
def test_reference(table: dict[tuple[str, str], Row], key: tuple[str, str], value: float, tolerance: float) -> None:
    assert table[key].computed == pytest.approx(value, rel=tolerance)


def test_zeros_and_coarse_references(table: dict[tuple[str, str], Row]) -> None:
    assert table["Table 3.1", "Fx largest"].computed == 0
    assert table["Table 3.1", "exit angle at 1 mm"].computed == 0
    assert table["Table 3.1", "tool torque, peak"].computed == pytest.approx(2.5, abs=0.05)  # given to two digits
    assert table["Table 3.1", "chip flow angle behind K_tc, K_rc, K_ac"].computed == pytest.approx(25, abs=0.2)
    assert table["Table 3.1", "volume through the tool's bottom"].computed == pytest.approx(14, abs=0.5)


@pytest.mark.parametrize("rpm", [10, 20, 30, 40, 50])
def test_chip_load_limits_and_removal_rates_to_the_last_printed_digit(
    table: dict[tuple[str, str], Row], rpm: int
) -> None:
    for (_, quantity), row in table.items():
        if f"workpiece {rpm} rpm" in quantity and row.published != 1960:
            assert row.computed == pytest.approx(float(row.published), abs=1.0)


def test_what_is_not_reproduced_is_off_and_says_why(table: dict[tuple[str, str], Row]) -> None:
    for row in table.values():
        if isinstance(row.published, float) and abs(row.computed / row.published - 1) > 0.02:
            assert len(row.why) > 10


def test_published_range_of_x_needs_the_resultant_feed_frame() -> None:
    """In the tool frame, whose x axis is the machine's, F_y is smaller by F_x sin(epsilon), about 2 N of 116."""
    op = load("thesis_table_3_1")
    loads = cutting_loads(op, op.conditions)
    epsilon = float(feed_angle(op, op.conditions, np.zeros(1))[0])
    assert math.degrees(epsilon) == pytest.approx(0.354, abs=0.001)
    assert loads.force_tool[:, 1].max() == pytest.approx(114.3, rel=0.01)
    # machine frame: x_T = -y_M, y_T = -z_M, z_T = x_M
    assert loads.force_machine_peak == pytest.approx([-84.4, 316, -114.3], rel=0.01)
