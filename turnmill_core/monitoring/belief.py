"""What the monitor believes of the true speed, as a ratio to the measured or the nominal one, from window to window."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from turnmill_core.monitoring.background import Background
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.features import Features
from turnmill_core.monitoring.gate import plain_comb
from turnmill_core.monitoring.lattice import MOST, evidence, measured_prior, nominal_prior, trial_ratios
from turnmill_core.monitoring.separation import Prepared, lay_out
from turnmill_core.monitoring.spectrum import LINE_RATIO, Array, lines, spectrum

MEMORY = 0.7
"""Share of the evidence that is left one window later."""

CALM = 0.1
"""Asynchronous over synchronous energy below which nothing speaks against the speed."""

NEAR = 3e-4
"""Distance from the most probable ratio at which that of the window before is as good."""

SURE = 5
"""Calm windows after which the ratio of true to measured speed is no longer sought far away."""


@dataclass(frozen=True)
class Belief:
    """Ratio of the true speed to the measured one, or to the nominal one where none is measured.

    ratio: of the newest window; middle: around which the measured speed is refined; scores: evidence for trial
    ratios, remembered; calm: windows of a plain comb and little else so far.
    """

    ratio: float = 1.0
    middle: float = 1.0
    scores: Array | None = None
    calm: int = 0

    @property
    def sure(self) -> bool:
        """True where another ratio is no longer sought far away."""
        return self.calm >= SURE


def search(config: ChatterConfig, belief: Belief, p: Prepared, turns: Array, measured: bool,
           background: Background) -> Belief:
    """Belief after the lines of a window have told the speed, before its features are known.

    turns: revolutions per sample at the assumed speed. By angle, what turns with the tool has sharp lines, whatever the
    speed does. measured: the speed is, else it is the nominal one; background: of air, whose tones tell nothing.
    """
    layout = lay_out(p, turns, 1)
    whole = spectrum(layout.values, layout.points * layout.frequency, p.top)
    told = [x for x in lines(whole, config.band[0], LINE_RATIO, 2 * MOST) if not background.holds(x)]
    ratios = trial_ratios(config.nominal_band)
    teeth = config.principal_teeth
    scores = evidence(told, whole.resolution, teeth * layout.frequency, teeth, ratios)
    if belief.scores is not None:
        scores = scores + MEMORY * belief.scores
    prior = measured_prior(ratios) if measured else nominal_prior(ratios)
    middle = float(ratios[np.argmax(scores + prior)])
    near = abs(belief.ratio - middle) <= NEAR
    return replace(belief, scores=scores, middle=middle, ratio=belief.ratio if near else middle)


def refinement(config: ChatterConfig, belief: Belief) -> tuple[float, tuple[float, float]]:
    """Ratio from which the speed of a window is refined, and the band in which it is."""
    low, high = belief.middle - config.axis_band, belief.middle + config.axis_band
    return min(high, max(low, belief.ratio)), (low, high)


def after(belief: Belief, f: Features) -> Belief:
    """Belief after a window of features `f`: a calm one moves its middle."""
    calm = plain_comb(f) and abs(math.log(f.change)) < 0.3 and sum(x.energy for x in f.lines) < CALM * f.synchronous
    if not calm:
        return replace(belief, ratio=f.speed_ratio)
    return replace(belief, ratio=f.speed_ratio, middle=f.speed_ratio, calm=min(SURE, belief.calm + 1))

