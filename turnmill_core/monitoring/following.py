"""Following the speed: the window is separated at the speed, and with the ramp, that the harmonics' phases show."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.monitoring._kernels.drift import telling_harmonics
from turnmill_core.monitoring.separation import (
    LAYOUT,
    Drift,
    Layout,
    Prepared,
    Synchronous,
    drift,
    followed,
    harmonic_noise,
    lay_out,
    sinusoids,
    synchronous,
    uniform_in_time,
)
from turnmill_core.monitoring.spectrum import LINE_RATIO, Array, Spectrum, lines, spectrum

STRONG = 0.02
"""Asynchronous lines above this share of the energy are taken out before the synchronous part is averaged."""

PHASE = 0.004
"""Drift of the first tooth passing harmonic over a window [revolutions of its phase] that is worth correcting."""

LARGEST_RAMP = 0.01
"""Largest relative change of the speed over a window that is followed by the signal alone."""

COMB_SHARE = 0.05
"""Share of the synchronous energy from which the tooth passing harmonics alone tell the speed.

Else all spindle harmonics do, if there are four or more and none holds most of the energy, as a chatter line would.
"""


@dataclass(frozen=True)
class Parts:
    """Window taken apart.

    layout: by angle; values: of the layout, in its order, without strong asynchronous lines; one: synchronous part
    over single revolutions; residual: spectrum of what that leaves of them.
    """

    layout: Layout
    values: Array
    one: Synchronous
    residual: Spectrum


def follow(p: Prepared, turns: Array, steady: bool, teeth: int, lowest: float, ratio: float,
           band: tuple[float, float]) -> tuple[Parts, float]:
    """Separation at the speed, and with the ramp, that the tooth passing harmonics show; and the mean speed's ratio.

    turns: revolutions per sample at the assumed speed; steady: True for a constant speed; lowest [Hz]: lower end of
    the band; ratio: expected true over assumed speed, refined within `band`.
    """
    assumed = turns * ratio
    parts = _separate(p, assumed, steady, teeth, lowest)
    length = parts.layout.revolutions
    found = _drift(parts, p, teeth)
    for _ in range(2):
        error = float(np.clip(ratio * (1 + found.speed), *band)) / ratio - 1
        if abs(error) * length * teeth < PHASE:
            break
        tried = followed(assumed, length, Drift(error))
        better = _separate(p, tried, steady, teeth, lowest)
        if better.residual.power.sum() > parts.residual.power.sum():
            break
        assumed, ratio, parts = tried, ratio * (1 + error), better
        found = _drift(parts, p, teeth)
    for _ in range(2):
        ramp = min(LARGEST_RAMP / length, max(-LARGEST_RAMP / length, found.ramp))
        if abs(ramp) * length**2 / 4 * teeth < PHASE:
            break
        assumed = followed(assumed, length, Drift(0.0, ramp))
        better = _separate(p, assumed, False, teeth, lowest)
        if better.residual.power.sum() > 0.9 * parts.residual.power.sum():
            break
        parts = better
        found = _drift(parts, p, teeth)
    return parts, ratio


def _separate(p: Prepared, turns: Array, steady: bool, teeth: int, lowest: float) -> Parts:
    """Synchronous part without the leakage of strong asynchronous lines, and the spectrum of what is left."""
    layout = lay_out(p, turns, 1 if teeth % 2 == 0 else 2)
    one = synchronous(layout, layout.values, 1)
    left = residual(layout, one, p, steady)
    least = STRONG * (left.power.sum() + one.energy().sum())
    harmonic = layout.frequency / (2 if teeth % 2 else 1)
    strong = [x.frequency for x in lines(left, lowest, 4 * LINE_RATIO, 6)
              if x.energy > least and abs(math.remainder(x.frequency / harmonic, 1.0)) * harmonic * layout.duration > 1]
    if not strong:
        return Parts(layout, layout.values, one, left)
    values = layout.values - sinusoids(layout, layout.values, strong)
    one = synchronous(layout, values, 1)
    return Parts(layout, values, one, residual(layout, one, p, steady))


def residual(layout: Layout, one: Synchronous, p: Prepared, steady: bool, rising: bool = False) -> Spectrum:
    """Spectrum of what a synchronous part leaves of its window.

    steady: True for a constant speed; rising: through a window that grows to its end.
    """
    values = layout.values - one.wave
    if steady:
        return spectrum(values, layout.points * layout.frequency, p.top, rising)
    return spectrum(*uniform_in_time(layout, values, LAYOUT * p.top), p.top, rising)


def _drift(parts: Parts, p: Prepared, teeth: int) -> Drift:
    noise = harmonic_noise(parts.residual, len(parts.one.mean), parts.layout.frequency, 1, parts.layout.duration)
    last = min(len(parts.one.mean), int(p.top / parts.layout.frequency))
    harmonics = telling_harmonics(parts.one.mean, noise, last, teeth, COMB_SHARE)
    return drift(parts.layout, parts.one, harmonics, noise[harmonics])
