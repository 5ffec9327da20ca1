"""Screw theory against the Denavit-Hartenberg solution: published beside computed.

Source: A. Comak, Mechanics, Dynamics and Stability of Turn-Milling Operations, PhD thesis, UBC 2018.
"""

from __future__ import annotations

import math

import numpy as np

from tests.published.row import Row
from turnmill_core.machine import denavit_hartenberg as dh
from turnmill_core.machine.inverse_kinematics import inverse_path
from turnmill_core.machine.kinematics import NT3150, forward


def difference(path: np.ndarray) -> float:
    """Largest difference of theta_b [rad] between the two solutions along tool axes (n, 3)."""
    screw = inverse_path(NT3150, np.zeros_like(path), path, start=(float(np.arctan2(path[0, 0], path[0, 2])), 0.0))
    return float(np.abs(screw[:, 3] - dh.rotary_angles(path)[:, 0]).max())


def contour(tilt: np.ndarray, out_of_plane: float = 0.0) -> np.ndarray:
    """Tool axes (n, 3) of a head that tilts by `tilt` [rad], turned out of the xz plane."""
    return np.stack([np.sin(tilt) * math.cos(out_of_plane), np.sin(tilt) * math.sin(out_of_plane), np.cos(tilt)], -1)


def rows() -> list[Row]:
    """The comparison of section 3.2, and where it does not hold."""
    tilt = np.radians(np.linspace(20, 70, 500))
    drives = np.random.default_rng(0).uniform(-1, 1, (1000, 5))
    links = max(float(np.abs(a - b).max()) for a, b in zip(dh.forward(drives), forward(NT3150, drives), strict=True))
    at = "Figure 3.3 (d), Eq. 3.12-3.14 and 3.21"
    return [
        Row("theta_b, screw theory against D-H, largest difference", at, 2.2e-16, difference(contour(tilt)), "rad",
            "one unit in the last place; a contour of 20 to 70 deg in the xz plane (the path is a missing figure)"),
        Row("the same, contour turned 10 deg out of the xz plane", at, "not given",
            difference(contour(tilt, math.radians(10))), "rad",
            "erratum K5: T_C turns about X, so the D-H solution holds only for Oy = 0, Oz > 0"),
        Row("pose, screw theory against D-H links", "Eq. 3.9 and 3.17", "not given", links, "m, rad",
            "three links of Eq. 3.17 that turn C about z have no such limit"),
    ]
