"""Forces, torque and power of a rigid cut over one tool revolution (thesis Eq. 3.45-3.54).

Forces are those that the workpiece exerts on the tool, in the tool frame T, for an axial immersion
angle of 90 degrees (Eq. 3.49, 4.66): F_x = -F_r sin(phi) - F_t cos(phi), F_y = -F_r cos(phi) +
F_t sin(phi), F_z = -F_a.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnmill_core.cutting import _kernels
from turnmill_core.cutting.chip import ChipModel, Cut, exact_chip, prepare_cut, static_chip
from turnmill_core.cutting.feed import feed_velocity
from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.operation import Conditions, Material, Operation, require

_POINT = 1e-6  # window [rad] that stands for a point where the edge has no helix


@dataclass(frozen=True)
class Revolution:
    """Loads over one revolution of the tool spindle.

    angle [rad] (n,), rotation of the tool, first tooth's tip on +y_T at 0; force_tool [N] (n, 3) on
    the tool, tool frame; tool_torque [N m] (n,), resisting the tool spindle; workpiece_torque [N m]
    (n,), resisting the workpiece spindle (negative: the cut drives it); chip_thickness_max [m].
    """

    angle: Array
    force_tool: Array
    tool_torque: Array
    workpiece_torque: Array
    chip_thickness_max: float


def revolution(
    op: Operation, conditions: Conditions, angles: int = 360, elements: int = 64, chip: ChipModel = "static",
    engine: Literal["fast", "plain"] = "fast", average: bool = False,
) -> Revolution:
    """Forces and torques at `angles` equal steps of one tool revolution, edges in `elements` discs.

    dF = K_c h db + K_e dS radially, tangentially and axially (Eq. 3.45), summed over teeth and
    heights in the cut (Eq. 3.50). The tool torque is the tangential force times the tooth's radius
    (Eq. 3.52). The workpiece torque is the moment of the forces about the C axis,
    -(R_w - a + z) F_x + x_T F_z: Eq. 3.53's force times effective radius, and the small part of the
    axial force that closes the power balance.

    Args:
        op: the operation.
        conditions: the instant of the cut; it must be in cut.
        angles: number of angles n.
        elements: number of axial elements m.
        chip: `static` (Eq. 3.44) or `exact` (trochoid, previous revolution's wall).
        engine: `fast` (compiled) or `plain` (numpy); the same to round-off.
        average: with the static chip, every angle stands for the step around it, so that the mean
            over the revolution is right to second order in the step whatever the helix; otherwise
            the forces at the angles themselves.

    Raises:
        ValueError: not in cut, fewer than 4 angles, no elements, or a depth beyond the flute length.
    """
    require(angles >= 4, "angles", angles, "", "an integer >= 4")
    cut = prepare_cut(op, conditions, elements)
    lag = abs(float(cut.elements.lag[0])) * 2
    require(lag <= math.pi / 2, "elements", elements, "", f"enough for a lag of at most pi/2 in one, not {lag:.3g} rad")
    window = 2 * math.pi / angles if average else max(lag, _POINT)
    result = np.zeros((angles, 5))
    run = _fast if engine == "fast" else _plain
    largest = run(cut, op.material, chip, window, result)
    if op.process == "milling":
        result[:, 4] = 0.0
    angle = np.arange(angles) * (2 * math.pi / angles)
    return Revolution(read_only(angle), read_only(result[:, :3]), read_only(result[:, 3]), read_only(result[:, 4]),
                      largest)


def _coefficients(material: Material) -> Array:
    return np.array([material.Ktc, material.Krc, material.Kac, material.Kte, material.Kre, material.Kae])


def _fast(cut: Cut, material: Material, chip: ChipModel, window: float, result: Array) -> float:
    e, arcs = cut.elements, cut.engagement
    if chip == "static":
        return float(_kernels.static_forces(
            len(result), window, e.offset, e.radius, e.lag, arcs.start, arcs.exit, cut.feed, cut.delay, cut.step,
            e.thickness, e.length, _coefficients(material), cut.lever, result))
    return float(_kernels.exact_forces(
        len(result), e.offset, e.radius, cut.tool_radius, e.lag, cut.feed, cut.sense, cut.lead, *cut.walls,
        cut.half_width, cut.lag, cut.step, cut.tool_speed, e.thickness, e.length, _coefficients(material), cut.lever,
        result))


def _plain(cut: Cut, material: Material, chip: ChipModel, window: float, result: Array) -> float:
    """The kernels' numpy twin: every angle, tooth, height and arc at once."""
    e = cut.elements
    count = len(result)
    phi = (np.arange(count) * (2 * math.pi / count))[:, None, None] + e.offset[None, :, None] - e.lag[None, None, :]
    if chip == "exact":
        return _sum_forces(cut, material, exact_chip(cut, phi), phi, np.ones_like(phi), result)
    largest = 0.0
    for start, stop in zip(cut.engagement.start.T, cut.engagement.exit.T, strict=True):
        # the turn in which the window around phi can overlap the arc, and the overlap
        wrapped = start - window / 2 + (phi - start + window / 2) % (2 * math.pi)
        left, right = np.maximum(wrapped - window / 2, start), np.minimum(wrapped + window / 2, stop)
        share = np.where(stop > start, np.maximum(right - left, 0.0) / window, 0.0)
        middle = (left + right) / 2
        largest = max(largest, _sum_forces(cut, material, static_chip(cut, middle), middle, share, result))
    return largest


def _sum_forces(cut: Cut, material: Material, chip: Array, phi: Array, share: Array, result: Array) -> float:
    e = cut.elements
    share = np.where(chip > 0, share, 0.0)
    area = chip * e.thickness
    radial = share * (material.Krc * area + material.Kre * e.length)
    tangential = share * (material.Ktc * area + material.Kte * e.length)
    axial = share * (material.Kac * area + material.Kae * e.length)
    sine, cosine = np.sin(phi), np.cos(phi)
    x = -radial * sine - tangential * cosine
    radius = e.radius[:, None]
    for column, value in enumerate((x, -radial * cosine + tangential * sine, -axial, radius * tangential,
                                    -cut.lever * x - radius * sine * axial)):
        result[:, column] += value.sum(axis=(1, 2))
    return float(np.where(share > 0, chip, 0.0).max())


def cutting_velocity(op: Operation, conditions: Conditions, angle: Array, height: Array) -> Array:
    """Velocity of the edge relative to the material [m/s] (n, m, 2) in x_T, y_T (Eq. 3.54, erratum M9).

    The workpiece's speed stands on the feed direction x, not on y as printed.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        angle: immersion angles phi of the edge [rad], (n,).
        height: heights above the tool tip [m], (m,).
    """
    speed = op.tool.radius * conditions.tool_speed
    edge = speed * np.stack([np.cos(angle), -np.sin(angle)], axis=-1)
    return np.asarray(edge[:, None, :] + feed_velocity(op, conditions, height)[None, :, :], dtype=np.float64)
