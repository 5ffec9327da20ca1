"""Selection of the most productive cut within all limits (thesis section 5.3).

Every combination of feed and workpiece speed gives a region over tool speed and depth; in each, the deepest feasible
cut removes most, MRR = Omega_c f_a a pi (D_w - a) (Eq. 5.1 with its lost factor a). The tool speed does not change the
removal rate, so that among the speeds that allow the depth the one is taken whose smallest margin is best, then the
second smallest, and so on. What is chosen is rounded and checked with the full models.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.engagement import removal_rate
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.process.cut_values import Progress, cut_values, feed_of, load_table, with_feed
from turnmill_core.process.limits import LimitMargin, limit_margins
from turnmill_core.process.region import TINY, Conflict, Region, conflicts, region

Floats = NDArray[np.float64]
Tell = Callable[[float, str], None]

SAME_DEPTH = 0.005
"""Tool speeds whose depth limit is within this share of the largest remove as much."""
DEPTH_STEP = 1e-5
"""Chosen depths are whole multiples of this [m]."""
CHECKS = 25
"""How often a chosen depth is reduced, by 1 % each time, until the full models agree."""


@dataclass(frozen=True)
class Grid:
    """What is searched: tool_speeds, workpiece_speeds [rad/s], depths [m], feeds [m/rev, milling: m per tooth].

    All ascending and > 0; a workpiece speed of 0 stands for milling.
    """

    tool_speeds: tuple[float, ...]
    workpiece_speeds: tuple[float, ...]
    depths: tuple[float, ...]
    feeds: tuple[float, ...]

    def __post_init__(self) -> None:
        for name, unit, least in (("tool_speeds", "rad/s", 2), ("workpiece_speeds", "rad/s", 1), ("depths", "m", 2),
                                  ("feeds", "m/rev", 1)):
            values = getattr(self, name)
            ascending = all(a < b for a, b in pairwise(values))
            zero = name == "workpiece_speeds" and values == (0.0,)
            good = all(math.isfinite(v) and v > 0 for v in values) or zero
            require(len(values) >= least and ascending and good, f"grid of {name.replace('_', ' ')}", values, unit,
                    f"at least {least} ascending numbers > 0")


def default_grid(op: Operation, tool_speeds: int = 200, depths: int = 100, workpiece_speeds: int = 10) -> Grid:
    """The grid that the limits of `op` suggest: up to the largest speeds and depth that they allow.

    tool_speeds, depths, workpiece_speeds: how many. Where a limit is not given, twice the nominal value is the largest
    (four times for the depth). The feed is the nominal one.
    """
    limits, nominal = op.limits, op.conditions
    ends = [limits.tool_speed_max, *(r.speeds[-1] for r in limits.tool_spindle[:1])]
    fastest = min(ends, default=math.inf)
    if math.isinf(fastest):
        cutting = 1.1 * limits.cutting_speed_max / op.tool.radius
        fastest = cutting if math.isfinite(cutting) else 2 * nominal.tool_speed
    slowest = max(limits.tool_speed_min, fastest / 12)
    deepest = min(limits.depth_max, op.tool.flute_length,
                  0.95 * op.workpiece.radius if op.workpiece.is_bar else op.workpiece.height)
    if math.isinf(limits.depth_max) and nominal.depth > 0:
        deepest = min(deepest, 4 * nominal.depth)
    turning: tuple[float, ...] = (0.0,)
    if op.process == "turn-milling":
        top = limits.workpiece_speed_max
        top = 2 * abs(nominal.workpiece_speed) if math.isinf(top) else top
        turning = tuple((top * np.arange(1, workpiece_speeds + 1) / workpiece_speeds).tolist())
    feed = op.axial_feed if op.process == "turn-milling" else op.feed_per_tooth
    return Grid(tuple(np.linspace(slowest, fastest, tool_speeds).tolist()), turning,
                tuple((deepest * np.arange(1, depths + 1) / depths).tolist()), (feed,))


@dataclass(frozen=True, eq=False)
class Choice:
    """A cut that meets every limit.

    op, conditions: the cut, with its feed; margins: of every limit, by the full models; rate [m3/s]; form_error [m],
    NaN in milling; tool_speeds: intervals of tool speed [rad/s] that allow this depth (Eq. 5.8). share [1]: of the
    sampled operations in which the cut is feasible, NaN where none were drawn.
    """

    op: Operation
    conditions: Conditions
    margins: tuple[LimitMargin, ...]
    rate: float
    form_error: float
    tool_speeds: tuple[tuple[float, float], ...]
    share: float = math.nan

    @property
    def binding(self) -> LimitMargin | None:
        """The limit with the smallest margin, None where there are no limits."""
        return min(self.margins, key=lambda m: float(m.margin), default=None)


@dataclass(frozen=True, eq=False)
class Plan:
    """Result of a selection.

    op: what was asked; regions: one for each feed and workpiece speed; choices: the most productive cut of each, None
    where there is none; reasons: why not, for each; pareto: cuts that no other beats in both removal rate and form
    error, by rising rate (empty in milling).
    """

    op: Operation
    regions: tuple[Region, ...]
    choices: tuple[Choice | None, ...]
    reasons: tuple[tuple[Conflict, ...], ...]
    pareto: tuple[Trade, ...]

    @property
    def best(self) -> Choice | None:
        """The most productive cut of all."""
        return max((c for c in self.choices if c is not None), key=lambda c: c.rate, default=None)


@dataclass(frozen=True)
class Trade:
    """A cut of the trade between removal rate and form error.

    tool_speed, workpiece_speed [rad/s]; depth [m]; feed [m/rev]; rate [m3/s]; form_error [m].
    """

    tool_speed: float
    workpiece_speed: float
    depth: float
    feed: float
    rate: float
    form_error: float


def plan(op: Operation, grid: Grid | None = None, tell: Tell | None = None) -> Plan:
    """Search a grid (None: default_grid) for the most productive cut of `op` within its limits.

    tell: called with the share that is done and what is being done; an exception from it ends the search.
    Raises ValueError for a grid that the operation does not allow.
    """
    grid = grid or default_grid(op)
    tell = tell or (lambda share, what: None)
    require(grid.depths[-1] <= op.tool.flute_length, "depth", grid.depths[-1], "m",
            f"at most the flute length {op.tool.flute_length} m")
    speeds, depths = np.array(grid.tool_speeds), np.array(grid.depths)
    sense = math.copysign(1.0, op.conditions.workpiece_speed)
    parts, regions = len(grid.feeds) * (1 + len(grid.workpiece_speeds)), []
    for i, feed in enumerate(grid.feeds):
        fed, done = with_feed(op, feed), i * (1 + len(grid.workpiece_speeds))
        tell(done / parts, "forces")
        table = load_table(fed, depths, grid.workpiece_speeds[0] / speeds[-1], grid.workpiece_speeds[-1] / speeds[0])
        for k, turning in enumerate(grid.workpiece_speeds, done + 1):
            regions.append(region(fed, table, speeds, sense * turning, progress=_within(tell, k, parts, turning)))
    tell(1.0, "choice")
    choices = tuple(choose(r) for r in regions)
    return Plan(op, tuple(regions), choices, tuple(conflicts(r) for r in regions), pareto_front(regions, choices))


def _within(tell: Tell, part: int, parts: int, workpiece_speed: float) -> Progress:
    """Progress of one part out of several."""
    what = f"workpiece at {workpiece_speed * 30 / math.pi:.6g} rpm" if workpiece_speed else "stability"
    return lambda share: tell((part + share) / parts, what)


def choose(found: Region, depth_limit: Floats | None = None) -> Choice | None:
    """The most productive cut of a region that the full models confirm; None where nothing is feasible.

    depth_limit (n,) [m]: deepest depth at each tool speed, None for the region's own.
    """
    limit = found.depth_limit if depth_limit is None else depth_limit
    if not np.any(limit > 0):
        return None
    weight = found.tool_speeds if found.op.process == "milling" else np.ones(limit.size)
    gain = limit * weight
    candidates = np.flatnonzero(gain >= gain.max() * (1 - SAME_DEPTH))
    j = max(candidates.tolist(), key=lambda k: _reserves(found, k, 0.95 * float(limit[k])))
    depth = min(math.floor(float(limit[j]) / DEPTH_STEP * (1 + 1e-9)) * DEPTH_STEP or math.inf, float(limit[j]))
    for _ in range(CHECKS):
        choice = _checked(found, float(found.tool_speeds[j]), depth)
        if choice is not None:
            return choice
        depth = math.floor(0.99 * depth / DEPTH_STEP) * DEPTH_STEP or 0.99 * depth
    return None


def _reserves(found: Region, column: int, depth: float) -> tuple[float, ...]:
    """Margins at a depth [m] and a tool speed, the smallest first, hundredths count; then nearness to the nominal."""
    at = [float(np.interp(depth, found.depths, m[:, column])) for m in found.stacked]
    return (*sorted(round(m, 2) for m in at), -abs(float(found.tool_speeds[column]) - found.op.conditions.tool_speed))


def _checked(found: Region, tool_speed: float, depth: float) -> Choice | None:
    """The cut with margins by the full models, None where one is not met; a whole number of rpm where that is met."""
    rpm = math.pi / 30
    for speed in (round(tool_speed / rpm) * rpm, tool_speed):
        cut = with_cut(found.op, speed, found.workpiece_speed, depth)
        values = cut_values(found.op, cut)
        margins = limit_margins(found.op.limits, values)
        if all(float(m.margin) >= -TINY for m in margins):
            return Choice(found.op, cut, margins, removal_rate(found.op, cut), float(values.form_error),
                          tuple(found.speed_intervals((1 - SAME_DEPTH) * depth)))
    return None


def pareto_front(regions: Sequence[Region], choices: Sequence[Choice | None]) -> tuple[Trade, ...]:
    """Feasible cuts that no other beats in both removal rate and form error, by rising rate.

    regions: their grids count; choices: and these cuts.
    """
    trades = [Trade(c.conditions.tool_speed, c.conditions.workpiece_speed, c.conditions.depth, feed_of(c.op), c.rate,
                    c.form_error) for c in choices if c is not None and math.isfinite(c.form_error)]
    for r in regions:
        error = np.broadcast_to(r.values.form_error, r.least.shape)
        for i, row in enumerate(np.where(r.feasible, error, math.inf)):
            j = int(np.argmin(row))
            if math.isfinite(row[j]) and r.rate.ndim == 1:
                trades.append(Trade(float(r.tool_speeds[j]), r.workpiece_speed, float(r.depths[i]), r.feed,
                                    float(r.rate[i]), float(row[j])))
    front: list[Trade] = []
    for trade in sorted(trades, key=lambda t: (-t.rate, t.form_error)):
        if not front or trade.form_error < front[-1].form_error:
            front.append(trade)
    return tuple(front[::-1])


def planned(choice: Choice) -> Operation:
    """The operation with the chosen cut as its nominal one; schedule, text and hash are left out."""
    return replace(choice.op, conditions=choice.conditions, schedule=(), text="", sha256="")
