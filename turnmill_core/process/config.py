"""How a cut is simulated and measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from turnmill_core.operation import require
from turnmill_core.process.sensors import CHANNELS, SoundModel


@dataclass(frozen=True)
class SimulationConfig:
    """How a cut is simulated and what is measured.

    sample_rate [Hz] of all channels, an integer; channels: names from sensors.CHANNELS, in SI units; oversampling:
    integration steps per sample (0: enough for 100 kHz); block_duration [s]; axes_rate [Hz] of
    the axis states that `simulate` makes; slices along the tool axis (0: one per 0.02 rad of helix
    lag at the largest depth, at most 32); displacement_noise [m rms], force_noise [N rms], white;
    loss_of_contact: the tool can leave the material (False: the linear cut, to compare with); truth:
    tell the truth (False: an empty one, which is faster); sound: the sound model; start_ns: stamp of
    the first sample of `simulate`; device, stream_id: of the blocks; volts: measure with all sensors of the
    operation, in volts, in place of `channels`, where the operation has sensors.
    """

    sample_rate: int = 12800
    channels: tuple[str, ...] = ("sound", "tool_x")
    oversampling: int = 0
    block_duration: float = 0.02
    axes_rate: float = 250.0
    slices: int = 0
    loss_of_contact: bool = True
    truth: bool = True
    displacement_noise: float = 5e-8
    force_noise: float = 0.5
    sound: SoundModel = field(default_factory=SoundModel)
    start_ns: int = 0
    device: str = "simulated"
    stream_id: int = 1
    volts: bool = False

    def __post_init__(self) -> None:
        require(self.sample_rate >= 100, "sample rate", self.sample_rate, "Hz", "an integer >= 100")
        require(len(self.channels) > 0 and len(set(self.channels)) == len(self.channels), "channels", self.channels,
                "", "at least one name, each once")
        for name in self.channels:
            require(name in CHANNELS, "channel", name, "", f"one of {', '.join(CHANNELS)}")
        require(0 <= self.oversampling <= 64, "oversampling", self.oversampling, "", "an integer from 0 (chosen) to 64")
        require(self.block_duration * self.sample_rate >= 1, "block duration", self.block_duration, "s",
                "at least one sample")
        require(self.axes_rate > 0, "axes rate", self.axes_rate, "Hz", "a number > 0")
        require(0 <= self.slices <= 256, "slices", self.slices, "", "an integer from 0 (chosen) to 256")
        require(self.displacement_noise >= 0, "displacement noise", self.displacement_noise, "m", "a number >= 0")
        require(self.force_noise >= 0, "force noise", self.force_noise, "N", "a number >= 0")

    @property
    def ratio(self) -> int:
        """Integration steps per sample."""
        return self.oversampling or math.ceil(100_000 / self.sample_rate)

    @property
    def block_samples(self) -> int:
        """Samples per block."""
        return max(1, round(self.block_duration * self.sample_rate))
