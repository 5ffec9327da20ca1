"""Spindle speed from the spacing of lines.

Whatever a cut does, its lines lie on few lattices whose step is the tooth passing frequency or, with runout, that of
the spindle: the comb of its multiples; with chatter at H the lines H + i f and, as frequencies are positive, i f - H;
half-order lines. So the true speed is the one at which lines lie whole steps apart, be the cut stable or not, and be
the comb loud or drowned. Each line counts by how well it fits, not by how strong it is, so that no chatter line pulls
the comb onto itself. Lines are compared with their neighbours, near the strongest one: a chatter line wanders, its
multiples wander more, but the spacing of those around it is the spindle's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from turnmill_core.monitoring._kernels.lattice import lattice_evidence
from turnmill_core.monitoring.spectrum import Array, Line

STEP = 1e-4
"""Distance of trial ratios."""

MOST = 24
"""Strongest lines that count."""

SHARP = 0.08
"""Standard deviation of a line's frequency [reciprocal window lengths]."""

REACH = 2.5
"""Distance from the strongest line [tooth passing frequencies] up to which lines count."""

ALONE = 0.1
"""Probability that a line belongs to no lattice found so far."""

TRUSTED, BROKEN = 1.5e-3, 0.05
"""Standard deviation of the relative error of a tachometer, and share of those that may be wrong by anything."""


def trial_ratios(band: float) -> Array:
    """Trial ratios of true to assumed speed: 1 - band ... 1 + band."""
    half = math.ceil(band / STEP)
    return 1 + STEP * np.arange(-half, half + 1.0)


def evidence(found: Sequence[Line], resolution: float, tooth_frequency: float, teeth: int, ratios: Array) -> Array:
    """Log-likelihood of each trial ratio (m,) of true to assumed tooth_frequency [Hz]: (m,).

    found: lines, strongest first, of a spectrum of `resolution` [Hz]; teeth: equal parts of a revolution. The step is
    the tooth passing or the spindle frequency, equally probable; of the latter only the spacing of lines counts, as its
    multiples lie so close together that any line is near one.
    """
    near = [x.frequency for x in found if abs(x.frequency - found[0].frequency) < REACH * tooth_frequency]
    frequency = np.array(near[:MOST])
    spread = np.hypot(SHARP * resolution, STEP / 2 * frequency)
    told: Array = lattice_evidence(frequency, spread, tooth_frequency, ratios, ALONE, True, 2 * REACH)
    if teeth > 1:
        apart = lattice_evidence(frequency, spread, tooth_frequency / teeth, ratios, ALONE, False, 2 * REACH * teeth)
        told = np.logaddexp(told, apart)
    return told


def measured_prior(ratios: Array) -> Array:
    """Log-probability of ratios of true to measured speed: most tachometers are right, some wrong by anything."""
    width = float(ratios[-1] - ratios[0])
    known = np.exp(-0.5 * ((ratios - 1) / TRUSTED) ** 2) / (TRUSTED * math.sqrt(2 * math.pi))
    prior: Array = np.log((1 - BROKEN) * known + BROKEN / width)
    return prior


def nominal_prior(ratios: Array) -> Array:
    """Log-probability of ratios of true to nominal speed: a declared speed is roughly right."""
    prior: Array = -2 * ((ratios - 1) / (ratios[-1] - 1)) ** 2
    return prior
