"""Forces, torque and power of a rigid cut over one tool revolution (thesis Eq. 3.45-3.54).

Forces are those that the workpiece exerts on the tool, in the tool frame T (Eq. 3.49), with the axial
immersion angle kappa of the edge: F_x = -(F_r sin(kappa) + F_a cos(kappa)) sin(phi) - F_t cos(phi),
F_y = -(F_r sin(kappa) + F_a cos(kappa)) cos(phi) + F_t sin(phi), F_z = F_r cos(kappa) - F_a sin(kappa).
On a cylinder (90 degrees, Eq. 4.66) F_z = -F_a. Bottom edges have no inclination, and no force F_a
along themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting._kernels.forces import exact_forces, static_forces
from turnmill_core.cutting.chip import (
    ChipModel,
    Cut,
    exact_chip,
    largest_static_chip,
    prepare_cut,
    required_bar,
    static_chip,
)
from turnmill_core.cutting.feed import feed_velocity
from turnmill_core.cutting.tool import Array, EdgeElements, read_only
from turnmill_core.operation import Conditions, Material, Operation, require

_POINT = 1e-6  # window [rad] that stands for a point where the edge has no helix


@dataclass(frozen=True)
class Revolution:
    """Loads over one revolution of the tool spindle.

    angle [rad] (n,), rotation of the tool, first tooth's tip on +y_T at 0; force_tool [N] (n, 3) on
    the tool, tool frame; tool_torque [N m] (n,), resisting the tool spindle; workpiece_torque [N m]
    (n,), resisting the workpiece spindle (negative: the cut drives it); chip_thickness_max [m], the
    largest chip of the arcs (static) or of the angles (exact).
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
    return revolve(op, prepare_cut(op, conditions, elements), angles, chip, engine, average)


def revolve(
    op: Operation, cut: Cut, angles: int = 360, chip: ChipModel = "static",
    engine: Literal["fast", "plain"] = "fast", average: bool = False,
) -> Revolution:
    """As `revolution`, for a cut that has been prepared.

    Args:
        op: the operation.
        cut: from `prepare_cut`.
        angles: number of angles n.
        chip: `static` or `exact`.
        engine: `fast` or `plain`.
        average: see `revolution`.

    Raises:
        ValueError: fewer than 4 angles, or elements too high for the helix.
    """
    require(angles >= 4, "angles", angles, "", "an integer >= 4")
    elements = cut.elements.height.size
    lag = float(np.abs(cut.elements.span).max())
    require(lag <= math.pi / 2, "elements", elements, "", f"enough for a lag of at most pi/2 in one, not {lag:.3g} rad")
    windows = _windows(cut, 2 * math.pi / angles if average else 0.0)
    result = np.zeros((angles, 5))
    run = _fast if engine == "fast" else _plain
    largest = run(cut, op.material, chip, windows, result)
    if op.process == "milling":
        result[:, 4] = 0.0
    angle = np.arange(angles) * (2 * math.pi / angles)
    return Revolution(read_only(angle), read_only(result[:, :3]), read_only(result[:, 3]), read_only(result[:, 4]),
                      largest)


def _windows(cut: Cut, step: float) -> tuple[Array, Array]:
    """Angles [rad] (N, m, A) over which an element comes into and goes out of the cut.

    `step` where it is given: the element stands for that part of the revolution. Otherwise the turn
    of the tool that carries an arc's end from the top of the element to its bottom, from lag and arc.
    """
    arcs = cut.engagement
    shape = (len(cut.elements.offset), *arcs.start.shape)
    if step:
        return np.full(shape, step), np.full(shape, step)
    whole = arcs.exit > arcs.start
    whole[1:] &= whole[:-1].copy()
    whole[:-1] &= whole[1:].copy()
    windows = []
    for end in (arcs.start, arcs.exit):
        slope = np.where(whole, np.gradient(end, axis=0), 0.0) if len(end) > 1 else np.zeros(end.shape)
        windows.append(np.clip(np.abs(slope + cut.elements.span[..., None]), _POINT, math.pi / 2))
    return windows[0], windows[1]


def _coefficients(material: Material, bottom: NDArray[np.bool_]) -> Array:
    """Coefficients (m, 6) by element; none along the bottom edges."""
    one = np.array([material.Ktc, material.Krc, material.Kac, material.Kte, material.Kre, material.Kae])
    alongside = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 0.0])
    return np.where(bottom[:, None], one * alongside, one)


def _fast(cut: Cut, material: Material, chip: ChipModel, windows: tuple[Array, Array], result: Array) -> float:
    e, arcs = cut.elements, cut.engagement
    coefficients = _coefficients(material, e.bottom)
    if chip == "static":
        static_forces(
            len(result), *windows, e.offset, e.runout, e.radius, e.height, e.sin_kappa, e.cos_kappa, e.lag, arcs.start,
            arcs.exit, cut.feed, cut.delay, cut.step, e.width, e.length, coefficients, cut.origin, cut.axis, result)
        return largest_static_chip(cut)
    bar = required_bar(cut)
    return float(exact_forces(
        len(result), e.offset, e.runout, bar.tool_radius, e.lag, cut.feed[:, :2], bar.sense, bar.lead, *bar.walls,
        bar.half_width, bar.lag, cut.step[0], cut.tool_speed, e.width, e.length, coefficients[0], bar.lever, result))


