"""Analytic signals of a milling cut: comb, chatter lines, noise. Seeded, no physics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.chatter import (
    ChatterConfig,
    SpindleSpeed,
    finish,
    initial,
    update,
)
from turnmill_core.monitoring.verdict import Verdict

RATE = 12800.0


def phase(speed: NDArray[np.float64] | float, seconds: float, rate: float = RATE) -> NDArray[np.float64]:
    """Revolutions of the spindle at every sample; speed in rad/s, one number or one per sample."""
    count = round(seconds * rate)
    return (np.cumsum(np.full(count, speed)) - np.full(count, speed)[0]) / (2 * math.pi * rate)


def comb(turns: NDArray[np.float64], teeth: int, amplitude: float = 1.0, harmonics: int = 10,
         runout: float = 0.0, seed: int = 0, rate: float = RATE) -> NDArray[np.float64]:
    """Tooth passing harmonics that fall as 1/k, and runout lines at the spindle harmonics between them."""
    rng = np.random.default_rng(seed)
    x = np.zeros(len(turns))
    speed = (turns[-1] - turns[0]) * rate / len(turns)
    for h in range(1, min(harmonics * teeth, int(0.45 * rate / speed)) + 1):
        a = amplitude / (h / teeth) if h % teeth == 0 else runout * amplitude / max(1.0, h / teeth)
        if a:
            x += a * np.cos(2 * math.pi * h * turns + rng.uniform(0, 2 * math.pi))
    return x


def hopf(turns: NDArray[np.float64], teeth: int, frequency: float, amplitude: float, rate: float = RATE,
         sideband: float = 0.2) -> NDArray[np.float64]:
    """Chatter line with one sideband a tooth passing frequency away on either side."""
    t = np.arange(len(turns)) / rate
    carrier = 2 * math.pi * frequency * t
    return amplitude * np.cos(carrier) * (1 + 2 * sideband * np.cos(2 * math.pi * teeth * turns + 0.3))


def flip(turns: NDArray[np.float64], teeth: int, amplitude: float, near: float = 3.0) -> NDArray[np.float64]:
    """Period-two lines at teeth (q + 1/2) times the spindle frequency, strongest next to q = near."""
    x = np.zeros(len(turns))
    for q in range(8):
        x += amplitude * math.exp(-abs(q - near)) * np.cos(2 * math.pi * teeth * (q + 0.5) * turns + q)
    return x


def noise(count: int, rms: float, seed: int) -> NDArray[np.float64]:
    """White noise."""
    return rms * np.random.default_rng(seed).standard_normal(count)


def blocks(x: NDArray[np.float64], rate: float = RATE, size: int = 256, stream_id: int = 1, first: int = 0,
           start_ns: int = 0, status: Status = Status.OK, device: str = "daq") -> Iterator[SensorBlock]:
    """Blocks of a signal (samples,) or (samples, channels)."""
    table = np.asarray(x, dtype=np.float32).reshape(len(x), -1)
    channels = tuple(Channel(f"ch{k}", "sound", "1", "", status) for k in range(table.shape[1]))
    for i in range(0, len(table), size):
        yield SensorBlock(start_ns + round((first + i) * 1e9 / rate), device, stream_id, first + i, rate, channels,
                          table[i: i + size].copy())


def speeds(speed: NDArray[np.float64] | float, seconds: float, rate: float = RATE,
           every: float = 0.004) -> Iterator[SpindleSpeed]:
    """Spindle speeds [rad/s] at 250 Hz; one number, or one per sample at `rate`."""
    values = np.full(round(seconds * rate), speed)
    for k in range(math.floor(seconds / every + 1e-9) + 2):
        at = k * every
        yield SpindleSpeed(round(at * 1e9), float(np.interp(at, np.arange(len(values)) / rate, values)))


def by_stamp(*sources: Sequence[SensorBlock | SpindleSpeed]) -> list[SensorBlock | SpindleSpeed]:
    """Items in order of stamp."""
    return sorted((item for source in sources for item in source), key=lambda item: item.stamp_ns)


def watch(config: ChatterConfig, items: Sequence[object]) -> list[Verdict]:
    """Verdicts on all items."""
    state = initial(config)
    found: list[Verdict] = []
    for item in items:
        state, verdicts = update(config, state, item)
        found.extend(verdicts)
    return found + list(finish(config, state)[1])


def judged(x: NDArray[np.float64], teeth: int, speed: float, rate: float = RATE, axes: bool = True,
           **settings: object) -> list[Verdict]:
    """Verdicts on a signal at a constant speed [rad/s]."""
    config = ChatterConfig(teeth=teeth, nominal_speed=speed, expect_axes=axes, **settings)
    given = list(speeds(speed, len(x) / rate)) if axes else []
    return watch(config, by_stamp(list(blocks(x, rate)), given))
