"""What the limits look at: of one cut exactly, and of whole grids of speeds and depths quickly.

Rigid loads of a turn-milling cut depend on depth, feed per revolution and the ratio of the two spindle speeds only: the
engagement does not change with the speeds, and the chip grows with workpiece speed over tool speed. So one table over
depth and ratio holds for every pair of speeds. Without runout every force is linear in the ratio at each tool angle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.loads import CuttingLoads, cutting_loads
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.process.limits import CutValues, nearest_stable
from turnmill_core.process.surface import form_error
from turnmill_core.stability.lobes import stability_boundary
from turnmill_core.stability.margin import stability_margin

Floats = NDArray[np.float64]
Progress = Callable[[float], None]

RATIOS, RUNOUT_RATIOS = 7, 25
"""Speed ratios of a load table, without and with runout."""
LOADS = ("chip_thickness", "tool_torque", "tool_torque_mean", "workpiece_torque", "workpiece_torque_mean",
         "tool_force", "feed_force")


def with_feed(op: Operation, feed: float) -> Operation:
    """`op` with another `feed`: axial feed [m/rev] in turn-milling, feed per tooth [m] in milling.

    In turn-milling the radial immersion is the axial feed and changes with it. Raises ValueError for an axial feed
    above the tool radius.
    """
    nominal, R = op.conditions, op.tool.radius
    if op.process == "milling":
        speed = feed * op.tool.teeth * nominal.tool_speed / (2 * math.pi)
        return replace(op, feed_per_tooth=feed, conditions=replace(nominal, feed_speed=speed))
    require(0 < feed <= R * (1 + 1e-12), "axial feed", feed, "m/rev", f"in (0, {R}] m/rev, the tool radius")
    span = (R - feed, R) if sum(nominal.cross_feed_span) > 0 else (-R, -R + feed)
    speed = feed * abs(nominal.workpiece_speed) / (2 * math.pi)
    return replace(op, axial_feed=feed, conditions=replace(nominal, feed_speed=speed, cross_feed_span=span))


def flexible(op: Operation) -> bool:
    """Whether tool or workpiece can vibrate, so that stability is a limit."""
    return op.tool.structure.flexible or op.workpiece.structure.flexible or op.workpiece.beam is not None


def feed_of(op: Operation) -> float:
    """Axial feed [m/rev] in turn-milling, feed per tooth [m] in milling."""
    return op.feed_per_tooth if op.process == "milling" else op.axial_feed


def surface_feed_per_tooth(op: Operation, tool_speed: float | Floats, workpiece_speed: float) -> float | Floats:
    """Resultant feed per tooth [m] at the surface of the bar (thesis section 5.2.1): hypot(pi D_w, f_a) Omega_c.

    tool_speed [rad/s], any shape; workpiece_speed [rad/s]. In milling the feed per tooth itself.
    """
    if op.process == "milling":
        return op.feed_per_tooth + 0 * np.asarray(tool_speed)
    path = math.hypot(2 * math.pi * op.workpiece.radius, op.axial_feed)
    return path * abs(workpiece_speed) / (op.tool.teeth * np.asarray(tool_speed))


def _load_values(op: Operation, loads: CuttingLoads) -> tuple[float, ...]:
    """The fields of LOADS."""
    across = float(np.hypot(loads.force_tool[:, 0], loads.force_tool[:, 1]).max())
    along = abs(float(loads.force_machine_peak[0 if op.process == "milling" else 2]))
    return (loads.chip_thickness_max, abs(loads.tool_torque_peak), loads.tool_torque_mean,
            abs(loads.workpiece_torque_peak), abs(loads.workpiece_torque_mean), across, along)


def cut_values(op: Operation, conditions: Conditions) -> CutValues:
    """Values of one cut, each from its own full model. Raises ValueError as the models do."""
    values = dict(zip(LOADS, _load_values(op, cutting_loads(op, conditions)), strict=True))
    lower, upper = math.nan, math.nan
    if flexible(op):
        deepest = searched_depth(op, conditions.depth, ahead=2.0)
        found = stability_margin(op, conditions, depth_search=deepest, speed_search=False)
        ends = nearest_stable(found.stable_depths, np.asarray(conditions.depth), deepest)
        lower, upper = float(ends[0]), float(ends[1])
    return CutValues(
        tool_speed=conditions.tool_speed, workpiece_speed=abs(conditions.workpiece_speed), depth=conditions.depth,
        cutting_speed=op.tool.radius * conditions.tool_speed, feed_speed=conditions.feed_speed,
        feed_per_tooth=float(surface_feed_per_tooth(op, conditions.tool_speed, conditions.workpiece_speed)),
        duration=op.workpiece.length / conditions.feed_speed, stable_from=lower, stable_to=upper,
        form_error=math.nan if op.process == "milling" else form_error(op, conditions).total, **values,
    )


def form_errors(op: Operation, depths: Floats, tool_speeds: Floats, workpiece_speed: float) -> Floats:
    """Form error [m] at depths (m,) [m] and tool_speeds (n,) [rad/s], NaN in milling: array (m, n).

    workpiece_speed [rad/s]. Computed on a coarser grid; between its points it is linear in the depth and in the tooth
    period, which is exact for the cusp and closer than 1 % for the small polygon.
    """
    if op.process == "milling":
        return np.full((depths.size, tool_speeds.size), math.nan)
    axial = flexible(op) and not all(
        s.modes and not any((s.heights, s.cross_modes, s.table, *(m.shape[2] for m in s.modes)))
        for s in (op.tool.structure, op.workpiece.structure) if s.flexible or op.workpiece.beam)
    columns, rows = (np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))
                     for n, most in ((tool_speeds.size, 48 if axial else 16), (depths.size, 8)))
    coarse = np.array([[form_error(op, with_cut(op, float(tool_speeds[j]), workpiece_speed, float(depths[i]))).total
                        for j in columns] for i in rows])
    period = -1 / tool_speeds
    across = np.array([np.interp(period, period[columns], row) for row in coarse])
    return np.array([np.interp(depths, depths[rows], column) for column in across.T]).T


def searched_depth(op: Operation, deepest: float, ahead: float = 1.02) -> float:
    """How deep [m] stability is searched for cuts down to `deepest` [m]: so far that the reserve can be told.

    ahead: how many times as deep, where tool and workpiece allow it.
    """
    wanted = ahead * deepest / (1 - op.limits.stability_margin)
    bounds = op.tool.flute_length, 0.95 * op.workpiece.radius if op.workpiece.is_bar else op.workpiece.height
    return max(min(wanted, *bounds), deepest)


@dataclass(frozen=True, eq=False)
class LoadTable:
    """Loads over depth and speed ratio.

    depths (m,) [m]; ratios (k,) [1], workpiece over tool speed (milling: one, 0); values (7, m, k): fields of LOADS.
    """

    depths: Floats
    ratios: Floats
    values: Floats

    def at(self, ratios: Floats) -> dict[str, Floats]:
        """Each field of LOADS at every depth and each of `ratios` (n,) [1]: arrays (m, n)."""
        if self.ratios.size == 1:
            return {name: np.repeat(v, ratios.size, axis=1) for name, v in zip(LOADS, self.values, strict=True)}
        place = np.clip(np.searchsorted(self.ratios, ratios) - 1, 0, self.ratios.size - 2)
        left, right = self.ratios[place], self.ratios[place + 1]
        share = (ratios - left) / (right - left)
        found = self.values[:, :, place] * (1 - share) + self.values[:, :, place + 1] * share
        return dict(zip(LOADS, found, strict=True))


def load_table(op: Operation, depths: Floats, lowest: float, highest: float, ratios: int | None = None) -> LoadTable:
    """Loads of `op` at depths (m,) [m] and speed ratios from `lowest` to `highest` [1], equally spaced in logarithm.

    ratios: how many, None for RATIOS or RUNOUT_RATIOS; two are exact without runout and edge forces.
    """
    count = ratios or (RUNOUT_RATIOS if any(op.tool.runout) else RATIOS)
    milling = op.process == "milling"
    at = np.zeros(1) if milling else np.geomspace(lowest, highest * (1 + 1e-9), count)
    speed = op.conditions.workpiece_speed
    values = np.empty((len(LOADS), depths.size, at.size))
    for i, depth in enumerate(depths):
        for k, ratio in enumerate(at):
            cut = with_cut(op, depth=float(depth), tool_speed=None if milling else abs(speed) / float(ratio))
            values[:, i, k] = _load_values(op, cutting_loads(op, cut, elements=48))
    return LoadTable(depths, at, values)


def grid_values(
    op: Operation, table: LoadTable, tool_speeds: Floats, workpiece_speed: float, scan: int = 16,
    progress: Progress | None = None,
) -> CutValues:
    """Values at every depth of the table and each of tool_speeds (n,) [rad/s]: arrays (m, n).

    workpiece_speed [rad/s], in the sense of the operation. scan: depths at which stability is sampled at each speed
    before its limits are refined. progress: called with the share that is done.
    """
    depths = table.depths[:, None] + 0 * tool_speeds
    speeds = tool_speeds + 0 * depths
    lower, upper = np.full(depths.shape, np.nan), np.full(depths.shape, np.nan)
    if flexible(op):
        deepest = searched_depth(op, float(table.depths[-1]))
        found = stability_boundary(
            op, tool_speeds, deepest, workpiece_speed, scan=scan,
            progress=None if progress is None else lambda done, total: progress(done / total))
        for j, (intervals, _) in enumerate(found.stable):
            lower[:, j], upper[:, j] = nearest_stable(intervals, table.depths, deepest)
    feed_speed = (surface_feed_per_tooth(op, tool_speeds, 0.0) * op.tool.teeth * tool_speeds / (2 * math.pi)
                  if op.process == "milling" else np.full(tool_speeds.shape, op.axial_feed * abs(workpiece_speed)
                                                          / (2 * math.pi)))
    feed_speed = feed_speed + 0 * depths
    return CutValues(
        tool_speed=speeds, workpiece_speed=np.full(depths.shape, abs(workpiece_speed)), depth=depths,
        cutting_speed=op.tool.radius * speeds, feed_speed=feed_speed,
        feed_per_tooth=surface_feed_per_tooth(op, speeds, workpiece_speed), duration=op.workpiece.length / feed_speed,
        stable_from=lower, stable_to=upper,
        form_error=form_errors(op, table.depths, tool_speeds, workpiece_speed),
        **table.at(abs(workpiece_speed) / tool_speeds),
    )
