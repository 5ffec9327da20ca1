"""Early warning: is a small asynchronous line growing exponentially?

Chatter grows as exp(rate t) from the noise until the tool leaves the material. The amplitude of the
strongest family over the last windows gives the rate; while it is still below the thresholds a
steady growth already tells when it will pass them. One that triples within a tenth of a second has grown before
its mean over a window shows it: it is looked for at the end of the windows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.monitoring.features import Features

WINDOWS = 6
"""Windows over which a growth is looked at."""

RISE_WINDOWS = 4
"""Newest windows over which the growth is taken that tells the amplitude at the end of a window."""

EVEN = 0.4
"""What jumps up and stays is no exponential."""

LARGEST = 6.0
"""Growth of an energy that is believed at most, within a window or from one to the next."""

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


def rise(history: tuple[Seen, ...], seconds: float) -> float:
    """Energy at the end of the newest window over its mean in it, while it grows steadily; else 1.

    seconds [s]: length of the window. Half of it lies between its middle, which the mean is about, and its end.
    """
    found = rate(history[-RISE_WINDOWS:], RISE_WINDOWS)
    return min(LARGEST, math.exp(found * seconds)) if found >= SLOWEST else 1.0


def time_to(history: tuple[Seen, ...], share: float) -> float:
    """Seconds until the share passes `share`, if the growth goes on; infinite without a steady growth."""
    found = rate(history)
    if not found >= SLOWEST:
        return math.inf
    return max(0.0, math.log(share / history[-1].share) / (2 * found))


STEEP = 5.0
"""Growth of the amplitude [1/s] from which a line surges: from window to window, at their ends."""

LEAST = 0.004
"""Share from which a line surges."""


@dataclass(frozen=True)
class Surge:
    """A line at the end of a window.

    frequency [Hz]; share: of the energy; growth: that share over the one a window before (1: not seen then); windows:
    in a row over which it has surged.
    """

    frequency: float
    share: float
    growth: float = 1.0
    windows: int = 0


def surges(f: Features, before: tuple[Surge, ...], hop: float) -> tuple[Surge, ...]:
    """Lines at the end of the window of features `f`; before: those of the window that ended a hop [s] earlier.

    One that grows as the window does has twice the mean energy at its end.
    """
    found, steep = list[Surge](), math.exp(2 * STEEP * hop)
    for x in f.rising:
        energy = 2 * x.energy
        share = energy / (energy + f.synchronous + f.own_half)
        last = max((s for s in before if abs(s.frequency - x.frequency) < 2 / f.seconds),
                   key=lambda s: s.share, default=None)
        if last is None or share < steep * last.share:
            found.append(Surge(x.frequency, share))
        else:
            found.append(Surge(x.frequency, share, min(LARGEST, share / last.share), last.windows + 1))
    return tuple(found)


def surging(found: tuple[Surge, ...], share: float) -> Surge | None:
    """The strongest line that surges and will hold a share of the energy one window later, if it goes on."""
    return max((s for s in found if s.windows and s.share > LEAST and s.growth * s.share > share),
               key=lambda s: s.share, default=None)
