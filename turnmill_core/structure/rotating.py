"""Structures that turn with the tool: asymmetric cutters in the frame (u, v) of the tool (thesis 4.2.1).

The tool turns from +y towards +x, so d_xy = T q with T = [[cos, sin], [-sin, cos]] (Eq. 4.8) and, with J = [[0, 1],
[-1, 0]], the acceleration in the tool's frame is q'' + 2 Omega J q' - Omega^2 q. A symmetric tool seen from either
frame is the same system only if its damping is fixed in the machine (erratum D7).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from turnmill_core.operation import Mode, require
from turnmill_core.structure.modal import LinearStructure

Coriolis = Literal["printed", "skew-symmetric"]
"""Coupling of u and v by the Coriolis force, per unit of mass: 2 Omega in both rows (Eq. 4.17 as printed), or 2 Omega
sqrt(m_u m_v) as a force, which does no work where the modal masses differ."""
Damping = Literal["tool", "machine"]
"""Where the damping is fixed: in the tool (no circulatory term K_crc), or in the machine (K_crc stands)."""


def rotating_structure(
    u: Mode, v: Mode, tool_speed: float, coriolis: Coriolis = "printed", damping: Damping = "tool",
) -> LinearStructure:
    """A pair of modes of the tool in its own frame, states (u, v, u', v'), displacement (u, v, 0) (Eq. 4.16, 4.17).

    u, v: modes along the tool's principal directions; their shapes are not used. tool_speed [rad/s]. coriolis, damping:
    by name, see :data:`Coriolis` and :data:`Damping`; what each choice changes is erratum D7. The sign of the coupling
    follows the sense of rotation. Raises ``ValueError`` for an unknown name.
    """
    require(coriolis in ("printed", "skew-symmetric"), "Coriolis form", coriolis, "", "printed or skew-symmetric")
    require(damping in ("tool", "machine"), "damping", damping, "", "fixed in the tool or in the machine")
    mass = np.array([u.mass, v.mass])
    wn = 2 * np.pi * np.array([u.frequency, v.frequency])
    rate = 2 * np.array([u.damping, v.damping]) * wn
    coupling = mass if coriolis == "printed" else np.full(2, np.sqrt(u.mass * v.mass))
    J = np.array([[0.0, 1.0], [-1.0, 0.0]])
    C = np.diag(rate) + 2 * tool_speed * J * (coupling / mass)[:, None]
    K = np.diag(wn**2) - tool_speed**2 * np.eye(2)
    if damping == "machine":
        K = K + tool_speed * J * rate[:, None]
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    B = np.zeros((4, 3))
    B[2:, :2] = np.diag(1 / mass)
    return LinearStructure(A, B, np.eye(3, 4) * np.array([1.0, 1.0, 0.0])[:, None])
