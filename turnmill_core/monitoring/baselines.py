"""Published chatter indicators, to stand beside ours in every table. Each gives one number per window.

They get what we get: the samples x (n,) of a window at `rate` [Hz] and the spindle_frequency [Hz].
"""

from __future__ import annotations

import math

import numpy as np

from turnmill_core.monitoring.spectrum import Array, spectrum


def fft_energy_ratio(
    x: Array, rate: float, spindle_frequency: float, top: float = 5000.0, lowest: float = 40.0,
) -> float:
    """Energy that is not at spindle harmonics over all energy, from a Hann spectrum.

    Multiples of spindle_frequency [Hz] are taken out of x (n,), at `rate` [Hz], with the main lobe, two reciprocal
    window lengths on either side. Between `lowest` and `top` [Hz].
    """
    s = spectrum(x, rate, min(top, 0.45 * rate))
    f = s.frequency
    away = np.abs(f - np.round(f / spindle_frequency) * spindle_frequency) > 2 * s.resolution
    band = f >= lowest
    total = float(s.power[band].sum())
    return float(s.power[band & away].sum()) / total if total > 0 else 0.0


def once_per_revolution_variance(x: Array, rate: float, spindle_frequency: float) -> float:
    """Variance of samples taken once per revolution over the variance of all (Schmitz 2003).

    Near 0 for a synchronous signal, near 1 for an asynchronous one; mean over 16 phases of the
    revolution. x: samples (n,) at `rate` [Hz]; spindle_frequency [Hz]. NaN below three revolutions.
    """
    revolutions = int(len(x) * spindle_frequency / rate)
    if revolutions < 3:
        return math.nan
    total = float(np.var(x))
    if total == 0:
        return 0.0
    at = (np.arange(revolutions)[:, None] + np.arange(16) / 16) * rate / spindle_frequency
    picked = np.interp(at, np.arange(len(x)), x)
    return float(np.var(picked, axis=0, ddof=1).mean()) / total


def kalman_energy_ratio(x: Array, rate: float, spindle_frequency: float, harmonics: int = 40,
                        gain: float = 0.003) -> float:
    """Energy of what a comb of tracked harmonics leaves over all energy (after Caliskan, Kilic, Altintas 2018).

    Every harmonic of the spindle is a rotating state that is corrected by its share of the
    innovation at each sample: the steady state of a Kalman filter with equal noise on all harmonics.
    Energies by the Teager-Kaiser operator x[n]^2 - x[n-1] x[n+1], over its second half. The
    published detector takes 0.2 as its threshold and splits the residual into bands; here the whole
    residual is one band. x: samples (n,) at `rate` [Hz]; spindle_frequency [Hz], of which `harmonics`
    multiples are tracked; gain: correction per sample, the reciprocal of a time constant in samples.
    """
    count = max(1, min(harmonics, int(0.45 * rate / spindle_frequency)))
    turn = np.exp(2j * math.pi * spindle_frequency / rate * np.arange(1, count + 1))
    state = np.zeros(count, dtype=complex)
    left = np.empty(len(x))
    share = min(gain, 0.5 / count)
    mean = float(np.mean(x))
    for n, value in enumerate(x - mean):
        state = state * turn
        left[n] = value - state.real.sum()
        state = state + 2 * share * left[n]
    half = len(x) // 2
    total = _teager_kaiser((x - mean)[half:])
    return min(1.0, max(0.0, _teager_kaiser(left[half:]) / total)) if total > 0 else 0.0


def _teager_kaiser(x: Array) -> float:
    """Mean of the Teager-Kaiser energy operator."""
    return float(np.mean(x[1:-1] ** 2 - x[:-2] * x[2:]))
