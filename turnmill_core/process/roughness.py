"""Roughness figures of profiles and surfaces: Gaussian filter (ISO 16610-21), ISO 21920-2, ISO 25178-2."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import require

Floats = NDArray[np.float64]

ALPHA = math.sqrt(math.log(2) / math.pi)
"""Constant of the Gaussian filter: half of the amplitude passes at the cut-off wavelength (ISO 16610-21)."""
SECTIONS = 5
"""Section lengths in the evaluation length of Rz."""


@dataclass(frozen=True)
class Roughness:
    """Figures of a roughness profile or surface [m], [1].

    mean_deviation: Ra or Sa; rms: Rq or Sq; height: Rz, the mean over the sections of highest peak to deepest valley,
    or Sz; total: Rt (for a surface Sz); skewness, kurtosis: Rsk, Rku or Ssk, Sku (NaN for a plane).
    """

    mean_deviation: float
    rms: float
    height: float
    total: float
    skewness: float
    kurtosis: float


def waviness(profile: Floats, spacing: float, cutoff: float) -> Floats:
    """Long-wave part of a periodic `profile` (n,) [m]: what the Gaussian filter passes (ISO 16610-21).

    spacing [m] of the points; cutoff [m]: wavelength of which half of the amplitude passes. The filter runs around the
    end, so the profile must repeat itself.
    """
    require(spacing > 0, "spacing", spacing, "m", "a number > 0")
    require(cutoff > 2 * spacing, "cut-off", cutoff, "m", f"more than two points of {spacing:.3g} m")
    waves = np.fft.rfftfreq(profile.size, spacing)
    return np.asarray(np.fft.irfft(np.fft.rfft(profile) * np.exp(-np.pi * (ALPHA * cutoff * waves) ** 2), profile.size))


def profile_roughness(profile: Floats, spacing: float, cutoff: float | None = None) -> Roughness:
    """Roughness of a periodic `profile` (n,) [m] with points `spacing` [m] apart.

    cutoff [m] of the Gaussian filter (None: only the mean is taken off). Rz is the mean over five sections.
    """
    require(profile.size >= 2 * SECTIONS, "profile", profile.size, "points", f"at least {2 * SECTIONS}")
    short = profile - (profile.mean() if cutoff is None else waviness(profile, spacing, cutoff))
    sections = np.array_split(short, SECTIONS)
    return _figures(short, float(np.mean([np.ptp(part) for part in sections])))


def surface_roughness(height: Floats) -> Roughness:
    """Sa, Sq, Sz, Ssk, Sku of a surface `height` [m] of any shape, its mean taken off (ISO 25178-2)."""
    return _figures((height - height.mean()).ravel(), float(np.ptp(height)))


def _figures(values: Floats, height: float) -> Roughness:
    rms = float(np.sqrt(np.mean(values**2)))
    flat = rms == 0
    return Roughness(float(np.abs(values).mean()), rms, height, float(np.ptp(values)),
                     math.nan if flat else float(np.mean(values**3)) / rms**3,
                     math.nan if flat else float(np.mean(values**4)) / rms**4)
