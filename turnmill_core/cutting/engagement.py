"""Closed-form engagement of a cylindrical end mill in milling and orthogonal turn-milling.

At each height the tool cuts the material between two lines parallel to the resultant feed. In
turn-milling one of them is the wall that the previous workpiece revolution left, and the round bar
ends at |x_T| = sqrt(R_w^2 - (R_w - a + z)^2). Both senses, slot and centred cuts follow from
Conditions.cross_feed_span. The material that lies under the tool's end face when its height passes
the tool tip is cut by the bottom edges, not by the side edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from turnmill_core.cutting.feed import cross_feed_sense, feed_angle, feed_velocity
from turnmill_core.cutting.tool import Array, lag_angle, read_only, require_cylinder, tooth_offsets
from turnmill_core.operation import Conditions, Operation, require

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)


@dataclass(frozen=True)
class Engagement:
    """Start and exit angles of the cut by height.

    height [m] (m,) above the tool tip; start, exit [rad] (m, A), the arcs at a height, two of the closed form, each
    from start to exit in the sense of rotation. The second arc exists (start < exit) only where the
    cut reaches past 90 degrees and the bar is narrower than the tool at that height; an empty arc
    has start = exit.
    """

    height: Array
    start: Array
    exit: Array

    @property
    def angle(self) -> Array:
        """Angle in the cut [rad] (m,), the arcs of a height added."""
        return np.asarray((self.exit - self.start).sum(axis=1), dtype=np.float64)


@dataclass(frozen=True)
class Removal:
    """Material removed per time [m3/s]: by the side edges, through the tool's bottom, and in total."""

    side: float
    bottom: float
    total: float

    @property
    def bottom_share(self) -> float:
        """Share of the volume that enters through the tool's bottom [1]; 0 where nothing is removed."""
        return self.bottom / self.total if self.total > 0 else 0.0


def engagement(op: Operation, conditions: Conditions, height: Array) -> Engagement:
    """Engagement arcs at each `height` [m] (m,), in the tool frame, angles from +y_T towards +x_T.

    Material lies between the walls y1 and y2 of `walls` and inside the bar; the tool cuts it with the
    half of its flank that moves into it, from -epsilon to pi - epsilon (epsilon: `feed_angle`).
    Milling: from acos(y2/R) to acos(y1/R); erratum M10 is the check of the sense. Up-milling in
    turn-milling: from -epsilon to the angle at which the flank leaves the wall of the previous
    workpiece revolution, acos(1 - f_a/R) for a small f_a/R_w, and only where R |sin(phi)| is inside
    the bar. Without feed or material: empty arcs.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        height: heights above the tool tip [m], (m,).

    Raises:
        ValueError: the tool is no cylinder, or stands beside or tilted to the bar (see engagement_map.py).
    """
    require_cylinder(op.tool)
    require(op.eccentricity == 0 and op.tilt == 0, "eccentricity and tilt", (op.eccentricity, op.tilt), "m, rad",
            "0: other cuts have no closed form")
    height = np.atleast_1d(np.asarray(height, dtype=np.float64))
    radius = op.tool.radius
    sense = cross_feed_sense(conditions)
    epsilon = sense * feed_angle(op, conditions, height)
    lower, upper = walls(op, conditions)
    if sense < 0:  # mirrored at the plane y_T = 0, down-milling becomes up-milling
        lower, upper = -upper, -lower
    first = _crossing(op, conditions, height, epsilon, upper)
    last = _crossing(op, conditions, height, epsilon, lower)
    start = np.stack([first, last], axis=1)
    stop = np.stack([last, last], axis=1)
    half_width = material_half_width(op, conditions, height)
    narrow = half_width < radius
    alpha = np.arcsin(np.where(narrow, half_width, radius) / radius)
    for arc, (low, high) in enumerate(((-alpha, alpha), (math.pi - alpha, math.pi + alpha))):
        start[narrow, arc] = np.maximum(first, low)[narrow]
        stop[narrow, arc] = np.minimum(last, high)[narrow]
    if sense < 0:
        start, stop = math.pi - stop[:, ::-1], math.pi - start[:, ::-1]
    stop[_idle(op, conditions, height)] = -math.inf
    return Engagement(read_only(height), *_tidy(start, stop))


