"""Early warning: is a small asynchronous line growing exponentially?

Chatter grows as exp(rate t) from the noise until the tool leaves the material. The amplitude of the
strongest family over the last windows gives the rate; while it is still below the thresholds a
steady growth already tells when it will pass them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

WINDOWS = 6
"""Windows over which a growth is looked at."""

RISE_WINDOWS = 4
"""Newest windows over which the growth is taken that tells the amplitude at the end of a window."""

STEEP_WINDOWS = 3
STEEP = 4.0
"""As many windows are enough where the energy grows by this factor over them."""

EVEN = 0.4
"""What jumps up and stays is no exponential."""

LARGEST_RISE = 10.0

SLOWEST = 2.0
"""Growth of the amplitude [1/s] below which no warning is given."""


@dataclass(frozen=True)
class Seen:
    """Strongest family of one window: time [s] of the window's end, frequency [Hz], its share of the energy."""

    time: float
    frequency: float
    share: float


def remember(history: tuple[Seen, ...], seen: Seen, tolerance: float, tooth_frequency: float) -> tuple[Seen, ...]:
    """History with `seen`; begins anew where the family moved by more than `tolerance` [Hz].

    The strongest member of a family may change: families are compared as H + i tooth_frequency [Hz].
    """
    apart = (seen.frequency - history[-1].frequency) / tooth_frequency if history else 0.0
    if abs(apart - round(apart)) * tooth_frequency > tolerance:
        return (seen,)
    return (*history[-WINDOWS + 1:], seen)


def rate(history: tuple[Seen, ...], least: int = WINDOWS) -> float:
    """Growth of the amplitude [1/s] by a straight line through its logarithm; NaN where it does not grow steadily.

    Steady: at least `least` windows, and from each to the next at least EVEN of the mean logarithmic growth.
    """
    shares = np.array([s.share for s in history])
    if len(history) < least or np.any(shares <= 0):
        return math.nan
    steps = np.diff(np.log(shares))
    if steps.min() <= max(0.0, EVEN * float(steps.mean())):
        return math.nan
    t = np.array([s.time for s in history])
    t = t - t.mean()
    return float(np.sum(t * np.log(shares)) / np.sum(t**2) / 2)


def rise(history: tuple[Seen, ...], seconds: float, evident: bool = True) -> float:
    """Energy at the end of the newest window over its mean in it, while it grows steadily; else 1.

    seconds [s]: length of the window. Half of it lies between its middle, which the mean is about, and its end.
    evident: sidebands show that the line is of the cut; without them it must grow by STEEP, as noise may grow a little
    through windows that overlap.
    """
    found = math.nan
    for count, steep in ((RISE_WINDOWS, not evident), (STEEP_WINDOWS, True)):
        newest = history[-count:]
        if math.isnan(found) and newest and (not steep or newest[-1].share > STEEP * newest[0].share):
            found = rate(newest, count)
    return min(LARGEST_RISE, math.exp(found * seconds)) if found >= SLOWEST else 1.0


def time_to(history: tuple[Seen, ...], share: float) -> float:
    """Seconds until the share passes `share`, if the growth goes on; infinite without a steady growth."""
    found = rate(history)
    if not found >= SLOWEST:
        return math.inf
    return max(0.0, math.log(share / history[-1].share) / (2 * found))
