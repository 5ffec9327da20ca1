"""Flip chatter or runout: what half-order lines are, with an even number of teeth.

Both have lines at the same harmonics of the spindle, so the signal alone cannot tell. Two things outside it can: a
prediction of stability, and a runout that has been measured. The first says whether the cut could flip; the second how
strong the lines are without: flip chatter grows until teeth leave the cut, far beyond what a small runout does.
"""

from __future__ import annotations

import math
from enum import Enum

from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.verdict import ChatterKind, Reason
from turnmill_core.prediction import PredictedType, Prior

NEAR_FLIP = 0.92
"""Predicted magnitude of a multiplier near -1 from which half-order lines are flip: models are no better than that."""

WITHIN, ABOVE, GROWN = 8.0, 30.0, 0.5
"""Half-order energy over all other energy, as a multiple of what the known runout gives the force: below WITHIN it is
runout, unless it is more than GROWN of all, as flip chatter often is that has grown; from ABOVE flip. Between force
and sensor resonances raise some lines over others. In simulated cuts of the training numbers, runout and flip with as
much runout, these bounds judge 2 % of the windows wrongly and leave 10 % undecided."""


class Says(Enum):
    """What one piece of evidence says."""

    NOTHING = 0
    FLIP = 1
    RUNOUT = 2


def half_order(config: ChatterConfig, half: float, prior: Prior | None) -> tuple[ChatterKind, Reason, str]:
    """State, reason and text for half-order lines that hold a share `half` of the synchronous energy.

    An odd number of teeth: flip. An even one: what the prior and the known runout (config.runout_share) say; where they
    contradict each other or both say nothing, FLIP_OR_RUNOUT.
    """
    text = f"lines at odd multiples of half the tooth passing frequency, {100 * half:.0f} % of the synchronous energy"
    if config.odd:
        return ChatterKind.FLIP, Reason.HALF_ORDER, text
    predicted, known = _prior(prior), _runout(config, half)
    if not math.isnan(config.runout_share):
        text += f"; of the force, known runout gives them {_percent(config.runout_share)} %"
    if Says.NOTHING not in (predicted, known) and predicted is not known:
        return ChatterKind.FLIP_OR_RUNOUT, Reason.CONTRADICTION, text + (
            "; predicted: flip, or close to it, but runout explains them" if predicted is Says.FLIP
            else "; not predicted to flip, but runout does not explain them")
    if predicted is Says.FLIP:
        return ChatterKind.FLIP, Reason.PRIOR_FLIP, text + "; predicted: flip, or close to it"
    if predicted is Says.RUNOUT:
        return ChatterKind.STABLE, Reason.PRIOR_RUNOUT, text + "; not predicted to flip: runout"
    if known is Says.FLIP:
        return ChatterKind.FLIP, Reason.ABOVE_RUNOUT, text + ": flip"
    if known is Says.RUNOUT:
        return ChatterKind.STABLE, Reason.KNOWN_RUNOUT, text + ": runout"
    return ChatterKind.FLIP_OR_RUNOUT, Reason.NO_PRIOR, text + "; flip or runout: no prediction" + (
        " and no known runout" if math.isnan(config.runout_share) else ", and a resonance could make as much of them")


def _prior(prior: Prior | None) -> Says:
    if prior is None or prior.predicted_type in (PredictedType.UNKNOWN, PredictedType.NO_CUT):
        return Says.NOTHING
    flips = prior.predicted_type is PredictedType.FLIP or prior.flip_multiplier > NEAR_FLIP
    return Says.FLIP if flips else Says.RUNOUT


def _runout(config: ChatterConfig, half: float) -> Says:
    """What the measured share says against the one of a known runout, both as energy over all other energy."""
    known = config.runout_share
    if math.isnan(known):
        return Says.NOTHING
    measured, expected = half * (1 - known), known * (1 - half)
    if measured > ABOVE * expected:
        return Says.FLIP
    return Says.RUNOUT if measured < WITHIN * expected and half < GROWN else Says.NOTHING


def _percent(share: float) -> str:
    return f"{100 * share:.2g}"
