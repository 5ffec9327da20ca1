"""Early warning from exponential growth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, comb, hopf, judged, noise, phase
from turnmill_core.monitoring.features import Features, HalfOrder
from turnmill_core.monitoring.growth import LARGEST, WINDOWS, Seen, rate, remember, rise, surges, surging, time_to
from turnmill_core.monitoring.spectrum import Line
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
    assert rise(exponential(20.0), 0.2) == LARGEST
    assert rise(exponential(1.0), 0.2) == 1.0
    assert rise((), 0.2) == 1.0


def onset(growth: float, channels: int = 1, at: float = 1.5, level: float = 0.02) -> np.ndarray:
    """A cut in which chatter grows from 3e-4 of the comb to twice it; each channel has noise of its own."""
    turns = phase(3350 * 2 * math.pi / 60, 3.0)
    time = np.arange(len(turns)) / RATE
    amplitude = np.minimum(2.0, 3e-4 * np.exp(growth * np.maximum(0.0, time - at))) * (time > at)
    clean = comb(turns, 4) + amplitude * hopf(turns, 4, 871.3, 1.0)
    return np.stack([clean + noise(len(turns), level, seed) for seed in range(channels)], axis=1)


def crossing(growth: float, at: float = 1.5) -> float:
    """Time at which the chatter line, and its two sidebands, are a fifth of the comb (rms)."""
    turns = phase(3350 * 2 * math.pi / 60, 3.0)
    ratio = float(np.std(hopf(turns, 4, 871.3, 1.0)) / np.std(comb(turns, 4)))
    return at + math.log(0.2 / ratio / 3e-4) / growth


@pytest.mark.parametrize("growth", [8.0, 15.0, 25.0])
@pytest.mark.parametrize("channels", [1, 3])
def test_chatter_that_triples_within_a_tenth_of_a_second_is_heard_before_it_has(growth: float, channels: int) -> None:
    verdicts = judged(onset(growth, channels), 4, 3350 * 2 * math.pi / 60)
    first = next(v for v in verdicts if v.state is ChatterKind.HOPF).window_end_ns * 1e-9
    assert -0.3 < first - crossing(growth) < max(0.05, math.log(3) / growth)
    assert verdicts[-1].state is ChatterKind.HOPF


def test_other_channels_let_a_surge_be_believed_sooner() -> None:
    def alarm(channels: int) -> tuple[int, str]:
        verdicts = judged(onset(20.0, channels, level=0.2), 4, 3350 * 2 * math.pi / 60)
        return next((v.window_end_ns, v.reason_text) for v in verdicts if v.state is ChatterKind.HOPF)

    (alone, _), (agreed, text) = alarm(1), alarm(3)
    assert agreed == alone - 50_000_000
    assert "surges" in text
    assert "heard by ch1, ch2 too" in text


def test_a_line_that_begins_and_stays_is_no_surge() -> None:
    speed = 3350 * 2 * math.pi / 60
    turns = phase(speed, 3.0)
    on = np.arange(len(turns)) / RATE > 1.5
    x = comb(turns, 4) + 0.13 * on * hopf(turns, 4, 871.3, 1.0) + noise(len(turns), 0.02, 2)
    assert {v.state for v in judged(x, 4, speed)[4:]} == {ChatterKind.STABLE}


def lines_at_the_end(*energies: float) -> Features:
    """Features of a window of 0.2 s with a synchronous energy of 1 and rising lines from 500 Hz on, 100 Hz apart."""
    found = tuple(Line(500.0 + 100 * k, e / 2, 100.0) for k, e in enumerate(energies))
    return Features(50.0, 1.0, 1.0, 1.0, 0.0, HalfOrder(0.0), 5, 12, 0.01, 1.0, 1.0, (), None, 0.0, 0.2, found)


def test_surges_go_on_from_window_to_window() -> None:
    first = surges(lines_at_the_end(0.001, 0.01), (), 0.05)
    assert [s.windows for s in first] == [0, 0]
    second = surges(lines_at_the_end(0.003, 0.012), first, 0.05)
    assert [s.windows for s in second] == [1, 0]
    assert second[0].growth == pytest.approx(3.0, rel=0.01)
    third = surges(lines_at_the_end(0.1), second, 0.05)
    assert (third[0].windows, third[0].growth) == (2, LARGEST)
    assert surging(first, 0.04) is None
    assert surging(second, 0.04) is None
    assert surging(third, 0.04) is third[0]


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
