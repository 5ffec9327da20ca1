"""Low speed: the envelope from two chatter tests, and the average model behind it (thesis 4.3.5)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Mode, Operation, require
from turnmill_core.operation_stability import ProcessDamping, Trial
from turnmill_core.stability.lobes import Progress, stability_boundary

Floats = NDArray[np.float64]
LEAST_IMMERSION = 0.6
"""Radial immersion over diameter from which on cutting and process damping matrix share their eigenvectors."""


class Envelope(NamedTuple):
    """Low-speed envelope a(Omega) = a_lim / (1 - Omega_a / Omega).

    depth_limit a_lim [m], far above the asymptotic tool speed; asymptotic_speed Omega_a [rad/s]; valid: False where
    the radial immersion is below 0.6 of the tool diameter, where the method's decoupling does not hold.
    """

    depth_limit: float
    asymptotic_speed: float
    valid: bool


def envelope_from_tests(
    first: tuple[float, float], second: tuple[float, float], immersion: float,
) -> Envelope:
    """Envelope a(Omega) = a_lim / (1 - Omega_a / Omega) through two chatter tests (Eq. 4.120, erratum D5).

    first, second: (tool speed [rad/s], depth [m]) of two tests at the limit. immersion: radial immersion over tool
    diameter [1]; below 0.6 the result is marked as not valid. Raises ``ValueError`` for tests through which no
    envelope passes.
    """
    (speed1, a1), (speed2, a2) = first, second
    for name, value, unit in (("speed", speed1, "rad/s"), ("speed", speed2, "rad/s"), ("depth", a1, "m"),
                              ("depth", a2, "m")):
        require(np.isfinite(value) and value > 0, f"test {name}", value, unit, "a finite number > 0")
    ra, r = a1 / a2, speed1 / speed2
    require((speed1 - speed2) * (a1 - a2) < 0 and (ra - r) != 0, "tests", (first, second), "rad/s, m",
            "the deeper cut at the lower speed")
    limit, speed = a1 * (1 - r) / (ra - r), speed1 * (ra - 1) / (ra - r)
    require(limit > 0 and 0 < speed < min(speed1, speed2), "tests", (first, second), "rad/s, m",
            "tests above a positive asymptotic speed")
    return Envelope(limit, speed, immersion >= LEAST_IMMERSION)


def envelope_depth(envelope: Envelope, tool_speed: ArrayLike) -> Floats:
    """Depth limit [m] of the envelope at tool_speed [rad/s]; infinite at and below the asymptotic speed."""
    speed = np.asarray(tool_speed, dtype=np.float64)
    with np.errstate(divide="ignore"):
        depth = envelope.depth_limit / (1 - envelope.asymptotic_speed / speed)
    return np.where(speed > envelope.asymptotic_speed, depth, np.inf)


def mean_eigenvalue(radial_ratio: float, arc: float) -> complex:
    """Eigenvalue lambda_c [1], Im >= 0, of the mean directional matrix over N Ktc / 2 pi and depth (Eq. 4.112).

    radial_ratio: Krc / Ktc; arc: exit minus start angle [rad].
    """
    delta = cmath.sqrt((1 + radial_ratio**2) * math.sin(arc) ** 2 - arc**2)
    return complex(-radial_ratio * arc / 2, abs(delta.imag) / 2) if delta.real == 0 else (
        -(radial_ratio * arc - delta) / 2)


def average_envelope(
    mode: Mode, teeth: int, tool_radius: float, coefficients: tuple[float, float], arc: float,
    flank: ProcessDamping | None,
) -> Envelope:
    """Envelope of a tool with one mode alike in x and y, by the mean matrices (Eq. 4.117, 4.119).

    At the worst phase of the past the cut feeds in a N Ktc / 2 pi (|lambda_c| + Im lambda_c), against structural
    damping 2 zeta m w_n and the flank's a N arc K_rp / (4 pi V), K_rp = K_sp L_w^2 / 2 [N/m]. tool_radius [m];
    coefficients (Ktc, Krc) [Pa]; arc [rad]; flank: None or without indentation gives an asymptotic speed of
    0. Light damping is taken.
    """
    Ktc, Krc = coefficients
    eigenvalue = mean_eigenvalue(Krc / Ktc, arc)
    drive = teeth * Ktc / (2 * math.pi) * (abs(eigenvalue) + eigenvalue.imag)
    w = 2 * math.pi * mode.frequency
    limit = 2 * mode.damping * mode.mass * w**2 / drive
    speed = 0.0 if flank is None else w * teeth * arc * flank.coefficient(1.0) / (4 * math.pi) / (drive * tool_radius)
    return Envelope(limit, speed, tool_radius * (1 - math.cos(arc)) >= LEAST_IMMERSION * 2 * tool_radius)


def ploughing_coefficient(
    envelope: Envelope, frequency: float, coefficients: tuple[float, float], arc: float, tool_diameter: float,
) -> float:
    """Radial ploughing coefficient K_rp [N/m] that puts the asymptote where it is (Eq. 4.119 solved for it).

    frequency [Hz]: chatter frequency of the tests; coefficients (Ktc, Krc) [Pa]; arc [rad]; tool_diameter [m].
    K_sp = 2 K_rp / L_w^2.
    """
    Ktc, Krc = coefficients
    eigenvalue = mean_eigenvalue(Krc / Ktc, arc)
    turns = envelope.asymptotic_speed / (2 * math.pi)
    return turns * Ktc * (abs(eigenvalue) + eigenvalue.imag) * tool_diameter / (arc * frequency)


@dataclass(frozen=True, eq=False)
class LowSpeed:
    """Three views of the stability limit at low speed (Figure 4.64).

    tool_speeds (n,) [rad/s]; undamped, damped (n,) [m]: lowest limits without and with the operation's process
    damping; envelope: through the operation's first two chatter trials, None where it has not two; ploughing [N/m]:
    K_rp that follows from it, NaN without measured frequencies; immersion [1]: radial, over the tool diameter.
    """

    tool_speeds: Floats
    undamped: Floats
    damped: Floats
    envelope: Envelope | None
    ploughing: float
    immersion: float

    @property
    def warning(self) -> str:
        """Why the envelope is not to be trusted, empty where it is."""
        if self.envelope is None or self.envelope.valid:
            return ""
        return (f"radial immersion is {self.immersion:.2f} of the tool diameter, below {LEAST_IMMERSION}: the two-test "
                "envelope is outside the range of its method")


def low_speed_limits(
    op: Operation, tool_speeds: Sequence[float] | Floats, deepest: float, workpiece_speed: float | None = None,
    progress: Progress | None = None,
) -> LowSpeed:
    """Limits of `op` over tool_speeds [rad/s] up to `deepest` [m], without and with process damping, and the envelope.

    workpiece_speed, progress: as in stability_boundary. Raises ``ValueError`` for an operation without process damping,
    and for trials through which no envelope passes.
    """
    require(op.process_damping is not None, "process damping", None, "", "an operation with a section process_damping")
    total = 2 * len(tool_speeds)

    def told(before: int) -> Progress | None:
        return None if progress is None else lambda done, _: progress(before + done, total)

    undamped, damped = (
        stability_boundary(case, tool_speeds, deepest, workpiece_speed, told(before)).depth_limit
        for case, before in ((replace(op, process_damping=None), 0), (op, len(tool_speeds))))
    cut = with_cut(op, workpiece_speed=workpiece_speed)
    immersion = cut.radial_immersion / op.tool.diameter
    tests: tuple[Trial, ...] = tuple(t for t in op.trials if t.outcome == "chatter")[:2]
    envelope, ploughing = None, math.nan
    if len(tests) == 2:
        envelope = envelope_from_tests(
            (tests[0].tool_speed, tests[0].depth), (tests[1].tool_speed, tests[1].depth), immersion)
        low, high = (math.acos(max(-1.0, min(1.0, y / op.tool.radius))) for y in reversed(cut.cross_feed_span))
        heard = [t.chatter_frequency for t in tests if t.chatter_frequency is not None]
        if heard:
            ploughing = ploughing_coefficient(envelope, sum(heard) / len(heard), (op.material.Ktc, op.material.Krc),
                                              high - low, op.tool.diameter)
    return LowSpeed(np.asarray(tool_speeds, dtype=np.float64), undamped, damped, envelope, ploughing, immersion)
