"""Stability diagrams: every point of a grid, or the boundary only."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation, require
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.floquet import kinds
from turnmill_core.stability.operating_point import depth_family
from turnmill_core.stability.search import StableDepths, stable_depths
from turnmill_core.structure.at import Position

Floats = NDArray[np.float64]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Lobes:
    """Stability diagram at one workpiece speed.

    workpiece_speed [rad/s]; tool_speeds (n,) [rad/s]; depths (m,) [m]; spectral_radius (m, n) [1];
    predicted_type (m, n), values of PredictedType; depth_limit (n,) [m], the lowest stability limit at
    each tool speed, the largest depth where there is none.
    """

    workpiece_speed: float
    tool_speeds: Floats
    depths: Floats
    spectral_radius: Floats
    predicted_type: NDArray[np.uint8]
    depth_limit: Floats


@dataclass(frozen=True, eq=False)
class Boundary:
    """Stability boundary at one workpiece speed.

    workpiece_speed [rad/s]; tool_speeds (n,) [rad/s]; deepest [m]: searched depth; stable: for each tool speed the
    stable depth intervals and the types of chatter at their ends, refined.
    """

    workpiece_speed: float
    tool_speeds: Floats
    deepest: float
    stable: tuple[StableDepths, ...]

    @property
    def depth_limit(self) -> Floats:
        """Lowest stability limit (n,) [m]; the searched depth where there is none."""
        return np.array([s.intervals[0, 1] if s.intervals.size and s.intervals[0, 0] == 0 else 0.0
                         for s in self.stable])


def stability_lobes(
    op: Operation, tool_speeds: Sequence[float] | Floats, depths: Sequence[float] | Floats,
    workpiece_speed: float | None = None, progress: Progress | None = None, delay_model: DelayModel = "mean",
    position: Position | None = None,
) -> Lobes:
    """Stability diagram over tool_speeds [rad/s] and depths [m], both ascending; every point is classified.

    workpiece_speed [rad/s] (None: the operation's). progress: called with (done, total) tool speeds.
    delay_model, position: as in stability_problem. Raises ``ValueError`` for values that are not positive, not
    ascending, or beyond the flute length.
    """
    speed, depth = _ascending("tool speeds", tool_speeds, "rad/s"), _ascending("depths", depths, "m")
    conditions = with_cut(op, tool_speed=float(speed[0]), workpiece_speed=workpiece_speed, depth=float(depth[-1]))
    family = depth_family(op, conditions, float(depth[-1]), delay_model, position)
    series = family.series(depth)
    multipliers = np.empty((depth.size, speed.size), dtype=np.complex128)
    for j, s in enumerate(speed):
        multipliers[:, j] = family.multipliers(series, float(s))
        if progress is not None:
            progress(j + 1, speed.size)
    radius, kind = np.abs(multipliers), kinds(multipliers)
    limit = lowest_limit(depth, np.log(radius), np.array([family.free_decay(float(s)) for s in speed]))
    return Lobes(conditions.workpiece_speed, speed, depth, radius, kind, limit)


def stability_boundary(
    op: Operation, tool_speeds: Sequence[float] | Floats, deepest: float, workpiece_speed: float | None = None,
    progress: Progress | None = None, delay_model: DelayModel = "mean", scan: int = 16,
    position: Position | None = None,
) -> Boundary:
    """Stable depth intervals up to `deepest` [m] at each of tool_speeds [rad/s], edges refined.

    workpiece_speed [rad/s], progress, delay_model, position: as in stability_lobes. scan: depths sampled at each speed
    before the edges are refined; an island thinner than deepest / scan may be missed.
    """
    speed = _ascending("tool speeds", tool_speeds, "rad/s")
    conditions = with_cut(op, tool_speed=float(speed[0]), workpiece_speed=workpiece_speed, depth=deepest)
    family = depth_family(op, conditions, deepest, delay_model, position)
    series = family.series(np.linspace(0.0, deepest, scan + 1)[1:])
    found = []
    for j, s in enumerate(speed):
        found.append(stable_depths(family, float(s), scan=scan, series=series))
        if progress is not None:
            progress(j + 1, speed.size)
    return Boundary(conditions.workpiece_speed, speed, deepest, tuple(found))


def lowest_limit(depths: Floats, excess: Floats, at_zero: Floats) -> Floats:
    """Depth [m] (n,) at which ln|mu| first passes 0 in each column of `excess` (m, n), else the largest of `depths`.

    at_zero (n,): ln|mu| at depth 0. Between depths ln|mu| is taken as linear.
    """
    limit = np.full(excess.shape[1], depths[-1])
    for j, column in enumerate(excess.T):
        unstable = np.flatnonzero(column >= 0)
        if at_zero[j] >= 0:
            limit[j] = 0.0
        elif unstable.size:
            place = np.concatenate([[0.0], depths[:unstable[0] + 1]])[-2:]
            value = np.concatenate([[at_zero[j]], column[:unstable[0] + 1]])[-2:]
            limit[j] = place[0] - value[0] * (place[1] - place[0]) / (value[1] - value[0])
    return limit


def _ascending(name: str, values: Sequence[float] | Floats, unit: str) -> Floats:
    array = np.array(values, dtype=np.float64)
    ok = array.ndim == 1 and array.size > 0 and np.all(np.isfinite(array)) and array[0] > 0
    require(bool(ok and np.all(np.diff(array) > 0)), name, array.tolist(), unit, "ascending numbers > 0")
    return array
