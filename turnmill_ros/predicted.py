"""What is predicted of the cut at an axis state, computed anew only where the cut has changed."""

from __future__ import annotations

import math
from typing import NamedTuple

from turnmill_core.cutting.runout import half_order_share
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes
from turnmill_core.operation import Conditions, Operation
from turnmill_core.prediction import Prior, flip_multiplier
from turnmill_core.stability.margin import StabilityPoint, stability_point
from turnmill_core.stability.operating_point import structure_key
from turnmill_core.structure.at import Position

CHANGE = 0.005
"""Relative change of speed, depth or immersion that is a new cut."""


class Cut(NamedTuple):
    """A cut on a grid of small relative steps, and its operation."""

    operation: str
    tool_speed: int
    workpiece_speed: int
    depth: int
    lower: int
    upper: int
    structure: tuple[int, ...]


def grid(cut: Conditions, operation: Operation, position: Position, change: float = CHANGE) -> Cut:
    """The cut in steps of `change` relative to the operation: equal for cuts that differ less than a step.

    position: axis positions, on which the structure may depend.
    """
    nominal, radius = operation.conditions, operation.tool.radius

    def steps(value: float, scale: float) -> int:
        return round(value / (change * abs(scale))) if scale else 0

    return Cut(operation.sha256, steps(cut.tool_speed, nominal.tool_speed),
               steps(cut.workpiece_speed, nominal.workpiece_speed), steps(max(cut.depth, 0.0), nominal.depth),
               steps(cut.cross_feed_span[0], radius), steps(cut.cross_feed_span[1], radius),
               structure_key(operation, cut, position, change))


class Predictor:
    """Gives the prior of the cut at an axis state; the same states in the same order give the same priors."""

    def __init__(self) -> None:
        self._known: tuple[Cut, StabilityPoint] | None = None

    def prior(self, operation: Operation, axes: AxisState) -> Prior | None:
        """Predicted type, spectral radius and chatter frequency, stamped as `axes`.

        None where the model describes no such cut: a rigid structure, axes where no cut is described.
        """
        try:
            cut = conditions_from_axes(operation, axes)
            key = grid(cut, operation, axes.position)
            if self._known is None or self._known[0] != key:
                self._known = key, stability_point(operation, cut, position=axes.position)
        except ValueError:
            self._known = None
            return None
        point = self._known[1]
        return Prior(axes.stamp_ns, point.predicted_type, point.spectral_radius, point.chatter_frequency,
                     flip_multiplier(complex(m) for m in point.multipliers))


def explained_by_runout(operation: Operation) -> float:
    """Share of half-order lines that the operation's runout gives the force of its nominal cut; NaN: not known."""
    try:
        return half_order_share(operation, operation.conditions)
    except ValueError:
        return math.nan
