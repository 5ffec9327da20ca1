"""From an operation and the conditions of one instant to the stability problem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting import engagement as cutting_engagement
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.stability.collocation import DepthSeries, depth_series, modal_blocks, series_multipliers
from turnmill_core.stability.delay import DELAY_MODELS, DelayModel, delay_variation, mean_delay, tooth_period
from turnmill_core.stability.problem import Engagement, StabilityProblem
from turnmill_core.structure.at import ContactStructure, Position, structure_at
from turnmill_core.structure.modal import frozen_array

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

BAR_SLICES = 80
"""Height intervals in which the engagement of a round bar is taken as linear."""
BAR_SAMPLES = 400
"""Heights at which it is computed."""


def stability_problem(
    op: Operation, conditions: Conditions, delay_model: DelayModel = "mean", position: Position | None = None,
    levelled: bool = True,
) -> StabilityProblem:
    """The stability problem of `op` at `conditions`.

    delay_model: "mean" (Eq. 4.88), "milling" or "first-principles"; see :mod:`turnmill_core.stability.delay`.
    position: axis positions for modes that depend on them, as in structure_at. levelled: leave out a bend of the
    arcs in the last micrometres under a bar's surface, which the chip's gain hardly feels but edge forces do.
    Raises ``ValueError`` for zero engagement, zero tool speed, a depth beyond the flutes, a rigid structure, an unknown
    delay model, a tool that is no cylinder, and an eccentric or tilted one.
    """
    family = depth_family(op, conditions, conditions.depth, delay_model, position, levelled)
    return family.problem(conditions.depth)


@dataclass(frozen=True, eq=False)
class DepthFamily:
    """The stability problems of one cut at all depths up to a deepest one, else the same.

    op, conditions: where they come from, at the deepest depth; delay_model, position: as in stability_problem.
    below (k,): depths under the surface [m], ascending from 0; start, stop (k, arcs): engagement angles
    there [rad]; kink [m]: depth below which the bar is wider than the cut (0: nowhere).
    """

    op: Operation
    conditions: Conditions
    delay_model: DelayModel
    position: Position | None
    below: Floats
    start: Floats
    stop: Floats
    kink: float

    def arcs(self, depths: Sequence[float] | Floats) -> tuple[Floats, Floats, Floats]:
        """Heights (n, k), start and exit angles (n, k, arcs) of the engagement at several depths [m]."""
        depth = np.asarray(depths, dtype=np.float64)
        if self.op.process == "milling":
            start, stop = (np.tile(v[0], (depth.size, 2, 1)) for v in (self.start, self.stop))
            return np.column_stack([np.zeros_like(depth), depth]), start, stop
        places = np.stack([_places(float(a), self.kink) for a in depth])
        start, stop = (np.stack([np.interp(places, self.below, arc) for arc in v.T], axis=-1)
                       for v in (self.start, self.stop))
        return places[:, :1] - places, start, stop

    def problem(self, depth: float, tool_speed: float | None = None) -> StabilityProblem:
        """The problem at a depth [m] and tool_speed [rad/s] (None: the conditions')."""
        heights, start, stop = self.arcs([depth])
        op, speed = self.op, self.conditions.tool_speed if tool_speed is None else tool_speed
        delays, variation = self.delays(speed, depth)
        structure, flank = self.structure(depth, speed), op.process_damping
        damping = (0.0, 0.0) if flank is None else (flank.coefficient(op.tool.radius * speed), flank.friction)
        return StabilityProblem(
            structure=structure.linear, rotating=structure.rotating, tool_speed=speed,
            pitch=tuple(float(p) for p in op.tool.pitch), delays=delays, delay_variation=variation,
            helix_lag=math.tan(op.tool.helix_angle) / op.tool.radius,
            coefficients=(op.material.Ktc, op.material.Krc, op.material.Kac),
            engagement=Engagement(heights[0], start[0], stop[0]), process_damping=damping)

    def structure(self, depth: float | None = None, tool_speed: float | None = None) -> ContactStructure:
        """Structure at the cutting point for a depth [m] and tool_speed [rad/s] (None: the conditions')."""
        return self._still or self._structure_at(depth, tool_speed)

    def _structure_at(self, depth: float | None, tool_speed: float | None) -> ContactStructure:
        there = at_depth(self.op, self.conditions, depth, tool_speed)
        return structure_at(self.op, machine_from_tool(self.op, there), there, self.position)

    @cached_property
    def _still(self) -> ContactStructure | None:
        """The structure where neither depth nor tool speed change it."""
        parts = (self.op.tool.structure, self.op.workpiece.structure)
        moving = self.by_depth or any(
            s.frame == "rotating" or (s.table is not None and "tool_speed" in s.table.axes) for s in parts)
        return None if moving else self._structure_at(None, None)

    @cached_property
    def by_depth(self) -> bool:
        """Whether the depth of cut changes the structure: it weighs the contact points, and thins the bar."""
        return bool(self.op.tool.structure.heights or self.op.workpiece.structure.heights
                    or self.op.workpiece.beam is not None)

    def delays(self, tool_speed: float, depth: float) -> tuple[tuple[float, ...], float]:
        """Mean delay [s] of each tooth, variation [1] (see StabilityProblem) at tool_speed [rad/s] and depth [m]."""
        cut, pitch, variation = self.conditions, self.op.tool.pitch, 0.0
        mean = self.delay_model == "mean"
        delays = mean_delay(pitch, tool_speed, cut.workpiece_speed) if mean else tooth_period(pitch, tool_speed)
        if self.delay_model == "first-principles":
            surface = cut.workpiece_speed * (cut.effective_radius + cut.depth - depth / 2)
            variation = delay_variation(self.op.tool.radius, tool_speed, surface)
        return tuple(float(t) for t in delays), variation

    @cached_property
    def deepest(self) -> StabilityProblem:
        """The problem at the deepest cut."""
        return self.problem(self.conditions.depth)

    def free_decay(self, tool_speed: float | None = None) -> float:
        """ln|mu| at depth 0, of the free structure, at tool_speed [rad/s] (None: the conditions')."""
        p = self.deepest
        decay = modal_blocks(self.structure(tool_speed=tool_speed).linear).lam.real.max()
        return float(decay * p.period * p.tool_speed / (tool_speed or p.tool_speed))

    def series(self, depths: Sequence[float] | Floats) -> DepthSeries:
        """The depths prepared for the fast solver."""
        return depth_series(self.deepest, *self.arcs(depths))

    def multipliers(self, series: DepthSeries, tool_speed: float | None = None) -> Complexes:
        """Leading multipliers of the series at tool_speed [rad/s] (None: the conditions')."""
        speed = self.conditions.tool_speed if tool_speed is None else tool_speed
        delays, variation = self.delays(speed, 0.0)[0], np.zeros(len(series.heights))
        if self.delay_model == "first-principles":
            variation = np.array([self.delays(speed, float(a))[1] for a in series.heights[:, -1]])
        if not self.by_depth:
            return series_multipliers(series, speed, delays, variation, self.structure(tool_speed=speed).linear)
        return np.concatenate([
            series_multipliers(series.one(i), speed, delays, variation[i:i + 1],
                               self.structure(float(series.heights[i, -1]), speed).linear)
            for i in range(len(series.heights))])


def depth_family(
    op: Operation, conditions: Conditions, deepest: float, delay_model: DelayModel = "mean",
    position: Position | None = None, levelled: bool = True,
) -> DepthFamily:
    """The problems of `op` at `conditions` for every depth up to `deepest` [m].

    delay_model, position, levelled and errors: as stability_problem.
    At a height the arcs depend on the distance from the C axis only, so the deepest cut holds all others.
    """
    require(conditions.tool_speed > 0, "tool speed", conditions.tool_speed, "rad/s", "a number > 0")
    require(deepest > 0, "depth", deepest, "m", "a number > 0")
    require(deepest <= op.tool.flute_length, "depth", deepest, "m",
            f"at most the flute length {op.tool.flute_length} m")
    require(conditions.radial_immersion > 0, "radial immersion", conditions.radial_immersion, "m", "a number > 0")
    require(delay_model in DELAY_MODELS, "delay model", delay_model, "", f"one of {', '.join(DELAY_MODELS)}")
    require(op.tool.shape.is_cylinder, "tool shape", op.tool.name, "", "a cylindrical tool: stability knows no other")
    require(op.eccentricity == 0 and op.tilt == 0, "eccentricity and tilt", (op.eccentricity, op.tilt), "m, rad",
            "0: stability knows orthogonal, centred turn-milling only")
    cut, kink = at_depth(op, conditions, deepest), 0.0
    if op.process == "milling":
        arcs = cutting_engagement.engagement(op, cut, np.zeros(1))
        below, start, stop = np.array([0.0, deepest]), np.repeat(arcs.start, 2, axis=0), np.repeat(arcs.exit, 2, axis=0)
    else:
        kink = min(max(deepest - _narrowing_height(op, cut), 0.0), deepest)
        below, start, stop = _bar_arcs(op, cut, kink, levelled)
    cuts = np.any(stop > start, axis=0)
    require(bool(np.any(cuts)), "engagement", 0.0, "rad", "a tool that cuts")
    start, stop = start[:, cuts], stop[:, cuts]
    family = DepthFamily(op, cut, delay_model, position, below, start, stop, kink)
    family.structure()  # refuses a rigid one
    return family


def _places(depth: float, kink: float) -> Floats:
    """Depths under a bar's surface [m], from `depth` to 0, finer towards the surface; `kink` [m] is one of them."""
    if not 0 < kink < depth:
        return depth * _falling(BAR_SLICES) ** 2
    lower = BAR_SLICES // 4
    return np.concatenate([kink + (depth - kink) * _falling(lower)[:-1], kink * _falling(BAR_SLICES - lower) ** 2])


@lru_cache(maxsize=4)
def _falling(intervals: int) -> Floats:
    """Equally spaced numbers from 1 to 0, read-only."""
    return frozen_array(np.linspace(1.0, 0.0, intervals + 1), "fractions", (-1,))


def _bar_arcs(
    op: Operation, deepest: Conditions, kink: float, levelled: bool,
) -> tuple[Floats, Floats, Floats]:
    """Depths under the surface (k,) [m] and the engagement angles there, start and exit (k, 2) [rad], of a bar."""
    depth = deepest.depth
    below = np.unique(np.concatenate([depth * np.linspace(0, 1, BAR_SAMPLES) ** 2, [kink]]))
    arcs = cutting_engagement.engagement(op, deepest, np.minimum(depth - below, depth * (1 - 1e-9)))
    start, stop = arcs.start.copy(), arcs.exit.copy()
    if np.any(stop[:, 1] > start[:, 1]):
        # one arc past 90 degrees below, two above: split it there, so that both forms join
        whole = (stop[:, 1] <= start[:, 1]) & (start[:, 0] < math.pi / 2) & (stop[:, 0] > math.pi / 2)
        stop[whole, 1], start[whole, 1], stop[whole, 0] = stop[whole, 0], math.pi / 2, math.pi / 2
    if levelled:
        _level_sliver(op, below, start[:, 0], stop[:, 0])
    return below, start, stop


def _level_sliver(op: Operation, below: Floats, start: Floats, stop: Floats) -> None:
    """Let the flank that a tool enters or leaves along the feed run on to the surface, in place.

    The feed angle turns that flank past x_T = 0, so the last micrometres under the bar's surface end it earlier than
    the heights below; left in, they would put a bend into the force that is too small to matter and costs nodes.
    """
    flank, past = (start, np.abs(start)) if abs(start[-1]) < abs(math.pi - stop[-1]) else (stop, np.abs(math.pi - stop))
    sliver = (op.tool.radius * math.sin(min(float(past.max()), 0.3))) ** 2 / (2 * op.workpiece.radius)
    first = int(np.searchsorted(below, 1.2 * sliver))
    if 0 < first < below.size:
        other = stop[:first] if flank is start else start[:first]
        flank[:first] = np.minimum(flank[first], other) if flank is start else np.maximum(flank[first], other)


def _narrowing_height(op: Operation, conditions: Conditions) -> float:
    """Height [m] above which the bar is narrower than the cut, so that its surface ends the arc."""
    tip = cutting_engagement.engagement(op, conditions, np.zeros(1))
    widest = cutting_engagement.material_half_width(op, conditions, np.zeros(1))[0]
    reach = op.tool.radius * max(math.sin(min(abs(v), math.pi / 2)) for v in (tip.start[0, 0], tip.exit[0, 0]))
    if reach >= widest * (1 - 1e-9):
        return 0.0
    return math.sqrt(op.workpiece.radius**2 - reach**2) - conditions.effective_radius


def at_depth(
    op: Operation, conditions: Conditions, depth: float | None, tool_speed: float | None = None,
) -> Conditions:
    """The same instant of `op` at another depth [m] and tool_speed [rad/s] (None: the same).

    The tip is nearer to or farther from the axis of a bar; the workpiece's speed and the feed do not change.
    """
    a = conditions.depth if depth is None else depth
    speed = conditions.tool_speed if tool_speed is None else tool_speed
    if op.process == "milling":
        return replace(conditions, depth=a, tool_speed=speed)
    radius = conditions.effective_radius + conditions.depth - a
    require(radius > 0, "depth", a, "m", f"less than the bar's radius {op.workpiece.radius} m")
    return replace(conditions, depth=a, effective_radius=radius, tool_speed=speed)


def structure_key(op: Operation, conditions: Conditions, position: Position | None, change: float) -> tuple[int, ...]:
    """Natural frequencies and compliance of the structure in steps of `change`: equal where they hardly differ.

    Poles and largest mobility at the cutting point, for the nominal tool speed of `op`; position: as in
    stability_problem. Says whether place or shape of the workpiece ask for another prediction; empty where they never
    do, and for a rigid structure.
    """
    tool, piece = op.tool.structure, op.workpiece.structure
    if tool.table is None and piece.table is None and op.workpiece.beam is None and piece.frame != "rotating":
        return ()
    there = at_depth(op, conditions, conditions.depth, op.conditions.tool_speed)
    s = structure_at(op, machine_from_tool(op, there), there, position).linear
    poles = np.abs(modal_blocks(s).lam)
    static = np.linalg.norm(s.C[:2] @ np.linalg.solve(s.A, s.B), axis=1)
    return tuple(np.round(np.log(np.concatenate([np.sort(poles), static + 1e-15])) / change).astype(int).tolist())
