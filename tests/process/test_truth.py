"""The truth of signals that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.process.cases import BENCHMARK_MODE, milling
from turnmill_core.process.truth import (
    MARKS_PER_TURN,
    PERIODS,
    Truth,
    crossings,
    join_truth,
    principal_turns,
    truth_of_marks,
)

SPEED = 50.0
"""Tool revolutions per second of the made-up signals."""


def marks(turns: int, **lines: tuple[float, float]) -> np.ndarray:
    """Marks of `turns` revolutions with lines name=(order, amplitude) along x; y is a tenth of it."""
    angle = np.arange(turns * MARKS_PER_TURN) / MARKS_PER_TURN
    x = 5e-6 + sum(a * np.cos(2 * np.pi * order * angle + 0.3) for order, a in lines.values())
    return np.stack([angle / SPEED, x, 0.1 * x, np.full_like(x, 1e-5)], axis=1)


def test_amplitudes_and_frequency_of_known_lines() -> None:
    found, _ = truth_of_marks(marks(20, tooth=(2, 3e-6), chatter=(15.43, 1e-6)), teeth=2, turns=1)
    scale = math.sqrt(0.5 * 1.01)
    assert len(found.time) == 20 - PERIODS + 1
    np.testing.assert_allclose(found.synchronous, 3e-6 * scale, rtol=0.02)
    np.testing.assert_allclose(found.asynchronous, 1e-6 * scale, rtol=0.1)
    np.testing.assert_allclose(found.frequency, 15.43 * SPEED, rtol=1e-3)
    np.testing.assert_allclose(found.ratio, 1 / 3, rtol=0.1)
    np.testing.assert_allclose(np.diff(found.time), 1 / SPEED)
    assert found.time[0] == pytest.approx(PERIODS / 2 / SPEED, rel=0.01)


@pytest.mark.parametrize(("teeth", "turns", "order"), [(2, 1, 1.0), (4, 1, 2.0), (3, 2, 1.5), (5, 2, 2.5), (2, 1, 3.0)])
def test_half_order_lines(teeth: int, turns: int, order: float) -> None:
    """Odd multiples of half the tooth passing frequency count as synchronous, and as half order."""
    found, _ = truth_of_marks(marks(24, tooth=(teeth, 3e-6), half=(order, 1e-6)), teeth, turns)
    np.testing.assert_allclose(found.half_order, 1e-6 * math.sqrt(0.5 * 1.01), rtol=1e-6)
    np.testing.assert_allclose(found.asynchronous, 0, atol=1e-12)
    uneven, _ = truth_of_marks(marks(24, tooth=(teeth, 3e-6), half=(order, 1e-6)), teeth, turns, uneven=True)
    assert np.all(uneven.half_order == 0)


def test_a_slow_drift_is_not_asynchronous() -> None:
    rows = marks(16, tooth=(2, 3e-6))
    rows[:, 1:3] *= 1 + 0.5 * np.floor(np.arange(len(rows)) / MARKS_PER_TURN)[:, None]
    found, _ = truth_of_marks(rows, 2, 1)
    np.testing.assert_allclose(found.asynchronous, 0, atol=1e-18)


def test_pieces_give_the_same_windows() -> None:
    rows = marks(30, tooth=(2, 3e-6), chatter=(15.43, 1e-6))
    whole, _ = truth_of_marks(rows, 2, 1)
    rest, parts = rows[:0], []
    for piece in np.array_split(rows, 17):
        part, rest = truth_of_marks(np.concatenate([rest, piece]), 2, 1)
        parts.append(part)
    np.testing.assert_array_equal(join_truth(parts).asynchronous, whole.asynchronous)


def test_contact_is_asked_of_every_revolution() -> None:
    rows = marks(30, tooth=(2, 3e-6))
    rows[: 10 * MARKS_PER_TURN, 3] = 0.0
    found, _ = truth_of_marks(rows, 2, 1)
    assert found.in_cut.tolist() == [i >= 10 for i in range(23)]
    assert found.touched.tolist() == [i + PERIODS > 10 for i in range(23)]
    assert np.all(np.isnan(found.ratio) == ~found.in_cut)


def _truth(ratio: list[float]) -> Truth:
    values = np.array(ratio)
    cut = ~np.isnan(values)
    ones = np.ones(len(values))
    return Truth(0.1 * np.arange(len(values)), ones, np.nan_to_num(values), 0 * ones, ones, cut, cut.copy())


def test_crossings_are_interpolated_in_the_logarithm() -> None:
    found = crossings(_truth([math.nan, 0.9, 0.1, 0.1, 0.4, 4.0, 0.1, math.nan]))
    assert [c.rising for c in found] == [True, False]
    assert found[0].time == pytest.approx(0.3 + 0.1 * math.log(2) / math.log(4))
    assert found[1].time == pytest.approx(0.5 + 0.1 * math.log(4 / 0.2) / math.log(40))


def test_entry_and_exit_are_no_crossings() -> None:
    assert crossings(_truth([math.nan, 0.9, 0.1, 0.1, math.nan, 0.1, math.nan])) == ()


def test_nothing_is_nothing() -> None:
    assert len(join_truth([]).time) == 0
    assert crossings(join_truth([])) == ()


def test_principal_period() -> None:
    assert [principal_turns(milling((BENCHMARK_MODE,), teeth=n).tool) for n in (1, 2, 3, 4, 5)] == [2, 1, 2, 1, 2]
    uneven = milling(teeth=3, pitch_angles=(2.0, 2.0, 2 * math.pi - 4.0))
    assert principal_turns(uneven.tool) == 1


def test_arrays_must_match() -> None:
    ones, cut = np.ones(3), np.ones(3, dtype=np.bool_)
    with pytest.raises(ValueError, match="asynchronous"):
        Truth(ones, ones, np.ones(2), ones, ones, cut, cut)


def test_chatter_that_has_locked_to_two_revolutions_is_asynchronous() -> None:
    """Two revolutions hold it, but it is no half-order line of three teeth (order 1.5, 4.5 ...)."""
    found, _ = truth_of_marks(marks(24, tooth=(3, 3e-6), half=(9.5, 1e-6)), 3, 2)
    np.testing.assert_allclose(found.half_order, 0, atol=1e-12)
    np.testing.assert_allclose(found.asynchronous, 1e-6 * math.sqrt(0.5 * 1.01), rtol=1e-6)
    np.testing.assert_allclose(found.synchronous, 3e-6 * math.sqrt(0.5 * 1.01), rtol=1e-6)