def _tidy(start: Array, stop: Array) -> tuple[Array, Array]:
    """Arcs with the empty ones last, at the exit of the first; zeros where nothing is cut."""
    cut = stop > start
    second = ~cut[:, 0] & cut[:, 1]
    first = np.where(second, 1, 0)[:, None]
    low, high = np.take_along_axis(start, first, 1)[:, 0], np.take_along_axis(stop, first, 1)[:, 0]
    both, none = cut.all(axis=1), ~cut.any(axis=1)
    starts = np.stack([low, np.where(both, start[:, 1], high)], axis=1)
    stops = np.stack([high, np.where(both, stop[:, 1], high)], axis=1)
    starts[none], stops[none] = 0.0, 0.0
    return read_only(starts), read_only(stops)


def walls(op: Operation, conditions: Conditions) -> tuple[float, float]:
    """Walls (y1, y2) [m] of the material to be cut, as `axial_place` measures; infinite where there is none.

    The span along y_T; a bound that reaches the tool's flank is no wall. A workpiece that stands
    still in turn-milling has no previous revolution: the whole tool diameter cuts.
    """
    radius = op.tool.radius * (1 - 1e-12)
    low, high = conditions.cross_feed_span
    if op.process == "turn-milling" and conditions.workpiece_speed == 0:
        low, high = -math.inf, math.inf
    return low if low > -radius else -math.inf, high if high < radius else math.inf


def axial_place(lead: float, radius: float, x: Array, y: Array, lever: Array) -> Array:
    """Where material at x_T = x and at y across lies along the feed axis, in the sense of `walls` [m].

    The material turns about the C axis while the tool travels, so it passes the tool's middle plane
    x_T = 0 at y - p atan(x / R(z)). From that the amount is taken by which the tool, moving on a
    helix, reaches beyond its radius at the material's radius r: R (sqrt(1 + (p/r)^2) - 1). The wall
    of the previous revolution is then at R - f_a, at every height.

    Args:
        lead: p = f_a / (2 pi) [m/rad], 0 in milling (see `helix_lead`).
        radius: tool radius R [m].
        x: x_T [m].
        y: position towards the uncut material [m], y_T in up-milling, -y_T in down-milling.
        lever: R(z) = R_w - a + z [m] (any number > 0 in milling).
    """
    beyond = radius * (np.sqrt(1 + lead**2 / (lever**2 + x**2)) - 1)
    return np.asarray(y - lead * np.arctan2(x, lever) - beyond, dtype=np.float64)


def helix_lead(op: Operation, conditions: Conditions) -> float:
    """Travel of the tool along the bar per radian of workpiece rotation [m/rad]; 0 in milling or at rest."""
    if op.process == "milling" or conditions.workpiece_speed == 0:
        return 0.0
    return conditions.feed_speed / abs(conditions.workpiece_speed)


def lever_arm(op: Operation, conditions: Conditions, height: Array) -> Array:
    """Distance R(z) = R_w - a + z [m] (m,) of `height` from the C axis (Eq. 3.25, erratum M1); 1 m in milling."""
    if op.process == "milling":
        return np.ones_like(height)
    return np.asarray(conditions.effective_radius + height, dtype=np.float64)


