"""Spindle speed over a window: from axis states, and refined from the signal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np
from scipy import ndimage

from turnmill_core.monitoring.spectrum import PAD, Array, Spectrum, lines

MEMORY_NS = 10_000_000_000
"""Spindle speeds older than this before the newest one are forgotten [ns]."""


@dataclass(frozen=True)
class SpindleSpeed:
    """Speed [rad/s] and angle [rad] (NaN: not known) of the tool spindle at an instant [ns], from an axis state or a
    tachometer."""

    stamp_ns: int
    speed: float
    angle: float = math.nan


Pages = tuple[tuple[SpindleSpeed, ...], ...]
PAGE = 64
"""Remembered speeds come in pages of so many, none of them empty: a new one copies the newest page only."""


def remember(pages: Pages, item: SpindleSpeed) -> Pages:
    """Speeds in order of stamp with `item` (magnitude); left out: one not newer than the newest, or not finite."""
    item = SpindleSpeed(item.stamp_ns, abs(item.speed), item.angle)
    if not math.isfinite(item.speed) or (pages and item.stamp_ns <= pages[-1][-1].stamp_ns):
        return pages
    if pages and len(pages[-1]) < PAGE:
        return (*pages[:-1], (*pages[-1], item))
    return (*(page for page in pages if page[-1].stamp_ns >= item.stamp_ns - MEMORY_NS), (item,))


def joined(pages: Pages) -> tuple[SpindleSpeed, ...]:
    """All remembered speeds."""
    return tuple(chain.from_iterable(pages))


def held_until(held: tuple[SpindleSpeed, ...], stamp_ns: int, longest_ns: int) -> tuple[SpindleSpeed, ...]:
    """Speeds with the newest one held until an instant, where that is at most `longest_ns` later."""
    if not held or not 0 < stamp_ns - held[-1].stamp_ns <= longest_ns:
        return held
    last = held[-1]
    turned = math.copysign(last.speed, last.angle - held[-2].angle) if len(held) > 1 else last.speed
    return (*held, SpindleSpeed(stamp_ns, last.speed, last.angle + turned * (stamp_ns - last.stamp_ns) * 1e-9))


def speed_at(held: tuple[SpindleSpeed, ...], stamp_ns: int, longest_gap_ns: int) -> float:
    """Speed at an instant [rad/s], linear between its neighbours; NaN without neighbours within `longest_gap_ns`."""
    for later, earlier in zip(reversed(held), reversed(held[:-1]), strict=False):
        if earlier.stamp_ns <= stamp_ns <= later.stamp_ns:
            if later.stamp_ns - earlier.stamp_ns > longest_gap_ns:
                return math.nan
            part = (stamp_ns - earlier.stamp_ns) / (later.stamp_ns - earlier.stamp_ns)
            return earlier.speed + part * (later.speed - earlier.speed)
    return math.nan


STEADY = 1e-5
"""Relative change of the speed over a window below which it counts as constant."""


@dataclass(frozen=True)
class Rotation:
    """Rotation of the tool over a window.

    turns: revolutions since the window's first sample, one per sample; mean [rad/s]: average
    speed; spread: largest difference of the speed from its mean, relative.
    """

    turns: Array
    mean: float
    spread: float


def constant_rotation(speed: float, count: int, rate: float) -> Rotation:
    """Rotation at a constant speed [rad/s] over `count` samples at `rate` [Hz]."""
    return Rotation(np.arange(float(count)) * (speed / (2 * math.pi * rate)), speed, 0.0)


def rotation(held: tuple[SpindleSpeed, ...], start_ns: int, end_ns: int, count: int, rate: float,
             longest_gap_ns: int) -> Rotation | None:
    """Rotation over the window of `count` samples at `rate` [Hz] whose first and last have stamps start_ns and end_ns.

    The speed is linear between the held values, its integral exact; None where they do not cover
    the window or lie further apart than `longest_gap_ns`.
    """
    first = next((i for i in range(len(held) - 1, -1, -1) if held[i].stamp_ns <= start_ns), -1)
    if first < 0 or held[-1].stamp_ns < end_ns:
        return None
    last = next(i for i in range(first, len(held)) if held[i].stamp_ns >= end_ns)
    used = held[first: max(last, first + 1) + 1]
    if len(used) < 2:
        return constant_rotation(used[0].speed, count, rate)
    if max(b.stamp_ns - a.stamp_ns for a, b in pairwise(used)) > longest_gap_ns:
        return None
    slowest, fastest = min(h.speed for h in used), max(h.speed for h in used)
    if slowest == fastest > 0:
        return constant_rotation(slowest, count, rate)
    stamps = np.array([h.stamp_ns - start_ns for h in used], dtype=np.int64)
    at = stamps.astype(np.float64) * 1e-9
    speed = np.array([h.speed for h in used])
    times = np.arange(count) / rate
    values = np.interp(times, at, speed)
    mean = float(values.mean())
    if mean <= 0:
        return Rotation(np.zeros(count), mean, 0.0)
    spread = float(np.abs(values - mean).max() / mean)
    if spread < STEADY:
        return constant_rotation(mean, count, rate)
    slope = np.diff(speed) / np.diff(at)
    angle = np.concatenate([[0.0], np.cumsum(np.diff(at) * (speed[1:] + speed[:-1]) / 2)])
    k = np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(slope) - 1)
    since = times - at[k]
    theta = angle[k] + since * (speed[k] + slope[k] * since / 2)
    return Rotation((theta - theta[0]) / (2 * math.pi), mean, spread)


def ratio_grid(band: float, step: float = 2.5e-4) -> Array:
    """Trial ratios of true to declared speed: 1 - band ... 1 + band, at most `step` apart."""
    half = max(1, math.ceil(band / step))
    return 1 + np.linspace(-band, band, 2 * half + 1)


def comb_score(s: Spectrum, tooth_frequency: float, ratios: Array, top: float = 2500.0, most: int = 20) -> Array:
    """Evidence of a tooth passing comb at each trial ratio: mean over harmonics of log(1 + power/floor).

    Harmonics of tooth_frequency [Hz] up to `top` [Hz], at most `most` of them.
    Each harmonic's share is bounded (power/floor counts up to 1000), so that one strong line which
    is no harmonic cannot pull the comb onto itself.
    """
    count = max(1, min(most, int(min(top, len(s.power) * s.step * 0.95) / (tooth_frequency * ratios[-1]))))
    harmonics = np.arange(1, count + 1)
    position = np.outer(ratios, harmonics) * (tooth_frequency / s.step)
    low = np.clip(position.astype(int), 0, len(s.power) - 2)
    part = position - low
    excess = np.log1p(np.minimum(s.power / s.floor, 1000.0))
    score: Array = (excess[low] * (1 - part) + excess[low + 1] * part).mean(axis=1)
    return score


def overruled(s: Spectrum, tooth_frequency: float, ratios: Array, held: float, band: float) -> float:
    """Ratio of true to measured speed: `held`, or another where the tooth passing comb is far plainer.

    held: ratio believed so far, within +-band of which a comb counts for it; s: spectrum of a window in which the
    speed is constant; tooth_frequency [Hz] as measured; ratios: trial ratios. Each harmonic counts with the
    logarithm of power over floor, at the tops of the peaks only; two plain lines more are needed, and a third of the
    first twelve harmonics.
    """
    count = min(20, int(len(s.power) * s.step * 0.98 / (tooth_frequency * ratios[-1])))
    if count < 1:
        return held
    top = ndimage.maximum_filter1d(s.power, 4 * PAD + 1)
    excess = np.log1p(np.minimum(s.power / s.floor, 1000.0)) * (s.power / top)
    excess[top < PLAIN * s.floor] = 0.0
    position = np.outer(ratios, np.arange(1, count + 1)) * (tooth_frequency / s.step)
    seen = excess[np.minimum(np.rint(position).astype(int), len(excess) - 1)]
    scores = seen.sum(axis=1)
    best = int(np.argmax(scores))
    near_held = float(scores[np.abs(ratios - held) <= band].max(initial=0.0))
    plain = int(np.sum(seen[best, :12] > math.log(PLAIN) / 2))
    far = near_held < COMB_HELD and scores[best] > near_held + (9.0 if count > 1 else 5.0)
    return float(ratios[best]) if far and plain >= min(count, max(2, -(-min(count, 12) // 3))) else held


def told_by_strongest(s: Spectrum, tooth_frequency: float, held: float, lowest: float, band: float,
                      near: float = 0.002) -> float:
    """Ratio of true to measured speed: `held`, or that which makes the strongest line a tooth or half-order harmonic.

    A cut has a tooth passing comb. Where there is none within +-near of the held ratio (NO_COMB of the line energy at
    most), while within +-band another ratio explains four fifths of it with harmonics k / 2 of tooth_frequency [Hz],
    k = 1 to 6 for the strongest, the speed is another. Lines above `lowest` [Hz] count; s: of a window at a constant
    speed.
    """
    found = lines(s, lowest, PLAIN, 24)
    if not found:
        return held
    frequency, energy = np.array([x.frequency for x in found]), np.array([x.energy for x in found])

    def explained(ratio: float) -> float:
        order = 2 * frequency / (ratio * tooth_frequency)
        away = np.abs(order - np.maximum(1, np.rint(order))) * ratio * tooth_frequency / 2
        return float(energy[away < 0.3 * s.resolution].sum() / energy.sum())

    if max(explained(held + part * near) for part in np.linspace(-1, 1, 17)) > NO_COMB:
        return held
    tried = [2 * frequency[0] / (k * tooth_frequency) for k in range(1, 7)]
    best = max((r for r in tried if abs(r - 1) <= band), key=explained, default=held)
    return float(best) if explained(best) > 0.8 else held


NO_COMB = 0.03

COMB_HELD = 10.0
"""Score of two to three plain lines: a comb at the held ratio, which no other comb overrules."""

PLAIN = 30.0
"""Power over floor from which a line speaks against the tachometer."""


def best_ratio(ratios: Array, scores: Array) -> tuple[float, float]:
    """Ratio of the highest score (parabola through its neighbours) and the score's lead over the median one."""
    k = int(np.argmax(scores))
    lead = float(scores[k] - np.median(scores))
    if not 0 < k < len(scores) - 1:
        return float(ratios[k]), lead
    a, b, c = scores[k - 1: k + 2]
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if bend < 0 else 0.0
    return float(ratios[k] + shift * (ratios[1] - ratios[0])), lead


