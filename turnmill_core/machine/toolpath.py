"""Toolpaths: cutter locations with feed and spindle speeds, in SI units.

Tip and tool axis are given as a part program has them. Where the workpiece spindle stands or is positioned
(workpiece_speed 0) they are in the workpiece frame W, and the C axis follows from the tool axis. Where the workpiece
turns they are in W at c = 0, which does not turn: the programmed coordinates of turn-milling, C running on its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from turnmill_core.machine.kinematics import Array
from turnmill_core.operation import Vector, require

MAX_COORDINATE = 1e3
"""Largest coordinate of a tool tip [m]; beyond it a path file is taken to be damaged."""


@dataclass(frozen=True)
class PathPoint:
    """One cutter location, and how the tool moves to it from the one before.

    tip: position of the tool tip [m]; axis: unit vector from the tip to the spindle; feed: [m/s] where feed_per is
    "time", [m/rev] where it is "revolution", 0 where none is given; a revolution is that of the workpiece spindle
    where it turns, that of the tool where it does not; tool_speed: [rad/s], positive clockwise seen from the
    spindle; workpiece_speed: [rad/s], signed about +z_M, 0 where the C axis is positioned; rapid: moves at rapid
    traverse, whatever the feed; tool: its number in the magazine, 0 where none was loaded.
    """

    tip: Vector
    axis: Vector
    feed: float = 0.0
    feed_per: Literal["time", "revolution"] = "time"
    tool_speed: float = 0.0
    workpiece_speed: float = 0.0
    rapid: bool = False
    tool: int = 0

    def __post_init__(self) -> None:
        require(all(abs(x) <= MAX_COORDINATE for x in self.tip), "tool tip", self.tip, "m",
                f"three numbers between -{MAX_COORDINATE:g} and {MAX_COORDINATE:g}")
        require(abs(math.hypot(*self.axis) - 1) < 1e-9, "tool axis", self.axis, "", "a vector of length 1")
        require(math.isfinite(self.feed) and self.feed >= 0, "feed", self.feed,
                "m/s" if self.feed_per == "time" else "m/rev", "a finite number >= 0")
        require(math.isfinite(self.tool_speed), "tool speed", self.tool_speed, "rad/s", "a finite number")
        require(math.isfinite(self.workpiece_speed), "workpiece speed", self.workpiece_speed, "rad/s",
                "a finite number")
        require(self.tool >= 0, "tool number", self.tool, "", "a whole number >= 0")


@dataclass(frozen=True)
class Toolpath:
    """Cutter locations in order, at least one.

    The first point is where the path begins: nothing moves to it. cutters: index of the point from which a cutter
    holds, and its APT parameters (diameter, corner radius, e, f [m], alpha, beta [rad], height [m]; trailing ones may
    be left out); notes: index of the point before which a text stands, and the text.
    """

    points: tuple[PathPoint, ...]
    name: str = ""
    cutters: tuple[tuple[int, tuple[float, ...]], ...] = ()
    notes: tuple[tuple[int, str], ...] = ()

    def __post_init__(self) -> None:
        require(len(self.points) > 0, "toolpath", self.name, "", "at least one point (GOTO or FROM)")
        for index, values in self.cutters:
            require(0 <= index <= len(self.points), "index of a cutter", index, "", f"0 to {len(self.points)}")
            require(1 <= len(values) <= 7 and all(map(math.isfinite, values)) and values[0] > 0, "cutter", values,
                    "m, rad", "one to seven finite numbers, the first (diameter) > 0")
        for index, text in self.notes:
            require(0 <= index <= len(self.points), "index of a note", index, "", f"0 to {len(self.points)}")
            require(text != "" and "$" not in text and text.isprintable() and text == " ".join(text.split()), "note",
                    text, "", "one printable line without $ or needless blanks")

    @property
    def tips(self) -> Array:
        """Tool tips [m] (n, 3)."""
        return np.array([p.tip for p in self.points])

    @property
    def axes(self) -> Array:
        """Tool axes (n, 3)."""
        return np.array([p.axis for p in self.points])


def with_workpiece_speed(path: Toolpath, workpiece_speed: float) -> Toolpath:
    """The path with the workpiece turning at `workpiece_speed` [rad/s], signed about +z_M, from its first point on."""
    return replace(path, points=tuple(replace(p, workpiece_speed=workpiece_speed) for p in path.points))
