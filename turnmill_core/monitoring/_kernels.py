"""Compiled loops of this room, each tested against its plain version (`.py_func`)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True)
def kalman_comb(x: Floats, turns: Floats, harmonics: int, gain: float) -> Floats:
    """What a comb of tracked harmonics leaves of x (n,): see baselines.kalman_energy_ratio.

    turns (n,): revolutions at the samples. Harmonic k is a rotating complex state, corrected at each sample by 2 gain
    times the innovation; all turn by powers of one rotation a sample.
    """
    real, imag = np.zeros(harmonics), np.zeros(harmonics)
    left = np.empty(len(x))
    for n in range(len(x)):
        turned = 2.0 * np.pi * (turns[n] - turns[n - 1] if n > 0 else 0.0)
        c, s = np.cos(turned), np.sin(turned)
        ck, sk, total = 1.0, 0.0, 0.0
        for k in range(harmonics):
            ck, sk = ck * c - sk * s, ck * s + sk * c
            real[k], imag[k] = real[k] * ck - imag[k] * sk, real[k] * sk + imag[k] * ck
            total += real[k]
        left[n] = x[n] - total
        for k in range(harmonics):
            real[k] += 2.0 * gain * left[n]
    return left
