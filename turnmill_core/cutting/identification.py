"""Cutting coefficients from measured average forces: mechanistic identification by linear regression.

The average force of an end mill is linear in the six coefficients, whatever the engagement
(Eq. 3.45-3.50), so several feeds and engagements can be used at once. F_x and F_y hold K_tc, K_rc,
K_te, K_re; F_z holds K_ac, K_ae; the two groups are fitted apart, each with its own scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from turnmill_core.cutting.tool import Array, read_only, require_cylinder
from turnmill_core.operation import Tool, require

NAMES = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")


@dataclass(frozen=True)
class AverageForces:
    """Average forces of milling tests, one row a test; n tests.

    feed_per_tooth [m] (n,); depth [m] (n,); start, exit [rad] (n,), engagement angles from +y_T
    towards +x_T; force [N] (n, 3), mean over whole tool revolutions, on the tool, tool frame.
    """

    feed_per_tooth: Array
    depth: Array
    start: Array
    exit: Array
    force: Array

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.feed_per_tooth))
        for name in ("feed_per_tooth", "depth", "start", "exit", "force"):
            shape = (n, 3) if name == "force" else (n,)
            values = read_only(getattr(self, name))
            if values.ndim == 0:
                values = read_only(np.broadcast_to(values, shape))
            require(values.shape == shape, name, values.shape, "", f"an array of shape {shape}")
            require(bool(np.isfinite(values).all()), name, values.tolist(), "", "finite numbers")
            object.__setattr__(self, name, values)
        for name, unit in (("feed_per_tooth", "m"), ("depth", "m")):
            require(bool((getattr(self, name) > 0).all()), name, getattr(self, name).tolist(), unit, "numbers > 0")
        require(bool((self.exit > self.start).all()), "exit", self.exit.tolist(), "rad", "angles beyond start")


@dataclass(frozen=True)
class Identification:
    """Coefficients with 95 % confidence intervals.

    value (6,), lower (6,), upper (6,): K_tc, K_rc, K_ac [Pa], K_te, K_re, K_ae [N/m], order of NAMES.
    residual [N] (n, 3), measured minus fitted; scatter [N] (2,), standard deviation of the residuals
    of F_x with F_y, and of F_z, degrees of freedom taken off.
    """

    value: Array
    lower: Array
    upper: Array
    residual: Array
    scatter: Array


def identify(tool: Tool, tests: AverageForces, confidence: float = 0.95) -> Identification:
    """Fit the six coefficients to average forces by least squares, with Student's t intervals.

    Args:
        tool: the end mill that was used (teeth, helix); the average force depends on nothing else of it.
        tests: the measurements, at least two different feeds.
        confidence: probability of the two-sided intervals, each coefficient by itself.

    Raises:
        ValueError: another tool than a cylinder, too few tests, feeds that are all alike, or a confidence outside
            (0, 1).
    """
    require_cylinder(tool)
    require(0 < confidence < 1, "confidence", confidence, "", "a probability in (0, 1)")
    n = len(tests.feed_per_tooth)
    require(n >= 3, "number of tests", n, "", "at least 3, so that scatter can be told from slope")
    rows = _average_of_unit_coefficients(tool, tests)  # (n, 3 forces, 6 coefficients)
    value, half = np.empty(6), np.empty(6)
    scatter = np.empty(2)
    groups = ((slice(0, 2), [0, 1, 3, 4]), (slice(2, 3), [2, 5]))
    for group, (forces, columns) in enumerate(groups):
        design = rows[:, forces][:, :, columns].reshape(-1, len(columns))
        measured = tests.force[:, forces].ravel()
        scale = np.linalg.norm(design, axis=0)
        rank = int(np.linalg.matrix_rank(design / scale, tol=1e-6))
        require(rank == len(columns), "feed_per_tooth", tests.feed_per_tooth.tolist(), "m",
                "different feeds, so that cutting and edge coefficients can be told apart")
        q, r = np.linalg.qr(design / scale)
        solution = np.linalg.solve(r, q.T @ measured)
        freedom = measured.size - len(columns)
        scatter[group] = np.sqrt(np.sum((measured - design / scale @ solution) ** 2) / freedom)
        spread = np.linalg.norm(np.linalg.inv(r), axis=1)
        value[columns] = solution / scale
        half[columns] = stdtrit(freedom, (1 + confidence) / 2) * scatter[group] * spread / scale
    residual = tests.force - rows @ value
    return Identification(read_only(value), read_only(value - half), read_only(value + half), read_only(residual),
                          read_only(scatter))


def _average_of_unit_coefficients(tool: Tool, tests: AverageForces) -> Array:
    """Average force (n, 3, 6) [N per Pa or N per N/m] that each coefficient of 1 gives, closed form over the arc.

    With h = c sin(phi), over N teeth: mean F = N a / (2 pi) times the integrals of the force
    directions (Eq. 3.49) times h for the chip, or times 1/cos(beta) for the edge.
    """
    def over_arc(integral: Array, at_start: Array) -> Array:
        return np.asarray(integral - at_start, dtype=np.float64)

    s, e = tests.start, tests.exit
    squares = over_arc(e / 2 - np.sin(2 * e) / 4, s / 2 - np.sin(2 * s) / 4)  # sin^2
    products = over_arc(np.sin(e) ** 2 / 2, np.sin(s) ** 2 / 2)  # sin cos
    sines, cosines = over_arc(-np.cos(e), -np.cos(s)), over_arc(np.sin(e), np.sin(s))
    zero = np.zeros_like(s)
    c = tests.feed_per_tooth
    edge = 1 / math.cos(tool.helix_angle)
    rows = np.array([
        [-c * products, -c * squares, zero, -edge * cosines, -edge * sines, zero],
        [c * squares, -c * products, zero, edge * sines, -edge * cosines, zero],
        [zero, zero, -c * sines, zero, zero, -edge * (e - s)],
    ])
    return np.asarray(np.moveaxis(rows, 2, 0) * (tool.teeth * tests.depth / (2 * math.pi))[:, None, None],
                      dtype=np.float64)
