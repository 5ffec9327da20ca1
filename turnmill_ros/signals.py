"""Signals of a bag in pictures' resolution: a bounded spectrogram, and one-second stretches.

Channels in volts that a sensor is known for come calibrated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.poincare import poincare_set
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.monitoring.verdict import Verdict
from turnmill_core.operation_sensors import NO_SENSORS, TIP_CHANNELS, Sensors
from turnmill_ros import topics
from turnmill_ros.bag import read_bag
from turnmill_ros.conversions import block_from_message

MAX_COLUMNS = 600


@dataclass(frozen=True)
class Spectrogram:
    """Power spectral density: times [s], frequencies [Hz], level_db (frequencies, times) [dB re 1 unit^2/Hz]."""

    channel: Channel
    times: NDArray[np.float64]
    frequencies: NDArray[np.float64]
    level_db: NDArray[np.float64]


@dataclass(frozen=True)
class Stretch:
    """A run of samples of one channel: start_ns, sample_rate [Hz], samples (n,)."""

    channel: Channel
    start_ns: int
    sample_rate: float
    samples: NDArray[np.float64]

    def amplitude_spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Frequencies [Hz] and peak amplitudes (Hann window, a sine of amplitude A shows A)."""
        window = np.hanning(len(self.samples))
        spectrum = np.fft.rfft((self.samples - self.samples.mean()) * window)
        return np.fft.rfftfreq(len(self.samples), 1 / self.sample_rate), np.abs(spectrum) * 2 / window.sum()


def sensor_blocks(path: Path, sensors: Sensors) -> Iterator[SensorBlock]:
    """The sensor blocks of a recording in the order in which they were recorded."""
    for _, _, message in read_bag(path, (topics.SENSOR_BLOCKS.name,)):
        yield calibrate(sensors, block_from_message(message))


def recorded_channel(channel: str, sensors: Sensors) -> str:
    """The channel of the blocks that shows a judged channel: itself; of the tool tip the first probe along its axis."""
    if channel not in TIP_CHANNELS:
        return channel
    return next((s.name for s in sensors.channels if s.kind == "fibre probe" and s.direction == channel[-1]), channel)


def _index(block: SensorBlock, channel: str) -> int | None:
    names = [c.name for c in block.channels]
    return names.index(channel) if channel in names else None


def spectrogram(
    path: Path, channel: str, start_ns: int, sensors: Sensors = NO_SENSORS, length: int = 1024
) -> Spectrogram | None:
    """Spectrogram of one channel with at most MAX_COLUMNS columns, whatever the recording's length.

    Neighbouring columns are averaged in pairs whenever the limit is passed, so that memory stays
    bounded. Returns None where the channel never occurs or is shorter than `length` samples.
    """
    columns: list[NDArray[np.float64]] = []
    stamps: list[float] = []
    merged, pending, pending_stamps = 1, [], []
    rest, window = np.zeros(0), np.hanning(length)
    found: tuple[Channel, float] | None = None
    for block in sensor_blocks(path, sensors):
        k = _index(block, channel)
        if k is None:
            continue
        found = found or (block.channels[k], block.sample_rate)
        rest = np.concatenate((rest, np.nan_to_num(block.samples[:, k].astype(np.float64))))
        end = block.stamp_ns + round(len(block.samples) / block.sample_rate * 1e9)
        while len(rest) >= length:
            part = rest[:length]
            power = np.abs(np.fft.rfft((part - part.mean()) * window)) ** 2
            pending.append(power)
            pending_stamps.append((end - start_ns) * 1e-9 - (len(rest) - length / 2) / block.sample_rate)
            rest = rest[length:]
            if len(pending) == merged:
                columns.append(np.mean(pending, axis=0))
                stamps.append(float(np.mean(pending_stamps)))
                pending, pending_stamps = [], []
            if len(columns) > MAX_COLUMNS:
                columns = [(a + b) / 2 for a, b in zip(columns[::2], columns[1::2], strict=False)]
                stamps = [(a + b) / 2 for a, b in zip(stamps[::2], stamps[1::2], strict=False)]
                merged *= 2
    if found is None or len(columns) < 2:
        return None
    density = np.array(columns).T * 2 / (found[1] * float(np.sum(window**2)))
    return Spectrogram(found[0], np.array(stamps), np.fft.rfftfreq(length, 1 / found[1]),
                       10 * np.log10(np.maximum(density, 1e-30)))


def stretch(
    path: Path, channel: str, from_ns: int, to_ns: int, sensors: Sensors = NO_SENSORS
) -> Stretch | None:
    """Samples of one channel acquired in [from_ns, to_ns); None where there are fewer than 64 without a gap."""
    found = stretches(path, (channel,), from_ns, to_ns, sensors)
    return None if found is None else found[0]


def stretches(
    path: Path, names: Sequence[str], from_ns: int, to_ns: int, sensors: Sensors
) -> tuple[Stretch, ...] | None:
    """The blocks with samples of [from_ns, to_ns), one stretch for each of the channels, alike in time.

    A channel has the status flags of all its blocks. None where there are fewer than 64 samples without a gap.
    """
    parts: list[SensorBlock] = []
    for block in sensor_blocks(path, sensors):
        end = block.stamp_ns + round(len(block.samples) / block.sample_rate * 1e9)
        if end <= from_ns or any(_index(block, name) is None for name in names):
            continue
        if block.stamp_ns >= to_ns:
            break
        if parts and block.first_sample != parts[-1].end_sample:
            parts = []
        parts.append(block)
    if sum(len(b.samples) for b in parts) < 64:
        return None
    columns = [[_index(b, name) or 0 for name in names] for b in parts]
    samples = np.concatenate([b.samples[:, c] for b, c in zip(parts, columns, strict=True)]).astype(np.float64)
    found = []
    for k in range(len(names)):
        channels = [b.channels[c[k]] for b, c in zip(parts, columns, strict=True)]
        flags = Status.OK
        for channel in channels:
            flags |= channel.status
        found.append(Stretch(replace(channels[0], status=flags), parts[0].stamp_ns, parts[0].sample_rate,
                             samples[:, k]))
    return tuple(found)


def poincare(part: Stretch, verdicts: Sequence[Verdict]) -> NDArray[np.float64] | None:
    """Once-per-revolution set (n, 2) of a stretch, at the speed that the verdicts found; None without one."""
    known = [v for v in verdicts if np.isfinite(v.spindle_speed) and v.spindle_speed > 0]
    if not known:
        return None
    time = part.start_ns * 1e-9 + np.arange(len(part.samples)) / part.sample_rate
    middle = [(v.window_start_ns + v.window_end_ns) * 5e-10 for v in known]
    speed = np.interp(time, middle, [v.spindle_speed for v in known])
    turns = np.concatenate([[0.0], np.cumsum(speed)[:-1]]) / (2 * np.pi * part.sample_rate)
    return poincare_set(part.samples, turns) if turns[-1] >= 3 else None
