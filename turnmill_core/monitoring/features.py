"""What one window shows: synchronous and half-order energy, asynchronous lines, the chatter family."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from turnmill_core.monitoring._kernels.family import family_sums
from turnmill_core.monitoring._kernels.synchronous import half_means
from turnmill_core.monitoring.background import NO_BACKGROUND, Background
from turnmill_core.monitoring.following import Parts, follow, residual
from turnmill_core.monitoring.separation import Layout, Prepared, harmonic_noise, synchronous
from turnmill_core.monitoring.spectrum import LINE_RATIO, Array, Line, Spectrum, lines, near

CANDIDATES = 4
"""Strongest lines that are tried as H."""

MOST_RISING, BESIDE = 8, 3.0
"""Lines looked at at the end of a window; how far [bins] from a tooth passing harmonic, which is wide there."""

WIDE = 10.0
"""Energy over that of a tooth passing harmonic from which a line beside it is none of the harmonic's width."""

FOLDS = 2
"""Multiple of the sample rate up to which tooth passing harmonics may be folded into the band."""

TURNING = 0.008
"""A line that turns faster than this against the tool [revolutions of phase per revolution] is asynchronous."""


@dataclass(frozen=True)
class ChatterFamily:
    """Lines at H + i f_tooth and, weaker or stronger, at 2 H and 3 H + i f_tooth.

    frequency: H [Hz]; energy: mean square of all these lines; sidebands: lines found next to H at a
    distance of one or two tooth passing frequencies; explained: share of the energy of all asynchronous
    lines in them and at H + i f_spindle; members [Hz], ascending: the lines at H + i f_tooth.
    """

    frequency: float
    energy: float
    sidebands: int
    explained: float
    members: tuple[float, ...]


@dataclass(frozen=True)
class HalfOrder:
    """Lines at odd multiples of half the tooth passing frequency.

    energy: mean square of all; frequency [Hz]: the strongest; members [Hz], ascending: all above the noise.
    """

    energy: float
    frequency: float = math.nan
    members: tuple[float, ...] = ()


@dataclass(frozen=True)
class Features:
    """Energies are mean squares over the window (Hann-squared weights), above noise.

    frequency: spindle frequency [Hz]; speed_ratio: refined over assumed speed; tooth: energy at
    tooth passing harmonics; synchronous: at all spindle harmonics; once: at the first of
    them; half: half-order lines; comb:
    number of tooth passing harmonics above the noise, of comb_of looked at; noise: broadband
    energy; energy: all energy in the band; change: amplitude of the tooth passing harmonics in the
    second half of the window over the first; lines: asynchronous lines, strongest first; chatter: the
    family that explains most of them, if any; own_half: energy of half-order lines that are not among the
    spindle harmonics; seconds: length of the window [s]; rising: asynchronous lines as they are at the end of the
    window (empty where not asked for).
    """

    frequency: float
    speed_ratio: float
    tooth: float
    synchronous: float
    once: float
    half: HalfOrder
    comb: int
    comb_of: int
    noise: float
    energy: float
    change: float
    lines: tuple[Line, ...]
    chatter: ChatterFamily | None
    own_half: float = 0.0
    seconds: float = 0.0
    rising: tuple[Line, ...] = ()


