"""Our verdicts beside published indicators, by the same rules: false alarms, recall, ROC area, delay.

An alarm is a run of windows: of ours those whose state is an alarm, of an indicator those that exceed its threshold
together with the window before. It is false where it touches nothing but windows without chatter, and where it
begins in such windows longer than EARLY before the first other one: what is always on raises false alarms, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.detection.hearing import ALARMS, INDICATORS, Heard
from turnmill_core.detection.rivals import HOP, RIVALS
from turnmill_core.monitoring.verdict import ChatterKind

Bools = NDArray[np.bool_]
Places = NDArray[np.int64]

LATE = 0.3
"""Time after full amplitude, or before its begin, in which an alarm finds a chatter [s]."""

EARLY = 0.3
"""Time by which an alarm may begin before the signal is anything but surely free of chatter [s]."""


@dataclass(frozen=True)
class Standing:
    """What one indicator is worth at its operating point.

    threshold (NaN: our states) and its source; false_alarms, and without the gate (ours has its own); false_share:
    share of the time without chatter that is spent in false alarms; hopf, flip_odd: (found, episodes), in time; area:
    under the ROC curve of windows; delays: of every ramp, alarm after the 20 % crossing [s] (NaN: none);
    before_tripled: ramps with the alarm before the amplitude has tripled, if it ever does; cpu: per second of signal.
    """

    name: str
    threshold: float
    source: str
    false_alarms: int
    ungated: int
    false_share: float
    hopf: tuple[int, int]
    flip_odd: tuple[int, int]
    area: float
    delays: tuple[float, ...]
    before_tripled: int
    cpu: float


def runs(on: Bools) -> tuple[Places, Places]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - 1


def without_chatter(h: Heard) -> Bools:
    """Windows that truly hold no chatter, and none before them: one that ends is no place for false alarms."""
    chatter = np.isin(h.truth, (int(ChatterKind.HOPF), int(ChatterKind.FLIP)))
    quiet: Bools = np.isin(h.truth, (int(ChatterKind.AIR), int(ChatterKind.STABLE)))
    return quiet & ~np.logical_or.accumulate(chatter)


def false_alarms(h: Heard, on: Bools) -> list[tuple[int, int]]:
    """First and last window of every run that is a false alarm."""
    first, last = _false(on, without_chatter(h))
    return list(zip(first.tolist(), last.tolist(), strict=True))


def _false(on: Bools, without: Bools) -> tuple[Places, Places]:
    count = len(without)
    other = np.minimum.accumulate(np.where(without, count, np.arange(count))[::-1])[::-1]
    first, last = runs(on)
    wrong = other[first] > np.minimum(last, first + round(EARLY / HOP))
    return first[wrong], last[wrong]


def seconds_without(h: Heard) -> float:
    """Time without chatter [s]."""
    return float(without_chatter(h).sum()) * HOP


def ours(h: Heard) -> Bools:
    """Windows in which our state is an alarm."""
    return np.isin(h.state, [int(k) for k in ALARMS])


def lasting(scores: NDArray[np.float32]) -> NDArray[np.float32]:
    """Smaller of the scores (n,) of each window and the one before: two in a row make an alarm."""
    before = np.concatenate([np.full(min(1, len(scores)), -np.inf, dtype=np.float32), scores[:-1]])
    found: NDArray[np.float32] = np.minimum(scores, before)
    return found


def in_time(h: Heard, on: Bools) -> bool:
    """True where a window of `on` ends near the growth of the chatter, at most LATE after full amplitude."""
    return bool((on & _growth(h)).any())


def peak(h: Heard, indicator: int) -> float:
    """Highest threshold on the score of an indicator (column) at which the chatter is found in time."""
    return float(lasting(h.scores[:, indicator])[_growth(h)].max(initial=0.0))


def _growth(h: Heard) -> Bools:
    assert h.episode is not None
    return (h.ends >= h.episode.begin - LATE) & (h.ends <= h.episode.full + LATE)


def ramp_delay(h: Heard, on: Bools) -> float:
    """Alarm of a ramp after the crossing [s]: of the first run that lasts until then or begins later; NaN: none."""
    assert h.episode is not None
    begin = h.episode.begin
    return next((float(h.ends[a]) - begin for a, b in zip(*runs(on), strict=True) if h.ends[b] >= begin), math.nan)


def episodes(found: Sequence[Heard], kind: ChatterKind) -> list[Heard]:
    """Signals that end in chatter of a kind, but ramps; of period two those with an odd number of teeth."""
    return [h for h in found if h.episode is not None and h.episode.kind is kind and h.kind != "ramp"
            and (kind is not ChatterKind.FLIP or h.teeth % 2 == 1)]


def ramps(found: Sequence[Heard]) -> list[Heard]:
    """Depth ramps that end in chatter."""
    return [h for h in found if h.kind == "ramp" and h.episode is not None]


def standings(found: Sequence[Heard]) -> tuple[Standing, ...]:
    """Ours first, then the RIVALS."""
    seconds = sum(h.seconds for h in found)
    any_alarm = [int(k) for k in (*ALARMS, ChatterKind.FLIP_OR_RUNOUT)]
    areas = roc_areas(found)
    rows = [_standing(found, INDICATORS[0], (math.nan, "its own decision"), [ours(h) for h in found],
                      [np.isin(h.state, any_alarm) for h in found], areas[0], sum(h.cpu for h in found) / seconds)]
    for k, rival in enumerate(RIVALS):
        on = [lasting(h.scores[:, k + 1]) >= rival.threshold for h in found]
        free = [lasting(h.ungated[:, k]) >= rival.threshold for h in found]
        row = _standing(found, rival.name, (rival.threshold, rival.source), on, on, areas[k + 1],
                        sum(h.rival_cpu[k] for h in found) / seconds,
                        sum(len(false_alarms(h, o)) for h, o in zip(found, free, strict=True)))
        rows.append(row)
    return tuple(rows)


def _standing(found: Sequence[Heard], name: str, operating: tuple[float, str], on: Sequence[Bools],
              on_ramps: Sequence[Bools], area: float, cpu: float, ungated: int | None = None) -> Standing:
    by = {id(h): o for h, o in zip(found, on, strict=True)}
    by_ramp = {id(h): o for h, o in zip(found, on_ramps, strict=True)}
    false = [r for h in found for r in false_alarms(h, by[id(h)])]
    quiet = sum(int(without_chatter(h).sum()) for h in found)
    hopf, odd = episodes(found, ChatterKind.HOPF), episodes(found, ChatterKind.FLIP)
    delays = [(ramp_delay(h, by_ramp[id(h)]), h.episode.tripled - h.episode.begin) for h in ramps(found) if h.episode]
    return Standing(
        name, *operating, len(false), len(false) if ungated is None else ungated,
        sum(b + 1 - a for a, b in false) / quiet if quiet else math.nan,
        (sum(in_time(h, by[id(h)]) for h in hopf), len(hopf)), (sum(in_time(h, by[id(h)]) for h in odd), len(odd)),
        area, tuple(d for d, _ in delays), sum(math.isfinite(d) and not d > tripled for d, tripled in delays), cpu)


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


def roc_areas(found: Sequence[Heard]) -> tuple[float, ...]:
    """Area under the ROC curve per indicator, of windows without chatter and with such as can be told from runout."""
    scores, chatter = [], []
    for h in found:
        kinds = (ChatterKind.HOPF, ChatterKind.FLIP) if h.teeth % 2 else (ChatterKind.HOPF,)
        on = np.isin(h.truth, [int(k) for k in kinds])
        asked = on | without_chatter(h)
        scores.append(h.scores[asked])
        chatter.append(on[asked])
    together, truth = np.concatenate(scores), np.concatenate(chatter)
    return tuple(roc_area(truth, together[:, k]) for k in range(len(INDICATORS)))


def curves(found: Sequence[Heard]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Recalls (r,) and false alarms per hour (r, indicators) at the highest threshold on the score that reaches each.

    Recall: share of the chatters (Hopf, and period two with an odd number of teeth) found in time. Two
    windows in a row must exceed the threshold, of every indicator alike. A lower threshold joins alarms; it never
    counts fewer for that. NaN where a recall is not reached with a threshold above 0.
    """
    asked = episodes(found, ChatterKind.HOPF) + episodes(found, ChatterKind.FLIP)
    hours = sum(seconds_without(h) for h in found) / 3600
    recalls = np.arange(1, len(asked) + 1) / max(1, len(asked))
    false_at = np.full((len(asked), len(INDICATORS)), np.nan)
    without = np.concatenate([np.append(without_chatter(h), False) for h in found])
    for k in range(len(INDICATORS)):
        peaks = np.sort([peak(h, k) for h in asked])[::-1]
        value = np.concatenate([np.append(lasting(h.scores[:, k]), -np.inf) for h in found])
        most = 0
        for i, threshold in enumerate(peaks):
            if threshold <= 0 or not hours:
                break
            if i == 0 or threshold != peaks[i - 1]:
                most = max(most, len(_false(value >= threshold, without)[0]))
            false_at[i, k] = most / hours
    return recalls, false_at
