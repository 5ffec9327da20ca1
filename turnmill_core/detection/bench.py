"""The detection benchmark: which signals, and what the verdicts on them are worth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.detection.comparison import (
    Standing,
    curves,
    episodes,
    false_alarms,
    in_time,
    ours,
    ramps,
    seconds_without,
    standings,
)
from turnmill_core.detection.cuts import KINDS, TRAIN_END
from turnmill_core.detection.endless import QUIET_KINDS, SECONDS, TRIED, quiet_motion
from turnmill_core.detection.hearing import NO_TRUTH, Heard, hear_cut, hear_quiet
from turnmill_core.detection.known_runout import EVEN_KINDS, decided_by_runout
from turnmill_core.monitoring.verdict import ChatterKind

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
    half-order lines with an even number of teeth, with a wrong model's prior and without (flips only);
    half_order_runout: (right, undecided, windows) with a runout known to 20 % and no prior.
    delays, tripled: of every ramp, alarm after the 20 % crossing [s] (NaN: none), and time from crossing to tripled.
    changed: (windows whose verdict changes, windows) with the tachometer 1 % wrong. standings: ours and published
    indicators side by side; recalls (r,), false_at (r, indicators): false alarms per hour at each recall. missed,
    raised: kind and number of the cuts missed, and of signals with a false alarm.
    """

    confusion: NDArray[np.int64]
    false_alarms: int
    hours: float
    undecided: int
    hopf: tuple[int, int]
    flip_odd: tuple[int, int]
    half_order_prior: tuple[int, int]
    half_order: tuple[int, int]
    half_order_runout: tuple[int, int, int]
    delays: tuple[float, ...]
    tripled: tuple[float, ...]
    changed: tuple[int, int]
    standings: tuple[Standing, ...]
    recalls: NDArray[np.float64]
    false_at: NDArray[np.float64]
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
        return [hear_quiet(kind, number, part, motion, tachometer=part == 0) for part in range(PARTS)]
    even = kind in EVEN_KINDS
    heard = hear_cut(kind, number, tachometer=True, prior=even)
    return [replace(heard, by_runout=decided_by_runout(kind, number)) if even else heard]


def tally(found: Sequence[Heard]) -> Tally:
    """What the verdicts are worth."""
    confusion = np.zeros((len(ChatterKind), len(ChatterKind)), dtype=np.int64)
    for h in found:
        at = h.truth != NO_TRUTH
        np.add.at(confusion, (h.truth[at], h.state[at]), 1)
    hopf, odd = episodes(found, ChatterKind.HOPF), episodes(found, ChatterKind.FLIP)
    missed = [[h for h in group if not in_time(h, h.state == int(kind))]
              for group, kind in ((hopf, ChatterKind.HOPF), (odd, ChatterKind.FLIP))]
    raised = [(h, len(false_alarms(h, ours(h)))) for h in found]
    asked = [h for h in found if math.isfinite(h.changed)]
    stand = standings(found)
    recalls, false_at = curves(found)
    return Tally(
        confusion, sum(n for _, n in raised), sum(seconds_without(h) for h in found) / 3600,
        sum(_undecided(h) for h in found),
        (len(hopf) - len(missed[0]), len(hopf)), (len(odd) - len(missed[1]), len(odd)),
        _half_order(found, True), _half_order(found, False),
        tuple(sum(h.by_runout[k] for h in found) for k in range(3)),  # type: ignore[arg-type]
        stand[0].delays, tuple(h.episode.tripled - h.episode.begin for h in ramps(found) if h.episode),
        (round(sum(h.changed for h in asked)), sum(len(h.state) for h in asked)), stand, recalls, false_at,
        tuple(f"{h.kind} {h.number}" for group in missed for h in group),
        tuple(f"{h.kind} {h.number}" for h, n in raised if n),
    )


def _undecided(h: Heard) -> int:
    """Runs of FLIP_OR_RUNOUT in nothing but windows without chatter."""
    return len(false_alarms(h, h.state == int(ChatterKind.FLIP_OR_RUNOUT)))


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
