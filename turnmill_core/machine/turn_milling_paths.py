"""Toolpaths of turn-milling: orthogonal, tangential, coaxial and along a curved contour with a tilting head.

Workpiece frame at c = 0: origin in the centre of the bar's free end face, the bar extends towards -z, x radial
(docs/frames.md). The workpiece turns in either sense. Eccentricity is the offset of the tool axis from the
workpiece axis along +y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.machine.conditions import feed_direction
from turnmill_core.machine.kinematics import Array
from turnmill_core.machine.toolpath import PathPoint, Toolpath
from turnmill_core.operation import Operation, Vector, require


@dataclass(frozen=True)
class TurnMillingCut:
    """What a turn-milling path is made for.

    bar_radius, bar_length, tool_radius [m]; depth [m], what one pass takes off the bar's radius; axial_feed [m/rev]
    along the bar per workpiece revolution; tool_speed [rad/s] > 0; workpiece_speed [rad/s], not 0, signed about
    +z_M; direction: of the axial feed along z, -1 towards the chuck; eccentricity [m]; clearance [m] between tool and
    bar before and after the cut; flute_length [m].
    """

    bar_radius: float
    bar_length: float
    tool_radius: float
    depth: float
    axial_feed: float
    tool_speed: float
    workpiece_speed: float
    direction: Literal[-1, 1] = -1
    eccentricity: float = 0.0
    clearance: float = 2e-3
    flute_length: float = math.inf

    def __post_init__(self) -> None:
        for name in ("bar_radius", "bar_length", "tool_radius", "axial_feed", "tool_speed", "clearance"):
            value = getattr(self, name)
            require(math.isfinite(value) and value > 0, name.replace("_", " "), value,
                    {"axial_feed": "m/rev", "tool_speed": "rad/s"}.get(name, "m"), "a finite number > 0")
        require(0 < self.depth < self.bar_radius, "depth", self.depth, "m",
                f"a number > 0 and less than the bar's radius {self.bar_radius} m")
        require(math.isfinite(self.workpiece_speed) and self.workpiece_speed != 0, "workpiece speed",
                self.workpiece_speed, "rad/s", "a finite number that is not 0")
        require(self.direction in (-1, 1), "direction", self.direction, "", "-1 (towards the chuck) or 1")
        require(math.isfinite(self.eccentricity), "eccentricity", self.eccentricity, "m", "a finite number")
        require(self.flute_length > 0, "flute length", self.flute_length, "m", "a number > 0")

    @property
    def finished_radius(self) -> float:
        """Radius that the pass leaves [m]."""
        return self.bar_radius - self.depth

    def at(self, tip: Vector, axis: Vector, rapid: bool = False) -> PathPoint:
        """A point at `tip` [m] with tool `axis` and this cut's feed and speeds."""
        return PathPoint(tip, axis, self.axial_feed, "revolution", self.tool_speed, self.workpiece_speed, rapid, 1)


def cut_from_operation(
    op: Operation, eccentricity: float | None = None, workpiece_speed: float | None = None
) -> TurnMillingCut:
    """The nominal cut of a turn-milling operation, in the direction that gives its milling sense.

    eccentricity [m], workpiece_speed [rad/s]: others than the operation's; turned the other way, the tool goes on
    in the same direction and the milling sense changes. Raises ValueError for another process or a tilted tool, or for
    values that a cut forbids.
    """
    require(op.process == "turn-milling", "process", op.process, "", "turn-milling")
    require(op.tilt == 0, "tilt", op.tilt, "rad", "0: generated paths have B at 90 deg, or across a contour")
    cut = op.conditions
    return TurnMillingCut(
        op.workpiece.radius, op.workpiece.length, op.tool.radius, cut.depth, op.axial_feed, cut.tool_speed,
        cut.workpiece_speed if workpiece_speed is None else workpiece_speed, feed_direction(op),
        op.eccentricity if eccentricity is None else eccentricity,
        flute_length=op.tool.flute_length)


def orthogonal_path(cut: TurnMillingCut) -> Toolpath:
    """Orthogonal turn-milling: the tool points at the bar (b = 90 deg), its end face makes the surface.

    Towards the chuck the tool comes in beside the free end; away from it it plunges first.
    Raises ValueError where the eccentricity is not smaller than the tool radius: the surface would not be reached.
    """
    require(abs(cut.eccentricity) < cut.tool_radius, "eccentricity", cut.eccentricity, "m",
            f"less than the tool radius {cut.tool_radius} m")
    require(cut.depth <= cut.flute_length, "depth", cut.depth, "m", f"at most the flute length {cut.flute_length} m")
    above = cut.bar_radius + cut.clearance
    return _pass(cut, "orthogonal", (1.0, 0.0, 0.0), (cut.finished_radius, cut.eccentricity),
                 (above, cut.eccentricity))


def tangential_path(cut: TurnMillingCut) -> Toolpath:
    """Tangential turn-milling: the tool is across the bar (b = 90 deg) and beside it, its flank makes the surface.

    Tool and workpiece axis are the finished radius plus the tool radius apart along +y; this is the eccentricity. The
    tip reaches past the chord that the bar holds at the finished radius.
    Raises ValueError for another eccentricity, and where the flutes are shorter than the chord.
    """
    require(cut.eccentricity == 0, "eccentricity", cut.eccentricity, "m", "none: it follows from depth and tool radius")
    half = math.sqrt(cut.bar_radius**2 - cut.finished_radius**2)
    require(2 * half <= cut.flute_length, "chord of the cut", 2 * half, "m",
            f"at most the flute length {cut.flute_length} m")
    x, beside = -half - cut.clearance, cut.tool_radius
    return _pass(cut, "tangential", (1.0, 0.0, 0.0), (x, cut.finished_radius + beside),
                 (x, cut.bar_radius + beside + cut.clearance))


