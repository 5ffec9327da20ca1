"""How good are verdicts? Confusion, ROC area, alarm delay, false alarms, for our verdicts and for baselines alike."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.monitoring.decision import CHATTER
from turnmill_core.monitoring.verdict import ChatterKind, Verdict


def confusion(
    truth: Sequence[ChatterKind | None], found: Sequence[ChatterKind],
) -> dict[tuple[ChatterKind, ChatterKind], int]:
    """Number of windows by (true state, found state); windows without a truth (None) are left out."""
    counts: dict[tuple[ChatterKind, ChatterKind], int] = {}
    for t, f in zip(truth, found, strict=True):
        if t is not None:
            counts[t, f] = counts.get((t, f), 0) + 1
    return counts


def roc_area(chatter: ArrayLike, score: ArrayLike) -> float:
    """Probability that a window with chatter has a higher score than one without; ties count half.

    chatter: truth (n,); score (n,). NaN where either kind is missing.
    """
    is_chatter, value = np.asarray(chatter, dtype=bool), np.asarray(score, dtype=float)
    with_it, without = value[is_chatter], np.sort(value[~is_chatter])
    if not len(with_it) or not len(without):
        return math.nan
    below = np.searchsorted(without, with_it, side="left")
    up_to = np.searchsorted(without, with_it, side="right")
    return float(np.mean((below + up_to) / 2) / len(without))


def recall_at(chatter: ArrayLike, score: ArrayLike, false_share: float) -> float:
    """Share of chatter windows found when at most `false_share` of the others exceed the threshold on the score."""
    is_chatter, value = np.asarray(chatter, dtype=bool), np.asarray(score, dtype=float)
    without = np.sort(value[~is_chatter])[::-1]
    if not is_chatter.any() or not len(without):
        return math.nan
    allowed = int(false_share * len(without))
    threshold = without[allowed] if allowed < len(without) else -math.inf
    return float(np.mean(value[is_chatter] > threshold))


@dataclass(frozen=True)
class Alarms:
    """Alarms of one recording, in seconds from its start.

    alarms: beginnings of runs of chatter states; delays: per true onset, first alarm window at or after
    it less the onset (NaN: missed); false:
    alarms that touch no true chatter; duration: judged time.
    """

    alarms: tuple[float, ...]
    delays: tuple[float, ...]
    false: tuple[float, ...]
    duration: float


def alarms(verdicts: Sequence[Verdict], chatter: Iterable[tuple[float, float]], lead: float = 0.3) -> Alarms:
    """Alarms held against the true intervals of chatter [s]; an alarm up to `lead` before an onset is not false."""
    true = tuple(chatter)
    if not verdicts:
        return Alarms((), tuple(math.nan for _ in true), (), 0.0)
    origin = verdicts[0].window_start_ns
    ends = [(v.window_end_ns - origin) * 1e-9 for v in verdicts]
    on = [v.state in CHATTER for v in verdicts]
    runs: list[tuple[float, float]] = []
    for k, now in enumerate(on):
        if now and (k == 0 or not on[k - 1]):
            runs.append((ends[k], ends[k]))
        elif now:
            runs[-1] = (runs[-1][0], ends[k])
    delays = []
    for begin, end in true:
        first = next((max(a, begin) for a, b in runs if b >= begin and a <= end + lead), math.nan)
        delays.append(first - begin)
    false = tuple(a for a, b in runs if not any(a <= end + lead and b >= begin - lead for begin, end in true))
    return Alarms(tuple(a for a, _ in runs), tuple(delays), false, ends[-1])


def per_hour(found: Iterable[Alarms]) -> tuple[float, float]:
    """False alarms per hour, and the hours of signal behind that."""
    listed = tuple(found)
    hours = sum(a.duration for a in listed) / 3600
    return (sum(len(a.false) for a in listed) / hours if hours > 0 else math.nan), hours
