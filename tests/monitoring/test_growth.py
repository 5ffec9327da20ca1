"""Early warning from exponential growth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, comb, hopf, judged, noise, phase
from turnmill_core.monitoring.growth import WINDOWS, Seen, rate, remember, rise, time_to
from turnmill_core.monitoring.verdict import ChatterKind, Reason

TOOTH = 220.0


def exponential(growth: float, first: float = 1e-3, windows: int = WINDOWS) -> tuple[Seen, ...]:
    """History of a family whose amplitude grows as exp(growth t)."""
    history: tuple[Seen, ...] = ()
    for k in range(windows):
        history = remember(history, Seen(0.05 * k, 900.0, first * math.exp(2 * growth * 0.05 * k)), 5.0,
                           TOOTH)
    return history


@pytest.mark.parametrize("growth", [0.5, 3.0, 20.0])
def test_rate_of_an_exponential(growth: float) -> None:
    assert rate(exponential(growth)) == pytest.approx(growth)


def test_time_until_a_share_is_passed() -> None:
    history = exponential(4.0)
    wait = time_to(history, 0.04)
    assert history[-1].share * math.exp(2 * 4.0 * wait) == pytest.approx(0.04)
    assert time_to(exponential(1.0), 0.04) == math.inf
    assert time_to(exponential(4.0, first=0.1), 0.04) == 0.0


def test_no_rate_without_steady_growth() -> None:
    assert math.isnan(rate(exponential(4.0)[:-1]))
    assert math.isnan(rate(exponential(-4.0)))
    dip = (*exponential(4.0)[:-1], Seen(0.25, 900.0, 1e-5))
    assert math.isnan(rate(dip))


def test_another_frequency_begins_anew() -> None:
    assert len(remember(exponential(4.0), Seen(0.3, 700.0, 1.0), 5.0, TOOTH)) == 1


@pytest.mark.parametrize("frequency", [900.0 + TOOTH, 900.0 - 2 * TOOTH])
def test_another_member_of_the_family_goes_on(frequency: float) -> None:
    assert len(remember(exponential(4.0), Seen(0.3, frequency, 1.0), 5.0, TOOTH)) == WINDOWS


def test_energy_at_the_end_of_a_window_while_it_grows() -> None:
    assert rise(exponential(4.0), 0.2) == pytest.approx(math.exp(4.0 * 0.2))
    assert rise(exponential(4.0, windows=3), 0.2) == 1.0
    assert rise(exponential(20.0, windows=3), 0.1) == pytest.approx(math.exp(2.0))
    assert rise(exponential(1.0), 0.2) == 1.0
    assert rise((), 0.2) == 1.0


def test_a_line_without_sidebands_must_grow_more() -> None:
    slow, fast = exponential(4.0, windows=4), exponential(5.0, windows=4)
    assert rise(slow, 0.2, evident=False) == 1.0 < rise(slow, 0.2)
    assert rise(fast, 0.2, evident=False) == rise(fast, 0.2) == pytest.approx(math.exp(1.0))


def test_growing_chatter_is_warned_of_before_it_is_chatter() -> None:
    speed, growth = 3350 * 2 * math.pi / 60, 4.0
    turns = phase(speed, 3.0)
    at = np.arange(len(turns)) / RATE
    amplitude = 0.004 * np.exp(growth * np.clip(at - 0.5, 0, None))
    x = comb(turns, 4) + amplitude * hopf(turns, 4, 871.3, 1.0) + noise(len(turns), 0.005, 2)
    verdicts = judged(x, 4, speed)
    first = next(v for v in verdicts if v.state is ChatterKind.HOPF)
    warned = [v for v in verdicts if v.state is ChatterKind.MARGINAL and v.reason is Reason.ASYNCHRONOUS]
    assert 0.1 < (first.window_end_ns - warned[0].window_end_ns) * 1e-9 < 0.7
    assert "grow exponentially" in warned[0].reason_text


def test_a_steady_small_line_is_not_warned_of() -> None:
    speed = 3350 * 2 * math.pi / 60
    turns = phase(speed, 3.0)
    x = comb(turns, 4) + hopf(turns, 4, 871.3, 0.1) + noise(len(turns), 0.02, 2)
    assert {v.state for v in judged(x, 4, speed)[4:]} == {ChatterKind.STABLE}
