"""The finished surface of a turn-milled bar: the envelope of all tooth passes, unrolled.

A point of the workpiece is passed by the bottom edges again and again while it turns under the tool, tooth by tooth and
in every workpiece revolution in which the tool reaches over it. What is left is the lowest of these passes: the
radius (R_we + h) / cos(psi) with h the height of the bottom edge there (dish, wiper, corner, axial runout) plus
the steady vibration of the tool along its axis at that instant, and psi the angle of the point from the tool's plane.
The polygon of Eq. 4.130, the cusps of Eq. 4.131 and the vibration of Eq. 4.132 all follow from it. Beside it
stands the tooth print of the thesis, which takes the workpiece as a plane and one pass of the leading edge as final.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.feed import cross_feed_sense
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.operation_cutter import outline
from turnmill_core.process._kernels.envelope import bottom_height, envelope
from turnmill_core.process.surface import rigid_cut, steady_axial
from turnmill_core.process.surface_profile import surface_feed_per_tooth

Floats = NDArray[np.float64]
Progress = Callable[[float], None]
TWO_PI = 2 * math.pi

PER_FACET = 6
ROWS = 200
BINS = 400
ACROSS = 1200
CHOSEN = 3_000_000
LARGEST = 20_000_000
CHUNK = 500
PASS_SPACING = 1.2
"""Distance along x_T within which a tooth surely passes, in feeds: a trailing edge swings with the material."""


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """The finished surface, unrolled.

    angle (n,) [rad] around the workpiece, from cell to cell by `angle[1] - angle[0]`; axial (m,) [m] along the bar, in
    the direction +y_T; height (m, n) [m] above the circle of `radius` [m], the programmed radius R_w - a. Positive is
    undercut, material left standing; negative is overcut.
    """

    angle: Floats
    axial: Floats
    height: Floats
    radius: float

    @property
    def mean_radius(self) -> float:
        """Mean radius [m]."""
        return self.radius + float(self.height.mean())

    @property
    def undercut(self) -> float:
        """Largest height above the programmed circle [m], >= 0."""
        return max(0.0, float(self.height.max()))

    @property
    def overcut(self) -> float:
        """Largest depth below it [m], >= 0."""
        return max(0.0, -float(self.height.min()))

    @property
    def mean_section(self) -> float:
        """Mean area of the part's cross-section [m2], as if the map went all around."""
        return math.pi * float(np.mean((self.radius + self.height) ** 2))


