"""What the monitor believes of the true speed, as a ratio to the measured or the nominal one, from window to window."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from turnmill_core.monitoring.background import Background
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.features import CALM, Features
from turnmill_core.monitoring.gate import loud, plain_comb
from turnmill_core.monitoring.separation import Prepared
from turnmill_core.monitoring.spectrum import Array, Spectrum, lines, spectrum
from turnmill_core.monitoring.speed import (
    Rotation,
    best_ratio,
    comb_score,
    family_score,
    overruled,
    ratio_grid,
    told_by_strongest,
)

SCORE_MEMORY = 0.9

SURE = 5
"""Calm windows after which the ratio of true to measured speed is no longer sought far away."""

NARROW = 1e-3
"""Relative change of the speed in a window up to which the lines of its spectrum are narrow enough to tell it."""

PULL = 0.3
"""Turn of the first tooth passing harmonic's phase over a window [revolutions] that still tells the speed's error."""


@dataclass(frozen=True)
class Belief:
    """Ratio of the true speed to the measured one, or to the nominal one where none is measured.

    ratio: of the newest window; middle: around which the measured speed is refined; scores: evidence for trial ratios
    of the nominal speed; calm: windows of a plain comb and little else so far.
    """

    ratio: float = 1.0
    middle: float = 1.0
    scores: Array | None = None
    calm: int = 0

    @property
    def sure(self) -> bool:
        """True where another ratio is no longer sought far away."""
        return self.calm >= SURE


@dataclass(frozen=True)
class Search:
    """Where the ratio of a window is sought: from `ratio` within `band`; and `wide`, where it must be far better."""

    ratio: float
    band: tuple[float, float]
    wide: tuple[float, float] | None


def search(config: ChatterConfig, belief: Belief, p: Prepared, turned: Rotation, measured: bool, far: bool,
           background: Background) -> tuple[Belief, Search]:
    """Belief and search of a window before its features are known.

    measured: the speed is; far: look for another ratio far from the one believed; background: of air.
    """
    tooth_frequency = config.principal_teeth * turned.mean / (2 * math.pi)
    if not measured:
        grid = ratio_grid(config.nominal_band)
        new = _ratio_scores(config, spectrum(p.samples, p.rate, p.top), turned.mean / (2 * math.pi), grid)
        scores = new if belief.scores is None else SCORE_MEMORY * belief.scores + (1 - SCORE_MEMORY) * new
        middle = best_ratio(grid, scores)[0]
        belief = replace(belief, scores=scores, ratio=middle, middle=middle)
    elif far and turned.spread < NARROW:
        whole = spectrum(p.samples, p.rate, p.top)
        middle = overruled(whole, tooth_frequency, ratio_grid(config.nominal_band), belief.middle, config.axis_band)
        if loud(config, background, float(whole.power.sum())):
            middle = told_by_strongest(whole, tooth_frequency, middle, config.band[0], config.nominal_band,
                                       config.axis_band)
        belief = replace(belief, middle=middle)
    turns = float(turned.turns[-1] - turned.turns[0])
    told = min(config.nominal_band, PULL / (config.principal_teeth * turns))
    band = (belief.middle - config.axis_band, belief.middle + config.axis_band)
    wide = (belief.middle - told, belief.middle + told) if far and told > config.axis_band else None
    return belief, Search(min(band[1], max(band[0], belief.ratio)), band, wide)


def after(belief: Belief, f: Features) -> Belief:
    """Belief after a window of features `f`: a calm one moves its middle."""
    calm = plain_comb(f) and abs(math.log(f.change)) < 0.3 and sum(x.energy for x in f.lines) < CALM * f.synchronous
    if not calm:
        return replace(belief, ratio=f.speed_ratio)
    return replace(belief, ratio=f.speed_ratio, middle=f.speed_ratio, calm=min(SURE, belief.calm + 1))


def _ratio_scores(config: ChatterConfig, whole: Spectrum, frequency: float, grid: Array) -> Array:
    """Evidence for each ratio of true to nominal speed; large departures need more of it."""
    scores = comb_score(whole, config.principal_teeth * frequency, grid)
    strongest = lines(whole, config.band[0], 100.0, 1)
    if strongest:
        scores = scores + family_score(whole, strongest[0].frequency, frequency, config.principal_teeth, grid)
    found: Array = scores - 0.3 * ((grid - 1) / config.nominal_band) ** 2
    return found
