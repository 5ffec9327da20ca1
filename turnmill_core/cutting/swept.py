"""The workpiece in process: the stock, less what the tool has swept on its way.

A point of the stock is there until a pose of the tool has held it. The poses stay in memory, close enough
together, and the tool is an exact body of revolution; so walls, cusps and undercuts of earlier passes are
where they are; the way from one pose to the next counts as straight. Positions are in the workpiece frame W, which
turns with the workpiece and coincides with the machine frame about the datum at c = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from turnmill_core.cutting._kernels import sweep
from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation, Tool, outline, require

SPACING = 1 / 20
"""Distance of the poses over the tool radius."""

MOST_POSES = 2_000_000
"""Poses that one workpiece may hold."""

_BLOCK = 2048


@dataclass(frozen=True)
class Stock:
    """What there was before the first cut.

    box [m] (6,): lowest and highest x, y, z in the workpiece frame; bar: whether the radius is bounded as well,
    by `radius` [m] at `z` [m], linear between them, z falling.
    """

    box: Array
    bar: bool
    z: Array
    radius: Array

    @property
    def numbers(self) -> Array:
        """As the kernels have it (7,)."""
        return np.array([*self.box, 1.0 if self.bar else 0.0])


@dataclass(frozen=True)
class SweptWorkpiece:
    """Stock and the poses that the tool has passed; a value, renewed by `swept_by`.

    profile (14,): the cutter's shape for the kernels; spacing [m]: distance between poses; blocks: poses (12, n), tip,
    axis and their change to the next, in order; last: axis state up to which the poses go (None: no motion yet).
    """

    stock: Stock
    profile: Array
    spacing: float
    blocks: tuple[Array, ...] = field(default=(), repr=False)
    last: AxisState | None = None

    @property
    def poses(self) -> int:
        """Number of poses that are held."""
        return sum(block.shape[1] for block in self.blocks)


def profile_of(tool: Tool, spacing: float) -> Array:
    """Shape of the tool as the kernels take it (14,), see _kernels/sweep.py.

    `spacing` [m]: largest distance from a pose to the next.
    """
    shape, line = tool.shape, outline(tool.diameter, tool.flute_length, tool.shape)
    widest = max(line.top[0], line.corner_end[0], line.tip_end[0])
    if line.centre[1] < line.corner_end[1]:  # the arc bulges below its end
        widest = max(widest, line.centre[0] + shape.corner_radius)
    return read_only((
        math.tan(shape.tip_angle), line.tip_end[1], *line.centre, shape.corner_radius**2, line.corner_end[1],
        line.flank_foot, math.tan(shape.taper_angle), line.top[1], line.wiper_start, math.tan(shape.bottom_clearance),
        (widest + spacing) ** 2, spacing,
        1.0 if shape.corner_radius > 0 and line.centre[0] < 1e-12 else 0.0))


def stock_of(op: Operation) -> Stock:
    """The operation's workpiece before the first cut: bar with its profile, or block."""
    piece = op.workpiece
    if piece.is_bar:
        r = piece.radius
        points = piece.profile or ((0.0, r), (-piece.length, r))
        return Stock(read_only((-r, r, -r, r, -piece.length, 0.0)), True, read_only([p[0] for p in points]),
                     read_only([p[1] for p in points]))
    return Stock(read_only((0.0, piece.length, 0.0, piece.width, -piece.height, 0.0)), False, read_only((0.0,)),
                 read_only((0.0,)))


def fresh_workpiece(op: Operation, spacing: float | None = None, stock: Stock | None = None) -> SweptWorkpiece:
    """The workpiece before the first cut.

    Args:
        op: the operation.
        spacing: distance between poses [m]; the tool radius times SPACING if not given.
        stock: another stock than the operation's.

    Raises:
        ValueError: a spacing that is not in (0, tool radius].
    """
    spacing = op.tool.radius * SPACING if spacing is None else spacing
    require(0 < spacing <= op.tool.radius, "spacing", spacing, "m", f"in (0, {op.tool.radius}] m, the tool radius")
    return SweptWorkpiece(stock_of(op) if stock is None else stock, profile_of(op.tool, spacing), spacing)


def poses_at(op: Operation, position: Array) -> Array:
    """Tool tip and axis (6, n) in the workpiece frame at axis positions (n, 6) x, y, z, b, c, s."""
    p = np.atleast_2d(np.asarray(position, dtype=np.float64))
    tip, b, c = p[:, :3] - np.asarray(op.workpiece.datum), p[:, 3], p[:, 4]
    cosine, sine = np.cos(c), np.sin(c)
    across, along = np.sin(b), np.cos(b)
    return np.stack([
        cosine * tip[:, 0] + sine * tip[:, 1], cosine * tip[:, 1] - sine * tip[:, 0], tip[:, 2],
        cosine * across, -sine * across, along])