def features(p: Prepared, turns: Array, steady: bool, teeth: int, lowest: float, ratio: float,
             band: tuple[float, float], background: Background = NO_BACKGROUND, apart: float = 0.0,
             surges: bool = False) -> Features:
    """Features of a window.

    turns: revolutions per sample at the assumed speed; steady: True for a constant speed; lowest
    [Hz]: lower end of the band; ratio: expected true over assumed speed, refined within `band`; background: whose
    tones are no lines of the cut; apart [bins]: how far from a tooth passing harmonic a line must be (while a cut
    begins, its harmonics are wide); surges: look at the lines at the end of the window, too.
    """
    parts, ratio = follow(p, turns, steady, teeth, lowest, ratio, band)
    layout, found = parts.layout, parts.residual
    tooth_frequency = teeth * layout.frequency
    noise = harmonic_noise(found, len(parts.one.mean), layout.frequency, 1, layout.duration)
    energy = parts.one.energy()
    order = np.arange(len(energy))
    inside = (order * layout.frequency >= min(lowest, 0.4 * tooth_frequency)) & (order * layout.frequency <= p.top)
    clear = np.where(inside & (energy > 4 * noise), energy - noise, 0.0)
    tooth = order % teeth == 0
    turning, moved = _turning(parts, clear, noise, tooth, lowest)
    clear = np.where(moved, 0.0, clear)
    first = np.flatnonzero(tooth & inside)[:12]
    asynchronous = tuple(x for x in lines(found, lowest, LINE_RATIO, 24) if not _is_skirt(x, found, layout, clear)
                         and not _widens_tooth(x, layout.frequency, teeth, clear, apart * found.resolution))
    asynchronous = tuple(x for x in _merged((*asynchronous, *turning), found.resolution) if not background.holds(x)
                         and not _is_folded(x, tooth_frequency, p.sampled, found.resolution))
    if teeth % 2:
        half = _half_odd(parts, p.top, teeth)
        asynchronous = tuple(x for x in asynchronous if not _is_half_order(x.frequency, tooth_frequency, found))
    else:
        half = _half(np.arange(teeth / 2, len(clear), teeth) * layout.frequency, clear[teeth // 2:: teeth])
    low = int(lowest / found.step)
    noise_energy = float(found.floor[low:].sum())
    return Features(
        layout.frequency, ratio, float(clear[tooth].sum()), float(clear.sum()), float(clear[1]), half,
        int(np.sum(energy[first] > 10 * noise[first])), len(first), noise_energy,
        float(found.power[low:].sum() + energy[inside].sum()), _change(parts, np.flatnonzero(tooth & inside), noise),
        asynchronous,
        _chatter(found, asynchronous, tooth_frequency, layout.frequency, lowest), half.energy if teeth % 2 else 0.0,
        layout.duration, _rising(parts, p, steady, lowest, tooth_frequency, clear, background) if surges else (),
    )


def _rising(parts: Parts, p: Prepared, steady: bool, lowest: float, tooth_frequency: float, clear: Array,
            background: Background) -> tuple[Line, ...]:
    """Asynchronous lines seen through a window that rises to its end; none beside a tooth passing harmonic."""
    end = residual(parts.layout, parts.one, p, steady, rising=True)
    return tuple(x for x in lines(end, lowest, LINE_RATIO, MOST_RISING)
                 if not _is_skirt(x, end, parts.layout, clear) and not background.holds(x)
                 and not _beside(x, tooth_frequency, BESIDE * end.resolution)
                 and not _is_folded(x, tooth_frequency, p.sampled, end.resolution))


def _half_odd(parts: Parts, top: float, teeth: int) -> HalfOrder:
    layout = parts.layout
    two = synchronous(layout, parts.values, 2)
    noise = harmonic_noise(parts.residual, len(two.mean), layout.frequency, 2, layout.duration)
    energy = two.energy()
    at = np.arange(teeth, min(len(energy), int(2 * top / layout.frequency)), 2 * teeth)
    return _half(at * layout.frequency / 2, np.where(energy[at] > 4 * noise[at], energy[at] - noise[at], 0.0))


def _half(frequencies: Array, energy: Array) -> HalfOrder:
    seen = np.flatnonzero(energy > 0)
    if not len(seen):
        return HalfOrder(0.0)
    return HalfOrder(float(energy.sum()), float(frequencies[np.argmax(energy)]), tuple(frequencies[seen].tolist()))


def _change(parts: Parts, harmonics: NDArray[np.integer[Any]], noise: Array) -> float:
    """Amplitude of the harmonics in the second half of the window over the first; no less than the noise's."""
    table = parts.values.reshape(parts.layout.revolutions, parts.layout.points)
    least = 2 * float(noise[harmonics].sum())
    amplitude = fft.rfft(half_means(table))[:, harmonics] * (2 / parts.layout.points)
    early, late = ((amplitude.real**2 + amplitude.imag**2).sum(axis=1) / 2).tolist()
    return math.sqrt(max(late, least) / max(early, least)) if least > 0 else 1.0


def _merged(found: tuple[Line, ...], within: float) -> tuple[Line, ...]:
    """Lines strongest first; what lies within `within` [Hz] of a stronger one is part of it."""
    kept: list[Line] = []
    for x in sorted(found, key=lambda line: -line.energy):
        k = next((i for i, other in enumerate(kept) if abs(other.frequency - x.frequency) < within), -1)
        if k < 0:
            kept.append(x)
        else:
            kept[k] = replace(kept[k], energy=kept[k].energy + x.energy)
    return tuple(sorted(kept, key=lambda line: -line.energy))


def _turning(parts: Parts, clear: Array, noise: Array, tooth: NDArray[np.bool_],
             lowest: float) -> tuple[tuple[Line, ...], NDArray[np.bool_]]:
    """Asynchronous lines so near to a spindle harmonic that the averaging took them in, and which harmonics they are.

    Their phase turns against the tool's rotation, while a line of runout keeps its phase. Harmonics of
    the tooth passing frequency, and phases that noise could turn as far, are left alone.
    """
    mean, trend = parts.one.mean, parts.one.trend
    moved = (clear > 10 * noise) & ~tooth
    if not moved.any():
        return (), moved
    noise = np.maximum(noise, np.finfo(float).tiny)
    power = np.maximum(np.abs(mean) ** 2, np.finfo(float).tiny)
    rate = np.imag(np.conj(mean) * trend) / (2 * math.pi * power)
    spread = np.sqrt(noise / power) / parts.layout.revolutions
    moved &= np.abs(rate) > TURNING + 3 * spread
    found = [Line(float((h + rate[h]) * parts.layout.frequency), float(clear[h]), float(clear[h] / noise[h]))
             for h in np.flatnonzero(moved)]
    return tuple(x for x in found if x.frequency >= lowest), moved


def _is_skirt(x: Line, s: Spectrum, layout: Layout, energy: Array) -> bool:
    """True for what a stronger spindle harmonic leaves on both sides of itself where its amplitude or phase varies.

    Such skirts lie within two bins of the harmonic and are alike on either side; a chatter line is not.
    """
    harmonic = round(x.frequency / layout.frequency)
    offset = x.frequency - harmonic * layout.frequency
    if harmonic >= len(energy) or abs(offset) > 2 * s.resolution or energy[harmonic] < x.energy:
        return False
    here, mirror = near(s.power, s, harmonic * layout.frequency + np.array([offset, -offset]), 0.5 * s.resolution)
    return bool(mirror > 0.25 * here)


def _beside(x: Line, tooth_frequency: float, apart: float) -> bool:
    """True within `apart` [Hz] of a tooth passing harmonic."""
    return abs(math.remainder(x.frequency / tooth_frequency, 1.0)) * tooth_frequency < apart


def _widens_tooth(x: Line, frequency: float, teeth: int, energy: Array, apart: float) -> bool:
    """True for what a tooth passing harmonic that changes leaves within `apart` [Hz] of itself.

    Not for a line that is far stronger than the harmonic, where that is heard at all. frequency [Hz], of the spindle;
    energy: of its harmonics.
    """
    harmonic = teeth * round(x.frequency / (teeth * frequency))
    return _beside(x, teeth * frequency, apart) and not (
        harmonic < len(energy) and x.energy > WIDE * energy[harmonic] > 0)


def _is_folded(x: Line, tooth_frequency: float, sampled: float, within: float) -> bool:
    """True where a tooth passing harmonic beyond half the rate `sampled` [Hz], but below twice the rate, is folded to.

    A sensor that limits the band by its rate may have no filter against it. Within half of `within` [Hz].
    """
    if not sampled:
        return False
    beyond = np.arange(math.ceil(sampled / 2 / tooth_frequency), math.ceil(FOLDS * sampled / tooth_frequency))
    at = beyond * tooth_frequency
    return bool((np.abs(np.abs(at - np.rint(at / sampled) * sampled) - x.frequency) < 0.5 * within).any())


def _is_half_order(frequency: float, tooth_frequency: float, s: Spectrum) -> bool:
    return abs(math.remainder(frequency / tooth_frequency - 0.5, 1.0)) * tooth_frequency < 0.5 * s.resolution


def _chatter(s: Spectrum, found: tuple[Line, ...], tooth_frequency: float, spindle_frequency: float,
             lowest: float) -> ChatterFamily | None:
    """Family that explains most of the lines' energy, of those that the strongest lines span; None without lines.

    The strongest line need not be H: loss of contact makes lines at 2 H and 3 H too, and sound and
    acceleration raise them.
    """
    if not found:
        return None
    frequency, energy = np.array([x.frequency for x in found]), np.array([x.energy for x in found])
    tolerance, total = 1.2 * s.resolution, float(energy.sum())
    best: tuple[float, float, NDArray[np.bool_], float] | None = None
    for x in found[:CANDIDATES]:
        own, multiples, explained = family_sums(frequency, energy, x.frequency, tooth_frequency, spindle_frequency,
                                                tolerance)
        share = explained / total if total > 0 else 0.0
        if best is None or round(share, 1) > round(best[1], 1):
            best = x.frequency, share, own, multiples
    assert best is not None
    first, share, own, multiples = best
    next_to = np.abs(first + tooth_frequency * np.array([-2, -1, 1, 2]))
    seen = near(s.power / s.floor, s, next_to, tolerance) > LINE_RATIO
    seen |= np.abs(frequency[:, None] - next_to).min(axis=0) <= tolerance
    return ChatterFamily(first, multiples, int(seen.sum()), share,
                         tuple(sorted(frequency[own & (frequency >= lowest)].tolist())))
