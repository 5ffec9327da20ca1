"""Is the tool in the cut? Evidence against a noise floor that is given or learned out of the cut."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.features import Features
from turnmill_core.monitoring.spectrum import Array, Spectrum

STEP_HZ = 10.0


@dataclass(frozen=True)
class Background:
    """Noise out of the cut, learned in windows judged as air.

    energy: mean square in the band (NaN before the first such window); power: mean square per 10 Hz.
    """

    energy: float = math.nan
    power: Array | None = None

    def line_energy(self, frequency: float) -> float:
        """Mean square that the background holds around a frequency [Hz]."""
        if self.power is None:
            return 0.0
        k = int(frequency / STEP_HZ)
        return float(self.power[max(0, k - 1): k + 2].sum())


def learn(config: ChatterConfig, background: Background, f: Features, whole: Spectrum) -> Background:
    """Background moved towards a window judged as air (its features and spectrum).

    By a twentieth; by a five-hundredth where the window is louder than the gate allows for air, so that a
    coolant pump that starts is learned within half a minute, but a passing sound is not. A window
    with a strong family (a tenth of the energy, with sidebands) is not learned: it may be chatter.
    """
    if f.chatter is not None and f.chatter.sidebands and f.chatter.energy > 0.1 * f.energy:
        return background
    index = (np.arange(len(whole.power)) * (whole.step / STEP_HZ)).astype(int)
    binned = np.bincount(index, weights=whole.power).astype(np.float64)
    if background.power is None or len(background.power) != len(binned):
        return Background(f.energy, binned)
    share = 0.05 if f.energy < config.gate_ratio**2 * background.energy else 0.002
    return Background((1 - share) * background.energy + share * f.energy,
                      (1 - share) * background.power + share * binned)


def plain_comb(f: Features) -> bool:
    """True where the tooth passing comb stands out of the noise.

    A third of its first harmonics, at least two, with 3 % of the energy, or fewer with half of it. Half-order
    lines that are no spindle harmonics (an odd number of teeth) belong to it: they, too, turn with the tool.
    """
    enough = f.comb >= max(2, -(-f.comb_of // 3))
    return f.tooth + f.own_half > (0.03 if enough else 0.5) * f.energy


def in_cut(config: ChatterConfig, f: Features, background: Background, chattering: bool) -> bool:
    """True where the window shows a cut.

    Either the tooth passing comb is plain, or one family of lines spaced by the tooth passing
    frequency holds a fifth of the energy, and the level exceeds the floor (where one is known) by the
    gate ratio; while chatter is held (chattering) a tenth is enough. Above a known floor it is enough,
    too, that half of the energy lies at spindle harmonics (the first left out) and in the family.
    """
    if plain_comb(f):
        return True
    floor = background.energy if config.noise_floor is None else config.noise_floor**2
    if math.isfinite(floor) and f.energy < config.gate_ratio**2 * floor:
        return False
    c = f.chatter
    turning = f.synchronous - f.once + f.own_half + (c.energy if c is not None else 0.0)
    if math.isfinite(floor) and turning > 0.5 * f.energy:
        return True
    if c is None:
        return False
    return c.energy > 0.1 * f.energy if chattering else c.sidebands >= 1 and c.energy > 0.2 * f.energy
