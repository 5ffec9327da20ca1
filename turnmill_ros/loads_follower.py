"""Loads along the axis states of a machine: what the force predictor publishes and what a comparison stands on."""

from __future__ import annotations

from turnmill_core.cutting.along_path import Followed, Method, follow
from turnmill_core.cutting.swept import SweptWorkpiece
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation


class LoadsFollower:
    """Predicts at most `rate` [Hz] times a second of axis time; the same states give the same loads."""

    def __init__(self, rate: float, method: Method = "auto") -> None:
        self._period_ns, self._next_ns, self._method = round(1e9 / rate), 0, method
        self._operation = ""
        self._workpiece: SweptWorkpiece | None = None

    def due(self, stamp_ns: int) -> bool:
        """Whether a prediction is due at a state of this time; after a jump back of ten periods it is."""
        if self._next_ns - 10 * self._period_ns <= stamp_ns < self._next_ns:
            return False
        if stamp_ns < self._next_ns:  # a new start: the workpiece is whole again
            self._workpiece = None
        self._next_ns = stamp_ns + self._period_ns
        return True

    def loads(self, operation: Operation, axes: AxisState) -> Followed:
        """Loads at an axis state. Raises ValueError where the model does not describe the cut."""
        if operation.sha256 != self._operation:
            self._operation, self._workpiece = operation.sha256, None
        self._workpiece, found = follow(operation, self._workpiece, axes, self._method)
        return found