def _plain(cut: Cut, material: Material, chip: ChipModel, windows: tuple[Array, Array], result: Array) -> float:
    """The kernels' numpy twin: every angle, tooth, height and arc at once."""
    largest = 0.0
    for thickness, phi, share in _pieces(cut, chip, windows, len(result)):
        for column, value in enumerate(_local_loads(cut, material, thickness, phi, share)):
            result[:, column] += np.sum(value, axis=(1, 2))
        largest = float(thickness.max())
    return largest if chip == "exact" else largest_static_chip(cut)


def _pieces(
    cut: Cut, chip: ChipModel, windows: tuple[Array, Array], angles: int
) -> Iterator[tuple[Array, Array, Array]]:
    """Chip [m], tooth angle [rad] and share in the cut of every piece of edge (n, N, m), arc by arc."""
    e, arcs = cut.elements, cut.engagement
    phi = (np.arange(angles) * (2 * math.pi / angles))[:, None, None] + e.offset[None, :, None] - e.lag[None]
    if chip == "exact":
        yield exact_chip(cut, phi), phi, np.ones_like(phi)
        return
    for start, stop, enter, leave in zip(arcs.start.T, arcs.exit.T, *(np.moveaxis(w, 2, 0) for w in windows),
                                         strict=True):
        wrapped = start - enter / 2 + (phi - start + enter / 2) % (2 * math.pi)
        outside = np.maximum(start - wrapped + enter / 2, 0.0)
        past = np.maximum(wrapped + leave / 2 - stop, 0.0)
        share = np.maximum(1 - outside / enter, 0.0) * np.maximum(1 - past / leave, 0.0) * (stop > start)
        middle = wrapped + (outside - past) / 2
        yield static_chip(cut, middle), middle, share


def _local_loads(
    cut: Cut, material: Material, chip: Array, phi: Array, share: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Forces x, y, z [N], tool torque and workpiece torque [N m] of every piece of edge (n, N, m)."""
    e = cut.elements
    share = np.where(chip > 0, share, 0.0)
    area = chip * e.width
    ktc, krc, kac, kte, kre, kae = _coefficients(material, e.bottom).T
    radial = share * (krc * area + kre * e.length)
    tangential = share * (ktc * area + kte * e.length)
    axial = share * (kac * area + kae * e.length)
    sine, cosine = np.sin(phi), np.cos(phi)
    radius = e.radius + e.runout[:, None]
    across = e.sin_kappa * radial + e.cos_kappa * axial
    fx, fy = -across * sine - tangential * cosine, -across * cosine + tangential * sine
    fz = e.cos_kappa * radial - e.sin_kappa * axial
    x, y, z = radius * sine, radius * cosine, e.height
    a, o = cut.axis, cut.origin
    arm = (o[0] + a[1] * z - a[2] * y, o[1] + a[2] * x - a[0] * z, o[2] + a[0] * y - a[1] * x)
    return fx, fy, fz, radius * tangential, arm[0] * fx + arm[1] * fy + arm[2] * fz


@dataclass(frozen=True)
class EdgeLoads:
    """Loads along the edges over one revolution of the tool spindle; n angles, N teeth, m elements.

    angle [rad] (n,); elements: the edges; chip [m] (n, N, m), uncut chip thickness, 0 out of the cut; force [N]
    (n, N, m, 3), on the tool in the tool frame; tool_torque [N m] (n, N, m).
    """

    angle: Array
    elements: EdgeElements
    chip: Array
    force: Array
    tool_torque: Array


def edge_loads(material: Material, cut: Cut, angles: int = 360, chip: ChipModel = "static") -> EdgeLoads:
    """What `revolve` adds up, piece by piece along the edges.

    Args:
        material: coefficients.
        cut: from `prepare_cut`, or a part of an engagement map.
        angles: number of angles n.
        chip: `static` or `exact`.
    """
    shape = (angles, *cut.elements.lag.shape)
    chips, force, torque = np.zeros(shape), np.zeros((*shape, 3)), np.zeros(shape)
    for thickness, phi, share in _pieces(cut, chip, _windows(cut, 0.0), angles):
        loads = _local_loads(cut, material, thickness, phi, share)
        force += np.stack(loads[:3], axis=-1)
        torque += loads[3]
        chips = np.maximum(chips, np.where(share > 0, thickness, 0.0))
    angle = np.arange(angles) * (2 * math.pi / angles)
    return EdgeLoads(read_only(angle), cut.elements, read_only(chips), read_only(force), read_only(torque))


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
