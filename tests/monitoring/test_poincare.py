"""The Poincare set: one point, two points, a closed curve."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, comb, flip, phase
from turnmill_core.monitoring.poincare import poincare_set

TURNS = phase(3000 * 2 * math.pi / 60, 1.0)


def spread(points: np.ndarray) -> float:
    return float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def test_forced_vibration_gives_one_point() -> None:
    points = poincare_set(comb(TURNS, 4, runout=0.3), TURNS)
    assert len(points) >= 48
    assert spread(points) < 1e-3


def test_period_two_of_three_teeth_gives_two_points() -> None:
    points = poincare_set(comb(TURNS, 3) + flip(TURNS, 3, 0.5), TURNS)
    assert spread(points[::2]) < 1e-3
    assert spread(points[1::2]) < 1e-3
    assert np.linalg.norm(points[0] - points[1]) > 0.1


def test_quasi_periodic_motion_gives_a_closed_curve() -> None:
    t = np.arange(len(TURNS)) / RATE
    f = 871.3
    points = poincare_set(comb(TURNS, 4) + np.cos(2 * math.pi * f * t), TURNS, RATE / f / 4)
    centred = points - poincare_set(comb(TURNS, 4), TURNS, RATE / f / 4)[: len(points)]
    assert np.linalg.norm(centred, axis=1) == pytest.approx(1.0, abs=0.01)
    angles = np.sort(np.arctan2(centred[:, 1], centred[:, 0]))
    assert np.diff(angles).max() < 0.6


def test_too_few_revolutions_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 3"):
        poincare_set(np.zeros(100), np.linspace(0, 2, 100))
