"""What the sensors of the simulated machine hear and see: sound model, channels, noise, filter.

Sound is the pressure of small baffled pistons in the far field, p = rho S a / (2 pi d), driven by
the acceleration of the vibrating tool and workpiece at the cutting point, and by panels of the
machine (resonators that the cutting force excites, which makes every tooth impact ring and does not
act back on the cut). To it come tones locked to the tool spindle, tones of fixed frequency and
coloured background noise. The way from source to microphone delays nothing here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, kaiser_beta

from turnmill_core.monitoring.blocks import Channel
from turnmill_core.operation import Mode, Vector, require
from turnmill_core.process._kernels.filters import first_order

Floats = NDArray[np.float64]

AIR_DENSITY = 1.204
STOPBAND_DB = 84.0
FRAME = 1024

CHANNELS: dict[str, Channel] = {
    "sound": Channel("sound", "sound_pressure", "Pa", "machine enclosure"),
    "tool_x": Channel("tool_x", "displacement", "m", "tool at the cutting point, x_T"),
    "tool_y": Channel("tool_y", "displacement", "m", "tool at the cutting point, y_T"),
    "tool_z": Channel("tool_z", "displacement", "m", "tool at the cutting point, z_T"),
    "workpiece_x": Channel("workpiece_x", "displacement", "m", "workpiece at the cutting point, x_T"),
    "workpiece_y": Channel("workpiece_y", "displacement", "m", "workpiece at the cutting point, y_T"),
    "workpiece_z": Channel("workpiece_z", "displacement", "m", "workpiece at the cutting point, z_T"),
    "force_x": Channel("force_x", "force", "N", "cutting force on the tool, x_T"),
    "force_y": Channel("force_y", "force", "N", "cutting force on the tool, y_T"),
    "force_z": Channel("force_z", "force", "N", "cutting force on the tool, z_T"),
    "tool_torque": Channel("tool_torque", "torque", "N m", "tool spindle"),
    "workpiece_torque": Channel("workpiece_torque", "torque", "N m", "workpiece spindle"),
    **{f"{side}_velocity_{axis}": Channel(f"{side}_velocity_{axis}", "velocity", "m/s",
                                          f"{side} at the cutting point, {axis}_T")
       for side in ("tool", "workpiece") for axis in "xyz"},
}


@dataclass(frozen=True)
class Tone:
    """A steady tone: amplitude [Pa]; `order` in tool revolutions [1] or fixed `frequency` [Hz], the other 0."""

    amplitude: float
    order: float = 0.0
    frequency: float = 0.0

    def __post_init__(self) -> None:
        require(self.amplitude >= 0, "tone amplitude", self.amplitude, "Pa", "a number >= 0")
        require((self.order > 0) != (self.frequency > 0), "tone", (self.order, self.frequency), "",
                "either an order > 0 or a frequency > 0")


@dataclass(frozen=True)
class SoundModel:
    """How the cut sounds at the microphone.

    distance [m]; direction: cosines of the microphone's direction in the tool frame, through which the
    three components of acceleration are seen; tool_area, workpiece_area [m2]: radiating areas that
    move with the cutting point; panels: resonators with the mass [kg] and the shape through which
    the cutting force drives them; panel_area [m2]; background [Pa rms], above background_corner [Hz]
    falling with the frequency; tones.
    """

    distance: float = 0.5
    direction: Vector = (0.6, 0.64, 0.48)
    tool_area: float = 0.004
    workpiece_area: float = 0.012
    panels: tuple[Mode, ...] = (
        Mode(1380.0, 0.05, 20.0, (0.6, 0.64, 0.48)),
        Mode(2750.0, 0.04, 12.0, (0.64, -0.6, 0.48)),
        Mode(4200.0, 0.04, 7.0, (0.48, 0.6, 0.64)),
    )
    panel_area: float = 0.25
    background: float = 0.015
    background_corner: float = 300.0
    tones: tuple[Tone, ...] = (Tone(0.006, order=1.0), Tone(0.003, order=2.0), Tone(0.004, frequency=100.0))

    def __post_init__(self) -> None:
        require(self.distance > 0, "microphone distance", self.distance, "m", "a number > 0")
        require(self.background_corner > 0, "background corner", self.background_corner, "Hz", "a number > 0")
        for name in ("tool_area", "workpiece_area", "panel_area"):
            require(getattr(self, name) >= 0, name.replace("_", " "), getattr(self, name), "m2", "a number >= 0")
        require(self.background >= 0, "background", self.background, "Pa", "a number >= 0")

    def radiation(self, area: float) -> float:
        """Pressure per acceleration of a piston of `area` [m2]: [Pa s2/m]."""
        return AIR_DENSITY * area / (2 * math.pi * self.distance)


def antialias_taps(ratio: int) -> Floats:
    """Symmetric low-pass taps for decimation by `ratio`: flat to 0.4, down 80 dB from 0.6 of the output rate."""
    if ratio == 1:
        return np.ones(1)
    half = math.ceil((STOPBAND_DB - 7.95) / (2.285 * 2 * math.pi * 0.2 / ratio) / 2)
    taps = firwin(2 * half + 1, 1.0 / ratio, window=("kaiser", kaiser_beta(STOPBAND_DB)))
    return np.asarray(taps, dtype=np.float64)


def white_noise(seed: int, channel: int, first: int, count: int) -> Floats:
    """Unit normal noise for samples first ... first + count - 1; the same for any cut into pieces."""
    frames = range(first // FRAME, (first + max(count, 1) - 1) // FRAME + 1)
    offset = first - frames[0] * FRAME
    return np.concatenate([_frame(seed, channel, f) for f in frames])[offset : offset + count]


@lru_cache(maxsize=64)
def _frame(seed: int, channel: int, frame: int) -> Floats:
    """FRAME values of unit normal noise, read-only."""
    bits = np.random.Philox(np.random.SeedSequence((seed, channel, frame)))
    values = np.random.Generator(bits).standard_normal(FRAME)
    values.flags.writeable = False
    return values


def ambient_sound(
    model: SoundModel, seed: int, first: int, sample_rate: float, tool_angle: Floats, last: float,
) -> tuple[Floats, float]:
    """Background noise and tones [Pa] for the samples from `first`, and the noise filter's last value.

    first: index of the first sample; sample_rate [Hz]; tool_angle (n,) [rad] at the samples; last: what
    the call before returned (0 at the beginning).
    """
    count = len(tool_angle)
    pole = math.exp(-2 * math.pi * model.background_corner / sample_rate)
    white = model.background * math.sqrt(1 - pole**2) * white_noise(seed, 0, first, count)
    sound = np.empty(count)
    last = first_order(white, pole, last, sound)
    time = (first + np.arange(count)) / sample_rate
    for i, tone in enumerate(model.tones):
        phase = tone.order * tool_angle + 2 * math.pi * tone.frequency * time
        sound += tone.amplitude * np.sin(phase + i)
    return sound, last
