"""Loads along the axis states of a machine: what the force predictor publishes and what a comparison stands on."""

from __future__ import annotations

from functools import lru_cache

from turnmill_core.cutting.loads import CuttingLoads, cutting_loads
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes
from turnmill_core.operation import Conditions, Operation


class LoadsFollower:
    """Predicts at most `rate` [Hz] times a second of axis time; the same states give the same loads."""

    def __init__(self, rate: float) -> None:
        self._period_ns, self._next_ns = round(1e9 / rate), 0
        self._loads = lru_cache(maxsize=64)(cutting_loads)

    def due(self, stamp_ns: int) -> bool:
        """Whether a prediction is due at a state of this time; after a jump back of ten periods it is."""
        if self._next_ns - 10 * self._period_ns <= stamp_ns < self._next_ns:
            return False
        self._next_ns = stamp_ns + self._period_ns
        return True

    def loads(self, operation: Operation, axes: AxisState) -> CuttingLoads:
        """Loads at an axis state. Raises ValueError where the model does not describe the cut."""
        return self._loads(operation, rounded(conditions_from_axes(operation, axes)))

    def restart(self) -> None:
        """Forget what was before: the next state is due."""
        self._next_ns = 0


def rounded(conditions: Conditions) -> Conditions:
    """Conditions with nine significant digits, so that rounding in the axis positions is no new cut."""
    def nine(value: float) -> float:
        return float(f"{value:.9g}")

    lower, upper = conditions.cross_feed_span
    return Conditions(
        nine(conditions.tool_speed), nine(conditions.workpiece_speed), nine(conditions.depth),
        nine(conditions.feed_speed), (nine(lower), nine(upper)), nine(conditions.effective_radius))
