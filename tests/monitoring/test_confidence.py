"""The confidence is a probability: what is stated at 90 % is right nine times out of ten."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import comb, hopf, judged, noise, phase
from tools.calibrate_confidence import cases, reliability, rows
from turnmill_core.detection.cuts import TRAIN_END
from turnmill_core.monitoring.confidence import EVIDENCE, WEIGHTS, confidence
from turnmill_core.monitoring.verdict import ChatterKind


def outcomes(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Stated probability and outcome of every verdict on cuts that the calibration has not seen."""
    found = [row for case in cases(TRAIN_END, count) for row in rows(case)]
    return (np.array([confidence(ChatterKind(state), e) for state, _, e in found]),
            np.array([outcome for _, outcome, _ in found]))


@pytest.mark.parametrize("count", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_stated_probability_is_the_share_that_is_right(count: int) -> None:
    probability, outcome = outcomes(count)
    error, bins = reliability(probability, outcome)
    assert len(outcome) > 250 * count
    assert error < (0.06 if count < 20 else 0.03), bins
    assert probability.mean() == pytest.approx(outcome.mean(), abs=0.06 if count < 20 else 0.03)


def test_every_state_has_weights_and_unknown_has_no_confidence() -> None:
    assert set(WEIGHTS) == set(ChatterKind) - {ChatterKind.UNKNOWN}
    assert {len(w) for w in WEIGHTS.values()} == {len(EVIDENCE)}
    assert confidence(ChatterKind.UNKNOWN, np.ones(len(EVIDENCE))) == 0.0


def test_clear_cases_are_stated_with_confidence() -> None:
    speed = 3350 * 2 * math.pi / 60
    t = phase(speed, 1.5)
    for x in (noise(len(t), 0.1, 1), comb(t, 4) + noise(len(t), 0.05, 1),
              comb(t, 4) + hopf(t, 4, 871.3, 1.0) + noise(len(t), 0.05, 1)):
        assert judged(x, 4, speed)[-1].confidence > 0.7
