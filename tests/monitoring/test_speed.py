"""A tachometer that is wrong, where the signal shows little of a comb."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, blocks, by_stamp, noise, phase, speeds, watch
from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.spectrum import spectrum
from turnmill_core.monitoring.speed import SpindleSpeed, held_until, told_by_strongest
from turnmill_core.monitoring.verdict import ChatterKind, SpeedSource

SPEED = 8000 * 2 * math.pi / 60
TEETH = 5
TOOTH = TEETH * SPEED / (2 * math.pi)


def told(*lines: tuple[float, float], measured: float = 1.0) -> float:
    """Ratio told by lines (order of the true tooth passing frequency, amplitude); tachometer `measured` times true."""
    t = np.arange(round(0.2 * RATE)) / RATE
    x = sum(a * np.cos(2 * math.pi * order * TOOTH * t + order) for order, a in lines) + noise(len(t), 1e-3, 1)
    return told_by_strongest(spectrum(x, RATE, 5000.0), TOOTH * measured, 1.0, 40.0, 0.02)


@pytest.mark.parametrize("measured", [0.985, 0.99, 1.01, 1.015])
@pytest.mark.parametrize("order", [0.5, 1.0, 1.5, 2.0])
def test_a_single_line_near_a_low_harmonic_tells_the_speed(order: float, measured: float) -> None:
    assert told((order, 1.0), measured=measured) == pytest.approx(1 / measured, rel=1e-3)


def test_other_lines_than_harmonics_tell_nothing() -> None:
    assert told((1.37, 1.0)) == 1.0
    assert told((2.02, 1.0), (2.0, 0.5)) == 1.0
    assert told((1.01, 1.0), (1.37, 0.9), (2.37, 0.9)) == 1.0
    assert told() == 1.0


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
