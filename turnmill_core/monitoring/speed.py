"""Spindle speed over a window, from axis states."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from turnmill_core.monitoring.spectrum import Array

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
