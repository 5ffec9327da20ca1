"""Other channels confirm or deny what one channel hears."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, blocks, by_stamp, comb, flip, hopf, noise, phase, speeds, watch
from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict

SPEED = 3350 * 2 * math.pi / 60
SECONDS = 3.0
BEGIN = 1.5


def heard(*columns: np.ndarray, teeth: int = 4) -> list[Verdict]:
    """Verdicts on the first of several channels."""
    config = ChatterConfig(teeth=teeth, nominal_speed=SPEED)
    return watch(config, by_stamp(list(blocks(np.stack(columns, axis=1))), list(speeds(SPEED, SECONDS))))


def signal(chatter: float, seed: int, level: float = 0.02, cut: float = 1.0) -> np.ndarray:
    """A cut with a chatter line from BEGIN on."""
    turns = phase(SPEED, SECONDS)
    on = np.arange(len(turns)) / RATE > BEGIN
    return cut * comb(turns, 4) + chatter * on * hopf(turns, 4, 871.3, 1.0) + noise(len(turns), level, seed)


def first_alarm(verdicts: list[Verdict]) -> float:
    return next(v.window_end_ns * 1e-9 for v in verdicts if v.state is ChatterKind.HOPF)


def test_agreement_brings_the_alarm_forward() -> None:
    alone = heard(signal(0.5, 1))
    both = heard(signal(0.5, 1), signal(0.3, 2))
    assert first_alarm(both) == pytest.approx(first_alarm(alone) - 0.05)
    text = next(v.reason_text for v in both if v.state is ChatterKind.HOPF)
    assert "heard by ch1 too" in text


def test_lines_in_one_channel_alone_are_no_chatter() -> None:
    verdicts = heard(signal(0.5, 1), signal(0.0, 2))
    assert not [v for v in verdicts if v.state is ChatterKind.HOPF]
    late = [v for v in verdicts if v.window_end_ns > 2.5e9]
    assert {(v.state, v.reason) for v in late} == {(ChatterKind.MARGINAL, Reason.DENIED)}
    assert "in this channel alone, not in ch1" in late[0].reason_text


def test_one_that_agrees_outweighs_one_that_does_not() -> None:
    verdicts = heard(signal(0.5, 1), signal(0.0, 2), signal(0.3, 3))
    assert verdicts[-1].state is ChatterKind.HOPF


@pytest.mark.parametrize("other", [
    signal(0.0, 2, level=3.0), signal(0.0, 2, cut=0.0), np.zeros(round(SECONDS * RATE)),
    np.full(round(SECONDS * RATE), np.nan)], ids=["noisy", "not at the cut", "dead", "not a number"])
def test_channels_that_could_not_hear_it_say_nothing(other: np.ndarray) -> None:
    assert first_alarm(heard(signal(0.5, 1), other)) == first_alarm(heard(signal(0.5, 1)))


def test_a_small_other_line_does_not_hide_that_period_two_is_heard_twice() -> None:
    turns = phase(SPEED, SECONDS)
    one = comb(turns, 3) + 0.6 * flip(turns, 3, 1.0) + 0.1 * np.cos(2 * math.pi * 871.3 * np.arange(len(turns)) / RATE)
    other = comb(turns, 3) + 0.3 * flip(turns, 3, 1.0) + noise(len(turns), 0.02, 2)
    assert heard(one + noise(len(turns), 0.02, 1), other, teeth=3)[-1].state is ChatterKind.FLIP


def test_period_two_is_confirmed_by_half_order_lines() -> None:
    turns = phase(SPEED, SECONDS)
    both = [comb(turns, 3) + size * flip(turns, 3, 1.0) + noise(len(turns), 0.02, k)
            for k, size in ((1, 0.6), (2, 0.3))]
    assert heard(*both, teeth=3)[-1].state is ChatterKind.FLIP
    denied = heard(both[0], comb(turns, 3) + noise(len(turns), 0.02, 3), teeth=3)[-1]
    assert (denied.state, denied.reason) == (ChatterKind.MARGINAL, Reason.DENIED)
