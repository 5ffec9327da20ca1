"""Forces of the bottom edges: the material that rises into the tool's end face in turn-milling.

The bar turns under the end face; where x_T > 0 its surface rises with Omega_c x_T, and what has not
met the flank is cut from below. The thesis leaves this out and names it as the cause of its error
in F_z (section 3.4). The bottom edges are taken as straight and radial, at 90 degrees to the tool
axis, with the same coefficients as the side: an edge of no inclination has no force along itself,
and its thrust (K_rc, K_re) points along the tool axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.cutting.engagement import axial_place, helix_lead, walls
from turnmill_core.cutting.feed import cross_feed_sense
from turnmill_core.cutting.tool import Array, read_only, tooth_offsets
from turnmill_core.operation import Conditions, Operation, require


@dataclass(frozen=True)
class BottomLoads:
    """Loads of the bottom edges over one tool revolution.

    angle [rad] (n,), rotation of the tool; force_tool [N] (n, 3), on the tool in the tool frame;
    tool_torque [N m] (n,), resisting the tool spindle; workpiece_torque [N m] (n,), resisting the
    workpiece spindle; chip_thickness_max [m], measured along the tool axis.
    """

    angle: Array
    force_tool: Array
    tool_torque: Array
    workpiece_torque: Array
    chip_thickness_max: float


def bottom_loads(op: Operation, conditions: Conditions, angles: int = 360, elements: int = 32) -> BottomLoads:
    """Forces of the bottom edges at `angles` equal steps, each edge in `elements` pieces along the radius.

    Chip: h = |Omega_c| x_T tau_j at x_T = rho sin(phi), with tau_j the time since the tooth before
    passed; it exists where x_T > 0, inside the bar at the tip's height, and beyond the wall of the
    previous workpiece revolution. dF_t = K_tc h drho + K_te drho against the motion of the edge,
    dF_z = +(K_rc h + K_re) drho, which lifts the tool. All zero in milling, at rest and without contact.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        angles: number of angles n.
        elements: pieces of each edge between the tool axis and its radius.

    Raises:
        ValueError: a count below 1.
    """
    require(angles >= 1, "angles", angles, "", "an integer >= 1")
    require(elements >= 1, "elements", elements, "", "an integer >= 1")
    turn = np.asarray(np.arange(angles) * (2 * math.pi / angles), dtype=np.float64)
    if op.process == "milling" or not conditions.in_cut or conditions.workpiece_speed == 0:
        nothing = read_only(np.zeros(angles))
        return BottomLoads(read_only(turn), read_only(np.zeros((angles, 3))), nothing, nothing, 0.0)
    tool, material = op.tool, op.material
    phi = (turn[:, None] + tooth_offsets(tool))[..., None]
    low, high = _material(op, conditions, np.asarray(phi, dtype=np.float64))
    # pieces of equal length between the two ends of the material on the edge
    part = (np.arange(elements) + 0.5) / elements
    rho = low + (high - low) * part
    piece = (high - low) / elements
    x = rho * np.sin(phi)
    tau = np.asarray(tool.pitch)[:, None] / conditions.tool_speed
    chip = np.where(piece > 0, abs(conditions.workpiece_speed) * x * tau, 0.0)
    tangential = (material.Ktc * chip + material.Kte) * piece
    thrust = (material.Krc * chip + material.Kre) * piece
    force = np.stack([(-tangential * np.cos(phi)), tangential * np.sin(phi), thrust], axis=-1)
    workpiece = -conditions.effective_radius * force[..., 0] + x * force[..., 2]
    return BottomLoads(
        angle=read_only(turn),
        force_tool=read_only(force.sum(axis=(1, 2))),
        tool_torque=read_only((rho * tangential).sum(axis=(1, 2))),
        workpiece_torque=read_only(workpiece.sum(axis=(1, 2))),
        chip_thickness_max=float(chip.max()),
    )


def _material(op: Operation, conditions: Conditions, phi: Array) -> tuple[Array, Array]:
    """Inner and outer radius [m] of uncut material on the bottom edge at `phi` [rad]; equal where there is none.

    The wall's place grows along the edge on the side that the tool feeds to, so the material reaches
    from the wall to the flank or to the bar's surface; its inner end is found by bisection. An edge
    that runs against the feed direction meets the wall at its outer end first.
    """
    radius = op.tool.radius
    sine, cosine = np.sin(phi), cross_feed_sense(conditions) * np.cos(phi)
    lower, upper = walls(op, conditions)
    if cross_feed_sense(conditions) < 0:
        lower, upper = -upper, -lower
    lever = np.full_like(phi, conditions.effective_radius)
    lead = helix_lead(op, conditions)
    bar = conditions.effective_radius + conditions.depth
    surface = math.sqrt(bar**2 - conditions.effective_radius**2)
    reach = np.where(sine > 0, np.minimum(radius, surface / np.where(sine > 0, sine, 1.0)), 0.0)
    low, high = np.zeros_like(reach), reach
    for wall, keep in ((lower, 1.0), (upper, -1.0)):
        if math.isinf(wall):
            continue

        def beyond(rho: Array, wall: float = wall, keep: float = keep) -> Array:
            return keep * (axial_place(lead, radius, rho * sine, rho * cosine, lever) - wall)

        inside_low, inside_high = beyond(low) > 0, beyond(high) > 0
        inner, outer = low.copy(), high.copy()
        for _ in range(50):
            middle = (inner + outer) / 2
            to_low = (beyond(middle) > 0) == inside_low
            inner, outer = np.where(to_low, middle, inner), np.where(to_low, outer, middle)
        crossing = (inner + outer) / 2
        low = np.where(inside_low, low, np.where(inside_high, crossing, high))
        high = np.where(inside_high, high, np.where(inside_low, crossing, low))
    return low, np.maximum(high, low)
