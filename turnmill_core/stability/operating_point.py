"""From an operation and the conditions of one instant to the stability problem."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from turnmill_core.cutting import engagement as cutting_engagement
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Conditions, Operation, Structure, require
from turnmill_core.stability.delay import DELAY_MODELS, DelayModel, delay_variation, mean_delay, tooth_period
from turnmill_core.stability.problem import Engagement, StabilityProblem
from turnmill_core.structure.modal import LinearStructure, modal_model, state_space

BAR_SLICES = 24
"""Height intervals in which the engagement of a round bar is taken as linear."""


def stability_problem(op: Operation, conditions: Conditions, delay_model: DelayModel = "mean") -> StabilityProblem:
    """The stability problem of `op` at `conditions`.

    delay_model: "mean" (Eq. 4.88), "milling" or "first-principles"; see :mod:`turnmill_core.stability.delay`.
    Raises ``ValueError`` for zero engagement, zero tool speed, a depth beyond the flutes, a rigid
    structure, or an unknown delay model.
    """
    require(delay_model in DELAY_MODELS, "delay model", delay_model, "", f"one of {', '.join(DELAY_MODELS)}")
    require(conditions.tool_speed > 0, "tool speed", conditions.tool_speed, "rad/s", "a number > 0")
    tool, pitch = op.tool, op.tool.pitch
    variation = 0.0
    if delay_model == "mean":
        delays = mean_delay(pitch, conditions.tool_speed, conditions.workpiece_speed)
    else:
        delays = tooth_period(pitch, conditions.tool_speed)
    if delay_model == "first-principles":
        surface = conditions.workpiece_speed * (conditions.effective_radius + conditions.depth / 2)
        variation = delay_variation(tool.radius, conditions.tool_speed, surface)
    return StabilityProblem(
        structure=contact_structure(op, conditions),
        tool_speed=conditions.tool_speed,
        pitch=tuple(float(p) for p in pitch),
        delays=tuple(float(t) for t in delays),
        helix_lag=math.tan(tool.helix_angle) / tool.radius,
        coefficients=(op.material.Ktc, op.material.Krc, op.material.Kac),
        engagement=engagement_of(op, conditions),
        delay_variation=variation,
    )


def contact_structure(op: Operation, conditions: Conditions) -> LinearStructure:
    """Modes of tool and workpiece at the cutting point, tool frame, as a first-order system."""
    rotation = tuple(map(tuple, machine_from_tool(op, conditions).tolist()))
    return _structure(op.tool.structure, op.workpiece.structure, rotation)


@lru_cache(maxsize=64)
def _structure(tool: Structure, workpiece: Structure, rotation: tuple[tuple[float, ...], ...]) -> LinearStructure:
    require(bool(tool.modes or workpiece.modes), "structure", "rigid", "",
            "at least one mode of tool or workpiece; a rigid structure cannot chatter")
    return state_space(modal_model(tool, workpiece, np.array(rotation)))


def engagement_of(op: Operation, conditions: Conditions) -> Engagement:
    """Engagement angles by height; a block has one form at every height, a bar is divided finely near its surface.

    Raises ``ValueError`` where the tool does not cut or the depth exceeds the flute length.
    """
    depth = conditions.depth
    require(depth > 0, "depth", depth, "m", "a number > 0")
    require(depth <= op.tool.flute_length, "depth", depth, "m", f"at most the flute length {op.tool.flute_length} m")
    require(conditions.radial_immersion > 0, "radial immersion", conditions.radial_immersion, "m", "a number > 0")
    slices = BAR_SLICES if op.process == "turn-milling" else 1
    height = depth * (1 - (1 - np.arange(slices + 1) / slices) ** 2)
    inside = height.copy()
    inside[-1] = depth * (1 - 1e-9)  # the material ends at the depth itself
    arcs = cutting_engagement.engagement(op, conditions, inside)
    start, stop = arcs.start.copy(), arcs.exit.copy()
    if np.any(stop[:, 1] > start[:, 1]):
        # one arc past 90 degrees below, two above: split it there, so that both forms join
        whole = (stop[:, 1] <= start[:, 1]) & (start[:, 0] < math.pi / 2) & (stop[:, 0] > math.pi / 2)
        stop[whole, 1], start[whole, 1], stop[whole, 0] = stop[whole, 0], math.pi / 2, math.pi / 2
    require(bool(np.any(stop > start)), "engagement", 0.0, "rad", "a tool that cuts")
    return Engagement(height, start, stop)


def at_depth(op: Operation, conditions: Conditions, depth: float) -> Conditions:
    """The same instant with another depth [m]: same speeds and feed, the tip nearer to or farther from the axis."""
    if op.process == "milling":
        return replace(conditions, depth=depth)
    radius = conditions.effective_radius + conditions.depth - depth
    require(radius > 0, "depth", depth, "m", f"less than the bar's radius {op.workpiece.radius} m")
    return replace(conditions, depth=depth, effective_radius=radius)
