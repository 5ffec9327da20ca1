"""Numeric engagement: where any tool, on any path, moves into the material that is left.

A circle of the tool's surface cuts where it moves outwards, f . n > 0 (`normal_feed`; the ends of that range are
exact), and where the swept workpiece still holds material. The ends of an arc are found by bisection, so that
they are as good as the workpiece and not as the probes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting._kernels import sweep
from turnmill_core.cutting.cutter import cutter_elements, outer_radius
from turnmill_core.cutting.engagement import Engagement, Removal
from turnmill_core.cutting.feed import ToolMotion, normal_feed, tool_motion
from turnmill_core.cutting.swept import SweptWorkpiece, fresh_workpiece, poses_at, poses_near, swept_by
from turnmill_core.cutting.tool import Array, EdgeElements, read_only
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation, Tool, require

PROBE_STEP = math.radians(2)
"""Angle between probes; an arc that is narrower may be missed."""

_TOLERANCE = 1e-6  # rad, of an arc's ends
_LEVELS = 60  # heights at which contact is sought
_OFF = 2e-6  # m, more than the straight way between two poses is off the path


@dataclass(frozen=True)
class EngagementMap:
    """Engagement of the tool at one instant.

    motion: of the tool; elements: edges from the lowest to the highest contact, m of them, bottom edges
    first; feed [m/s] (m, 3): A, B, C of `normal_feed`; arcs: height, start and exit angles (m, A), as many
    arcs as any height has; removal: volume per time that the engaged surface takes, side and bottom apart.
    """

    motion: ToolMotion
    elements: EdgeElements
    feed: Array
    arcs: Engagement
    removal: Removal

    @property
    def in_cut(self) -> bool:
        """Whether anything is cut."""
        return self.removal.total > 0


def engage(
    op: Operation, workpiece: SweptWorkpiece, axes: AxisState, elements: int = 40, bottom: int = 12
) -> tuple[SweptWorkpiece, EngagementMap]:
    """Move the tool to `axes`; the workpiece it leaves behind and its engagement there.

    Args:
        op: the operation: tool and stock; its nominal cut plays no part.
        workpiece: from `fresh_workpiece`, or from the call before.
        axes: axis state with positions and velocities.
        elements: elements around the tool.
        bottom: elements of the bottom edge.

    Raises:
        ValueError: a tool speed against the cutting sense, material that meets the tool above its flutes, or
            what `swept_by` refuses.
    """
    require(all(map(math.isfinite, axes.velocity)), "axis velocities", axes.velocity, "m/s, rad/s", "finite numbers")
    workpiece = swept_by(op, workpiece, axes)
    return workpiece, engagement_map(op, workpiece, axes, elements, bottom)


def engagement_along(
    op: Operation, states: Iterable[AxisState], workpiece: SweptWorkpiece | None = None, elements: int = 40,
    bottom: int = 12,
) -> Iterator[EngagementMap]:
    """Engagement at each of the axis states `states`, the workpiece updated along the way.

    workpiece: where the path begins; the untouched stock if not given. Between two states every axis moves
    linearly. See `engage` for the rest.
    """
    workpiece = fresh_workpiece(op) if workpiece is None else workpiece
    for axes in states:
        workpiece, cut = engage(op, workpiece, axes, elements, bottom)
        yield cut


def engagement_map(
    op: Operation, workpiece: SweptWorkpiece, axes: AxisState, elements: int = 40, bottom: int = 12
) -> EngagementMap:
    """Engagement of the tool at `axes` in a workpiece that it has swept up to there; see `engage`."""
    motion = tool_motion(op, axes)
    require(motion.tool_speed > -0.1, "tool spindle speed (axis s)", motion.tool_speed, "rad/s",
            "a speed >= 0, clockwise seen from the spindle")
    now = poses_at(op, np.asarray(axes.position))[:, 0]
    c = motion.c
    to_workpiece = np.array([[math.cos(c), math.sin(c), 0.0], [-math.sin(c), math.cos(c), 0.0], [0.0, 0.0, 1.0]])
    columns = np.ascontiguousarray(to_workpiece @ motion.rotation)
    contact = _contact(op.tool, workpiece, now[:3], columns)
    if contact is None:
        return _empty(op.tool, motion)
    low, top, beyond = contact
    edges = cutter_elements(op.tool, top, elements, bottom if low == 0 else 0, low)
    feed = normal_feed(motion, edges)
    earlier, last = _passed(op.tool, workpiece, now, columns, edges)
    start, stop = _arcs(workpiece, earlier, now[:3], columns, edges.radius, edges.height, feed)
    if op.tool.shape.bottom_clearance > 0 and edges.bottom.any():
        # A hollow meets what its rim has left: nothing where the tool was before, felt a little inside the surface, nor
        # where the rim has just been, felt a little outside of it.
        hollow, part = edges.chosen(edges.bottom), feed[edges.bottom]
        within, without = (_arcs(workpiece, poses, now[:3], columns, hollow.radius, hollow.height + off, part)
                           for poses, off in ((earlier, _OFF), (last, -_OFF)))
        common = _common(within, without)
        start, stop = (_replaced(arcs, some, edges.bottom) for arcs, some in zip((start, stop), common, strict=True))
    if beyond > top:
        _check_shank(op.tool, workpiece, motion, now, columns, beyond)
    arcs = Engagement(edges.height, read_only(start), read_only(stop))
    return EngagementMap(motion, edges, read_only(feed), arcs, _removal(edges, feed, arcs))


def _contact(tool: Tool, workpiece: SweptWorkpiece, tip: Array, columns: Array) -> tuple[float, float, float] | None:
    """Lowest and highest contact of the flutes with the stock, and the highest of the whole tool; None: no contact."""
    stock, axis = workpiece.stock, columns[:, 2]
    reach = math.sqrt(workpiece.profile[sweep.WIDEST])
    require(math.isfinite(reach), "flute length", tool.flute_length, "m", "a finite length of a tapered tool")
    limit = math.inf
    for k in range(3):
        side = reach * math.sqrt(max(1 - axis[k] ** 2, 0.0))
        if abs(axis[k]) > 1e-9:
            bound = stock.box[2 * k + 1] + side if axis[k] > 0 else stock.box[2 * k] - side
            limit = min(limit, (bound - tip[k]) / axis[k])
    if limit < 0:
        return None
    require(math.isfinite(limit), "flute length", tool.flute_length, "m", "a finite length of a tool along the stock")
    heights = np.linspace(0.0, max(limit, 1e-9), _LEVELS)
    hits = np.flatnonzero(_levels(tool, workpiece, tip, columns, heights, 90))
    if hits.size == 0:
        return None
    last = len(heights) - 1
    low, high = float(heights[max(hits[0] - 1, 0)]), float(heights[min(hits[-1] + 2, last)])
    near = np.linspace(heights[hits[-1]], high, 17)  # contact ends in a point: closer levels, and more of each
    above = np.flatnonzero(_levels(tool, workpiece, tip, columns, near, 360))
    high = float(near[min(above[-1] + 1, 16)]) if above.size else high
    top = min(high, tool.flute_length)
    return (low, top, high) if low < top else None


def _levels(
    tool: Tool, workpiece: SweptWorkpiece, tip: Array, columns: Array, heights: Array, angles: int
) -> np.ndarray:
    """Which circles of the tool at `heights` (n,) have one of `angles` points in the uncut stock, bool (n,)."""
    stock = workpiece.stock
    radii = outer_radius(tool, np.minimum(heights, tool.flute_length))
    hits = np.zeros(len(heights))
    sweep.touching(tip, columns, stock.numbers, stock.z, stock.radius, radii, heights, angles, hits)
    return hits > 0


def _common(first: tuple[Array, Array], second: tuple[Array, Array]) -> tuple[Array, Array]:
    """Where both of two sets of arcs (m, A), (m, B) are; (m, A B), empty arcs last."""
    low = np.maximum(first[0][:, :, None], second[0][:, None, :]).reshape(len(first[0]), -1)
    high = np.minimum(first[1][:, :, None], second[1][:, None, :]).reshape(low.shape)
    order = np.argsort(np.where(high > low, low, np.inf), axis=1)
    low, high = (np.take_along_axis(a, order, 1) for a in (low, high))
    end = np.maximum.accumulate(np.where(high > low, high, -np.inf), axis=1)
    end = np.where(np.isneginf(end), 0.0, end)
    return np.where(high > low, low, end), end


def _replaced(arcs: Array, some: Array, rows: NDArray[np.bool_]) -> Array:
    """Arcs (m, A) with other ones in the chosen rows; as many columns as either has, filled with the last."""
    width = max(arcs.shape[1], some.shape[1])
    result, some = (np.pad(a, ((0, 0), (0, width - a.shape[1])), mode="edge") for a in (arcs, some))
    result[rows] = some
    return np.asarray(result, dtype=np.float64)


def _passed(
    tool: Tool, workpiece: SweptWorkpiece, now: Array, columns: Array, edges: EdgeElements
) -> tuple[Array, Array]:
    """Poses that may have swept what the edges meet; and apart the last ones, less than two spacings away.

    A convex tool leaves those behind: its leading side was never in them, nor on the way from them.
    """
    earlier = workpiece.poses
    for block in workpiece.blocks[::-1]:
        moved = (np.linalg.norm(block[:3] - now[:3, None], axis=0)
                 + 2 * tool.diameter * np.linalg.norm(block[3:6] - now[3:, None], axis=0))
        apart = np.flatnonzero(moved[::-1] >= 2 * workpiece.spacing)
        earlier -= int(apart[0]) if apart.size else block.shape[1]
        if apart.size:
            break
    low, top = float(edges.height.min()), float(edges.height.max())
    size = math.hypot((top - low) / 2, float(edges.radius.max()))
    near = poses_near(workpiece, now[:3] + columns[:, 2] * (low + top) / 2, size, earlier)
    last = np.concatenate([np.empty((12, 0)), *workpiece.blocks], axis=1)[:, earlier:] if (
        tool.shape.bottom_clearance > 0) else np.empty((12, 0))
    return near, np.ascontiguousarray(last)


def _arcs(
    workpiece: SweptWorkpiece, poses: Array, tip: Array, columns: Array, radius: Array, height: Array, feed: Array
) -> tuple[Array, Array]:
    """Start and exit angles (m, A) of the arcs, empty ones at the exit of the last before them."""
    stock, room = workpiece.stock, 4
    while True:
        start, stop = np.empty((2, len(radius), room))
        most = sweep.arcs(radius, height, feed, tip, columns, workpiece.profile, poses, stock.numbers, stock.z,
                          stock.radius, PROBE_STEP, _TOLERANCE, start, stop)
        if most <= room:
            break
        room = most
    start, stop = start[:, :max(most, 2)], stop[:, :max(most, 2)]
    stop = np.where(np.isnan(stop), -np.inf, stop)
    end = np.maximum.accumulate(stop, axis=1)
    end = np.where(np.isneginf(end), 0.0, end)
    return np.where(np.isnan(start), end, start), end


def _removal(edges: EdgeElements, feed: Array, arcs: Engagement) -> Removal:
    s, e = arcs.start, arcs.exit
    flux = (feed[:, :1] * (np.cos(s) - np.cos(e)) + feed[:, 1:2] * (np.sin(e) - np.sin(s)) + feed[:, 2:] * (e - s))
    volume = edges.radius * edges.width * flux.sum(axis=1)
    side, bottom = float(volume[~edges.bottom].sum()), float(volume[edges.bottom].sum())
    return Removal(side, bottom, side + bottom)


def _check_shank(
    tool: Tool, workpiece: SweptWorkpiece, motion: ToolMotion, now: Array, columns: Array, beyond: float
) -> None:
    """Raise ValueError where material meets the tool above its flutes."""
    height = np.linspace(tool.flute_length, beyond, 9)[1:]
    radius = np.full(8, float(outer_radius(tool, np.array([tool.flute_length]))[0]))
    feed = np.stack([motion.velocity[0] + height * motion.spin[1], motion.velocity[1] - height * motion.spin[0],
                     np.zeros(8)], axis=1)
    poses = poses_near(workpiece, now[:3] + columns[:, 2] * beyond, beyond - tool.flute_length + radius[0])
    start, stop = _arcs(workpiece, poses, now[:3], columns, radius, height, feed)
    require(not bool((stop > start).any()), "depth along the tool axis", beyond, "m",
            f"at most the flute length {tool.flute_length} m: material meets the tool above its flutes")


def _empty(tool: Tool, motion: ToolMotion) -> EngagementMap:
    """Map of a tool that touches nothing: one element, no arc."""
    edges = cutter_elements(tool, min(tool.radius, tool.flute_length) / 2, 1, 0)
    nothing = read_only(np.zeros((len(edges.height), 2)))
    return EngagementMap(motion, edges, read_only(normal_feed(motion, edges)),
                         Engagement(edges.height, nothing, nothing), Removal(0.0, 0.0, 0.0))
