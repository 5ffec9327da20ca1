"""Published indicators on one signal of the corpus, for the windows of our verdicts, each with its operating point.

They get the true rotation, and the noise-floor gate that our monitor has: a window is heard where its level is at
least GATE times the floor that was learned in windows that our monitor calls AIR. Without it all of them raise alarms
through air. Thresholds: the published one where there is one, else what `tools/fit_baselines.py` finds on training
numbers; it fits the densities too.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.detection.recordings import RATE, Observed
from turnmill_core.monitoring.baselines import (
    concentration,
    fft_energy_ratio,
    kalman_energy_ratios,
    once_per_revolution_variance,
)
from turnmill_core.monitoring.entropy import Density, sequential_test
from turnmill_core.monitoring.verdict import ChatterKind, Verdict

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rival:
    """A published indicator: its name, the threshold from which two windows in a row make an alarm, whose it is."""

    name: str
    threshold: float
    source: str


FITTED = "finds 95 % of training chatters"

RIVALS = (
    Rival("FFT energy ratio", 0.330, FITTED),
    Rival("once-per-revolution variance", 0.723, FITTED),
    Rival("Kalman comb, Teager-Kaiser", 0.2, "published"),
    Rival("maximum entropy, sequential", 0.248, FITTED),
)

HOP = 0.05
"""Time between windows [s]."""

WINDOW = 0.375
"""Window of the sequential test [s]; of each only what is new since the one before counts (windows overlap)."""

WRONG = 0.01
"""Probabilities of both errors that set the bound of the sequential test."""

RANGE = (-6.0, 0.0)
"""Range of the densities [decades of energy share]."""

STABLE = Density(*RANGE, (-9.25, -13.06, -6.83, -2.33, -1.34))
CHATTER = Density(*RANGE, (-62.16, 102.4, -70.24, 31.34, -12.18))

GATE = 2.0
LEARNED, LEARNED_LOUD = 0.05, 0.002
"""Level over the floor that opens the gate, and shares by which a quiet and a loud window of air move the floor: those
of the monitor."""


@dataclass(frozen=True)
class Rated:
    """Values of the RIVALS in n windows: gated, ungated (n, RIVALS), with and without the gate; cpu [s] of each."""

    gated: NDArray[np.float32]
    ungated: NDArray[np.float32]
    cpu: tuple[float, ...]


def rate_windows(seen: Observed, teeth: int, verdicts: Sequence[Verdict]) -> Rated:
    """Published indicators for the windows of verdicts; with the gate: 0 where it is shut."""
    samples = seen.samples.astype(np.float64)
    ends = [v.last_sample + 1 for v in verdicts]
    begins = [max(0, round(v.window_start_ns * 1e-9 * RATE)) for v in verdicts]
    heard = open_gate(verdicts)

    def each(indicator: Callable[[Floats, Floats], float]) -> Floats:
        return np.array([indicator(samples[a:b], seen.turns[a:b]) if b - a > RATE // 20 else 0.0
                         for a, b in zip(begins, ends, strict=True)])

    def ratio(x: Floats, turns: Floats) -> float:
        return fft_energy_ratio(x, turns, float(RATE))

    def variance(x: Floats, turns: Floats) -> float:
        found = once_per_revolution_variance(x, turns)
        return found if math.isfinite(found) else 0.0

    clock = [time.process_time()]
    plain = [each(ratio)]
    clock.append(time.process_time())
    plain.append(each(variance))
    clock.append(time.process_time())
    plain.append(kalman_energy_ratios(samples, seen.turns, float(RATE), teeth, ends, RATE // 5))
    clock.append(time.process_time())
    new = evidence(concentrations(seen, ends))
    clock.append(time.process_time())
    gated = [np.where(heard, c, 0.0) for c in plain] + [sequential_test(new, heard, WRONG, WRONG)]
    free = [*plain, sequential_test(new, np.ones(len(new), dtype=bool), WRONG, WRONG)]
    return Rated(np.column_stack(gated).astype(np.float32), np.column_stack(free).astype(np.float32),
                 tuple(float(c) for c in np.diff(clock)))


def concentrations(seen: Observed, ends: Sequence[int]) -> Floats:
    """Concentration of the energy away from spindle harmonics in windows of WINDOW that end before `ends` (n,)."""
    samples, length = seen.samples.astype(np.float64), round(WINDOW * RATE)
    return np.array([concentration(samples[max(0, b - length):b], seen.turns[max(0, b - length):b], float(RATE))
                     if b > length // 2 else RANGE[0] for b in ends])


def evidence(concentrations: Floats) -> Floats:
    """Logarithm of the ratio of densities, chatter over stable, of concentrations (n,), times what is new."""
    return (CHATTER.logarithm(concentrations) - STABLE.logarithm(concentrations)) * (HOP / WINDOW)


def open_gate(verdicts: Sequence[Verdict]) -> NDArray[np.bool_]:
    """Where windows are loud enough to be heard (n,); all until a first window of air."""
    found, floor = np.ones(len(verdicts), dtype=bool), math.nan
    for k, v in enumerate(verdicts):
        energy = v.level**2
        loud = not energy < GATE**2 * floor
        found[k] = loud
        if v.state is ChatterKind.AIR and math.isfinite(energy):
            floor = energy if math.isnan(floor) else floor + (LEARNED_LOUD if loud else LEARNED) * (energy - floor)
    return found
