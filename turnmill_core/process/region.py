"""The feasible region: margins of every limit over tool speed and depth at one workpiece speed and one feed.

Thesis Figures 5.10 and 5.11. Where nothing is feasible, `conflicts` says which limits exclude each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.engagement import removal_rate
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.process.cut_values import (
    LoadTable,
    Progress,
    feed_of,
    grid_values,
    surface_feed_per_tooth,
)
from turnmill_core.process.limits import CutValues, LimitMargin, limit_margins

Floats = NDArray[np.float64]

TINY = 1e-9
"""A margin above minus this counts as met: a cut exactly at its limit."""


@dataclass(frozen=True, eq=False)
class Region:
    """Margins over depths (m,) [m] and tool_speeds (n,) [rad/s] at one workpiece_speed [rad/s].

    op: the operation, with the feed of this region. values, margins: arrays (m, n) inside. rate (m,) [m3/s]: material
    removal rate, which depends on the depth only (turn-milling), (m, n) in milling.
    """

    op: Operation
    workpiece_speed: float
    tool_speeds: Floats
    depths: Floats
    values: CutValues
    margins: tuple[LimitMargin, ...]
    rate: Floats

    @property
    def feed(self) -> float:
        """Axial feed [m/rev], or feed per tooth [m] in milling."""
        return feed_of(self.op)

    @cached_property
    def stacked(self) -> Floats:
        """Margins of all limits, (limits, m, n)."""
        shape = self.depths.size, self.tool_speeds.size
        if not self.margins:
            return np.full((1, *shape), math.inf)
        return np.stack([np.broadcast_to(m.margin, shape) for m in self.margins])

    @cached_property
    def least(self) -> Floats:
        """Smallest margin of all limits, (m, n)."""
        return np.asarray(self.stacked.min(axis=0), dtype=np.float64)

    @cached_property
    def binding(self) -> NDArray[np.intp]:
        """Index of the limit with the smallest margin, (m, n)."""
        return np.asarray(self.stacked.argmin(axis=0), dtype=np.intp)

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Where every limit is met, (m, n)."""
        return np.asarray(self.least >= -TINY)

    @cached_property
    def depth_limit(self) -> Floats:
        """Deepest feasible depth [m] at each tool speed (n,), 0 where there is none.

        Between two depths of the grid each margin is taken as linear.
        """
        limit = np.zeros(self.tool_speeds.size)
        for j in np.flatnonzero(self.feasible.any(axis=0)):
            last = int(np.flatnonzero(self.feasible[:, j])[-1])
            limit[j] = self.depths[last]
            if last + 1 < self.depths.size:
                here, beyond = np.maximum(self.stacked[:, last, j], 0.0), self.stacked[:, last + 1, j]
                fails = beyond < 0
                share = np.divide(here[fails], here[fails] - beyond[fails])
                limit[j] += (self.depths[last + 1] - self.depths[last]) * float(share.min())
        return limit

    def speed_intervals(self, depth: float) -> list[tuple[float, float]]:
        """Intervals of tool speed [rad/s] in which at least `depth` [m] is feasible (thesis Eq. 5.8).

        Between two speeds of the grid the depth limit is taken as linear, unless one of them allows no cut at all.
        """
        speed, limit = self.tool_speeds, self.depth_limit
        runs = limit >= depth * (1 - TINY)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], runs, [False]]).astype(int)))

        def end(inside: int, outside: int) -> float:
            if not 0 <= outside < speed.size or limit[outside] == 0:
                return float(speed[inside])
            share = (limit[inside] - depth) / (limit[inside] - limit[outside])
            return float(speed[inside] + max(share, 0.0) * (speed[outside] - speed[inside]))

        return [(end(a, a - 1), end(b - 1, b)) for a, b in edges.reshape(-1, 2)]


def speed_edges(op: Operation, table: LoadTable, workpiece_speed: float) -> Floats:
    """Tool speeds [rad/s] at which a limit that knows only speeds and chip load is just met; they belong on the grid.

    table: loads of `op`; workpiece_speed [rad/s].
    """
    limits, found = op.limits, []
    found += [limits.tool_speed_min, limits.tool_speed_max]
    found += [limits.cutting_speed_min / op.tool.radius, limits.cutting_speed_max / op.tool.radius]
    if op.process != "milling":
        if limits.chip_load == "thickness":
            chip = table.at(table.ratios)["chip_thickness"].max(axis=0) / table.ratios
            path = float(chip.mean())
        else:
            path = float(surface_feed_per_tooth(op, 1.0, 1.0))
        found += [path * abs(workpiece_speed) / c for c in (limits.chip_load_min, limits.chip_load_max) if c]
    values = np.array(sorted(set(found)))
    return np.asarray(values[(values > 0) & np.isfinite(values)], dtype=np.float64)


