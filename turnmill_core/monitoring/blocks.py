"""Blocks of sensor samples."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import require


class Status(IntFlag):
    """Channel status of one block (same values as turnmill_msgs/SensorChannel); append-only."""

    OK = 0
    SATURATED = 1
    DEAD = 2
    UNCALIBRATED = 4


@dataclass(frozen=True)
class Channel:
    """What one channel measures; `unit` is an SI unit, "1" where the scale is unknown."""

    name: str
    quantity: str
    unit: str
    location: str = ""
    status: Status = Status.OK


@dataclass(frozen=True)
class SensorBlock:
    """A run of samples of all channels of one device.

    stamp_ns: acquisition time of the first sample [ns]; first_sample: its index since the stream
    began; sample_rate [Hz]; samples: float32 (samples, channels), read-only.
    """

    stamp_ns: int
    device: str
    stream_id: int
    first_sample: int
    sample_rate: float
    channels: tuple[Channel, ...]
    samples: NDArray[np.float32]

    def __post_init__(self) -> None:
        require(self.sample_rate > 0, "sample rate", self.sample_rate, "Hz", "a number > 0")
        require(self.samples.ndim == 2 and self.samples.shape[1] == len(self.channels), "samples shape",
                self.samples.shape, "", f"(samples, {len(self.channels)})")
        self.samples.flags.writeable = False

    @property
    def end_sample(self) -> int:
        """Index of the sample after the last one."""
        return self.first_sample + len(self.samples)
