"""Predicted loads of one instant of the cut: forces, torque and power of both spindles, chip, removal rate.

`cutting_loads` is for the steady cut of an operation at given conditions, in closed form where there is one;
`path_loads` for an engagement map, that is any tool anywhere on a path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.bottom import bottom_loads
from turnmill_core.cutting.chip import ChipModel, Cut, prepare_cut
from turnmill_core.cutting.engagement import Engagement, Removal, bottom_rate, removal_rate
from turnmill_core.cutting.engagement_map import EngagementMap
from turnmill_core.cutting.forces import revolve
from turnmill_core.cutting.steady import steady_map
from turnmill_core.cutting.tool import Array, predecessors, read_only
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import CYLINDER, Conditions, Operation

_MEAN_ANGLES = 180  # steps of the mean, second order
_FINER = 4  # peaks are sought at so many times the angles that are given back


@dataclass(frozen=True)
class CuttingLoads:
    """Rigid cutting loads over one revolution of the tool spindle; the fields of turnmill_msgs/CuttingLoads.

    Forces [N] (3,) are those that the workpiece exerts on the tool, in the tool frame and in the
    machine frame: mean, integrated over the arcs, and peak, the value of largest magnitude of each
    component (signed) at four times the angles given.
    Torques [N m] resist their spindle; powers [W]; chip_thickness_max [m]; cutting_speed [m/s],
    peripheral speed of the tool; tooth_passing_frequency [Hz]; material_removal_rate [m3/s];
    operation_hash, sha256 of the operation's text.

    For pictures: angle [rad] (n,), force_tool [N] (n, 3), tool_torque [N m] (n,), workpiece_torque
    [N m] (n,) over the revolution; engagement, the arcs by height; bottom_share [1], share of the
    removed volume that enters through the tool's bottom; its forces are added on request only.
    """

    force_tool_mean: Array
    force_tool_peak: Array
    force_machine_mean: Array
    force_machine_peak: Array
    tool_torque_mean: float
    tool_torque_peak: float
    tool_power_mean: float
    workpiece_torque_mean: float
    workpiece_torque_peak: float
    workpiece_power_mean: float
    chip_thickness_max: float
    cutting_speed: float
    tooth_passing_frequency: float
    material_removal_rate: float
    in_cut: bool
    operation_hash: str
    angle: Array
    force_tool: Array
    tool_torque: Array
    workpiece_torque: Array
    engagement: Engagement
    bottom_share: float


def cutting_loads(
    op: Operation, conditions: Conditions, angles: int = 360, elements: int = 64, chip: ChipModel = "static",
    bottom: bool = False,
) -> CuttingLoads:
    """Loads over one tool revolution at `conditions`.

    A cylinder over the C axis, and milling with it, have their engagement in closed form; any other tool, an
    eccentric or a tilted one, numerically. Without contact, without feed or with a tool at rest all loads
    are zero and in_cut is False.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        angles: number of angles n of the revolution.
        elements: number of axial elements m of the edges.
        chip: `static` (Eq. 3.44) or `exact`, this only in closed form.
        bottom: add the forces of the bottom edges (see bottom.py); the thesis' forces are without.

    Raises:
        ValueError: the depth exceeds the flute length, or an exact chip is asked for where there is none.
    """
    if not _has_closed_form(op):
        return path_loads(op, steady_map(op, conditions, elements), angles, chip, bottom)
    cut = prepare_cut(op, conditions, elements) if conditions.in_cut else None
    arcs = cut.engagement if cut else Engagement(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 2)))
    turns = []
    if cut and arcs.angle.any():
        turns.append(_turn(op, cut, angles, chip))
        if bottom and op.tool.shape != CYLINDER:  # dish, wiper or axial runout
            below_map = steady_map(op, conditions)
            if below_map.arcs.angle[below_map.elements.bottom].any():
                turns.append(_turn(op, part_of(op, below_map, below_map.elements.bottom), angles, "static"))
        elif bottom:
            below = bottom_loads(op, conditions, angles * _FINER)
            turns.append(_Turn(below.force_tool, below.tool_torque, below.workpiece_torque,
                               below.force_tool.mean(axis=0), float(below.tool_torque.mean()),
                               float(below.workpiece_torque.mean()), below.chip_thickness_max))
    removal = _NOTHING
    if turns:
        rate, through = removal_rate(op, conditions), bottom_rate(op, conditions)
        removal = Removal(rate - through, through, rate)
    return _loads(op, turns, angles, machine_from_tool(op, conditions), conditions.tool_speed,
                  conditions.workpiece_speed, arcs, removal)


def path_loads(
    op: Operation, cut: EngagementMap, angles: int = 360, chip: ChipModel = "static", bottom: bool = False
) -> CuttingLoads:
    """Loads over one tool revolution with the engagement `cut`, of any tool anywhere on its path.

    The cut is taken as steady for this revolution. tool frame and machine frame are joined by cut.motion.rotation.

    Args:
        op: the operation: tool, material.
        cut: from engagement_map.py.
        angles: number of angles n of the revolution.
        chip: `static`; the `exact` chip has no numeric form.
        bottom: add the forces of the bottom edges.

    Raises:
        ValueError: an exact chip.
    """
    turns = []
    if cut.in_cut and cut.motion.tool_speed > 0:
        parts = [~cut.elements.bottom, *([cut.elements.bottom] if bottom else [])]
        turns = [_turn(op, part_of(op, cut, part), angles, chip) for part in parts if cut.arcs.angle[part].any()]
    return _loads(op, turns, angles, cut.motion.rotation, cut.motion.tool_speed, cut.motion.workpiece_speed, cut.arcs,
                  cut.removal if turns else _NOTHING)


def part_of(op: Operation, cut: EngagementMap, part: NDArray[np.bool_]) -> Cut:
    """The elements `part` (m,) of an engagement map as the force model takes them; the tool must turn.

    Raises:
        ValueError: teeth of different helix angles meet on the engaged edge.
    """
    motion, arcs = cut.motion, cut.arcs
    edges = cut.elements.chosen(part)
    angle, step = predecessors(op.tool, edges)
    sense = math.copysign(1.0, motion.workpiece_speed or op.conditions.workpiece_speed)
    axis = sense * motion.rotation[2]
    return Cut(
        elements=edges,
        engagement=Engagement(edges.height, arcs.start[part], arcs.exit[part]),
        feed=cut.feed[part],
        delay=read_only(angle / motion.tool_speed),
        step=step,
        tool_speed=motion.tool_speed,
        origin=read_only(np.cross(axis, motion.rotation.T @ motion.tip)),
        axis=read_only(axis),
    )


_NOTHING = Removal(0.0, 0.0, 0.0)


def _has_closed_form(op: Operation) -> bool:
    return op.tool.shape.is_cylinder and op.eccentricity == 0 and op.tilt == 0


@dataclass(frozen=True)
class _Turn:
    """One part of the loads over a revolution: at the angles, and their means."""

    force: Array
    tool_torque: Array
    workpiece_torque: Array
    force_mean: Array
    tool_torque_mean: float
    workpiece_torque_mean: float
    chip_max: float


def _turn(op: Operation, cut: Cut, angles: int, chip: ChipModel) -> _Turn:
    turn = revolve(op, cut, angles * _FINER, chip)
    mean = revolve(op, cut, _MEAN_ANGLES, chip, average=True) if chip == "static" else turn
    return _Turn(turn.force_tool, turn.tool_torque, turn.workpiece_torque, mean.force_tool.mean(axis=0),
                 float(mean.tool_torque.mean()), float(mean.workpiece_torque.mean()), turn.chip_thickness_max)


def _loads(
    op: Operation, turns: list[_Turn], angles: int, rotation: Array, tool_speed: float, workpiece_speed: float,
    arcs: Engagement, removal: Removal,
) -> CuttingLoads:
    """The parts of a revolution added up; no parts: no loads."""
    count = angles * _FINER
    angle = np.asarray(np.arange(count) * (2 * math.pi / count), dtype=np.float64)
    force, force_mean = np.zeros((count, 3)), np.zeros(3)
    tool_torque, workpiece_torque = np.zeros(count), np.zeros(count)
    for k, turn in enumerate(turns):
        force = turn.force if k == 0 else force + turn.force
        tool_torque = turn.tool_torque if k == 0 else tool_torque + turn.tool_torque
        workpiece_torque = turn.workpiece_torque if k == 0 else workpiece_torque + turn.workpiece_torque
        force_mean = turn.force_mean if k == 0 else force_mean + turn.force_mean
    tool_torque_mean = sum(t.tool_torque_mean for t in turns)
    workpiece_torque_mean = sum(t.workpiece_torque_mean for t in turns)
    force_machine = force @ rotation.T
    return CuttingLoads(
        force_tool_mean=read_only(force_mean),
        force_tool_peak=read_only(_peak(force)),
        force_machine_mean=read_only(rotation @ force_mean),
        force_machine_peak=read_only(_peak(force_machine)),
        tool_torque_mean=tool_torque_mean,
        tool_torque_peak=float(_peak(tool_torque)),
        tool_power_mean=tool_torque_mean * tool_speed,
        workpiece_torque_mean=workpiece_torque_mean,
        workpiece_torque_peak=float(_peak(workpiece_torque)),
        workpiece_power_mean=workpiece_torque_mean * abs(workpiece_speed),
        chip_thickness_max=max((t.chip_max for t in turns), default=0.0),
        cutting_speed=op.tool.radius * tool_speed,
        tooth_passing_frequency=op.tool.teeth * tool_speed / (2 * math.pi),
        material_removal_rate=removal.total,
        in_cut=bool(turns),
        operation_hash=op.sha256,
        angle=read_only(angle[::_FINER]),
        force_tool=read_only(force[::_FINER]),
        tool_torque=read_only(tool_torque[::_FINER]),
        workpiece_torque=read_only(workpiece_torque[::_FINER]),
        engagement=arcs,
        bottom_share=removal.bottom_share,
    )


def _peak(values: Array) -> Array:
    """The value of largest magnitude along the first axis, with its sign."""
    columns = values.reshape(len(values), -1)
    found = columns[np.abs(columns).argmax(axis=0), np.arange(columns.shape[1])]
    return np.asarray(found.reshape(values.shape[1:]), dtype=np.float64)