def region(
    op: Operation, table: LoadTable, tool_speeds: Floats, workpiece_speed: float, scan: int = 16,
    progress: Progress | None = None,
) -> Region:
    """Margins of every limit of `op` over the table's depths and tool_speeds (n,) at one workpiece_speed [rad/s].

    tool_speeds [rad/s]; the speeds of :func:`speed_edges` within their range are added. table, scan, progress: as in
    grid_values.
    """
    edges = speed_edges(op, table, workpiece_speed)
    edges = edges[(edges > tool_speeds[0]) & (edges < tool_speeds[-1])]
    speeds = np.unique(np.concatenate([tool_speeds, edges]))
    values = grid_values(op, table, speeds, workpiece_speed, scan, progress)
    rate = np.array([removal_rate(op, with_cut(op, depth=float(a), workpiece_speed=workpiece_speed))
                     for a in table.depths])
    if op.process == "milling":
        rate = rate[:, None] * speeds / op.conditions.tool_speed
    return Region(op, workpiece_speed, speeds, table.depths, values, limit_margins(op.limits, values), rate)


@dataclass(frozen=True, eq=False)
class Conflict:
    """Limits that cannot be met together at one workpiece speed and feed.

    limits: names; margins (k,) [1]: what each has left in the cut that comes nearest to meeting them, where the
    smallest of them is `shortfall` [1], below 0; values, bounds (k,): theirs there, in `units`. tool_speed [rad/s],
    depth [m]: that cut. asks, allows [rad/s]: lowest tool speed that the first limit asks for and highest that the
    second allows at that depth; NaN where they do not exclude each other by speed.
    """

    limits: tuple[str, ...]
    margins: tuple[float, ...]
    values: tuple[float, ...]
    bounds: tuple[float, ...]
    units: tuple[str, ...]
    tool_speed: float
    depth: float
    asks: float = math.nan
    allows: float = math.nan

    @property
    def shortfall(self) -> float:
        """Smallest margin [1] of the cut that comes nearest."""
        return min(self.margins)


def conflicts(found: Region) -> tuple[Conflict, ...]:
    """The smallest sets of limits that no cut of a region meets together, the worst first; empty where some cut is."""
    if found.feasible.any():
        return ()
    met = found.stacked >= -TINY
    for size in range(1, len(found.margins) + 1):
        sets = [s for s in combinations(range(len(found.margins)), size) if not met[list(s)].all(axis=0).any()]
        if sets:
            return tuple(sorted((_conflict(found, s) for s in sets), key=lambda c: c.shortfall))
    raise AssertionError("all limits together exclude every cut")


def _conflict(found: Region, chosen: tuple[int, ...]) -> Conflict:
    together = found.stacked[list(chosen)].min(axis=0)
    i, j = (int(k) for k in np.unravel_index(int(together.argmax()), together.shape))
    order = list(chosen)
    asks = allows = math.nan
    if len(order) == 2:
        for first, second in (order, order[::-1]):
            high = np.flatnonzero(found.stacked[first][i] >= -TINY)
            low = np.flatnonzero(found.stacked[second][i] >= -TINY)
            if high.size and low.size and high[0] > low[-1]:
                order = [first, second]
                asks, allows = float(found.tool_speeds[high[0]]), float(found.tool_speeds[low[-1]])
    limits = [found.margins[k] for k in order]

    def here(values: float | Floats) -> float:
        return float(np.broadcast_to(values, together.shape)[i, j])

    return Conflict(
        limits=tuple(m.name for m in limits), margins=tuple(here(m.margin) for m in limits),
        values=tuple(here(m.value) for m in limits), bounds=tuple(here(m.bound) for m in limits),
        units=tuple(m.unit for m in limits), tool_speed=float(found.tool_speeds[j]), depth=float(found.depths[i]),
        asks=asks, allows=allows)
