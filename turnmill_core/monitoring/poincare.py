"""Once-per-revolution (Poincare) set of a signal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Floats = NDArray[np.float64]


def poincare_set(x: Floats, turns: Floats, delay: float = 0.0) -> Floats:
    """Points (n, 2): the signal once per revolution of the tool, and a little later.

    x (n,) at equal steps of time; turns (n,): revolutions of the tool at the samples, ascending; delay [samples] to
    the second coordinate (0: a quarter of the strongest line's period). A forced vibration gives one point, period two
    of a tool with an odd number of teeth two, quasi-periodic chatter a closed curve. Raises ValueError below three
    revolutions.
    """
    if turns[-1] - turns[0] < 3:
        raise ValueError(f"signal holds {turns[-1] - turns[0]:.3g} revolutions, expected at least 3")
    if delay <= 0:
        power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)))) ** 2
        delay = len(x) / (4 * max(1, int(np.argmax(power[1:])) + 1))
    whole = np.arange(np.ceil(turns[0]), turns[-1])
    at = np.interp(whole, turns, np.arange(float(len(turns))))
    at = at[at + delay <= len(x) - 1]
    found: Floats = np.stack([ndimage.map_coordinates(x, [at + later], order=3, mode="nearest")
                              for later in (0.0, delay)], axis=1)
    return found
