"""What the command lobes computed, as one value for pictures, JSON and CSV."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnmill_core.operation import Conditions, Operation
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.lobes import Boundary, Lobes
from turnmill_core.stability.low_speed import LowSpeed, envelope_depth
from turnmill_core.stability.margin import StabilityPoint
from turnmill_core.stability.trials import JudgedTrial

RPM = 60 / (2 * math.pi)


@dataclass(frozen=True, eq=False)
class Diagrams:
    """Stability diagrams of one operation, one for each workpiece speed, ascending.

    parts: maps or boundaries, all over the same tool speeds and depths; cut, point: the operating point and its
    stability; trials: the operation's; delay_model: by name; low_speed: limits with and without process damping, where
    they were asked for.
    """

    op: Operation
    cut: Conditions
    point: StabilityPoint
    parts: tuple[Lobes | Boundary, ...]
    trials: tuple[JudgedTrial, ...]
    delay_model: str
    low_speed: LowSpeed | None = None

    @property
    def deepest(self) -> float:
        """Largest depth [m] of the diagrams."""
        first = self.parts[0]
        return float(first.depths[-1]) if isinstance(first, Lobes) else first.deepest

    def trials_at(self, workpiece_speed: float) -> tuple[JudgedTrial, ...]:
        """The trials at a workpiece speed [rad/s], to a hundredth, that lie in the diagram."""
        return tuple(t for t in self.trials
                     if self._shows(t.trial.workpiece_speed, t.trial.tool_speed, workpiece_speed))

    def cut_at(self, workpiece_speed: float) -> bool:
        """Whether the operating point lies in the diagram of a workpiece speed [rad/s]."""
        return self._shows(self.cut.workpiece_speed, self.cut.tool_speed, workpiece_speed)

    def _shows(self, workpiece_speed: float, tool_speed: float, of: float) -> bool:
        speeds = self.parts[0].tool_speeds
        return abs(workpiece_speed - of) <= 0.01 * abs(of) and bool(speeds[0] <= tool_speed <= speeds[-1])


def diagrams_document(found: Diagrams) -> dict[str, Any]:
    """JSON document, SI units; predicted_type holds names by their number in `types`."""
    point = found.point
    return {
        "operation": found.op.name, "operation_sha256": found.op.sha256, "delay_model": found.delay_model,
        "kind": "map" if isinstance(found.parts[0], Lobes) else "boundary",
        "types": {kind.name: kind.value for kind in PredictedType},
        "tool_speeds_rad_s": found.parts[0].tool_speeds, "deepest_m": found.deepest,
        "point": {
            "tool_speed_rad_s": found.cut.tool_speed, "workpiece_speed_rad_s": found.cut.workpiece_speed,
            "depth_m": found.cut.depth, "predicted_type": point.predicted_type.name,
            "spectral_radius": point.spectral_radius, "chatter_frequency_hz": point.chatter_frequency},
        "diagrams": [_part(part) for part in found.parts],
        "trials": [{
            "tool_speed_rad_s": t.trial.tool_speed, "workpiece_speed_rad_s": t.trial.workpiece_speed,
            "depth_m": t.trial.depth, "outcome": t.trial.outcome, "chatter_frequency_hz": t.trial.chatter_frequency,
            "note": t.trial.note, "predicted_type": t.point.predicted_type.name,
            "spectral_radius": t.point.spectral_radius, "predicted_frequency_hz": t.point.chatter_frequency,
            "agrees": t.agrees} for t in found.trials],
        "low_speed": None if found.low_speed is None else _low_speed(found.low_speed),
    }


def _low_speed(low: LowSpeed) -> dict[str, Any]:
    envelope = low.envelope
    return {
        "tool_speeds_rad_s": low.tool_speeds, "limit_without_process_damping_m": low.undamped,
        "limit_with_process_damping_m": low.damped, "radial_immersion_ratio": low.immersion, "warning": low.warning,
        "envelope_limit_m": None if envelope is None else envelope.depth_limit,
        "envelope_asymptotic_speed_rad_s": None if envelope is None else envelope.asymptotic_speed,
        "envelope_m": None if envelope is None else envelope_depth(envelope, low.tool_speeds),
        "ploughing_coefficient_n_m": low.ploughing}


def low_speed_curves(found: Diagrams, low: LowSpeed) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Limits [mm] over tool speed by name; NaN above the searched depth."""
    named = {"without process damping": low.undamped, "with process damping": low.damped}
    if low.envelope is not None:
        named["envelope through two trials"] = envelope_depth(low.envelope, low.tool_speeds)
    return {k: np.where(v < found.deepest * (1 - 1e-9), v * 1e3, np.nan) for k, v in named.items()}


def _part(part: Lobes | Boundary) -> dict[str, Any]:
    base = {"workpiece_speed_rad_s": part.workpiece_speed, "depth_limit_m": part.depth_limit}
    if isinstance(part, Lobes):
        return base | {"depths_m": part.depths, "spectral_radius": part.spectral_radius,
                       "predicted_type": part.predicted_type}
    return base | {"stable_depths_m": [s.intervals for s in part.stable],
                   "types_at_their_ends": [s.types for s in part.stable]}


def diagrams_csv(found: Diagrams) -> str:
    """One row a point of a map, or a stable depth interval of a boundary; units in the header."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    speeds = ("workpiece speed [rpm]", "tool speed [rpm]")
    if isinstance(found.parts[0], Lobes):
        write((*speeds, "depth [mm]", "largest multiplier [1]", "type"))
    else:
        write((*speeds, "stable from [mm]", "stable to [mm]", "type below", "type above"))
    for part in found.parts:
        for j, speed in enumerate(part.tool_speeds):
            start = (f"{part.workpiece_speed * RPM:.8g}", f"{speed * RPM:.8g}")
            if isinstance(part, Lobes):
                for i, depth in enumerate(part.depths):
                    write((*start, f"{depth * 1e3:.8g}", f"{part.spectral_radius[i, j]:.8g}",
                           PredictedType(int(part.predicted_type[i, j])).name))
            else:
                for (low, high), (below, above) in zip(*part.stable[j], strict=True):
                    write((*start, f"{low * 1e3:.8g}", f"{high * 1e3:.8g}",
                           *(PredictedType(int(kind)).name for kind in (below, above))))
    return text.getvalue()


def limit_surface(found: Diagrams) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Lowest depth limits (workpiece speeds, tool speeds) [m]."""
    return np.stack([part.depth_limit for part in found.parts])
