"""Noise out of the cut: what the machine sounds like while the tool turns in air."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.monitoring.spectrum import Array, Line, Spectrum

STEP_HZ = 10.0

LOUDER = 4.0
"""Energy over that of the background around its frequency from which a line is the cut's own."""


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

    def holds(self, line: Line) -> bool:
        """True for a line that was there in air, as strong as now: a tone of the machine."""
        return line.energy <= LOUDER * self.line_energy(line.frequency)

    def towards(self, energy: float, whole: Spectrum, share: float) -> Background:
        """Background moved by a `share` towards a window of that energy and spectrum; the window itself if new."""
        index = (np.arange(len(whole.power)) * (whole.step / STEP_HZ)).astype(int)
        binned = np.bincount(index, weights=whole.power).astype(np.float64)
        if self.power is None or len(self.power) != len(binned):
            return Background(energy, binned)
        return Background((1 - share) * self.energy + share * energy, (1 - share) * self.power + share * binned)


NO_BACKGROUND = Background()
