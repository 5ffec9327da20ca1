"""Cylindrical end mill: cutting edges divided along the tool axis (thesis 3.3.1, Eq. 3.41-3.43, 3.46).

Angles are measured from +y_T (cross feed) towards +x_T (feed), the sense in which the tool turns;
heights from the tool tip along +z_T (tool frame T).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Tool, require

Array = NDArray[np.float64]


def read_only(values: object) -> Array:
    """A float64 copy of `values` that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class EdgeElements:
    """Cutting edges of an end mill in axial disc elements.

    height [m] (m,), middle of each element above the tool tip; thickness [m] (m,), the element's
    height dz, which is also the chip width db for an axial immersion angle of 90 degrees; length
    [m] (m,), edge length dS within the element; lag [rad] (m,), angle by which the edge at that
    height stays behind the tip; offset [rad] (N,), angle of each tooth ahead of the first; radius
    [m] (N,), radius of each tooth, runout included.
    """

    height: Array
    thickness: Array
    length: Array
    lag: Array
    offset: Array
    radius: Array


def edge_elements(tool: Tool, depth: float, elements: int = 64) -> EdgeElements:
    """Divide the engaged edges of `tool` from the tip to `depth` [m] into `elements` discs of equal height.

    The edge length is dS = sqrt(1 + (R dpsi/dz)^2) dz = dz / cos(beta) (Eq. 3.46 with dR/dz = 0,
    erratum M7: the root spans the whole sum and dz stands inside); the chip width is db = dz.

    Raises:
        ValueError: `depth` is not in (0, flute length] or `elements` is not positive.
    """
    require(0 < depth <= tool.flute_length * (1 + 1e-9), "depth", depth, "m",
            f"in (0, {tool.flute_length}] m, the flute length")
    require(elements >= 1, "elements", elements, "", "an integer >= 1")
    height = middle_heights(depth, elements)
    thickness = np.full(elements, depth / elements)
    return EdgeElements(
        height=read_only(height),
        thickness=read_only(thickness),
        length=read_only(thickness / math.cos(tool.helix_angle)),
        lag=read_only(lag_angle(tool, height)),
        offset=tooth_offsets(tool),
        radius=read_only(tool.radius + np.asarray(tool.runout or (0.0,) * tool.teeth)),
    )


def middle_heights(depth: float, elements: int) -> Array:
    """Middle of each of `elements` equal discs from the tip to `depth` [m], (elements,)."""
    return np.asarray((np.arange(elements) + 0.5) * (depth / elements), dtype=np.float64)


def lag_angle(tool: Tool, height: Array) -> Array:
    """Lag angle psi(z) = z tan(beta) / R [rad] of the edge at `height` [m] (Eq. 3.42); same shape as `height`."""
    return np.asarray(height * (math.tan(tool.helix_angle) / tool.radius), dtype=np.float64)


def tooth_offsets(tool: Tool) -> Array:
    """Angles [rad] (N,) of the teeth ahead of the first: the sum of the pitch angles before each."""
    return read_only(np.concatenate(([0.0], np.cumsum(tool.pitch[:-1]))))


def tooth_angles(tool: Tool, angle: Array, height: Array) -> Array:
    """Immersion angle phi_j(z) [rad] of every tooth, not wrapped (Eq. 3.41).

    phi_j(z) = phi + (sum of the pitch angles before tooth j) - psi(z).

    Args:
        tool: the end mill.
        angle: rotation phi of the tool spindle [rad], (n,).
        height: height above the tool tip [m], (m,).

    Returns:
        (n, N, m) array.
    """
    phi = np.asarray(angle)[:, None, None] + tooth_offsets(tool)[None, :, None]
    return np.asarray(phi - lag_angle(tool, np.asarray(height))[None, None, :], dtype=np.float64)


def predecessors(tool: Tool, revolutions: int = 1) -> tuple[Array, Array]:
    """Angles and radius steps from each tooth to the teeth that passed the same place before it.

    Tooth j follows tooth j+1 by its pitch angle, tooth j+2 by the sum of two, and so on until it
    follows itself after each revolution of the tool.

    Returns:
        angle [rad] (N, K), rotation since the k-th predecessor passed; step [m] (N, K), radius of
        the tooth minus radius of that predecessor. K = N * revolutions; K = 1 without runout,
        where only the tooth just ahead can limit the chip.
    """
    pitch = np.asarray(tool.pitch)
    runout = np.asarray(tool.runout or (0.0,) * tool.teeth)
    count = tool.teeth * revolutions if np.ptp(runout) > 0 else 1
    ahead = np.arange(tool.teeth)[:, None] + np.arange(count)[None, :]
    angle = np.cumsum(pitch[ahead % tool.teeth], axis=1)
    step = runout[:, None] - runout[(ahead + 1) % tool.teeth]
    return read_only(angle), read_only(step)
