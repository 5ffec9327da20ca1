"""The operation's cutting trials beside what is computed at the same cuts."""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_stability import Trial
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.margin import StabilityPoint, stability_point

MARGINAL = 0.1
"""A marginal cut agrees where the growth in a tooth period, |ln|mu||, is below this."""


@dataclass(frozen=True, eq=False)
class JudgedTrial:
    """A trial, the stability computed at its cut, and whether they agree."""

    trial: Trial
    point: StabilityPoint
    agrees: bool


def judged_trials(op: Operation, delay_model: DelayModel = "mean") -> tuple[JudgedTrial, ...]:
    """Every trial of `op`, judged; delay_model and errors as in stability_point."""
    return tuple(_judged(op, trial, delay_model) for trial in op.trials)


def _judged(op: Operation, trial: Trial, delay_model: DelayModel) -> JudgedTrial:
    cut = with_cut(op, trial.tool_speed, trial.workpiece_speed, trial.depth)
    point = stability_point(op, cut, delay_model)
    if trial.outcome == "marginal":
        teeth = point.principal_period * trial.tool_speed * op.tool.teeth / (2 * math.pi)
        agrees = abs(math.log(point.spectral_radius)) / teeth < MARGINAL
    else:
        agrees = (trial.outcome == "stable") == (point.predicted_type is PredictedType.STABLE)
    return JudgedTrial(trial, point, agrees)
