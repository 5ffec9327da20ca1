"""How probable it is that a verdict's state is right.

A logistic map for each state: 1 / (1 + exp(-(b + w . e))), e the evidence below. Weights from
tools/calibrate_confidence.py: 280 random cuts of the process simulator (1 to 6 teeth, 1200 to 18000 rpm,
up- and down-milling and slots, runout, noise, tones, tachometer up to 0.2 % wrong, depth held or ramped
into chatter), each verdict held against the noise-free signal. On other machines and sensors the
probabilities are as good as these cuts are like them; that they are calibrated is tested on cuts
that the calibration has not seen.
"""

from __future__ import annotations

import math

import numpy as np

from turnmill_core.monitoring.features import Features
from turnmill_core.monitoring.spectrum import Array
from turnmill_core.monitoring.verdict import ChatterKind

EVIDENCE = ("1", "asynchronous", "half order", "near threshold", "noise", "comb", "sidebands", "explained", "held",
            "change", "level")
"""Names of the evidence, in order; see :func:`evidence`."""

_HALF_ORDER = (3.98, -0.83, 0.01, 0.15, -0.11, 0.04, -0.13, -0.12, -0.32, -0.02, 0.06)

WEIGHTS: dict[ChatterKind, tuple[float, ...]] = {
    ChatterKind.AIR: (4.07, -0.82, 0.02, 0.13, 0.79, -0.04, -0.53, -0.19, -0.7, -0.03, -0.42),
    ChatterKind.STABLE: (1.75, -0.78, -0.58, 0.14, -0.26, 0.05, -0.14, -0.18, -0.26, -0.13, 0.08),
    ChatterKind.MARGINAL: (5.08, -0.94, 0.51, -0.05, -0.05, -0.45, -0.64, -0.18, 0.17, -0.64, 0.15),
    ChatterKind.HOPF: (3.53, 1.17, -0.68, 0.25, 0.35, -0.31, 0.13, 0.03, -0.24, 0.01, 0.04),
    ChatterKind.FLIP: _HALF_ORDER,
    ChatterKind.FLIP_OR_RUNOUT: _HALF_ORDER,
}


def evidence(f: Features, asynchronous: float, half: float, threshold: float, held: bool, floor: float) -> Array:
    """Evidence of one window, in the order of EVIDENCE.

    asynchronous, half: ratios of the verdict; threshold: where chatter begins; held: True where
    persistence holds the state against the window; floor: mean square out of the cut (NaN: unknown).
    1; decades of the two ratios over the threshold (-3 to 2), and the smaller of
    their distances from it (to 1.5); decades of noise over all energy (-4 to 0); share of tooth
    passing harmonics above the noise; sidebands of four; share of line energy that the family
    explains; 1 where held; logarithm of the change of the
    synchronous amplitude within the window (to 2); decades of the level over the floor (0 to 2).
    """
    def decades(x: float, low: float, high: float) -> float:
        return min(high, max(low, math.log10(max(x, 1e-12))))

    c = f.chatter
    a, h = decades(asynchronous / threshold, -3, 2), decades(half / threshold, -3, 2)
    above = f.energy / floor if math.isfinite(floor) and floor > 0 else 1.0
    return np.array([
        1.0, a, h, min(1.5, abs(a), abs(h)), decades(f.noise / f.energy if f.energy > 0 else 1.0, -4, 0),
        f.comb / f.comb_of if f.comb_of else 0.0, c.sidebands / 4 if c else 0.0, c.explained if c else 0.0, float(held),
        min(2.0, abs(math.log(f.change))), decades(above, 0, 4) / 2,
    ])


def confidence(kind: ChatterKind, found: Array) -> float:
    """Probability, 0 to 1, that state `kind` is right, given the evidence `found`; 0 for UNKNOWN."""
    if kind not in WEIGHTS:
        return 0.0
    exponent = float(np.sum(np.array(WEIGHTS[kind]) * found))
    return 1 / (1 + math.exp(-min(30.0, max(-30.0, exponent))))