def swept_by(op: Operation, workpiece: SweptWorkpiece, axes: AxisState) -> SweptWorkpiece:
    """The workpiece after the tool has gone to `axes`, every axis linearly from where it was.

    Poses at which the tool is clear of the stock are not kept; a move of less than a quarter of the spacing waits
    for the next one.

    Raises:
        ValueError: axis positions that are not finite, or more poses than one workpiece may hold.
    """
    require(bool(np.isfinite(axes.position).all()), "axis positions", axes.position, "m, rad", "finite numbers")
    if workpiece.last is None:
        return replace(workpiece, last=axes)
    start, end = np.asarray(workpiece.last.position), np.asarray(axes.position)
    datum = np.array([*op.workpiece.datum, 0.0, 0.0, 0.0])
    change = np.abs(end - start)
    # C carries the tip and what of the tool is in the bar; a tip close to it leaves sharper cusps
    lever, nearest = (pick(math.hypot(*(p - datum)[:2]) for p in (start, end)) for pick in (max, min))
    turned = change[4] * (lever + op.tool.diameter) * math.sqrt(max(1.0, op.tool.radius / max(nearest, 1e-3)))
    length = math.hypot(*change[:3]) + turned + change[3] * 2 * op.tool.diameter
    if length < workpiece.spacing / 4:
        return workpiece
    count = math.ceil(length / workpiece.spacing)
    require(count + workpiece.poses <= MOST_POSES, "number of tool poses", count + workpiece.poses, "",
            f"at most {MOST_POSES}: a shorter path, or a wider spacing")
    along = poses_at(op, start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start))
    poses = np.concatenate([along[:, :-1], np.diff(along, axis=1)])
    return replace(workpiece, blocks=_appended(workpiece.blocks, poses[:, _touching(workpiece, poses)]), last=axes)


def _appended(blocks: tuple[Array, ...], poses: Array) -> tuple[Array, ...]:
    """Blocks with `poses` behind them; the last block is filled up first."""
    count = poses.shape[1]
    if count == 0:
        return blocks
    if blocks and blocks[-1].shape[1] + count <= _BLOCK:
        return (*blocks[:-1], read_only(np.concatenate([blocks[-1], poses], axis=1)))
    return (*blocks, *(read_only(poses[:, k:k + _BLOCK]) for k in range(0, count, _BLOCK)))


def _touching(workpiece: SweptWorkpiece, poses: Array) -> np.ndarray:
    """Poses (n,) of which the lowest or the outermost part may be in the stock."""
    stock, tip, axis = workpiece.stock, poses[:3], poses[3:6]
    reach = math.sqrt(workpiece.profile[sweep.WIDEST])
    keep = np.ones(poses.shape[1], dtype=bool)
    if not math.isfinite(reach):
        return keep
    for k in range(3):  # the tool is a ray with a radius; it leaves the box where it points away from it
        side = reach * np.sqrt(np.maximum(1 - axis[k] ** 2, 0.0))
        keep &= (tip[k] - side <= stock.box[2 * k + 1]) | (axis[k] < 0)
        keep &= (tip[k] + side >= stock.box[2 * k]) | (axis[k] > 0)
    if stock.bar:
        away = np.hypot(tip[0], tip[1])
        outward = (tip[0] * axis[0] + tip[1] * axis[1]) / np.maximum(away, 1e-12)
        side = reach * np.sqrt(np.maximum(1 - outward**2, 0.0))
        keep &= (away - side <= stock.radius.max()) | (outward < 0)
    return keep


def poses_near(workpiece: SweptWorkpiece, centre: Array, size: float, newest: int | None = None) -> Array:
    """Poses (12, K), newest first, whose tool may reach into the ball of radius `size` [m] around `centre` (3,).

    newest: so many poses only, counted from the first; all of them if not given.
    """
    left = workpiece.poses if newest is None else newest
    found = []
    for block in workpiece.blocks:
        part = block[:, :max(left, 0)]
        left -= part.shape[1]
        chosen = np.empty(part.shape[1], dtype=np.int64)
        count = sweep.near(part, centre, size, workpiece.profile, chosen)
        if count:
            found.append(part[:, chosen[:count][::-1]])
    return np.ascontiguousarray(np.concatenate(found[::-1], axis=1)) if found else np.empty((12, 0))


def material_at(workpiece: SweptWorkpiece, points: Sequence[Sequence[float]] | Array) -> np.ndarray:
    """Whether material is left at `points` [m] (n, 3) in the workpiece frame; bool (n,)."""
    p = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    result = np.zeros(len(p))
    if len(p):
        centre = (p.min(axis=0) + p.max(axis=0)) / 2
        poses = poses_near(workpiece, centre, float(np.linalg.norm(p - centre, axis=1).max()))
        stock = workpiece.stock
        sweep.material(workpiece.profile, poses, stock.numbers, stock.z, stock.radius, p, result)
    return result > 0
