"""Uncut chip thickness of a rigid cut (thesis Eq. 3.44, erratum M6), and the speeds that bound it.

`static` is the projection of the feed vector on the tooth's normal. `exact` measures, along the
tooth's normal, the material that is really there: between the trochoid of the tooth and those of
the teeth before it, the wall left by the previous workpiece revolution, and the surface of the bar.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnmill_core.cutting.engagement import (
    Engagement,
    axial_place,
    engagement,
    helix_lead,
    lever_arm,
    material_half_width,
    walls,
)
from turnmill_core.cutting.feed import cross_feed_sense, feed_velocity
from turnmill_core.cutting.tool import Array, EdgeElements, edge_elements, predecessors, read_only
from turnmill_core.operation import Conditions, Operation

ChipModel = Literal["static", "exact"]


@dataclass(frozen=True)
class Bar:
    """Material around a cylinder in the closed form's cuts.

    lever [m] (m,), distance of the height from the C axis; half_width [m] (m,), largest |x_T| of
    material; sense: +1 up-milling, -1 down-milling; lead [m/rad] and walls [m] (lower, upper) of the
    material as `axial_place` measures it, for the longest tooth; tool_radius [m]; lag [rad] (N, K),
    rotation since the k-th predecessor of each tooth passed.
    """

    lever: Array
    half_width: Array
    sense: float
    lead: float
    walls: tuple[float, float]
    tool_radius: float
    lag: Array


@dataclass(frozen=True)
class Cut:
    """Everything by height that the chip of one instant needs; m heights, N teeth.

    elements: the edges; engagement: arcs of the `static` chip; feed [m/s] (m, 3), coefficients of sin
    phi, cos phi and 1 in the feed along the normal f . n (on a cylinder f_x, f_y, 0); delay [s] (m, N, K)
    since the k-th predecessor of each tooth passed; step [m] (m, N, K), how far the tooth stands out
    beyond that predecessor along the normal; tool_speed [rad/s]; origin, axis (3,): in the tool frame,
    `axis` x (place of the tip from the C axis) [m] and the direction of the C axis, both times the sense
    of its rotation, so that the force's moment that resists it is F . (origin + axis x r).
    bar: what the `exact` chip needs besides, only for a cylinder in the closed form's cuts.
    """

    elements: EdgeElements
    engagement: Engagement
    feed: Array
    delay: Array
    step: Array
    tool_speed: float
    origin: Array
    axis: Array
    bar: Bar | None = None


def prepare_cut(op: Operation, conditions: Conditions, elements: int = 64) -> Cut:
    """Collect what the chip models need at one instant of the cut.

    Raises:
        ValueError: the conditions are not in cut, or the depth exceeds the flute length.
    """
    if not conditions.in_cut:
        raise ValueError(f"depth is {conditions.depth!r} m, radial immersion {conditions.radial_immersion!r} m, tool "
                         f"speed {conditions.tool_speed!r} rad/s, expected a cut (all > 0)")
    edges = edge_elements(op.tool, conditions.depth, elements)
    lower, upper = walls(op, conditions)
    sense = cross_feed_sense(conditions)
    if sense < 0:
        lower, upper = -upper, -lower
    if op.process == "turn-milling" and math.isinf(upper):
        lower += float((op.tool.radius + edges.runout).max()) - op.tool.radius  # the longest tooth left the wall
    angle, step = predecessors(op.tool, edges)
    feed = np.zeros((elements, 3))
    feed[:, :2] = feed_velocity(op, conditions, edges.height)
    turning = op.process == "turn-milling"
    return Cut(
        elements=edges,
        engagement=engagement(op, conditions, edges.height),
        feed=read_only(feed),
        delay=read_only(angle / conditions.tool_speed),
        step=step,
        tool_speed=conditions.tool_speed,
        origin=read_only((-conditions.effective_radius, 0.0, 0.0)),
        axis=read_only((0.0, -1.0 if turning else 0.0, 0.0)),
        bar=Bar(
            lever=read_only(lever_arm(op, conditions, edges.height)),
            half_width=read_only(material_half_width(op, conditions, edges.height)),
            sense=sense, lead=helix_lead(op, conditions), walls=(lower, upper), tool_radius=op.tool.radius,
            lag=angle[0],
        ),
    )


def static_chip(cut: Cut, phi: Array) -> Array:
    """Chip thickness of Eq. 3.44 at the tooth angles `phi` [rad] (n, N, m), engagement not applied.

    h_j = min over k of [(f . n) tau_jk + s_jk], with tau_jk the time since the k-th predecessor of
    tooth j passed and s_jk how far the tooth stands out beyond it; for equal pitch without runout
    h = (f . n) / (N Omega_t) (erratum M6: the feed is a length per time). Never below 0.
    """
    normal_feed = cut.feed[:, 0] * np.sin(phi) + cut.feed[:, 1] * np.cos(phi) + cut.feed[:, 2]
    chip = normal_feed[..., None] * cut.delay.swapaxes(0, 1) + cut.step.swapaxes(0, 1)
    return np.asarray(np.maximum(chip.min(axis=-1), 0.0), dtype=np.float64)


def largest_static_chip(cut: Cut) -> float:
    """Largest `static` chip [m] of all teeth and heights: at the end of an arc or across the feed, whichever is in."""
    arcs = cut.engagement
    across = np.arctan2(cut.feed[:, 0], cut.feed[:, 1])[:, None]
    # the turn of the arc's own: at most 2 pi past its start
    within = np.clip(arcs.start + (across - arcs.start) % (2 * math.pi), arcs.start, arcs.exit)
    across = np.where((across > arcs.start) & (across < arcs.exit), across, within)
    phi = np.stack([arcs.start, across, arcs.exit]).transpose(0, 2, 1).reshape(-1, 1, len(arcs.start))
    cuts = np.tile((arcs.exit > arcs.start).T, (3, 1))[:, None, :]
    return float(np.where(cuts, static_chip(cut, phi), 0.0).max())


def exact_chip(cut: Cut, phi: Array) -> Array:
    """Material along the tooth's normal [m] at the tooth angles `phi` [rad] (n, N, m), engagement included.

    On the ray from the tool axis through the edge, material lies outside the trochoid of every
    predecessor, inside the wall of the previous workpiece revolution and inside the bar. The radius
    at which the predecessor k crossed the ray solves
    r_jk sin(delta) = tau (f . e), delta = lag_jk - Omega_t tau, e the direction of motion of the edge,
    which Newton's method solves to round-off. The feed is taken as straight over the lag (workpiece
    rotation of a few mrad) and the wall as smooth.
    """
    bar = required_bar(cut)
    sine, cosine = np.sin(phi), np.cos(phi)
    along = cut.feed[:, 0] * sine + cut.feed[:, 1] * cosine
    across = cut.feed[:, 0] * cosine - cut.feed[:, 1] * sine
    own = (bar.tool_radius + cut.elements.runout)[:, None]
    inner = np.zeros(np.broadcast_shapes(phi.shape))
    for k in range(bar.lag.shape[1]):
        radius = own - cut.step[0, :, k, None]
        tau = np.broadcast_to(cut.delay[0, :, k, None], phi.shape)
        for _ in range(4):
            delta = bar.lag[:, k, None] - cut.tool_speed * tau
            tau = tau + (radius * np.sin(delta) - tau * across) / (cut.tool_speed * radius * np.cos(delta) + across)
        inner = np.maximum(inner, radius * np.cos(bar.lag[:, k, None] - cut.tool_speed * tau) - tau * along)
    x = own * sine
    outer = np.minimum(own, np.divide(bar.half_width, np.abs(sine), out=np.full(phi.shape, np.inf), where=sine != 0))
    place = axial_place(bar.lead, bar.tool_radius, x, bar.sense * own * cosine, bar.lever)
    slope = bar.sense * cosine - bar.lead * sine * bar.lever / (bar.lever**2 + x**2)
    for wall, rising in ((bar.walls[0], slope > 0), (bar.walls[1], slope < 0)):
        if math.isfinite(wall):
            with np.errstate(divide="ignore"):
                bound = own - (place - wall) / slope
            inner = np.where(rising, np.maximum(inner, bound), inner)
            outer = np.where(rising, outer, np.minimum(outer, bound))
    return np.asarray(np.maximum(outer - inner, 0.0), dtype=np.float64)


def required_bar(cut: Cut) -> Bar:
    """The material around a cylinder; raises ValueError where the cut has none, and so no `exact` chip."""
    if cut.bar is None:
        raise ValueError("chip model is 'exact', expected 'static': the exact chip is that of a cylinder in orthogonal "
                         "turn-milling or milling with a known wall")
    return cut.bar


def feed_per_tooth(op: Operation, conditions: Conditions) -> float:
    """Largest feed per tooth [m] of the bar's surface: hypot(pi D_w Omega_c, f_a Omega_c) / (N Omega_t), speeds in 1/s.

    In milling the feed speed over N Omega_t. This is the chip that chapter 5 of the thesis limits;
    the uncut chip itself is smaller by the sine of the exit angle.
    """
    if conditions.tool_speed == 0:
        return 0.0
    surface = conditions.workpiece_speed * op.workpiece.radius if op.process == "turn-milling" else 0.0
    return math.hypot(surface, conditions.feed_speed) * 2 * math.pi / (op.tool.teeth * conditions.tool_speed)


def tool_speed_for_feed_per_tooth(op: Operation, conditions: Conditions, limit: float) -> float:
    """Lowest tool speed [rad/s] that keeps `feed_per_tooth` at or below `limit` [m] (thesis 5.2.1)."""
    return feed_per_tooth(op, conditions) * conditions.tool_speed / limit


def tool_speed_for_cutting_speed(op: Operation, limit: float) -> float:
    """Highest tool speed [rad/s] whose peripheral speed is at or below `limit` [m/s] (thesis 5.2.5)."""
    return limit / op.tool.radius
