"""Predicted loads of one instant of the cut: forces, torque and power of both spindles, chip, removal rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.cutting.bottom import bottom_loads
from turnmill_core.cutting.chip import ChipModel, prepare_cut
from turnmill_core.cutting.engagement import Engagement, bottom_rate, engagement, removal_rate
from turnmill_core.cutting.forces import revolve
from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Conditions, Operation

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

    Without contact, without feed or with a tool at rest all loads are zero and in_cut is False.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        angles: number of angles n of the revolution.
        elements: number of axial elements m of the edges.
        chip: `static` (Eq. 3.44) or `exact`.
        bottom: add the forces of the bottom edges (see bottom.py); the thesis' forces are without.

    Raises:
        ValueError: the depth exceeds the flute length.
    """
    cut = prepare_cut(op, conditions, elements) if conditions.in_cut else None
    arcs = cut.engagement if cut else engagement(op, conditions, np.zeros(1))
    in_cut = bool(arcs.angle.any())
    if cut and in_cut:
        turn = revolve(op, cut, angles * _FINER, chip)
        mean = revolve(op, cut, _MEAN_ANGLES, chip, average=True) if chip == "static" else turn
        angle, force, chip_max = turn.angle, turn.force_tool, turn.chip_thickness_max
        tool_torque, workpiece_torque = turn.tool_torque, turn.workpiece_torque
        force_mean = mean.force_tool.mean(axis=0)
        tool_torque_mean, workpiece_torque_mean = float(mean.tool_torque.mean()), float(mean.workpiece_torque.mean())
        if bottom:
            below = bottom_loads(op, conditions, angle.size)
            force, tool_torque = force + below.force_tool, tool_torque + below.tool_torque
            workpiece_torque = workpiece_torque + below.workpiece_torque
            force_mean = force_mean + below.force_tool.mean(axis=0)
            tool_torque_mean += float(below.tool_torque.mean())
            workpiece_torque_mean += float(below.workpiece_torque.mean())
            chip_max = max(chip_max, below.chip_thickness_max)
        rate = removal_rate(op, conditions)
        bottom_share = bottom_rate(op, conditions) / rate
    else:
        angle = np.asarray(np.arange(angles * _FINER) * (2 * math.pi / (angles * _FINER)), dtype=np.float64)
        force, chip_max = np.zeros((angle.size, 3)), 0.0
        tool_torque = workpiece_torque = np.zeros(angle.size)
        force_mean, tool_torque_mean, workpiece_torque_mean = np.zeros(3), 0.0, 0.0
        rate, bottom_share = 0.0, 0.0
    rotation = machine_from_tool(op, conditions)
    force_machine = force @ rotation.T
    return CuttingLoads(
        force_tool_mean=read_only(force_mean),
        force_tool_peak=read_only(_peak(force)),
        force_machine_mean=read_only(rotation @ force_mean),
        force_machine_peak=read_only(_peak(force_machine)),
        tool_torque_mean=tool_torque_mean,
        tool_torque_peak=float(_peak(tool_torque)),
        tool_power_mean=tool_torque_mean * conditions.tool_speed,
        workpiece_torque_mean=workpiece_torque_mean,
        workpiece_torque_peak=float(_peak(workpiece_torque)),
        workpiece_power_mean=workpiece_torque_mean * abs(conditions.workpiece_speed),
        chip_thickness_max=chip_max,
        cutting_speed=op.tool.radius * conditions.tool_speed,
        tooth_passing_frequency=op.tool.teeth * conditions.tool_speed / (2 * math.pi),
        material_removal_rate=rate,
        in_cut=in_cut,
        operation_hash=op.sha256,
        angle=read_only(angle[::_FINER]),
        force_tool=read_only(force[::_FINER]),
        tool_torque=read_only(tool_torque[::_FINER]),
        workpiece_torque=read_only(workpiece_torque[::_FINER]),
        engagement=arcs,
        bottom_share=bottom_share,
    )


def _peak(values: Array) -> Array:
    """The value of largest magnitude along the first axis, with its sign."""
    index = np.abs(values).argmax(axis=0)
    return np.asarray(np.take_along_axis(values, np.expand_dims(index, 0), axis=0)[0], dtype=np.float64)