def surface_map(
    op: Operation, conditions: Conditions, around: float | None = None, passes: float = 1.0, columns: int | None = None,
    rows: int = ROWS, vibration: tuple[Floats, Floats] | None = None, progress: Progress | None = None,
) -> SurfaceMap:
    """Finished surface over `around` [rad] of the workpiece and `passes` axial feeds.

    around: None for a full workpiece revolution. columns, rows: cells (columns None: six to every tooth pass,
    where that is not more than three million cells).
    vibration: tool angle [rad] (p,), equally spaced over a revolution from 0, and displacement of the tool against
    the workpiece along +z_T [m] (p,); None: the steady vibration of the linear cut.
    progress: called with the share that is done. Raises ``ValueError`` for milling, a tilted tool, no contact, or more
    cells than memory is for.
    """
    require(op.process == "turn-milling", "process", op.process, "", "turn-milling")
    require(op.tilt == 0, "tilt", op.tilt, "rad", "0: the surface of a tilted tool is not described")
    require(conditions.in_cut, "depth", conditions.depth, "m", "a cut (contact, both spindles turning)")
    speed = abs(conditions.workpiece_speed)
    require(speed > 0, "workpiece speed", conditions.workpiece_speed, "rad/s", "a turning workpiece")
    span = TWO_PI if around is None else around
    require(0 < span <= TWO_PI * (1 + 1e-12), "angle around", span, "rad", "in (0, 2 pi]")
    require(passes > 0, "passes", passes, "", "a number > 0")
    facet = speed * TWO_PI / (op.tool.teeth * conditions.tool_speed)
    fine = min(max(16, math.ceil(PER_FACET * span / facet)), max(16, CHOSEN // max(rows, 1)))
    n = fine if columns is None else columns
    require(n >= 2 and rows >= 2, "cells", (n, rows), "", "at least 2 each way")
    require(n * rows <= LARGEST, "cells", n * rows, "", f"at most {LARGEST}; ask for fewer columns or rows")
    feed = conditions.feed_speed * TWO_PI / speed
    angle, axial = _middles(span, n), _middles(passes * feed, rows)
    moved = steady_axial(op, conditions)[1] if vibration is None else vibration[1]
    return SurfaceMap(angle, axial, _lowest(op, conditions, angle, axial, np.ascontiguousarray(moved), progress),
                      conditions.effective_radius)


def _middles(length: float, cells: int) -> Floats:
    """Middles of equal cells from 0 to `length`."""
    return np.asarray((np.arange(cells) + 0.5) * (length / cells), dtype=np.float64)


def _lowest(
    op: Operation, conditions: Conditions, angle: Floats, axial: Floats, moved: Floats, progress: Progress | None,
) -> Floats:
    """Heights (m, n) of the envelope."""
    tool, speed = op.tool, abs(conditions.workpiece_speed)
    runout = np.array(tool.shape.axial_runout or (0.0,) * tool.teeth)
    teeth = np.stack([np.cumsum((0.0, *tool.pitch[:-1])), runout], axis=1)
    bottom, reach = bottom_of(op)
    # the tool axis stands at y_M = eccentricity, and x_T is -y_M for a positive workpiece speed
    offset = math.copysign(op.eccentricity, conditions.workpiece_speed * op.eccentricity)
    lead = cross_feed_sense(conditions) * conditions.feed_speed / speed
    spread = float(np.ptp(moved)) + float(np.ptp(runout))
    feed = PASS_SPACING * surface_feed_per_tooth(op, conditions) * (tool.teeth if np.ptp(runout) > 0 else 1)
    speeds = np.array([conditions.tool_speed, speed])
    window = _window(conditions.effective_radius, bottom, reach, offset, spread, feed)
    height = np.empty((axial.size, angle.size))
    for first in range(0, angle.size, CHUNK):
        part = np.full((axial.size, angle[first : first + CHUNK].size), conditions.depth)
        envelope(angle[first : first + CHUNK], axial, conditions.effective_radius, lead, speeds, teeth, bottom, reach,
                 offset, window, spread, moved, part)
        height[:, first : first + CHUNK] = part
        if progress is not None:
            progress(min(1.0, (first + CHUNK) / angle.size))
    return height


def bottom_of(op: Operation) -> tuple[Floats, float]:
    """Bottom edge of the tool as the kernel wants it (see _kernels.envelope), and the radius [m] that it reaches to."""
    tool = op.tool
    shape = outline(tool.diameter, tool.flute_length, tool.shape)
    bottom = np.array([shape.wiper_start, math.tan(tool.shape.bottom_clearance), shape.tip_end[0],
                       math.tan(tool.shape.tip_angle), *shape.centre, tool.shape.corner_radius])
    return bottom, shape.tip_end[0] if tool.shape.corner_radius == 0 else shape.centre[0] + tool.shape.corner_radius


def _window(radius: float, bottom: Floats, reach: float, offset: float, spread: float, feed: float) -> Floats:
    """Where along x_T a tool edge can be the one that is lowest, by intervals of y_T; see _kernels.envelope.

    An edge that passes at x_T stands at g(x, y) = (R_we + h(rho)) / cos(psi) - R_we without vibration. Passes whose g
    is more than `spread` above the lowest cannot win; teeth pass every `feed` along x_T, so one is that near.
    """
    edges = np.linspace(-reach, reach, BINS + 1)
    heights = np.vectorize(lambda rho: bottom_height(rho, bottom), otypes=[float])
    window = np.empty((4, BINS))
    rho = np.linspace(0.0, reach, 4001)
    profile = np.where(np.isfinite(h := heights(rho)), h, 1e3)
    found = np.empty((BINS + 1, 4))
    for i, y in enumerate(edges):
        half = math.sqrt(max(0.0, reach**2 - y**2))
        x = half * np.linspace(-1.0, 1.0, ACROSS + 1)
        g = (radius + np.interp(np.hypot(x, y), rho, profile)) * np.hypot(1.0, (x - offset) / radius) - radius
        best = int(np.argmin(g))
        sure = np.interp(np.clip([x[best] - feed, x[best] + feed], x[0], x[-1]), x, g).max() if half else g[best]
        inside = x[g <= sure + spread]
        found[i] = inside.min() - feed, inside.max() + feed, g[best], sure
    window[0], window[1] = (np.minimum(found[:-1, 0], found[1:, 0]), np.maximum(found[:-1, 1], found[1:, 1]))
    window[2], window[3] = (np.minimum(found[:-1, 2], found[1:, 2]), np.maximum(found[:-1, 3], found[1:, 3]))
    return window


@dataclass(frozen=True, eq=False)
class ToothPrint:
    """Surface left by one tooth in the thesis' reading (Figures 4.58, 4.59): a band behind its tip.

    angle (n,) [rad]: of the tip, from start to exit; place (m,) [m] behind the tip towards the tool axis, from 0 to
    the feed per tooth; height (m, n) [m]: static cusp and vibration (Eq. 4.132), positive is undercut.
    """

    angle: Floats
    place: Floats
    height: Floats


def tooth_print(op: Operation, conditions: Conditions, columns: int = 120, rows: int = 60) -> ToothPrint:
    """Static cusp x_b tan(alpha_b) of the bottom edge plus the steady vibration at each tip angle (Eq. 4.131, 4.132).

    columns, rows: points along the arc of the first tooth and behind its tip. Errors as surface_map.
    """
    require(op.process == "turn-milling", "process", op.process, "", "turn-milling")
    require(conditions.in_cut, "depth", conditions.depth, "m", "a cut (contact, both spindles turning)")
    arcs = rigid_cut(op, conditions).engagement
    angle = np.linspace(arcs.start[0].min(), arcs.exit[0].max(), columns)
    place = np.linspace(0.0, surface_feed_per_tooth(op, conditions), rows)
    shape = op.tool.shape
    static = np.maximum(0.0, place - shape.wiper_length) * math.tan(shape.bottom_clearance)
    at, moved = steady_axial(op, conditions)
    return ToothPrint(angle, place, static[:, None] + np.interp(angle, at, moved, period=TWO_PI))
