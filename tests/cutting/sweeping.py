"""Cuts with any tool and pose, their swept workpieces, and independent truths about them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.swept import Stock, SweptWorkpiece, fresh_workpiece, swept_by
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation, Shape, Tool

from .cases import AL6061, MM, turn_milling

Array = NDArray[np.float64]
R, BAR, DEPTH, FEED = 8 * MM, 30 * MM, 1 * MM, 2 * MM
SHAPES = {"cylinder": Shape(), "ball": Shape(corner_radius=R), "bull nose": Shape(corner_radius=3 * MM)}


def operation(shape: Shape, workpiece_rpm: float = 10.0, **tool: object) -> Operation:
    """Turn-milling of a 60 mm bar with a 16 mm tool of that shape, 2 mm per revolution."""
    cutter = Tool("tool", 2 * R, 2, math.radians(25), 60 * MM, shape=shape, **tool)  # type: ignore[arg-type]
    return turn_milling(cutter, AL6061, 2 * BAR, DEPTH, FEED, 3000, workpiece_rpm)


def state(op: Operation, x: float, y: float = 0.0, b: float = math.pi / 2, time: float = 0.0, z: float = 0.0,
          feed: float = FEED) -> AxisState:
    """Axis state `time` after the tool tip was at (x, y, z), feeding towards -z."""
    speed = op.conditions.workpiece_speed
    along = -feed * abs(speed) / (2 * math.pi)
    return AxisState(round(time * 1e9), (x, y, z + along * time, b, speed * time, 0.0),
                     (0.0, 0.0, along, 0.0, speed, op.conditions.tool_speed))


def endless(op: Operation, spacing: float | None = None) -> SweptWorkpiece:
    """The operation's bar without ends."""
    r = op.workpiece.radius
    stock = Stock(np.array([-r, r, -r, r, -math.inf, math.inf]), True, np.zeros(1), np.full(1, r))
    return fresh_workpiece(op, spacing, stock)


def steady(op: Operation, x: float, y: float = 0.0, b: float = math.pi / 2, feed: float = FEED,
           ) -> tuple[SweptWorkpiece, AxisState]:
    """The endless bar after one and a half revolutions at this pose, and the state at the end."""
    period = 2 * math.pi / abs(op.conditions.workpiece_speed)
    begin, end = (state(op, x, y, b, t, feed=feed) for t in (-1.5 * period, 0.0))
    return swept_by(op, replace(endless(op), last=begin), end), end


def inside(kind: str, p: Array) -> NDArray[np.bool_]:
    """Whether points (..., 3) of the tool frame are in the tool, straight from its definition."""
    radius, z = np.hypot(p[..., 0], p[..., 1]), p[..., 2]
    if kind == "cylinder":
        return (z >= 0) & (radius <= R)
    if kind == "ball":
        return ((radius <= R) & (z >= R)) | (radius**2 + (z - R) ** 2 <= R**2)
    corner = 3 * MM  # bull nose
    near_ring = (radius - (R - corner)) ** 2 + (z - corner) ** 2 <= corner**2
    return ((radius <= R) & (z >= corner)) | ((radius <= R - corner) & (z >= 0)) | near_ring


def to_tool(machine: Array, tip: Array, b: float) -> Array:
    """Points (..., 3) of the machine frame as seen along the tool axis; x and y of the tool are turned somehow."""
    axis = np.array([math.sin(b), 0.0, math.cos(b)])
    across = np.array([math.cos(b), 0.0, -math.sin(b)])
    d = machine - tip
    return np.stack([d @ across, d[..., 1], d @ axis], axis=-1)


def finished_radius(kind: str, x: float, y: float, b: float, places: Array) -> Array:
    """Radius that the steady helical motion leaves at each of `places` [m] (n,) along the bar, 0 to FEED.

    For every turn of the workpiece and every angle of it at which the tool is deep, the radius at which the ray meets
    the tool, found by bisection; the smallest counts.
    """
    best = np.full(len(places), BAR)
    levels = np.linspace(BAR - 1.3 * DEPTH, BAR, 25)
    alpha = (math.pi / 2 if y > R else 0.0) + np.linspace(-0.3, 0.3, 241)
    for turn in range(-6, 7):
        zeta = places[:, None] + FEED * (turn + alpha / (2 * math.pi))  # the tool meets the ray there, its tip at z = 0

        def held(rho: Array, zeta: Array = zeta) -> NDArray[np.bool_]:
            points = np.stack(np.broadcast_arrays(rho * np.cos(alpha), rho * np.sin(alpha), zeta), axis=-1)
            return inside(kind, to_tool(points, np.array([x, y, 0.0]), b))

        entered = np.array([held(np.full_like(zeta, rho)) for rho in levels])
        first = entered.argmax(axis=0)
        assert not entered[0].any()  # the tool goes no deeper than was thought
        low, high = levels[np.maximum(first - 1, 0)], levels[first]
        for _ in range(16):
            middle = (low + high) / 2
            there = held(middle)
            high, low = np.where(there, middle, high), np.where(there, low, middle)
        best = np.minimum(best, np.where(entered.any(axis=0), high, BAR).min(axis=1))
    return best
