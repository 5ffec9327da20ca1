"""Cutting edges in elements, and the teeth's angles (thesis 3.3.1, Eq. 3.41-3.43, 3.46); cylindrical end mill.

Angles are measured from +y_T (cross feed) towards +x_T (feed), the sense in which the tool turns;
heights from the tool tip along +z_T (tool frame T).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

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
    """Cutting edges of a tool, divided along its profile; m elements, N teeth.

    radius, height [m] (m,), middle of each element, from the axis and above the tip; sin_kappa,
    cos_kappa (m,), of the axial immersion angle kappa between the tool axis and the outward normal
    n = (sin kappa sin phi, sin kappa cos phi, -cos kappa) of Eq. 3.40, 90 degrees on a cylinder, 0 on
    a flat bottom; width [m] (m,), chip width db, the element's length along the profile; length [m]
    (N, m), edge length dS; lag [rad] (N, m), angle by which the edge stays behind the tip; span [rad]
    (N, m), the lag from the lower to the upper end of an element; offset [rad] (N,), angle of each
    tooth ahead of the first; runout, axial_runout [m] (N,); bottom (m,), True for bottom edges.
    """

    radius: Array
    height: Array
    sin_kappa: Array
    cos_kappa: Array
    width: Array
    length: Array
    lag: Array
    span: Array
    offset: Array
    runout: Array
    axial_runout: Array
    bottom: NDArray[np.bool_]

    @property
    def kappa(self) -> Array:
        """Axial immersion angle [rad] (m,)."""
        return np.asarray(np.arctan2(self.sin_kappa, self.cos_kappa), dtype=np.float64)

    def chosen(self, part: NDArray[np.bool_]) -> EdgeElements:
        """The elements for which `part` (m,) is True."""
        return replace(
            self, radius=self.radius[part], height=self.height[part], sin_kappa=self.sin_kappa[part],
            cos_kappa=self.cos_kappa[part], width=self.width[part], length=self.length[:, part],
            lag=self.lag[:, part], span=self.span[:, part], bottom=self.bottom[part])


def edge_elements(tool: Tool, depth: float, elements: int = 64) -> EdgeElements:
    """Divide the engaged edges of the cylindrical `tool` from the tip to `depth` [m] into `elements` equal discs.

    The edge length is dS = sqrt(1 + (R dpsi/dz)^2) dz = dz / cos(beta) (Eq. 3.46 with dR/dz = 0,
    erratum M7: the root spans the whole sum and dz stands inside); the chip width is db = dz. The
    bottom edges are not among them. For other tools see cutter.py.

    Raises:
        ValueError: `depth` is not in (0, flute length], `elements` is not positive, or the tool is no cylinder.
    """
    require_cylinder(tool)
    require(0 < depth <= tool.flute_length * (1 + 1e-9), "depth", depth, "m",
            f"in (0, {tool.flute_length}] m, the flute length")
    require(elements >= 1, "elements", elements, "", "an integer >= 1")
    height = middle_heights(depth, elements)
    thickness = np.full(elements, depth / elements)
    lag = np.tile(lag_angle(tool, height), (tool.teeth, 1))
    return EdgeElements(
        radius=read_only(np.full(elements, tool.radius)),
        height=read_only(height),
        sin_kappa=read_only(np.ones(elements)),
        cos_kappa=read_only(np.zeros(elements)),
        width=read_only(thickness),
        length=read_only(np.tile(thickness / math.cos(tool.helix_angle), (tool.teeth, 1))),
        lag=read_only(lag),
        span=read_only(np.tile(2 * lag[:, :1], (1, elements))),
        offset=tooth_offsets(tool),
        runout=read_only(tool.runout or (0.0,) * tool.teeth),
        axial_runout=read_only((0.0,) * tool.teeth),
        bottom=np.zeros(elements, dtype=np.bool_),
    )


def require_cylinder(tool: Tool) -> None:
    """Raise ValueError for another than a cylindrical tool with edges alike, which the closed forms describe."""
    require(tool.shape.is_cylinder, "tool shape", tool.shape, "", "a cylinder: other tools have no closed form")


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


def predecessors(tool: Tool, elements: EdgeElements, revolutions: int = 1) -> tuple[Array, Array]:
    """Angles and steps from each tooth to the teeth that passed the same place before it, by element.

    Tooth j follows tooth j+1 by its pitch angle and what the two lag differently, tooth j+2 by the sum
    of two, and so on until it follows itself after each revolution of the tool.

    Returns:
        angle [rad] (m, N, K), rotation since the k-th predecessor passed; step [m] (m, N, K), how far
        the tooth stands out beyond that predecessor along the normal, from radial and axial runout.
        K = N * revolutions; K = 1 without runout, where only the tooth just ahead can limit the chip.

    Raises:
        ValueError: teeth of different helix angles meet on the engaged edge.
    """
    pitch = np.asarray(tool.pitch)
    even = np.ptp(elements.runout) == 0 and np.ptp(elements.axial_runout) == 0
    count = 1 if even else tool.teeth * revolutions
    ahead = np.arange(tool.teeth)[:, None] + np.arange(count)[None, :]
    before = (ahead + 1) % tool.teeth
    angle = np.cumsum(pitch[ahead % tool.teeth], axis=1)
    lag = elements.lag.T
    passed = angle + (lag[:, :, None] - lag[:, before])
    require(bool((passed > 0).all()), "helix angles", tool.shape.helix_angles, "rad",
            "angles with which the teeth do not meet on the engaged edge")
    step = ((elements.runout[:, None] - elements.runout[before]) * elements.sin_kappa[:, None, None]
            + (elements.axial_runout[:, None] - elements.axial_runout[before]) * elements.cos_kappa[:, None, None])
    return read_only(passed), read_only(step)