def _crossing(op: Operation, conditions: Conditions, height: Array, epsilon: Array, wall: float) -> Array:
    """Angle in [-epsilon, pi - epsilon] at which the flank crosses `wall`, by a bracketed secant; (m,)."""
    radius = op.tool.radius
    if op.process == "milling" or math.isinf(wall):
        return np.full(height.shape, math.acos(max(-1.0, min(1.0, wall / radius)))) - epsilon

    lead, lever = helix_lead(op, conditions), lever_arm(op, conditions, height)
    # the place falls like R cos(phi + epsilon), so step in that cosine
    low, high = -epsilon, math.pi - epsilon
    phi = np.arccos(np.clip(wall / radius * np.ones_like(epsilon), -1.0, 1.0)) - epsilon
    for _ in range(12):  # two or three are enough where the feed per revolution is small beside the bar
        excess = axial_place(lead, radius, radius * np.sin(phi), radius * np.cos(phi), lever) - wall
        if np.abs(excess).max() < 1e-13 * radius:
            break
        low, high = np.where(excess > 0, phi, low), np.where(excess > 0, high, phi)
        phi = np.arccos(np.clip(np.cos(phi + epsilon) - excess / radius, -1.0, 1.0)) - epsilon
        phi = np.where((phi < low) | (phi > high), (low + high) / 2, phi)
    return np.asarray(phi, dtype=np.float64)


def material_half_width(op: Operation, conditions: Conditions, height: Array) -> Array:
    """Largest |x_T| [m] (m,) that holds material at each `height` [m]; infinite in a block."""
    height = np.asarray(height, dtype=np.float64)
    if op.process == "milling":
        return np.full(height.shape, np.inf)
    square = op.workpiece.radius**2 - (conditions.effective_radius + height) ** 2
    return np.asarray(np.sqrt(np.maximum(square, 0.0)), dtype=np.float64)