def family_score(s: Spectrum, strongest: float, spindle_frequency: float, teeth: int, ratios: Array) -> Array:
    """Evidence, at each trial ratio, of lines spaced by tooth passing and spindle frequency around the strongest line.

    Works for a tooth passing harmonic and for a chatter line alike, where the comb itself may
    lie below the noise: chatter at H shows H + i f_tooth whatever H is. Mean of log(1 + power/floor)
    over i = -2 ... 2 tooth passing frequencies, twice, and over i = -2 N ... 2 N spindle
    frequencies, four times; the strongest line itself does not count.
    """
    excess = np.log1p(np.minimum(s.power / s.floor, 1000.0))
    excess[np.abs(np.arange(len(excess)) * s.step - strongest) < 2.5 * s.resolution] = 0.0
    total = np.zeros(len(ratios))
    for spacing, reach, weight in ((teeth * spindle_frequency, 2, 2.0), (spindle_frequency, 2 * teeth, 4.0)):
        i = np.concatenate([np.arange(-reach, 0), np.arange(1, reach + 1)])
        position = np.abs(strongest + np.outer(ratios, i) * spacing) / s.step
        inside = position < len(excess) - 2
        low = np.minimum(position, len(excess) - 2).astype(int)
        part = position - low
        value = np.where(inside, excess[low] * (1 - part) + excess[low + 1] * part, 0.0)
        total += weight * value.sum(axis=1) / np.maximum(inside.sum(axis=1), 1)
    return total
