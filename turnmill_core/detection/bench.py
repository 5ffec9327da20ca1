"""The detection benchmark: which signals, and what the verdicts on them are worth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from turnmill_core.detection.cuts import KINDS, TRAIN_END
from turnmill_core.detection.endless import QUIET_KINDS, SECONDS, TRIED, quiet_motion
from turnmill_core.detection.hearing import ALARMS, INDICATORS, NO_TRUTH, Heard, hear_cut, hear_quiet
from turnmill_core.monitoring.evaluation import roc_area
from turnmill_core.monitoring.verdict import ChatterKind

LATE = 0.3
DWELL = 2
PARTS = 10
"""Minutes of quiet signal made from one simulated cut."""


@dataclass(frozen=True)
class Plan:
    """How many cuts of each kind (in the order of KINDS), how many hours without chatter, from which number on."""

    cuts: tuple[int, ...]
    hours: float
    first: int

    @property
    def quiet(self) -> int:
        """Cuts that are made to go on, PARTS minutes each, the kinds of QUIET_KINDS in turn."""
        return math.ceil(self.hours * 3600 / SECONDS / PARTS)


QUICK = Plan((2, 2, 2, 3, 2, 3, 5), 0.0, TRAIN_END)
FULL = Plan((40, 40, 40, 160, 80, 60, 60), 10.2, TRAIN_END)


@dataclass(frozen=True)
class Tally:
    """What the verdicts are worth; every share with the count behind it.

    confusion (7, 7): windows by true kind (rows) and verdict. false_alarms, hours, undecided: alarms without chatter
    in all signals that truly have none, the hours of them, and runs of FLIP_OR_RUNOUT there. hopf, flip_odd: (found,
    episodes) with the right verdict within 0.3 s of full amplitude. half_order_prior, half_order: (right, windows) of
    half-order lines with an even number of teeth, with a wrong model's prior and without (flips only).
    delays, tripled: of every ramp, alarm after the 20 % crossing [s] (NaN: none), and time from crossing to tripled.
    areas: of the ROC per indicator. changed: (windows whose verdict changes, windows) with the tachometer 1 % wrong.
    recalls (r,), false_at (r, indicators): false alarms per hour at each recall. cpu: of the monitor per second
    of signal. missed, raised: kind and number of the cuts missed, and of signals with a false alarm.
    """

    confusion: NDArray[np.int64]
    false_alarms: int
    hours: float
    undecided: int
    hopf: tuple[int, int]
    flip_odd: tuple[int, int]
    half_order_prior: tuple[int, int]
    half_order: tuple[int, int]
    delays: tuple[float, ...]
    tripled: tuple[float, ...]
    areas: tuple[float, ...]
    changed: tuple[int, int]
    recalls: NDArray[np.float64]
    false_at: NDArray[np.float64]
    cpu: float
    missed: tuple[str, ...]
    raised: tuple[str, ...]


def run(plan: Plan, jobs: int = 1, progress: Callable[[float], None] | None = None) -> list[Heard]:
    """Hear all signals of a plan, in `jobs` processes; progress: called with the share done."""
    tasks = [("cut", kind, plan.first + n) for kind, count in zip(KINDS, plan.cuts, strict=True) for n in range(count)]
    tasks += [("quiet", QUIET_KINDS[n % len(QUIET_KINDS)], plan.first // TRIED + n) for n in range(plan.quiet)]
    found: list[Heard] = []
    if jobs == 1:
        results: Iterable[list[Heard]] = map(hear, tasks)
        return _collected(results, len(tasks), found, progress)
    with ProcessPoolExecutor(jobs) as pool:
        return _collected(pool.map(hear, tasks), len(tasks), found, progress)


def _collected(results: Iterable[list[Heard]], count: int, found: list[Heard],
               progress: Callable[[float], None] | None) -> list[Heard]:
    for k, heard in enumerate(results, start=1):
        found.extend(heard)
        if progress is not None:
            progress(k / count)
    return found


def hear(task: tuple[str, str, int]) -> list[Heard]:
    """One simulated cut, or PARTS minutes of a quiet one."""
    what, kind, number = task
    if what == "quiet":
        motion = quiet_motion(kind, number)
        return [hear_quiet(kind, number, part, motion) for part in range(PARTS)]
    return [hear_cut(kind, number, tachometer=True, prior=kind in ("flip_even", "runout"))]


def tally(found: Sequence[Heard]) -> Tally:
    """What the verdicts are worth."""
    confusion = np.zeros((len(ChatterKind), len(ChatterKind)), dtype=np.int64)
    for h in found:
        at = h.truth != NO_TRUTH
        np.add.at(confusion, (h.truth[at], h.state[at]), 1)
    false = [(h, *_false(h)) for h in found]
    ramps = [h for h in found if h.kind == "ramp" and h.episode is not None]
    hopf = [h for h in found if h.episode is not None and h.episode.kind is ChatterKind.HOPF and h.kind != "ramp"]
    odd = [h for h in found if h.episode is not None and h.episode.kind is ChatterKind.FLIP and h.teeth % 2]
    found_hopf, found_odd = ([_in_time(h) for h in group] for group in (hopf, odd))
    asked = [h for h in found if math.isfinite(h.changed)]
    recalls, false_at = curves(found)
    return Tally(
        confusion, sum(n for _, n, _, _ in false), sum(s for _, _, _, s in false) / 3600,
        sum(u for _, _, u, _ in false),
        (sum(found_hopf), len(hopf)), (sum(found_odd), len(odd)), _half_order(found, True), _half_order(found, False),
        tuple(_delay(h) for h in ramps), tuple(h.episode.tripled - h.episode.begin for h in ramps if h.episode),
        areas(found), (round(sum(h.changed for h in asked)), sum(len(h.state) for h in asked)), recalls, false_at,
        sum(h.cpu for h in found) / sum(h.seconds for h in found),
        tuple(f"{h.kind} {h.number}" for h, ok in zip([*hopf, *odd], [*found_hopf, *found_odd], strict=True) if not ok),
        tuple(f"{h.kind} {h.number}" for h, n, _, _ in false if n),
    )


def _runs(on: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _without(h: Heard) -> NDArray[np.bool_]:
    """Windows that truly hold no chatter."""
    return np.isin(h.truth, (int(ChatterKind.AIR), int(ChatterKind.STABLE)))


def _false(h: Heard) -> tuple[int, int, float]:
    """Alarms that touch nothing but windows without chatter, runs of FLIP_OR_RUNOUT there, seconds of such windows."""
    without = _without(h)
    step = float(np.median(np.diff(h.ends))) if len(h.ends) > 1 else 0.0
    alarms = sum(bool(without[a: b + 1].all()) for a, b in _runs(np.isin(h.state, [int(k) for k in ALARMS])))
    undecided = sum(bool(without[a: b + 1].all()) for a, b in _runs(h.state == int(ChatterKind.FLIP_OR_RUNOUT)))
    return alarms, undecided, float(without.sum()) * step


def _in_time(h: Heard) -> bool:
    """True where the right verdict stands at most LATE after full amplitude."""
    assert h.episode is not None
    at = (h.state == int(h.episode.kind)) & (h.ends >= h.episode.begin - LATE) & (h.ends <= h.episode.full + LATE)
    return bool(at.any())


def _delay(h: Heard) -> float:
    """Alarm of a ramp after the crossing [s]: of the first run of alarms that lasts until then or begins later."""
    assert h.episode is not None
    alarm = np.isin(h.state, [int(k) for k in (*ALARMS, ChatterKind.FLIP_OR_RUNOUT)])
    return next((float(h.ends[a]) - h.episode.begin for a, b in _runs(alarm) if h.ends[b] >= h.episode.begin), math.nan)


def _half_order(found: Sequence[Heard], prior: bool) -> tuple[int, int]:
    """Windows with half-order lines of even teeth that are judged right: (right, windows).

    Without a prior: of all that truly flip, those said to be FLIP_OR_RUNOUT. With the wrong model's prior: of all that
    truly flip, those said to be FLIP; and of those with runout that looks like it, those said to be STABLE.
    """
    right = total = 0
    for h in found:
        if not len(h.with_prior):
            continue
        flips = h.truth == int(ChatterKind.FLIP)
        alike = (h.truth == int(ChatterKind.STABLE)) & (h.state == int(ChatterKind.FLIP_OR_RUNOUT))
        if prior:
            total += int(flips.sum() + alike.sum())
            right += int(np.sum(h.with_prior[flips] == int(ChatterKind.FLIP)))
            right += int(np.sum(h.with_prior[alike] == int(ChatterKind.STABLE)))
        else:
            total += int(flips.sum())
            right += int(np.sum(h.state[flips] == int(ChatterKind.FLIP_OR_RUNOUT)))
    return right, total


def _scored(found: Sequence[Heard]) -> list[tuple[Heard, NDArray[np.bool_], NDArray[np.bool_]]]:
    """Signals with the windows that hold chatter that can be told from runout, and those that hold none."""
    rows = []
    for h in found:
        chatter = h.truth == int(ChatterKind.HOPF)
        if h.teeth % 2:
            chatter = chatter | (h.truth == int(ChatterKind.FLIP))
        rows.append((h, chatter, _without(h)))
    return rows


def areas(found: Sequence[Heard]) -> tuple[float, ...]:
    """Area under the ROC curve of windows, per indicator."""
    rows = [(h.scores[c | w], c[c | w]) for h, c, w in _scored(found)]
    scores = np.concatenate([s for s, _ in rows])
    chatter = np.concatenate([c for _, c in rows])
    return tuple(roc_area(chatter, scores[:, k]) for k in range(len(INDICATORS)))


def curves(found: Sequence[Heard], count: int = 40) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """False alarms per hour at each recall, per indicator.

    An alarm begins where DWELL windows in a row exceed the threshold, for every indicator alike. Recall: share of
    chatter windows above it.
    """
    rows = _scored(found)
    hours = sum(w.sum() for _, _, w in rows) * 0.05 / 3600
    recalls = np.linspace(0.025, 1.0, count)
    false_at = np.full((count, len(INDICATORS)), np.nan)
    for k in range(len(INDICATORS)):
        positive = np.sort(np.concatenate([h.scores[c, k] for h, c, _ in rows]))
        if not len(positive) or not hours:
            continue
        lasting = [np.where(w[1:] & w[:-1], np.minimum(h.scores[1:, k], h.scores[:-1, k]), -1.0) for h, _, w in rows]
        joined = np.concatenate([np.concatenate([x, [-1.0]]) for x in lasting])
        for i, recall in enumerate(recalls):
            threshold = positive[min(len(positive) - 1, math.floor((1 - recall) * len(positive) + 1e-9))]
            on = joined >= threshold
            false_at[i, k] = np.sum(on[1:] & ~on[:-1]) + on[0]
    return recalls, false_at / hours if hours else false_at


def names() -> tuple[str, ...]:
    """Fields of a tally."""
    return tuple(f.name for f in fields(Tally))
