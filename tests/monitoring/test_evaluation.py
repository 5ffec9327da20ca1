"""Scores and baselines against hand-made cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, comb, hopf, noise, phase
from turnmill_core.monitoring import _kernels
from turnmill_core.monitoring.baselines import (
    fft_energy_ratio,
    kalman_energy_ratios,
    once_per_revolution_variance,
)
from turnmill_core.monitoring.evaluation import alarms, confusion, per_hour, recall_at, roc_area
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict


def series(states: str) -> list[Verdict]:
    """Verdicts every 50 ms: H chatter, anything else stable."""
    kinds = [ChatterKind.HOPF if s == "H" else ChatterKind.STABLE for s in states]
    return [Verdict(50_000_000 * k, 50_000_000 * (k + 1), k, "d", 1, "c", kind, Reason.NONE, "")
            for k, kind in enumerate(kinds)]


def test_confusion_leaves_out_what_has_no_truth() -> None:
    h, s = ChatterKind.HOPF, ChatterKind.STABLE
    assert confusion([h, h, None, s], [h, s, s, s]) == {(h, h): 1, (h, s): 1, (s, s): 1}


def test_roc_area() -> None:
    assert roc_area([0, 0, 1, 1], [1, 2, 3, 4]) == 1.0
    assert roc_area([0, 0, 1, 1], [4, 3, 2, 1]) == 0.0
    assert roc_area([0, 1, 0, 1], [1, 1, 2, 2]) == 0.5
    assert math.isnan(roc_area([1, 1], [1, 2]))
    rng = np.random.default_rng(1)
    a, b = rng.normal(0, 1, 4000), rng.normal(1, 1, 4000)
    expected = 0.5 * math.erfc(-1 / 2)
    assert roc_area(np.r_[np.zeros(4000), np.ones(4000)], np.r_[a, b]) == pytest.approx(expected, abs=0.02)


def test_recall_at_a_share_of_false_ones() -> None:
    assert recall_at([0, 0, 0, 0, 1, 1], [1, 2, 3, 9, 4, 10], 0.25) == 1.0
    assert recall_at([0, 0, 0, 0, 1, 1], [1, 2, 3, 9, 4, 10], 0.0) == 0.5


def test_alarms_delays_and_false_alarms() -> None:
    found = alarms(series("sssssHHHHsssssssssssssssHHsss"), [(0.2, 0.5), (5.0, 6.0)], lead=0.1)
    assert found.alarms == pytest.approx((0.3, 1.25))
    assert found.delays[0] == pytest.approx(0.1)
    assert math.isnan(found.delays[1])
    assert found.false == pytest.approx((1.25,))
    assert per_hour([found])[0] == pytest.approx(3600 / found.duration)
    early = alarms(series("ssssHHHHHH"), [(0.3, 0.6)], lead=0.1)
    assert early.false == ()
    assert early.delays == pytest.approx((0.0,))


def _kalman(x: np.ndarray, rate: float, spindle_frequency: float) -> float:
    turns = np.arange(len(x)) * spindle_frequency / rate
    return float(kalman_energy_ratios(x, turns, [len(x)], round(0.2 * rate))[0])


def test_compiled_kalman_comb_does_what_its_plain_version_does() -> None:
    t = phase(3350 * 2 * math.pi / 60, 0.1)
    x = comb(t, 4) + noise(len(t), 0.1, 1)
    assert np.allclose(_kernels.kalman_comb(x, t, 12, 0.003), _kernels.kalman_comb.py_func(x, t, 12, 0.003), atol=1e-9)


def test_kalman_comb_follows_a_harmonic_and_leaves_what_is_between() -> None:
    t = phase(3000 * 2 * math.pi / 60, 1.0)
    other = np.cos(2 * math.pi * 77.3 * np.arange(len(t)) / RATE)
    left = _kernels.kalman_comb(np.cos(2 * math.pi * 3 * t) + other, t, 8, 0.003)
    assert np.std(left[-4000:] - other[-4000:]) < 0.15


@pytest.mark.parametrize("indicator", [fft_energy_ratio, once_per_revolution_variance, _kalman])
def test_baselines_tell_clear_chatter_from_a_clear_cut(indicator) -> None:
    t = phase(3350 * 2 * math.pi / 60, 0.4)
    stable = comb(t, 4) + noise(len(t), 0.02, 1)
    chatter = stable + hopf(t, 4, 885.0, 1.0)
    assert indicator(stable, RATE, 3350 / 60) < 0.1
    assert indicator(chatter, RATE, 3350 / 60) > 0.2
