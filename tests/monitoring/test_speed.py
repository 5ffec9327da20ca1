"""A tachometer that is wrong, where the signal shows little of a comb."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, blocks, by_stamp, comb, hopf, noise, phase, speeds, watch
from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.lattice import MOST, evidence, measured_prior, trial_ratios
from turnmill_core.monitoring.spectrum import LINE_RATIO, lines, spectrum
from turnmill_core.monitoring.speed import SpindleSpeed, held_until
from turnmill_core.monitoring.verdict import ChatterKind, SpeedSource

SPEED = 8000 * 2 * math.pi / 60
TEETH = 5
TOOTH = TEETH * SPEED / (2 * math.pi)


def told(*given: tuple[float, float], measured: float = 1.0, seed: int = 1) -> float:
    """Ratio told by lines (order of the true tooth passing frequency, amplitude); tachometer `measured` times true."""
    t = np.arange(round(0.2 * RATE)) / RATE
    x = sum(a * np.cos(2 * math.pi * order * TOOTH * t + order) for order, a in given) + noise(len(t), 1e-3, seed)
    s, ratios = spectrum(x, RATE, 5000.0), trial_ratios(0.02)
    scores = evidence(lines(s, 40.0, LINE_RATIO, MOST), s.resolution, TOOTH * measured, TEETH, ratios)
    return float(ratios[np.argmax(scores + measured_prior(ratios))])


COMB = tuple((float(k), 1.0 / k) for k in range(1, 6))
FAMILY = tuple((abs(k + 0.37), a) for k, a in ((3, 1.0), (4, 0.5), (2, 0.3), (-2, 0.1), (-3, 0.05)))
HALF_ORDER = tuple((k + 0.5, 1.0 / (1 + k)) for k in range(4))
RUNOUT = tuple((k / TEETH, 0.1) for k in range(1, 10))


@pytest.mark.parametrize("measured", [0.985, 0.99, 0.998, 1.0, 1.01, 1.015])
@pytest.mark.parametrize("given", [COMB, FAMILY, (*COMB, *FAMILY), HALF_ORDER, RUNOUT, COMB[:2]])
def test_the_spacing_of_lines_tells_the_speed(given: tuple[tuple[float, float], ...], measured: float) -> None:
    """Stable or not, with a comb or without one."""
    assert told(*given, measured=measured) == pytest.approx(1 / measured, rel=4e-4)


@pytest.mark.parametrize("measured", [0.985, 0.99, 1.01, 1.015])
def test_a_single_line_near_a_harmonic_tells_the_speed(measured: float) -> None:
    assert told((1.0, 1.0), measured=measured) == pytest.approx(1 / measured, rel=1e-3)
    assert told((2.0, 1.0), measured=measured) == pytest.approx(1 / measured, rel=1e-3)


def test_chatter_is_no_reason_to_doubt_a_right_tachometer() -> None:
    """No strong family pulls the comb onto itself, wherever it lies."""
    for offset in np.linspace(0.03, 0.47, 23):
        family = tuple((k + offset, a) for k, a in ((4, 1.0), (5, 0.3), (3, 0.3), (6, 0.1)))
        assert told(*family, (1.0, 0.01), (2.0, 0.01)) == pytest.approx(1.0, abs=1e-3)


def test_noise_and_single_lines_elsewhere_tell_nothing() -> None:
    assert told() == 1.0
    assert told((1.37, 1.0)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("error", [-0.01, 0.01])
def test_one_harmonic_at_a_wrong_tachometer_is_no_chatter(error: float) -> None:
    turns = phase(SPEED, 3.0)
    cut = np.arange(len(turns)) / RATE > 1.0
    x = cut * np.cos(2 * math.pi * TEETH * turns) + noise(len(turns), 2e-3, 2)
    config = ChatterConfig(teeth=TEETH, nominal_speed=SPEED)
    verdicts = watch(config, by_stamp(list(blocks(x)), list(speeds(SPEED * (1 + error), 3.0))))
    late = [v for v in verdicts if v.window_end_ns > 1.3e9]
    assert {v.state for v in late} == {ChatterKind.STABLE}
    assert late[-1].spindle_speed == pytest.approx(SPEED, rel=1e-3)


@pytest.mark.parametrize("error", [-0.01, 0.01])
@pytest.mark.parametrize("chatter", [0.0, 2.0])
def test_a_wrong_tachometer_is_found_while_the_speed_ramps(chatter: float, error: float) -> None:
    """500 rpm a second, from the first window of a cut on."""
    seconds = 3.0
    speed = (3000 + 500 * np.arange(round(seconds * RATE)) / RATE) * 2 * math.pi / 60
    turns = phase(speed, seconds)
    cut = np.arange(len(turns)) / RATE > 1.0
    x = cut * (comb(turns, TEETH, harmonics=6) + hopf(turns, TEETH, 871.3, chatter)) + noise(len(turns), 2e-2, 2)
    config = ChatterConfig(teeth=TEETH, nominal_speed=float(speed[0]))
    verdicts = watch(config, by_stamp(list(blocks(x)), list(speeds(speed * (1 + error), seconds))))
    late = [v for v in verdicts if v.window_end_ns > 1.4e9]
    assert {v.state for v in late} == {ChatterKind.HOPF if chatter else ChatterKind.STABLE}
    middle = late[-1].window_end_ns * 1e-9 - 0.1
    assert late[-1].spindle_speed == pytest.approx((3000 + 500 * middle) * 2 * math.pi / 60, rel=1e-3)


def test_the_newest_speed_is_held_for_a_moment() -> None:
    held = (SpindleSpeed(0, 100.0, 0.0), SpindleSpeed(10, 101.0, 1.0))
    assert held_until(held, 10, 5) is held
    assert held_until(held, 14, 5) == (*held, SpindleSpeed(14, 101.0, 1.0 + 101.0 * 4e-9))
    back = (SpindleSpeed(0, 100.0, 1.0), SpindleSpeed(10, 101.0, 0.0))
    assert held_until(back, 14, 5)[-1].angle == -101.0 * 4e-9
    assert held_until(held, 16, 5) is held
    assert held_until((), 16, 5) == ()


def test_windows_at_the_end_of_the_axis_states_use_them() -> None:
    turns = phase(SPEED, 2.0)
    x = np.cos(2 * math.pi * TEETH * turns) + noise(len(turns), 2e-3, 2)
    given = [s for s in speeds(0.99 * SPEED, 2.0) if s.stamp_ns < 1.97e9]
    config = ChatterConfig(teeth=TEETH, nominal_speed=SPEED)
    verdicts = watch(config, by_stamp(list(blocks(x)), given))
    assert verdicts[-1].window_end_ns > 1.99e9
    assert verdicts[-1].spindle_speed_source is not SpeedSource.NOMINAL