def _idle(op: Operation, conditions: Conditions, height: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Heights at which nothing is cut: above the material, without contact, or without feed."""
    speed = np.hypot(*feed_velocity(op, conditions, height).T)
    return np.asarray((not conditions.in_cut) | (height < 0) | (height >= conditions.depth) | (speed == 0))


def removal(op: Operation, conditions: Conditions) -> Removal:
    """Volume removed per time by the side edges, through the bottom, and in total.

    The side integrates the flux (f . n) R dphi dz of material into the engaged tool flank; see
    `bottom_rate` and `removal_rate` for the others. The three come from separate integrals.
    """
    if not conditions.in_cut:
        return Removal(0.0, 0.0, 0.0)
    return Removal(_side(op, conditions), bottom_rate(op, conditions), removal_rate(op, conditions))


def removal_rate(op: Operation, conditions: Conditions) -> float:
    """Material removal rate [m3/s]: Omega_c f_a a pi (D_w - a), Omega_c in revolutions, or feed speed times section.

    Eq. 5.1 with its lost factor a. A slot in turn-milling is as wide as the helix of the tool sweeps.
    """
    if not conditions.in_cut:
        return 0.0
    radius, depth = op.tool.radius, conditions.depth
    width = min(conditions.cross_feed_span[1], radius) - max(conditions.cross_feed_span[0], -radius)
    if op.process == "milling":
        return conditions.feed_speed * width * depth
    if any(map(math.isfinite, walls(op, conditions))):
        section = (conditions.effective_radius + depth) ** 2 - conditions.effective_radius**2
        return abs(conditions.workpiece_speed) * width * section / 2
    height = depth * (1 - ((_NODES + 1) / 2) ** 2)
    weight = _WEIGHTS * depth * (_NODES + 1) / 2
    speed = np.hypot(*feed_velocity(op, conditions, height).T)
    if conditions.workpiece_speed == 0:
        return float(weight @ (2 * speed * np.minimum(material_half_width(op, conditions, height), radius)))
    return float(weight @ (2 * radius * speed))


def _heights(op: Operation, conditions: Conditions) -> tuple[Array, Array]:
    """Gauss nodes and weights from tip to depth, split at every height where an arc changes its form."""
    depth, radius = conditions.depth, op.tool.radius
    breaks = [0.0, depth]
    if op.process == "turn-milling":
        tip = engagement(op, conditions, np.zeros(1))
        reach = [radius, *np.abs(radius * np.sin(np.concatenate([tip.start[0], tip.exit[0]])))]
        breaks += [math.sqrt(max(op.workpiece.radius**2 - r**2, 0.0)) - conditions.effective_radius for r in reach]
    edges = sorted({min(max(b, 0.0), depth) for b in breaks})
    nodes, weights = [], []
    for low, high in pairwise(edges):
        # z = high - (high - low) s^2 smooths the square root at the top of each piece
        s = (_NODES + 1) / 2
        nodes.append(high - (high - low) * s**2)
        weights.append(_WEIGHTS * (high - low) * s)
    return np.concatenate(nodes), np.concatenate(weights)


def _side(op: Operation, conditions: Conditions) -> float:
    height, weight = _heights(op, conditions)
    arcs = engagement(op, conditions, height)
    feed = feed_velocity(op, conditions, height)[:, :, None]
    # integral of f_x sin(phi) + f_y cos(phi) over an arc
    flux = feed[:, 0] * (np.cos(arcs.start) - np.cos(arcs.exit)) + feed[:, 1] * (np.sin(arcs.exit) - np.sin(arcs.start))
    return float(op.tool.radius * weight @ flux.sum(axis=1))


def bottom_rate(op: Operation, conditions: Conditions) -> float:
    """Material [m3/s] that enters through the tool's bottom: the flux Omega_c x_T of what rises into the end face."""
    if not conditions.in_cut or op.process == "milling" or conditions.workpiece_speed == 0:
        return 0.0
    tip, radius = np.zeros(1), op.tool.radius
    half_width = float(material_half_width(op, conditions, tip)[0])
    # strips along y_T at x_T = R sin(theta), where material rises with Omega_c x_T
    edges = np.linspace(0.0, math.asin(min(1.0, half_width / radius)), 9)
    theta = (edges[:-1, None] + (edges[1] - edges[0]) * (_NODES + 1) / 2).ravel()
    weight = np.tile(_WEIGHTS, 8) * (edges[1] - edges[0]) / 2 * radius * np.cos(theta)
    x, flank = radius * np.sin(theta), radius * np.cos(theta)
    lower, upper = walls(op, conditions)
    if cross_feed_sense(conditions) < 0:
        lower, upper = -upper, -lower
    shift = axial_place(helix_lead(op, conditions), radius, x, np.zeros_like(x), lever_arm(op, conditions, tip))
    strip = np.clip(upper - shift, -flank, flank) - np.clip(lower - shift, -flank, flank)
    return float(abs(conditions.workpiece_speed) * weight @ (x * strip))


def cutting_time_share(op: Operation, conditions: Conditions, heights: int = 400) -> float:
    """Share of a tool revolution in which at least one point of an edge cuts [1].

    The ratio of cutting to non-cutting time is share / (1 - share) (Table 3.1 and 3.2). The union
    of the arcs of all teeth and heights, each shifted by its lag, is formed exactly; `heights`
    sets how finely the tool axis is sampled.
    """
    if not conditions.in_cut:
        return 0.0
    height = np.linspace(0.0, conditions.depth, heights, endpoint=False)
    arcs = engagement(op, conditions, height)
    turn = lag_angle(op.tool, height)[:, None] * np.ones((1, 2))
    cuts = arcs.exit > arcs.start
    low, high = (arcs.start + turn)[cuts], (arcs.exit + turn)[cuts]
    if low.size == 0:
        return 0.0
    low = (low[None, :] - tooth_offsets(op.tool)[:, None]).ravel()
    high = low + np.tile((arcs.exit - arcs.start)[cuts], op.tool.teeth)
    whole = 2 * math.pi
    low, high = np.concatenate([low % whole, low % whole - whole]), np.concatenate(
        [low % whole + (high - low), low % whole - whole + (high - low)])
    order = np.argsort(low)
    covered, end = 0.0, 0.0
    for a, b in zip(np.maximum(low[order], 0.0), np.minimum(high[order], whole), strict=True):
        if b > end:
            covered += b - max(a, end)
            end = float(b)
    return float(covered / whole)
