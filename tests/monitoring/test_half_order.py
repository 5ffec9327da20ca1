"""Flip or runout of an even number of teeth: what a prediction and a known runout decide, and what they cannot."""

from __future__ import annotations

import math

import pytest

from tests.monitoring.signals import blocks, by_stamp, comb, flip, noise, phase, speeds, watch
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.half_order import ABOVE, GROWN, WITHIN, half_order
from turnmill_core.monitoring.verdict import ChatterKind, Reason
from turnmill_core.prediction import PredictedType, Prior

SPEED = 3350 * math.pi / 30
FLIP, STABLE = Prior(0, PredictedType.FLIP, 1.1), Prior(0, PredictedType.STABLE, 0.6, flip_multiplier=0.5)
EITHER = ChatterKind.FLIP_OR_RUNOUT


def of_odds(odds: float) -> float:
    return odds / (1 + odds)


def config(times: float, half: float = 0.5, teeth: int = 2) -> ChatterConfig:
    """Monitor whose known runout explains half-order lines that are `times` weaker than a share `half`."""
    return ChatterConfig(teeth=teeth, nominal_speed=SPEED, runout_share=of_odds(half / (1 - half) / times))


@pytest.mark.parametrize("half", [0.05, 0.2, 0.49])
@pytest.mark.parametrize(("times", "prior", "state", "reason"), [
    (0.5, None, ChatterKind.STABLE, Reason.KNOWN_RUNOUT),
    (0.9 * WITHIN, None, ChatterKind.STABLE, Reason.KNOWN_RUNOUT),
    (1.1 * WITHIN, None, EITHER, Reason.NO_PRIOR),
    (0.9 * ABOVE, None, EITHER, Reason.NO_PRIOR),
    (1.1 * ABOVE, None, ChatterKind.FLIP, Reason.ABOVE_RUNOUT),
    (1.1 * ABOVE, Prior(0, PredictedType.UNKNOWN, math.nan), ChatterKind.FLIP, Reason.ABOVE_RUNOUT),
    (1.1 * ABOVE, FLIP, ChatterKind.FLIP, Reason.PRIOR_FLIP),
    (1.1 * ABOVE, STABLE, EITHER, Reason.CONTRADICTION),
    (1.4 * WITHIN, FLIP, ChatterKind.FLIP, Reason.PRIOR_FLIP),
    (1.4 * WITHIN, STABLE, ChatterKind.STABLE, Reason.PRIOR_RUNOUT),
    (0.5, STABLE, ChatterKind.STABLE, Reason.PRIOR_RUNOUT),
    (0.5, FLIP, EITHER, Reason.CONTRADICTION),
])
def test_known_runout_and_prediction_decide_where_they_do_not_contradict(
        half: float, times: float, prior: Prior | None, state: ChatterKind, reason: Reason) -> None:
    found = half_order(config(times, half), half, prior)
    assert found[:2] == (state, reason)
    assert f"{100 * half:.0f} %" in found[2]


def test_lines_that_hold_most_of_the_energy_are_not_taken_for_runout() -> None:
    half = 1.1 * GROWN
    assert half_order(config(0.5, half), half, None)[:2] == (EITHER, Reason.NO_PRIOR)
    assert half_order(config(0.5, half), half, STABLE)[:2] == (ChatterKind.STABLE, Reason.PRIOR_RUNOUT)
    assert half_order(config(1.1 * ABOVE, half), half, None)[:2] == (ChatterKind.FLIP, Reason.ABOVE_RUNOUT)


@pytest.mark.parametrize("half", [0.05, 0.9999, 1.0])
def test_teeth_that_are_measured_alike_explain_nothing(half: float) -> None:
    alike = ChatterConfig(teeth=4, runout_share=0.0)
    assert half_order(alike, half, None)[:2] == (ChatterKind.FLIP, Reason.ABOVE_RUNOUT)


def test_an_odd_number_of_teeth_asks_nobody() -> None:
    assert half_order(config(0.1, teeth=3), 0.5, STABLE)[:2] == (ChatterKind.FLIP, Reason.HALF_ORDER)


@pytest.mark.parametrize(("share", "state", "reason"), [
    (math.nan, EITHER, Reason.NO_PRIOR), (0.1, ChatterKind.STABLE, Reason.KNOWN_RUNOUT),
    (1e-4, ChatterKind.FLIP, Reason.ABOVE_RUNOUT)])
def test_monitor_decides_with_a_known_runout_and_without_a_prior(
        share: float, state: ChatterKind, reason: Reason) -> None:
    t = phase(SPEED, 1.5)
    x = comb(t, 2) + flip(t, 2, 0.5) + noise(len(t), 0.1, 3)
    items = by_stamp(list(blocks(x)), list(speeds(SPEED, 1.5)))
    last = watch(ChatterConfig(teeth=2, nominal_speed=SPEED, runout_share=share), items)[-1]
    assert (last.state, last.reason, last.prior) == (state, reason, None)
    assert 0.1 < last.half_order_ratio < 0.5


def test_a_share_beyond_one_is_refused() -> None:
    with pytest.raises(ValueError, match="runout share"):
        ChatterConfig(teeth=2, runout_share=1.2)
