"""A new cut from the present state: the operation, modes that have changed, and what the machine has shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnmill_core.cutting.engagement import removal_rate
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation, require
from turnmill_core.process.cut_values import flexible
from turnmill_core.process.plan import Choice, Grid, Plan, Tell, default_grid, plan
from turnmill_core.process.region import Conflict
from turnmill_core.process.robust import Draws, Observation, draw, robust_choice

TOOL_SPEEDS, DEPTHS, WORKPIECE_SPEEDS = 96, 40, 8
"""Size of the grid: coarser than that of a plan, because the answer is wanted while the cut goes on."""
NEARBY = 0.3
"""Tool speeds this far from the nominal one are searched where nothing limits the tool speed."""


@dataclass(frozen=True, eq=False)
class Suggestion:
    """What is suggested instead of the present cut.

    op: the operation with the changed modes; choice: the cut, None where there is none; made: the plan behind it;
    draws: the operations that agree with what was observed; present_rate [m3/s]: removal rate of the present cut.
    """

    op: Operation
    choice: Choice | None
    made: Plan
    draws: Draws
    present_rate: float

    @property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Why there is no cut: the nearest miss of each region without one."""
        return tuple(c[0] for c in self.made.reasons if c)


def with_modes(op: Operation, frequencies: Sequence[float] = (), dampings: Sequence[float] = ()) -> Operation:
    """`op` with natural frequencies [Hz] and damping ratios [1] measured anew: the tool's modes, then the workpiece's.

    NaN keeps a value, nothing keeps all. The modal stiffness is kept: a frequency that falls means more mass.
    Raises ValueError where their number is not that of the modes.
    """
    modes = (*op.tool.structure.modes, *op.workpiece.structure.modes)
    for name, values in (("mode frequencies", frequencies), ("mode dampings", dampings)):
        require(len(values) in (0, len(modes)), name, len(values), "values", f"none or {len(modes)}, one per mode")
    changed = []
    for k, mode in enumerate(modes):
        frequency = frequencies[k] if frequencies and not math.isnan(frequencies[k]) else mode.frequency
        damping = dampings[k] if dampings and not math.isnan(dampings[k]) else mode.damping
        require(frequency > 0, "mode frequency", frequency, "Hz", "a number > 0")
        changed.append(replace(mode, frequency=frequency, damping=damping,
                               mass=mode.mass * (mode.frequency / frequency) ** 2))
    split = len(op.tool.structure.modes)

    tool, piece = (replace(old, modes=tuple(part)) if part else old for old, part in (
        (op.tool.structure, changed[:split]), (op.workpiece.structure, changed[split:])))
    return replace(op, tool=replace(op.tool, structure=tool), workpiece=replace(op.workpiece, structure=piece))


def search_grid(op: Operation, present_depth: float = 0.0) -> Grid:
    """What is searched for a suggestion: all that the limits allow, and what is usual where there are none.

    Usual is the nominal workpiece speed, tool speeds near the nominal one, and depths down to the nominal one or
    present_depth [m].
    """
    grid, limits, nominal = default_grid(op, TOOL_SPEEDS, DEPTHS, WORKPIECE_SPEEDS), op.limits, op.conditions
    if math.isinf(limits.depth_max):
        deepest = min(max(nominal.depth, present_depth), op.tool.flute_length)
        grid = replace(grid, depths=tuple((deepest * np.arange(1, DEPTHS + 1) / DEPTHS).tolist()))
    if math.isinf(limits.workpiece_speed_max) and not limits.workpiece_spindle:
        grid = replace(grid, workpiece_speeds=(abs(nominal.workpiece_speed),))
    if math.isinf(limits.tool_speed_max) and math.isinf(limits.cutting_speed_max) and not limits.tool_spindle:
        speeds = nominal.tool_speed * np.linspace(1 - NEARBY, 1 + NEARBY, TOOL_SPEEDS)
        grid = replace(grid, tool_speeds=tuple(speeds.tolist()))
    return grid


def suggest(
    op: Operation, present: Observation | None = None, observations: Sequence[Observation] = (), samples: int = 24,
    seed: int = 0, share: float = 0.9, tell: Tell | None = None,
) -> Suggestion:
    """The most productive cut that at least a `share` [1] of the models can make which agree with the observations.

    present: the cut that is being made, None for the nominal one. observations: what the machine showed; they count
    where the operation has modes. samples, seed: of the draws. tell: as in plan.
    """
    draws = draw(op, samples, seed, observations=observations if flexible(op) else ())
    made = plan(op, search_grid(op, 0.0 if present is None else present.depth), tell)
    now = op.conditions if present is None else with_cut(
        op, present.tool_speed, present.workpiece_speed, present.depth)
    return Suggestion(op, robust_choice(made, draws, share, tell), made, draws, removal_rate(op, now))
