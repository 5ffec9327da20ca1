"""Streams with faults: every fault has a stated outcome, nothing raises, nothing grows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.monitoring.signals import RATE, blocks, by_stamp, comb, hopf, noise, phase, speeds, watch
from turnmill_core.monitoring.blocks import SensorBlock, Status
from turnmill_core.monitoring.chatter import ChatterConfig, RecordedPrior, finish, initial, update
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict
from turnmill_core.prediction import PredictedType, Prior

SPEED = 3350 * 2 * math.pi / 60
CONFIG = ChatterConfig(teeth=4, nominal_speed=SPEED, expect_axes=False)
SECONDS = 2.0


def cut(seconds: float = SECONDS, channels: int = 1) -> np.ndarray:
    t = phase(SPEED, seconds)
    x = comb(t, 4) + noise(len(t), 0.05, 1)
    return np.stack([x] * channels, axis=1)


def unknown(verdicts: list[Verdict], reason: Reason) -> list[float]:
    """Ends [s] of the windows that are unknown for `reason`."""
    return [v.window_end_ns / 1e9 for v in verdicts if v.state is ChatterKind.UNKNOWN and v.reason is reason]


def test_clean_stream_warms_up_for_one_window() -> None:
    verdicts = watch(CONFIG, list(blocks(cut())))
    assert unknown(verdicts, Reason.WARMUP) == pytest.approx([0.05, 0.1, 0.15], abs=1e-4)
    assert {v.state for v in verdicts[3:]} == {ChatterKind.STABLE}
    assert [v.last_sample for v in verdicts] == [640 * k - 1 for k in range(1, 41)]


def test_gap() -> None:
    whole = list(blocks(cut()))
    verdicts = watch(CONFIG, whole[:40] + whole[45:])
    gap = unknown(verdicts, Reason.GAP)
    assert gap[0] >= 40 * 256 / RATE
    assert gap[-1] < 45 * 256 / RATE + 0.2
    assert len(gap) in (3, 4)
    assert verdicts[-1].state is ChatterKind.STABLE
    assert "1280 samples are missing" in next(v.reason_text for v in verdicts if v.reason is Reason.GAP)


def test_gap_of_hours_gives_no_flood() -> None:
    x = cut()
    far = list(blocks(x, first=10**12, start_ns=0))
    assert len(watch(CONFIG, list(blocks(x)) + far)) < 90


@pytest.mark.parametrize("fault", ["duplicate", "swap"])
def test_repeated_and_swapped_blocks(fault: str) -> None:
    b = list(blocks(cut()))
    items = [*b[:41], b[40], *b[41:]] if fault == "duplicate" else [*b[:40], b[41], b[40], *b[42:]]
    verdicts = watch(CONFIG, items)
    assert unknown(verdicts, Reason.GAP)
    assert max(unknown(verdicts, Reason.GAP)) < 42 * 256 / RATE + 0.2 + 1e-3
    assert verdicts[-1].state is ChatterKind.STABLE


def test_partly_repeated_block_keeps_its_fresh_samples() -> None:
    x = cut()
    late = next(iter(blocks(x[1100:], first=1100, size=len(x))))
    verdicts = watch(CONFIG, [*blocks(x[:1280]), late])
    assert unknown(verdicts, Reason.GAP)
    assert verdicts[-1].last_sample == len(x) - 1


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_no_numbers(value: float) -> None:
    x = cut()
    x[13000] = value
    verdicts = watch(CONFIG, list(blocks(x)))
    bad = unknown(verdicts, Reason.BAD_SAMPLES)
    assert len(bad) == 4
    assert verdicts[-1].state is ChatterKind.STABLE


def test_dead_channel() -> None:
    x = cut()
    x[12800:] = 0.25
    assert watch(CONFIG, list(blocks(x)))[-1].reason is Reason.BAD_SAMPLES
    flagged = list(blocks(cut(), status=Status.DEAD))
    assert {v.reason for v in watch(CONFIG, flagged)[3:]} == {Reason.BAD_SAMPLES}


def test_saturated_channel() -> None:
    x = np.clip(cut(), -0.8, 0.8)
    assert {v.reason for v in watch(CONFIG, list(blocks(x)))[3:]} == {Reason.SATURATED}
    assert {v.reason for v in watch(CONFIG, list(blocks(cut(), status=Status.SATURATED)))[3:]} == {Reason.SATURATED}


def test_fallback_to_another_channel_is_stated() -> None:
    x = cut(channels=2)
    x[:, 0] = 0.0
    verdicts = watch(CONFIG, list(blocks(x)))
    assert verdicts[-1].state is ChatterKind.STABLE
    assert verdicts[-1].channel == "ch1"
    chosen = replace(CONFIG, channel="ch0")
    assert watch(chosen, list(blocks(x)))[-1].reason is Reason.BAD_SAMPLES
    assert watch(replace(chosen, fallback=True), list(blocks(x)))[-1].channel == "ch1"
    missing = watch(replace(CONFIG, channel="microphone"), list(blocks(x)))[-1]
    assert missing.state is ChatterKind.UNKNOWN
    assert "microphone" in missing.reason_text


def test_restart() -> None:
    x = cut(1.0)
    items = [*blocks(x, stream_id=1), *blocks(x, stream_id=2, start_ns=1_500_000_000)]
    verdicts = watch(CONFIG, items)
    assert unknown(verdicts, Reason.STREAM_RESTART) == pytest.approx([1.55, 1.6, 1.65], abs=1e-3)
    assert [v.stream_id for v in verdicts] == sorted(v.stream_id for v in verdicts)


@pytest.mark.parametrize("change", ["rate", "channels"])
def test_change_of_rate_or_channels_begins_a_new_stream(change: str) -> None:
    x = cut(1.0)
    later = list(blocks(x[::2], RATE / 2, start_ns=10**9)) if change == "rate" else \
        list(blocks(cut(1.0, 2), start_ns=10**9))
    verdicts = watch(CONFIG, [*blocks(x), *later])
    assert len(unknown(verdicts, Reason.STREAM_RESTART)) == 3
    assert verdicts[-1].state is ChatterKind.STABLE


def test_clock_step() -> None:
    b = list(blocks(cut()))
    items = b[:50] + [replace(x, stamp_ns=x.stamp_ns + 3_000_000_000) for x in b[50:]]
    verdicts = watch(CONFIG, items)
    assert any("clock stepped by 3000 ms" in v.reason_text for v in verdicts)
    assert verdicts[-1].window_end_ns == pytest.approx(5e9, abs=2e8)
    assert verdicts[-1].state is ChatterKind.STABLE


def test_without_axis_states_the_nominal_speed_is_used_after_the_timeout() -> None:
    config = replace(CONFIG, expect_axes=True, speed_timeout=0.5)
    state, early = initial(config), []
    for b in blocks(cut()):
        state, verdicts = update(config, state, b)
        early.extend(verdicts)
    assert early[-1].window_end_ns / 1e9 == pytest.approx(SECONDS - config.speed_timeout, abs=0.06)
    assert early[-1].state is ChatterKind.STABLE
    _, rest = finish(config, state)
    assert rest[-1].last_sample == len(cut()) - 1
    off = watch(replace(config, nominal_speed=0.0), list(blocks(cut())))
    assert {v.reason for v in off[3:]} == {Reason.NO_SPEED}


def test_axis_states_that_stop_are_replaced_by_the_nominal_speed() -> None:
    config = replace(CONFIG, expect_axes=True)
    items = by_stamp(list(blocks(cut())), list(speeds(SPEED, 1.0)))
    verdicts = watch(config, items)
    assert verdicts[-1].state is ChatterKind.STABLE
    assert verdicts[-1].spindle_speed == pytest.approx(SPEED, rel=1e-3)


def test_standing_and_changing_spindle() -> None:
    config = replace(CONFIG, expect_axes=True)
    x = list(blocks(cut()))
    still = watch(config, by_stamp(x, list(speeds(0.0, SECONDS))))
    assert {v.reason for v in still[3:]} == {Reason.NO_SPEED}
    ramp = np.linspace(0.5, 4.0, round(SECONDS * RATE)) * SPEED
    assert Reason.SPEED_CHANGING in {v.reason for v in watch(config, by_stamp(x, list(speeds(ramp, SECONDS))))}


def test_recorded_priors_are_waited_for_and_used() -> None:
    config = replace(CONFIG, recorded_priors=True)
    state, held = initial(config), []
    for b in blocks(cut()):
        state, verdicts = update(config, state, b)
        held.extend(verdicts)
    assert held == []
    priors = [Prior(k, PredictedType.STABLE, 0.5 + k / 100) if k % 2 else None for k in range(40)]
    for k, prior in enumerate(priors):
        state, verdicts = update(config, state, RecordedPrior(1, 640 * (k + 1) - 1, prior))
        held.extend(verdicts)
    assert [v.prior for v in held] == priors


def test_memory_is_bounded() -> None:
    config = replace(CONFIG, expect_axes=True)
    state = initial(config)
    sizes = []
    item: SensorBlock
    for k, item in enumerate(by_stamp(list(blocks(cut(12.0))), list(speeds(SPEED, 12.0)))):
        state, _ = update(config, state, item)
        if k % 200 == 0:
            held = sum(len(s.blocks) + len(s.breaks) + len(s.anchors) for s in state.streams)
            sizes.append(held + sum(map(len, state.speeds)) / 25)
    assert max(sizes) < 250
    assert state.streams[0].blocks[0].first_sample > state.streams[0].end - 3 * RATE


def test_what_one_channel_hears_in_air_is_not_held_against_another() -> None:
    """A channel of another scale takes over: its chatter is far below the first one's noise out of the cut."""
    speed, seconds = 3350 * 2 * math.pi / 60, 4.0
    turns = phase(speed, seconds)
    at = np.arange(len(turns)) / RATE
    x = (at > 1.0) * comb(turns, 4) + (at > 2.5) * hopf(turns, 4, 871.3, 0.6)
    first = np.where(at < 2.0, x + noise(len(turns), 0.1, 1), 0.0)
    second = 1e-6 * (x + noise(len(turns), 0.02, 2))
    config = ChatterConfig(teeth=4, nominal_speed=speed, fallback=True)
    table = np.stack([first, second], axis=1)
    verdicts = watch(config, by_stamp(list(blocks(table)), list(speeds(speed, seconds))))
    assert verdicts[-1].channel == "ch1"
    assert verdicts[-1].state is ChatterKind.HOPF
