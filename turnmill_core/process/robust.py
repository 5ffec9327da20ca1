"""Robust choice: the cut that stays feasible when modes and coefficients are not quite what is believed.

Operations are drawn around the given one (seeded); the share of them in which a cut meets every limit takes the place
of the safety margin of the stability limit. What the machine has shown, chatter or none in a cut that was made, keeps
the draws that agree with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation, require
from turnmill_core.process.cut_values import cut_values, feed_of, load_table, with_feed
from turnmill_core.process.limits import limit_margins
from turnmill_core.process.plan import Choice, Plan, Tell, choose
from turnmill_core.process.region import TINY, Region, region
from turnmill_core.stability.floquet import chatter_family
from turnmill_core.stability.operating_point import depth_family
from turnmill_core.stability.uncertainty import Spread, sampled

Floats = NDArray[np.float64]

SPEEDS = 24
DEPTHS = 10
"""Tool speeds and depths of a region at which the share is computed."""
WIDENINGS = (1.0, 2.0, 4.0)
"""Spreads that are tried in turn, as multiples, until draws agree with what was observed."""
FREQUENCY_AGREES = 0.01
"""Relative difference of a predicted chatter frequency from the measured one up to which a draw agrees."""


@dataclass(frozen=True)
class Observation:
    """What the machine showed in one cut.

    tool_speed, workpiece_speed [rad/s]; depth [m]; chatter: whether there was; frequency [Hz]: its line, NaN where
    there was none or it is not known.
    """

    tool_speed: float
    workpiece_speed: float
    depth: float
    chatter: bool
    frequency: float = math.nan


@dataclass(frozen=True, eq=False)
class Draws:
    """Operations that are drawn around one.

    operations: the draws kept; drawn: how many there were; widened [1]: the multiple of the spread that they took.
    """

    operations: tuple[Operation, ...]
    drawn: int
    widened: float = 1.0


def draw(
    op: Operation, samples: int, seed: int = 0, spread: Spread | None = None,
    observations: Sequence[Observation] = (),
) -> Draws:
    """`samples` operations around `op` that agree with all observations; equal arguments give equal draws.

    spread: None for the defaults. Up to 20 times as many are drawn; where not half of `samples` agree, the spread is
    widened, and where no widening helps, those of the widest stand, possibly none.
    Raises ValueError where the model describes no cut like an observed one.
    """
    require(samples >= 1, "samples", samples, "", "an integer >= 1")
    base, drawn, factor = spread or Spread(), 0, 1.0
    kept: list[Operation] = []
    for factor in WIDENINGS if observations else WIDENINGS[:1]:
        wide = Spread(*(min(factor * s, 0.4) for s in (base.frequency, base.damping, base.mass, base.coefficient)))
        rng, kept = np.random.default_rng(seed), []
        for drawn in range(1, 20 * samples + 1):
            one = sampled(op, wide, rng)
            if all(agrees(one, seen) for seen in observations):
                kept.append(one)
            if len(kept) == samples or (drawn == 4 * samples and not kept):
                break
        if 2 * len(kept) >= samples:
            break
    return Draws(tuple(kept), drawn, factor)


def agrees(op: Operation, seen: Observation) -> bool:
    """Whether `op` predicts what was observed: chatter, at about its frequency where that is known, or none."""
    cut = with_cut(op, seen.tool_speed, seen.workpiece_speed, seen.depth)
    family = depth_family(op, cut, seen.depth)
    multiplier = complex(family.multipliers(family.series([seen.depth]))[0])
    if (abs(multiplier) >= 1) != seen.chatter:
        return False
    if not seen.chatter or math.isnan(seen.frequency):
        return True
    lines = chatter_family(multiplier, family.deepest.period, 2 * seen.frequency)
    return bool(np.any(np.abs(lines / seen.frequency - 1) < FREQUENCY_AGREES))


@dataclass(frozen=True, eq=False)
class ShareMap:
    """Share of the draws in which a cut is feasible, (m, n) [1] at depths (m,) [m] and tool_speeds (n,) [rad/s]."""

    tool_speeds: Floats
    depths: Floats
    share: Floats

    def deepest(self, wanted: float) -> Floats:
        """Deepest depth [m] at each tool speed (n,) with at least a share `wanted` [1], linear in between; 0: none."""
        limit = np.zeros(self.tool_speeds.size)
        for j, column in enumerate(self.share.T):
            good = np.flatnonzero(column >= wanted)
            if good.size:
                last = good[-1]
                limit[j] = self.depths[last]
                if last + 1 < column.size:
                    limit[j] += (self.depths[last + 1] - self.depths[last]) * (column[last] - wanted) / (
                        column[last] - column[last + 1])
        return limit


def _without_reserve(op: Operation) -> Operation:
    return replace(op, limits=replace(op.limits, stability_margin=0.0))


def share_map(found: Region, draws: Draws, tell: Tell | None = None) -> ShareMap:
    """Share of the draws that are feasible over the feasible part of a region, on a coarser grid.

    tell: as in plan.
    """
    columns = np.flatnonzero(found.depth_limit > 0)
    columns = columns[np.unique(np.linspace(0, columns.size - 1, min(SPEEDS, columns.size)).round().astype(int))]
    speeds, top = found.tool_speeds[columns], float(found.depth_limit.max())
    depths, count = np.linspace(0.3 * top, top, DEPTHS), np.zeros((DEPTHS, columns.size))
    for k, one in enumerate(draws.operations):
        fed, ratios = _without_reserve(with_feed(one, found.feed)), 2 if not one.tool.runout else 5
        turning = abs(found.workpiece_speed)
        table = load_table(fed, depths, turning / speeds[-1], turning / speeds[0], ratios)
        here = region(fed, table, speeds, found.workpiece_speed, scan=DEPTHS)
        count += here.feasible[:, np.searchsorted(here.tool_speeds, speeds)]
        if tell is not None:
            tell((k + 1) / len(draws.operations), "uncertainty")
    return ShareMap(speeds, depths, count / len(draws.operations))


def feasible_share(choice: Choice, draws: Draws) -> float:
    """Share [1] of the draws in which a chosen cut meets every limit, by the full models; NaN without draws."""
    if not draws.operations:
        return math.nan
    met = 0
    for one in draws.operations:
        fed = _without_reserve(with_feed(one, feed_of(choice.op)))
        margins = limit_margins(fed.limits, cut_values(fed, choice.conditions))
        met += all(float(m.margin) >= -TINY for m in margins)
    return met / len(draws.operations)


def robust_choice(made: Plan, draws: Draws, wanted: float = 0.9, tell: Tell | None = None) -> Choice | None:
    """The most productive cut that at least a share `wanted` [1] of the draws can make; None where there is none.

    Regions are taken by falling removal rate; those that cannot beat what was found are left out. tell: as in plan.
    """
    require(0 < wanted <= 1, "share", wanted, "", "in (0, 1]")
    pairs = [(r, c) for r, c in zip(made.regions, made.choices, strict=True) if c is not None]
    best: Choice | None = None
    for found, nominal in sorted(pairs, key=lambda pair: -pair[1].rate):
        if not draws.operations or (best is not None and nominal.rate <= best.rate):
            break
        shares = share_map(found, draws, tell)
        limit = np.where(found.depth_limit > 0, np.minimum(
            np.interp(found.tool_speeds, shares.tool_speeds, shares.deepest(wanted), left=0, right=0),
            found.depth_limit), 0.0)
        choice, less = choose(found, limit), 0.02
        while choice is not None and (share := feasible_share(choice, draws)) < wanted:
            limit, less = limit * (1 - less), min(2 * less, 0.5)  # the shares were known on a coarse grid only
            choice = choose(found, limit) if limit.max() > found.depths[0] else None
        if choice is not None and (best is None or choice.rate > best.rate):
            best = replace(choice, share=share)
    return best