def coaxial_path(cut: TurnMillingCut) -> Toolpath:
    """Coaxial turn-milling: tool and bar are parallel (b = 0), side by side, the flank makes the surface.

    The axes are the finished radius plus the tool radius apart, of which the eccentricity lies along y. Towards the
    chuck the tool comes in before the free end; away from it it plunges radially at the chuck first.
    Raises ValueError where the eccentricity is larger than the distance of the axes.
    """
    apart = cut.finished_radius + cut.tool_radius
    require(abs(cut.eccentricity) <= apart, "eccentricity", cut.eccentricity, "m",
            f"at most the distance of the two axes {apart} m")
    out = (cut.bar_radius + cut.tool_radius + cut.clearance) / apart
    x, y = math.sqrt(apart**2 - cut.eccentricity**2), cut.eccentricity
    return _pass(cut, "coaxial", (0.0, 0.0, 1.0), (x, y), (out * x, out * y), reach=0.0)


def _pass(
    cut: TurnMillingCut, kind: str, axis: Vector, inside: tuple[float, float], outside: tuple[float, float],
    reach: float | None = None,
) -> Toolpath:
    """One straight pass along the bar: (x, y) of the tip in the cut and clear of it; reach: tool radius along z."""
    reach = cut.tool_radius if reach is None else reach
    free, chuck = reach + cut.clearance, -cut.bar_length + reach
    require(chuck < free, "bar length", cut.bar_length, "m", f"more than {cut.clearance} m")
    first, last = (free, chuck) if cut.direction < 0 else (chuck, free)
    points = (
        cut.at((*outside, first), axis, rapid=True), cut.at((*inside, first), axis, rapid=cut.direction < 0),
        cut.at((*inside, last), axis), cut.at((*outside, last), axis, rapid=True),
    )
    return Toolpath(points, f"{kind} turn-milling", ((0, (2 * cut.tool_radius,)),))


def arc_profile(cut: TurnMillingCut, sagitta: float, points: int = 101) -> Array:
    """Barrel profile (points, 2) of z [m] from 0 to -bar_length and radius [m].

    The radius is the cut's finished radius at half length and `sagitta` [m] less at both ends, on a circle.
    Raises ValueError for a sagitta that is not in (0, finished radius) or more than half of the length, or fewer
    than 3 points.
    """
    half = cut.bar_length / 2
    require(0 < sagitta < min(cut.finished_radius, half), "sagitta", sagitta, "m",
            f"a number > 0 and less than {min(cut.finished_radius, half)} m")
    require(points >= 3, "profile points", points, "", "a whole number >= 3")
    circle = (half**2 + sagitta**2) / (2 * sagitta)
    angle = np.linspace(-1, 1, points) * math.asin(half / circle)
    return np.stack([-half - circle * np.sin(angle), cut.finished_radius - circle * (1 - np.cos(angle))], -1)


def curved_path(cut: TurnMillingCut, profile: ArrayLike) -> Toolpath:
    """Curved turn-milling: B keeps the tool across a turned contour, its end face makes the surface.

    profile: (n, 2) of z and radius [m], at least two points, radii > 0, z strictly in one direction; it is followed
    in its order. The tool axis is the outward normal, from differences weighted by the spacing (second order). An
    eccentricity shifts the tool along y.
    Raises ValueError where the profile is not of that kind.
    """
    p = np.asarray(profile, dtype=np.float64)
    require(p.ndim == 2 and p.shape[1:] == (2,) and len(p) >= 2 and bool(np.isfinite(p).all()), "profile", p.shape, "m",
            "an array (n, 2) of finite numbers z, radius with n >= 2")
    z, r = p.T
    require(bool(np.all(np.diff(z) > 0) or np.all(np.diff(z) < 0)), "profile z", z.tolist()[:4], "m",
            "values that rise or fall all along")
    require(bool(np.all(r > 0)), "profile radius", float(r.min()), "m", "radii > 0")
    slope = np.gradient(r, z, edge_order=2 if len(p) > 2 else 1)
    normal = np.stack([np.ones_like(slope), np.zeros_like(slope), -slope], -1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tips = np.stack([r, np.full_like(r, cut.eccentricity), z], -1)
    axes: list[Vector] = [(n[0], n[1], n[2]) for n in normal.tolist()]
    places: list[Vector] = [(t[0], t[1], t[2]) for t in tips.tolist()]
    lifts = [cut.bar_radius + cut.clearance - r[0], cut.bar_radius + cut.clearance - r[-1]]
    (a, b), (first, last) = (tips[0] + max(lifts[0], cut.clearance) * normal[0],
                             tips[-1] + max(lifts[1], cut.clearance) * normal[-1]), (axes[0], axes[-1])
    points = (
        cut.at((a[0], a[1], a[2]), first, rapid=True), *map(cut.at, places, axes),
        cut.at((b[0], b[1], b[2]), last, rapid=True),
    )
    return Toolpath(points, "curved turn-milling", ((0, (2 * cut.tool_radius,)),))
