"""Loads along a path: at every axis state the engagement of that moment, and the loads of one tool revolution with it.

Two ways to the engagement. `closed`: the closed form of a steady cut (orthogonal turn-milling with a cylinder over the
C axis, milling along +x), each state by itself. `swept`: the workpiece in process, which remembers what the tool
has removed; any tool, place and tilt, and the states must follow each other closely enough, because between
two of them every axis is taken to move linearly. State in, state out, so that a node and a table of a path are one
function.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.engagement_map import engage
from turnmill_core.cutting.loads import CuttingLoads, cutting_loads, path_loads
from turnmill_core.cutting.swept import SweptWorkpiece, fresh_workpiece
from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes, machine_from_tool
from turnmill_core.machine.screw import rotation
from turnmill_core.operation import Conditions, Operation

Method = Literal["auto", "closed", "swept"]


@dataclass(frozen=True)
class Followed:
    """Loads at one axis state, and the axes x_T, y_T, z_T in the machine frame as columns (3, 3) of `rotation`."""

    loads: CuttingLoads
    rotation: Array


def has_closed_form(op: Operation) -> bool:
    """Whether the engagement of the operation's tool, over its workpiece, has a closed form."""
    return (op.tool.shape.is_cylinder and not op.tool.shape.axial_runout and not op.workpiece.profile
            and op.eccentricity == 0 and op.tilt == 0)


def follow(
    op: Operation, workpiece: SweptWorkpiece | None, axes: AxisState, method: Method = "auto", bottom: bool = False
) -> tuple[SweptWorkpiece | None, Followed]:
    """Loads at the next axis state.

    Args:
        op: the operation: tool, workpiece, material.
        workpiece: what the call before gave; None at first.
        axes: positions and velocities.
        method: `auto` is the closed form where the operation has one, otherwise the swept workpiece.
        bottom: add the forces of the bottom edges.

    Returns:
        the workpiece for the next call (None with the closed form), and the loads.

    Raises:
        ValueError: what the closed form, or the swept workpiece, does not describe.
    """
    if method == "closed" or (method == "auto" and has_closed_form(op)):
        conditions = rounded(conditions_from_axes(op, axes))
        return None, Followed(_known_loads(op, conditions, bottom), machine_from_tool(op, conditions))
    workpiece, cut = engage(op, fresh_workpiece(op) if workpiece is None else workpiece, axes)
    return workpiece, Followed(path_loads(op, cut, bottom=bottom), cut.motion.rotation)


_known_loads = lru_cache(maxsize=64)(lambda op, conditions, bottom: cutting_loads(op, conditions, bottom=bottom))


def rounded(conditions: Conditions) -> Conditions:
    """Conditions with nine significant digits, so that rounding in the axis positions is no new cut."""
    def nine(value: float) -> float:
        return float(f"{value:.9g}")

    lower, upper = conditions.cross_feed_span
    return Conditions(
        nine(conditions.tool_speed), nine(conditions.workpiece_speed), nine(conditions.depth),
        nine(conditions.feed_speed), (nine(lower), nine(upper)), nine(conditions.effective_radius))


@dataclass(frozen=True)
class PathLoads:
    """Loads along a path at n axis states; zeros where nothing is cut, NaN where the model describes no cut.

    method: `closed` or `swept`. time [s] (n,); tip [m] (n, 3), tool tip in the machine frame. force_tool,
    force_machine, force_workpiece [N] (n, 3), on the tool, means over a revolution, in tool, machine and workpiece
    frame (which turns with C); force_tool_peak [N] (n, 3), largest magnitudes, signed. tool_torque,
    workpiece_torque [N m], tool_power, workpiece_power [W] (n,), means, as in CuttingLoads; chip_thickness_max [m],
    removal_rate [m3/s], bottom_share [1] (n,); in_cut (n,). refused: state and reason where there is no
    prediction.
    """

    method: Method
    time: Array
    tip: Array
    force_tool: Array
    force_tool_peak: Array
    force_machine: Array
    force_workpiece: Array
    tool_torque: Array
    tool_power: Array
    workpiece_torque: Array
    workpiece_power: Array
    chip_thickness_max: Array
    removal_rate: Array
    bottom_share: Array
    in_cut: NDArray[np.bool_]
    refused: tuple[tuple[int, str], ...]


def loads_along(
    op: Operation, states: Sequence[AxisState], method: Method = "auto", bottom: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> PathLoads:
    """Loads at each of the axis states `states`, from a workpiece that is whole at the first.

    Args:
        op: the operation.
        states: axis states in their order.
        method: `auto` takes the closed form where it describes the operation and every one of the states.
        bottom: add the forces of the bottom edges.
        progress: called with the share done, 0 to 1.
    """
    if method == "auto":
        method = "closed" if has_closed_form(op) and all(_described(op, axes) for axes in states) else "swept"
    n = len(states)
    vectors, scalars = np.full((n, 4, 3), np.nan), np.full((n, 7), np.nan)
    in_cut, refused = np.zeros(n, dtype=np.bool_), []
    workpiece: SweptWorkpiece | None = None
    for k, axes in enumerate(states):
        try:
            workpiece, found = follow(op, workpiece, axes, method, bottom)
        except ValueError as error:
            refused.append((k, str(error)))
            continue
        loads, in_cut[k] = found.loads, found.loads.in_cut
        turned = rotation((0.0, 0.0, 1.0), -axes.position[4])
        vectors[k] = (loads.force_tool_mean, loads.force_tool_peak, loads.force_machine_mean,
                      turned @ loads.force_machine_mean)
        scalars[k] = (loads.tool_torque_mean, loads.tool_power_mean, loads.workpiece_torque_mean,
                      loads.workpiece_power_mean, loads.chip_thickness_max, loads.material_removal_rate,
                      loads.bottom_share)
        progress((k + 1) / n)
    start = states[0].stamp_ns if states else 0
    columns = {name: read_only(vectors[:, j]) for j, name in enumerate(_VECTORS)}
    columns |= {name: read_only(scalars[:, j]) for j, name in enumerate(_SCALARS)}
    return PathLoads(
        method=method, time=read_only([(axes.stamp_ns - start) * 1e-9 for axes in states]),
        tip=read_only(np.array([axes.position[:3] for axes in states]).reshape(n, 3)), in_cut=in_cut,
        refused=tuple(refused), **columns)


_VECTORS = ("force_tool", "force_tool_peak", "force_machine", "force_workpiece")
_SCALARS = ("tool_torque", "tool_power", "workpiece_torque", "workpiece_power", "chip_thickness_max", "removal_rate",
            "bottom_share")


def _described(op: Operation, axes: AxisState) -> bool:
    try:
        conditions_from_axes(op, axes)
    except ValueError:
        return False
    return True
